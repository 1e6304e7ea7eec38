"""The seven stages: what each depends on, what it makes, and how its result is read back.

The order stands in `lidarspectra.workflow.pipeline`; how a stage is kept, in `lidarspectra.workflow.workspace`.
"""

from pathlib import Path
from typing import Any

import xarray as xr

from lidarspectra.geometry.scan import Scan, load_scan, save_scan
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.io.files import hash_file
from lidarspectra.lamps.lamp_file import load_lamps, save_lamps
from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.floor_plan import floor_plan
from lidarspectra.mapping.figures.material_figures import (
    MaterialPictures,
    material_code,
    mean_shown_colors,
    painted,
    segmentation_figure,
)
from lidarspectra.mapping.maps.spectral_map import (
    MAP_FILE,
    MAP_TABLE_FILE,
    load_map,
    save_map,
    save_map_table,
    spectral_map,
)
from lidarspectra.mapping.report.report import PAGE, ReportInput, ReportView, StageRow, write_report
from lidarspectra.mapping.report.room_view import RoomSurfaces
from lidarspectra.material.lamp_fluxes import save_lamp_fluxes
from lidarspectra.material.material_map import MaterialMap, load_materials, save_materials
from lidarspectra.material.material_mesh import daylight_colors, save_material_mesh
from lidarspectra.material.model_card import CARD_SUFFIX
from lidarspectra.material.segmentation import SHIPPED_MODEL
from lidarspectra.material.viewpoints import render_views
from lidarspectra.material.views import ViewSet, load_views, save_views
from lidarspectra.progress import Progress, shares
from lidarspectra.radiance.engine.engine import find_engine
from lidarspectra.radiance.engine.options import reflections_in_words
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.sampling.transport import TRANSPORT_FILE, load_transport, save_transport
from lidarspectra.radiance.scene.exported_model import write_workflow
from lidarspectra.radiance.scene.placement import placement_notes
from lidarspectra.radiance.scene.scene import RadianceScene, load_scene, write_scene
from lidarspectra.room.room import find_room, load_room, save_room
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.sensor_files import find_bands
from lidarspectra.workflow.delighting import take_light_out, with_light_uncertainty
from lidarspectra.workflow.inputs import (
    Inputs,
    assigned_spectra,
    database_hashes,
    lamp_files,
    lamp_settings,
    scan_files,
)
from lidarspectra.workflow.lamps_of_run import ScannedRoom, daylight_of_run, lamps_of_run, with_estimated_fluxes
from lidarspectra.workflow.materials_of_run import materials_of_run
from lidarspectra.workflow.report_applications import report_applications
from lidarspectra.workflow.sensing_of_run import receptor_of_run, sensor_points, trace_engine
from lidarspectra.workflow.workspace import Notes, Stage, StageResult, versions

REPORT_PAGE = PAGE
MODEL_FOLDER = "model"
SEGMENTATION = "segmentation"
# Shares of a stage's time, on a first run; `workspace` corrects them by what the last run took.
SCAN_SHARES = (0.1, 0.65, 0.1, 0.15)  # reading, repairing, finding the room, saving
VIEWS_SHARES = (0.01, 0.83, 0.16)  # reading, looking around, saving
DELIGHTING_SHARE, MATERIALS_SHARES = 0.3, (0.62, 0.08)  # de-lighting where it is asked for; estimating, saving
SCENE_SHARES = (0.05, 0.85, 0.1)  # finding lamps, writing, looking for lamps in walls
TRACE_SHARES = (0.18, 0.75, 0.07)  # placing the sensors, tracing, saving
READING_SHARE, APPLYING_SHARE, PAGE_SHARE = 0.03, 0.5, 0.97  # of the report; applications where they are asked for
TRACE_SEED = 20240513  # of the ray directions; Radiance seeds its shadow rays by the clock: runs agree within noise


def scan_stage(inputs: Inputs) -> Stage[ScannedRoom]:
    """Stage 1: read the phone's mesh, repair it, find the room in it (paper, Section 2.2)."""
    section = inputs.room.scan
    file = inputs.path(section.file)

    def make(folder: Path, progress: Progress) -> Notes:
        reading, repairing, finding, saving = shares(progress, SCAN_SHARES)
        raw = read_scan(file, unit=section.unit, up=section.up, progress=reading)
        scan = repair_scan(
            raw,
            close_holes=section.close_holes,
            max_hole_m=section.max_hole_m,
            flatten=section.flatten,
            max_faces=section.max_faces,
            progress=repairing,
        )
        finding(0.0, "finding floor, walls and ceiling")
        room = find_room(scan)
        saving(0.0, "saving")
        save_scan(scan, folder)
        save_room(room, folder)
        record = scan.record
        return Notes(
            summary=f"{record.faces_kept} triangles, {record.area_m2:.0f} m²; room {room.area_m2:.1f} m² x "
            f"{room.height_m:.2f} m; {record.holes_closed} holes closed "
            f"({100 * record.hole_area_m2 / record.area_m2:.1f} % of the area)",
            warnings=record.notes,
        )

    settings = {"section": section.model_dump(), "files": {path.name: hash_file(path) for path in scan_files(file)}}
    return Stage(
        name="scan",
        settings=settings,
        make=make,
        load=lambda folder: ScannedRoom(scan=load_scan(folder), room=load_room(folder)),
    )


def views_stage(inputs: Inputs, scan: StageResult[ScannedRoom]) -> Stage[ViewSet]:
    """Stage 2: look around until the surfaces are covered (Algorithm 1, CaptureImage and Viewpoint Update)."""
    coverage = inputs.room.materials.coverage

    def make(folder: Path, progress: Progress) -> Notes:
        loading, looking, saving = shares(progress, VIEWS_SHARES)
        loading(0.0, "reading the scan")
        mesh = scan.value.scan
        loading(1.0, "scan read")
        views = render_views(mesh, scan.value.room, coverage=coverage, progress=looking)
        saving(0.0, "saving")
        save_views(views, folder)
        short = views.area_coverage < views.threshold
        return Notes(
            summary=f"{len(views.views)} views cover {100 * views.area_coverage:.1f} % of the area, "
            f"{100 * views.point_coverage:.1f} % of the points",
            warnings=(
                f"The views cover less than the wanted {100 * coverage:.0f} % of the surfaces: {views.stopped}. "
                "Surfaces that no view saw take the material of their neighbours.",
            )
            if short
            else (),
        )

    settings = {"scan": scan.contents(), "coverage": coverage}
    return Stage(name="views", settings=settings, make=make, load=load_views)


def materials_stage(inputs: Inputs, scan: StageResult[ScannedRoom], views: StageResult[ViewSet]) -> Stage[MaterialMap]:
    """Stage 3: a reflectance spectrum for every face (Algorithm 1, DM and RPP)."""
    section = inputs.room.materials
    delight = section.delight and section.method != "default"  # that one does without the scan's colours

    def make(folder: Path, progress: Progress) -> Notes:
        delighting, estimating, saving = shares(progress, (DELIGHTING_SHARE if delight else 0.0, *MATERIALS_SHARES))
        delighting(0.0, "reading scan and views")
        mesh, light = scan.value.scan, None
        lamps = lamps_of_run(inputs, scan.value) if delight else ()
        found = inputs.room.lamps_from_scan
        stated = found is None or found.fluxes == "area"
        if delight:
            light = take_light_out(mesh, scan.value.room, lamps, fluxes_stated=stated, progress=delighting)
        materials = materials_of_run(
            mesh,
            views.value,
            section,
            room=scan.value.room,
            face_color=light.face_color if light else None,
            folder=inputs.base,
            progress=estimating,
        )
        saving(0.0, "saving")
        if light is not None:
            materials = with_light_uncertainty(materials, light, mesh.areas)
        save_materials(materials, folder, face_areas=mesh.areas)
        save_lamp_fluxes(light.lamp_fluxes if light else (), folder)
        save_material_mesh(mesh, materials, folder)
        pictures = _material_pictures(mesh, views.value, materials)
        save_figure(segmentation_figure(pictures), folder, SEGMENTATION)
        left_in = light is None or light.face_color is None
        words, warnings = materials.in_words(mesh.areas), materials.warnings(mesh.areas, light_left_in=left_in)
        return Notes(
            summary=f"{words}; {light.words}" if light and light.words else words,
            warnings=(*warnings, *light.warnings) if light else warnings,
        )

    settings = {
        "scan": scan.contents(),
        "views": views.contents(),
        "section": section.model_dump(exclude={"coverage"}),
        "databases": {**database_hashes("reflectance"), **(database_hashes("lamps") if delight else {})},
        "model": {SHIPPED_MODEL.name: hash_file(SHIPPED_MODEL)} if section.model == "builtin" else {},
        "files": inputs.hashes(
            section.file,
            *assigned_spectra(inputs),
            section.model,
            str(Path(section.model).with_suffix(CARD_SUFFIX)),
            *section.databases,
            *(lamp_files(inputs.room) if delight else ()),
        ),
        **(lamp_settings(inputs.room) if delight else {}),
    }
    return Stage(name="materials", settings=settings, make=make, load=load_materials)


def scene_stage(
    inputs: Inputs, scan: StageResult[ScannedRoom], materials: StageResult[MaterialMap]
) -> Stage[RadianceScene]:
    """Stage 4: the room as a Radiance model, with its lamps' spectra (paper, Section 3.1)."""
    room = inputs.room

    def make(folder: Path, progress: Progress) -> Notes:
        finding, writing, placing = shares(progress, SCENE_SHARES)
        finding(0.0, "lamps")
        lamps = (
            *with_estimated_fluxes(lamps_of_run(inputs, scan.value), materials.folder),
            *daylight_of_run(room, folder),
        )
        save_lamps(lamps, folder)
        mesh, bands = scan.value.scan, find_bands(room.sensors.device, inputs.base)
        scene = write_scene(
            mesh,
            materials.value,
            lamps,
            bands,
            folder,
            mode=room.trace.mode,
            engine=find_engine(),
            progress=writing,
        )
        placing(0.0, "places of the lamps")
        notes = placement_notes(lamps, mesh)
        return Notes(
            summary=f"{len(lamps)} lamps, {len(materials.value.materials)} materials, "
            f"{len(scene.passes)} {'pass' if len(scene.passes) == 1 else 'passes'} of up to "
            f"{max(each.slot_count for each in scene.passes)} bands",
            warnings=notes,
        )

    settings = {
        "scan": scan.contents(),
        "materials": materials.contents(),
        **lamp_settings(room),
        "databases": database_hashes("lamps"),
        "files": inputs.hashes(*lamp_files(room), room.sensors.device),
        "device": room.sensors.device,
        "mode": room.trace.mode,
    }
    return Stage(name="scene", settings=settings, make=make, load=load_scene)


def trace_stage(inputs: Inputs, scan: StageResult[ScannedRoom], scene: StageResult[RadianceScene]) -> Stage[xr.Dataset]:
    """Stage 5: every lamp's light at every sensor point, with its standard error (paper, Sections 2.4.4 and 3.1)."""
    sensors = inputs.room.sensors
    section = inputs.room.trace

    def make(folder: Path, progress: Progress) -> Notes:
        placing, tracing, saving = shares(progress, TRACE_SHARES)
        placing(0.0, "sensor points")
        points = sensor_points(scan.value.scan, scan.value.room, sensors, folder=inputs.base)
        receptor = receptor_of_run(inputs)
        with trace_engine(inputs.cluster) as engine:
            transport = trace(
                scene.value,
                points,
                accuracy=section.accuracy,
                noise=section.noise,
                seed=TRACE_SEED,
                workers=inputs.workers or section.workers,
                receptor=receptor,
                engine=engine,
                progress=tracing,
            )
        saving(0.0, "saving")
        save_transport(transport, folder / TRANSPORT_FILE)
        write_workflow(scene.value, points, folder / MODEL_FOLDER, accuracy=section.accuracy, noise=section.noise)
        return Notes(
            summary=f"{len(points)} points, {reflections_in_words(section.accuracy)}; "
            f"standard error {100 * transport.attrs['achieved_relative_se']:.2f} % of the mean "
            f"(wanted {100 * transport.attrs['target_relative_se']:.1f} %), "
            f"{transport.attrs['truncated_share']:.2%} left out beyond the last reflection",
            warnings=_trace_warnings(transport, points),
        )

    settings = {
        "scan": scan.contents(),
        "scene": scene.contents(),
        "sensors": sensors.model_dump(exclude={"device"}),
        "files": inputs.hashes(sensors.points, sensors.receptor),
        "accuracy": section.accuracy,
        "noise": section.noise,
    }
    return Stage(
        name="trace", settings=settings, make=make, load=lambda folder: load_transport(folder / TRANSPORT_FILE)
    )


def map_stage(scene: StageResult[RadianceScene], transport: StageResult[xr.Dataset]) -> Stage[xr.Dataset]:
    """Stage 6: the spectral map, the sum over lamps (paper, Section 3.3)."""

    def make(folder: Path, progress: Progress) -> Notes:
        light = spectral_map(transport.value, lamps=load_lamps(scene.folder))
        save_map(light, folder / MAP_FILE)
        save_map_table(light, folder / MAP_TABLE_FILE)
        mean = light["irradiance"].mean("point")
        return Notes(
            summary=f"{light.sizes['band']} channels x {light.sizes['point']} points; "
            f"mean {float(mean.min()):.3g} to {float(mean.max()):.3g} W/m²/nm"
            + (f", {float(light['illuminance'].mean()):.0f} lx" if "illuminance" in light else "")
        )

    return Stage(
        name="map",
        settings={"transport": transport.contents()},
        make=make,
        load=lambda folder: load_map(folder / MAP_FILE),
    )


def report_stage(
    inputs: Inputs,
    scan: StageResult[ScannedRoom],
    views: StageResult[ViewSet],
    materials: StageResult[MaterialMap],
    scene: StageResult[RadianceScene],
    transport: StageResult[xr.Dataset],
    light: StageResult[xr.Dataset],
) -> Stage[Path]:
    """Stage 7: figures, tables and one page that tells of all the others."""
    before: tuple[StageResult[Any], ...] = (scan, views, materials, scene, transport, light)

    def make(folder: Path, progress: Progress) -> Notes:
        mesh, room = scan.value.scan, scan.value.room
        applications = inputs.room.people_and_plants or inputs.room.cells
        reading, applying, writing = shares(
            progress, (READING_SHARE, APPLYING_SHARE if applications else 0.0, PAGE_SHARE)
        )
        lamps = load_lamps(scene.folder)
        plan = floor_plan(mesh, room)
        face_color = mesh.face_colors()
        pictures = _material_pictures(mesh, views.value, materials.value)
        reading(1.0, "scan and materials are read")
        page = write_report(
            folder,
            ReportInput(
                title=inputs.name,
                spectral_map=light.value,
                transport=transport.value,
                plan=plan,
                applications=report_applications(
                    inputs.room,
                    transport.value,
                    {lamp.name: lamp.flux for lamp in lamps},
                    scene.value.bands,
                    plan,
                    base=inputs.base,
                    progress=applying,
                ),
                scan=mesh.record,
                materials=materials.value.materials,
                material_areas_m2=materials.value.areas(mesh.areas),
                surfaces=RoomSurfaces(
                    vertices=mesh.vertices,
                    faces=mesh.faces,
                    face_material=materials.value.face_material,
                    face_color=face_color,
                ),
                lamps=lamps,
                views=tuple(ReportView(name=view.name, image=view.image) for view in views.value.views[:6]),
                material_pictures=pictures,
                view_notes=views.record.summary,
                floor_z_m=room.floor_z,
                room_notes=scan.record.summary,
                stages=tuple(
                    StageRow(
                        stage=result.record.stage,
                        summary=result.record.summary,
                        seconds=result.record.seconds,
                        peak_memory_mib=result.record.peak_memory_mib,
                    )
                    for result in before
                ),
                warnings=tuple(warning for result in before for warning in result.record.warnings),
                provenance=_provenance(before),
                run_file=inputs.text,
            ),
            progress=writing,
        )
        return Notes(summary=f"{page.name}, with figures and tables beside it")

    settings = {"stages": {result.record.stage: result.contents() for result in before}, "run_file": inputs.text}
    if inputs.room.cells:
        settings["files"] = inputs.hashes(*(section.cell for section in inputs.room.cells))
        settings["databases"] = database_hashes("cells")
    return Stage(name="report", settings=settings, make=make, load=lambda folder: folder / REPORT_PAGE)


def _material_pictures(scan: Scan, views: ViewSet, materials: MaterialMap) -> MaterialPictures:
    """The first six views before and after segmentation, and the materials' colours with and without the light."""
    areas = materials.areas(scan.areas)
    listed = materials.materials
    code = material_code(tuple(m.name for m in listed), tuple(m.category for m in listed), areas)
    first = views.views[:6]
    found = daylight_colors(listed)
    return MaterialPictures(
        views=tuple(ReportView(name=view.name, image=view.image) for view in first),
        segmented=tuple(
            ReportView(name=view.name, image=code.image(view.face, materials.face_material)) for view in first
        ),
        lit_evenly=tuple(
            ReportView(name=view.name, image=painted(view.face, found[materials.face_material])) for view in first
        ),
        code=code,
        shown=mean_shown_colors(scan.face_colors(), materials.face_material, scan.areas, len(listed)),
        found=found,
    )


def _trace_warnings(transport: xr.Dataset, points: SensorPoints) -> tuple[str, ...]:
    warnings = []
    buried = int(points.buried.sum())
    if buried:
        warnings.append(
            f"{buried} of {len(points)} sensor points are buried in furniture or walls: their values are meaningless, "
            "and they are marked on the maps. Move them into free air if you need them."
        )
    achieved, target = transport.attrs["achieved_relative_se"], transport.attrs["target_relative_se"]
    if achieved > target:
        warnings.append(
            f"The standard error of the simulation is {100 * achieved:.1f} % of the mean, above the target of "
            f"{100 * target:.1f} %, when the budget of rays was used up. The map is right within these larger error "
            "bars; the report's map of the standard error shows where they are large."
        )
    truncated = transport.attrs["truncated_share"]
    if truncated > target:
        warnings.append(
            f"About {100 * truncated:.2g} % of the mean irradiance is missing in the worst channel, because light is "
            f"followed for {transport.attrs['bounces']} reflections only and the room is bright; that is more than the "
            f'noise of {100 * target:.1f} % that was asked for. Write accuracy = "all" in [trace] to follow all of it.'
        )
    return tuple(warnings)


def _provenance(before: tuple[StageResult[Any], ...]) -> dict[str, str]:
    hashes = {
        f"sha256 of {name}": digest
        for result in before
        for part in ("files", "databases")
        for name, digest in result.record.settings.get(part, {}).items()
    }
    finished = {f"stage '{result.record.stage}' finished": result.record.finished for result in before}
    return {**versions(), **finished, **hashes, "trace seed": str(TRACE_SEED)}
