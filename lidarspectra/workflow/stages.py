"""The seven stages: what each reads, what it makes, and how its result is read back.

A stage first declares what it reads (`workflow.run_folder.declared`); it is given that, and made again when it changes.
The order stands in `workflow.pipeline`; how a stage is kept, in `workflow.run_folder.workspace`.
"""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import load_scan, save_scan
from lidarspectra.hardware.phone.readers import read_scan_and_frames
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.io.files import write_whole
from lidarspectra.lamps.lamp_file import load_lamps, save_lamps
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.maps.assumptions import mark_assumed
from lidarspectra.mapping.maps.channel_levels import beyond_notes, levels_in_words, mark_partly_known
from lidarspectra.mapping.maps.light_unknowns import save_unknowns, uncertainty_in_words
from lidarspectra.mapping.maps.map_files import MAP_FILE, MAP_TABLE_FILE, load_map, save_map, save_map_table
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.mapping.report import PAGE
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.material.lit_lamps.fluxes import save_lamp_fluxes
from lidarspectra.material.material_map import MaterialMap, load_materials, save_materials
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.material.views.views import ViewSet, load_views, no_views, save_views
from lidarspectra.progress import Progress, shares
from lidarspectra.radiance.engine.engine import find_engine
from lidarspectra.radiance.engine.options import reflections_in_words
from lidarspectra.radiance.sampling.opening_light import opening_light
from lidarspectra.radiance.sampling.plain_rtrace import trace_plain
from lidarspectra.radiance.sampling.relit_transport import relit_transport
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.sampling.transport import (
    SEEN_BY,
    TRANSPORT_FILE,
    load_transport,
    save_transport,
    with_opening,
)
from lidarspectra.radiance.scene.black_lamps import black_lamps_note
from lidarspectra.radiance.scene.clearance import clear_lamps
from lidarspectra.radiance.scene.exported_model import write_workflow
from lidarspectra.radiance.scene.placement import placement_notes
from lidarspectra.radiance.scene.relit_scene import relit_scene
from lidarspectra.radiance.scene.scene import LAMPS_PER_PASS, RadianceScene, load_scene, write_scene
from lidarspectra.room.room import load_room, save_room
from lidarspectra.spectra.sensor_files import find_bands
from lidarspectra.words import counted, were
from lidarspectra.workflow.calibration.results import REPORTED, SUMMARY, found_by_calibration
from lidarspectra.workflow.calibration.unknowns_of_run import lost_calibration_note, unknowns_of_map
from lidarspectra.workflow.kept_light import (
    lamp_names,
    present_lamps,
    relit_notes,
    same_picture_light,
    same_room,
    why_not_relit,
    with_present_names,
)
from lidarspectra.workflow.materials.delighting import Delighting, take_light_out
from lidarspectra.workflow.materials.gloss_of_run import gloss_in_words, gloss_of_materials, save_gloss, with_gloss
from lidarspectra.workflow.materials.light_uncertainty import with_light_uncertainty
from lidarspectra.workflow.materials.materials_of_run import (
    all_given,
    materials_of_run,
    model_of_run,
    with_assignments_of_run,
)
from lidarspectra.workflow.materials.votes_ahead import votes_beside
from lidarspectra.workflow.run_folder.assumed import assumed_lamps, assumed_of_scan, lamp_notes, lit_notes, scan_notes
from lidarspectra.workflow.run_folder.calibration_of_run import (
    calibrated_lamps,
    calibrated_materials,
    calibration_notes,
)
from lidarspectra.workflow.run_folder.cards_of_run import cards_of_run
from lidarspectra.workflow.run_folder.declared import Declared
from lidarspectra.workflow.run_folder.frames_of_run import (
    frame_colors,
    frame_notes,
    frames_in_words,
    panes_seen_in,
    save_frames,
)
from lidarspectra.workflow.run_folder.inputs import Inputs
from lidarspectra.workflow.run_folder.lamps_of_run import (
    LAMP_KEYS,
    MOMENT_KEYS,
    ScannedRoom,
    daylight_of_run,
    lamps_in_picture,
    lamps_of_run,
    with_estimated_fluxes,
    without_names,
)
from lidarspectra.workflow.run_folder.panes_of_run import assumed_notes, panes_of_run, with_panes_of_run
from lidarspectra.workflow.run_folder.sensing_of_run import receptor_of_run, seen_by, sensor_points, trace_engine
from lidarspectra.workflow.run_folder.workspace import (
    Notes,
    Stage,
    StageRecord,
    StageResult,
    read_record,
    stage_folder,
    stage_key,
)
from lidarspectra.workflow.trace_notes import glass_notes, trace_warnings, truncation_in_words
from lidarspectra.workflow.whole_room import missing_in_words, whole_room

REPORT_PAGE = PAGE
MODEL_FOLDER = "model"
VIEW_SETTINGS = ViewSettings()
NO_VIEWS = "no views are taken, since all surfaces are given one material"
MATERIALS_KEYS = (
    "materials.method",
    "materials.default",
    "materials.file",
    "materials.databases",
    "materials.matching",
    "materials.model",
    "materials.names",
    "materials.colors",
    "materials.delight",
    "materials.cards",
)
DAYLIGHT_KEYS = tuple(f"daylight.{key}" for key in (*MOMENT_KEYS, "windows"))  # of the moment: not the year's weather
SENSOR_KEYS = ("sensors.grid", "sensors.points", "sensors.field_of_view_deg", "sensors.receptor", "sensors.lift")
# Shares of a stage's time, on a first run; `workspace` corrects them by what the last run took.
SCAN_SHARES = (0.1, 0.65, 0.6, 0.1, 0.15)  # reading, repairing, colours from frames, finding the room, saving
VIEWS_SHARES = (0.01, 0.83, 0.16)  # reading, rendering views, saving
DELIGHTING_SHARE, MATERIALS_SHARES = 0.3, (0.62, 0.08)  # de-lighting (if enabled); estimating, saving
SCENE_SHARES = (0.05, 0.85, 0.1)  # finding lamps, writing, checking for lamps inside walls
TRACE_SHARES = (0.18, 0.7, 0.05, 0.07)  # placing the sensors, tracing, light by way of openings, saving
MAP_SHARES = (0.8, 0.2)  # what is not known of the light; the map and its files
READING_SHARE, APPLYING_SHARE, PAGE_SHARE = 0.03, 0.5, 0.97  # of the report; applications only if the run file has any
TRACE_SEED = 20240513  # of the ray directions; Radiance seeds its shadow rays by the clock: runs agree within noise


def scan_stage(inputs: Inputs) -> Stage[ScannedRoom]:
    """Stage 1: read the phone's mesh, repair it, find the room in it (paper, Section 2.2)."""
    given = inputs.declare("scan", "scan.assumed", "panes", "panes.assumed")
    section = given.run_file.scan

    def make(folder: Path, progress: Progress) -> Notes:
        reading, repairing, coloring, finding, saving = shares(progress, SCAN_SHARES)
        raw, capture = read_scan_and_frames(
            given.base / section.file, unit=section.unit, up=section.up, level=section.level, progress=reading
        )
        scan = repair_scan(
            raw,
            close_holes=section.close_holes,
            max_hole_m=section.max_hole_m,
            flatten=section.flatten,
            max_faces=section.max_faces,
            progress=repairing,
        )
        colors = frame_colors(scan, capture, wanted=section.frames, progress=coloring)
        scan = scan if colors is None else colors.scan
        finding(0.0, "finding floor, walls and ceiling")
        scan, found_room, *_ = whole_room(
            scan,
            close_ceiling=section.close_ceiling,
            close_floor=section.close_floor,
            close=section.close,
            floor_z=section.floor,
            ceiling_z=section.ceiling,
            panes=panes_of_run(given.run_file.panes),
            seen=panes_seen_in(colors, capture),
        )
        saving(0.0, "saving")
        save_scan(scan, folder)
        save_room(found_room, folder)
        if colors is not None and capture is not None:
            save_frames(colors, capture, folder)
        record = scan.record
        return Notes(
            summary=f"{record.faces_kept} triangles, {record.area_m2:.0f} m²; room {found_room.area_m2:.1f} m² x "
            f"{found_room.height_m:.2f} m; {record.holes_closed} holes closed "
            f"({100 * record.hole_area_m2 / record.area_m2:.1f} % of the area){missing_in_words(record)}"
            f"{frames_in_words(colors)}",
            warnings=(
                *record.notes,
                *frame_notes(colors, capture),
                *scan_notes(section),
                *assumed_notes(given.run_file.panes),
            ),
            # Radiance of frames is kept in fewer digits than it was made in, and so read back.
            made=ScannedRoom(scan=scan, room=found_room) if scan.appearance.linear is None else None,
        )

    return Stage(
        name="scan",
        settings=given.settings,
        make=make,
        load=lambda folder: ScannedRoom(scan=load_scan(folder), room=load_room(folder)),
    )


def views_stage(inputs: Inputs, scan: StageResult[ScannedRoom]) -> Stage[ViewSet]:
    """Stage 2: render views until they cover the surfaces (Algorithm 1, CaptureImage and Viewpoint Update).

    None where all surfaces are given one material: nobody would look at them.
    """
    asked = inputs.declare("materials.method", "materials.file")
    taken = not all_given(asked.run_file.materials, asked.base)
    given = inputs.declare(
        "materials.coverage",
        "materials.method",
        stages=(scan,),
        # A network's scales are of views so large; another file of assignments takes no other views.
        others={"pixels": [VIEW_SETTINGS.width, VIEW_SETTINGS.height]} if taken else {"views": NO_VIEWS},
    )
    coverage = given.run_file.materials.coverage

    def make(folder: Path, progress: Progress) -> Notes:
        if not taken:
            progress(0.0, "saving")
            save_views(no_views(len(scan.value.scan.faces), coverage=coverage, why=NO_VIEWS), folder)
            return Notes(summary=NO_VIEWS)
        loading, looking, saving = shares(progress, VIEWS_SHARES)
        loading(0.0, "reading the scan")
        mesh = scan.value.scan
        loading(1.0, "scan read")
        views = render_views(
            mesh,
            scan.value.room,
            coverage=coverage,
            settings=VIEW_SETTINGS,
            workers=inputs.workers,
            progress=looking,
        )
        saving(0.0, "saving")
        save_views(views, folder, workers=inputs.workers)
        # Of a model's walls the outer sides count too, which no room shows; names tell what they are made of.
        short = views.area_coverage < views.threshold and not mesh.appearance.is_drawn
        return Notes(
            summary=f"{were(len(views.views), 'view', ('covers', 'cover'))} "
            f"{100 * views.area_coverage:.1f} % of the area, {100 * views.point_coverage:.1f} % of the points",
            warnings=(
                f"The views cover less than the wanted {100 * coverage:.0f} % of the surfaces: {views.stopped}. "
                "Surfaces that no view saw take the material of their neighbours; if they matter, scan them again from "
                "closer, or assign their materials in a file ([materials] file).",
            )
            if short
            else (),
            made=views,
        )

    return Stage(name="views", settings=given.settings, make=make, load=load_views)


def materials_stage(inputs: Inputs, scan: StageResult[ScannedRoom], views: StageResult[ViewSet]) -> Stage[MaterialMap]:
    """Stage 3: a reflectance spectrum for every face (Algorithm 1, DM and RPP)."""
    asked = inputs.declare(*MATERIALS_KEYS)
    section = asked.run_file.materials
    delight = section.delight and not all_given(section, asked.base)  # which does not use the scan's colours
    given = inputs.declare(
        *MATERIALS_KEYS,
        "panes",
        *(LAMP_KEYS if delight else ()),
        databases=("reflectance", "lamps") if delight else ("reflectance",),
        stages=(scan, views),
    )

    def make(folder: Path, progress: Progress) -> Notes:
        from lidarspectra.mapping.figures.figure_style import svg_text  # these load what draws, and trimesh
        from lidarspectra.mapping.figures.material_figures import segmentation_figure
        from lidarspectra.material.material_mesh import save_material_mesh
        from lidarspectra.workflow.report.report_of_run import SEGMENTATION_FILE, material_pictures

        delighting, estimating, saving = shares(progress, (DELIGHTING_SHARE if delight else 0.0, *MATERIALS_SHARES))
        delighting(0.0, "reading scan and views")
        scanned = scan.value if section.names else without_names(scan.value)
        mesh, found_room = scanned.scan, scanned.room
        records = FrameRecords.load(scan.folder)
        model = model_of_run(section.model, given.base) if delight and mesh.appearance.known else None
        beside = nullcontext() if model is None else votes_beside(model, mesh, views.value, workers=inputs.workers)
        with beside as votes:
            unlit = _without_light(given, scanned, records, delighting) if delight else None
            materials = materials_of_run(
                mesh,
                views.value,
                section,
                room=found_room,
                face_color=unlit.face_color if unlit else None,
                folder=given.base,
                votes=votes,
                progress=estimating,
            )
        saving(0.0, "saving")
        materials = with_light_uncertainty(materials, unlit, mesh.areas)
        gloss = gloss_of_materials(records, mesh, materials, unlit)
        save_gloss(materials, gloss, folder)
        materials = with_gloss(materials, gloss)
        materials = with_panes_of_run(materials, mesh, given.run_file.panes)
        # At last, since the groups that it names are those that a run writes.
        materials = with_assignments_of_run(materials, section, folder=given.base)
        save_materials(materials, folder, face_areas=mesh.areas)
        save_lamp_fluxes(unlit.lamp_fluxes if unlit else (), folder)
        save_material_mesh(mesh, materials, folder)
        if views.value.views:
            pictures = material_pictures(mesh, views.value, materials)
            write_whole(folder / SEGMENTATION_FILE, svg_text(segmentation_figure(pictures)))
        notes = _materials_notes(materials, mesh.areas, unlit)
        return replace(notes, summary=notes.summary + gloss_in_words(gloss))

    return Stage(
        name="materials",
        settings=given.settings,
        make=make,
        load=load_materials,
        stands_in=lambda record, _: same_picture_light(record.settings, given.settings),
        shown=lambda record: with_present_names(record, lamp_names(record.settings), lamp_names(given.settings)),
    )


def scene_stage(
    inputs: Inputs,
    scan: StageResult[ScannedRoom],
    materials: StageResult[MaterialMap],
    *,
    note: Callable[[str], None] = lambda words: None,
) -> Stage[RadianceScene]:
    """Stage 4: the room as a Radiance model, with its lamps' spectra (paper, Section 3.1).

    A scene that was traced for other fluxes or spectra of the same lamps stands in where relighting is exact; `note`
    is called with the reason where it is not.
    """
    given = inputs.declare(
        *(*LAMP_KEYS, *DAYLIGHT_KEYS, "calibration", "sensors.device", "trace.mode", "trace.method"),
        databases=("lamps",),
        stages=(scan, materials),
    )
    run_file = given.run_file

    def make(folder: Path, progress: Progress) -> Notes:
        finding, writing, placing = shares(progress, SCENE_SHARES)
        finding(0.0, "lamps")
        named = with_estimated_fluxes(lamps_of_run(run_file, scan.value, base=given.base), materials.folder)
        lamps = calibrated_lamps((*named, *daylight_of_run(run_file, folder)), run_file.calibration)
        clear = clear_lamps(lamps, scan.value.scan)
        lamps, mesh = clear.lamps, clear.scan
        save_lamps(lamps, folder)
        bands = find_bands(run_file.sensors.device, given.base)
        surfaces = calibrated_materials(materials.value, scan.value, run_file.calibration)
        scene = write_scene(
            mesh,
            surfaces,
            lamps,
            bands,
            folder,
            mode=run_file.trace.mode,
            lamps_per_pass=1 if run_file.trace.method == "rtrace" else LAMPS_PER_PASS,
            engine=find_engine(),
            progress=writing,
        )
        placing(0.0, "places of the lamps")
        return Notes(
            summary=f"{counted(len(lamps), 'lamp')}, "
            f"{counted(len(materials.value.materials), 'material')}, "
            f"{counted(len(scene.passes), 'pass')} of up to "
            f"{max(each.slot_count for each in scene.passes)} bands",
            warnings=(
                *clear.notes,
                *placement_notes(lamps, mesh),
                *glass_notes(scene.left_out_m2),
                *(() if run_file.calibration else black_lamps_note(lamps, mesh, surfaces)),
            ),
        )

    def present(folder: Path) -> tuple[Lamp, ...]:
        return present_lamps(run_file, load_lamps(folder), materials.folder, base=given.base)

    def load(folder: Path) -> RadianceScene:
        return relit_scene(load_scene(folder), load_lamps(folder), present(folder))

    def stands_in(record: StageRecord, folder: Path) -> bool:
        if not same_room(record.settings, given.settings):
            return False
        traced = read_record(stage_folder(folder.parent, "trace"))
        unlit = StageResult(record, folder, load_scene, fresh=True)
        if traced is None or traced.key != stage_key(trace_stage(inputs, scan, materials, unlit)):
            return False  # to be traced anyway: under the present lamps
        reason = why_not_relit(load_scene(folder), load_lamps(folder), present(folder))
        if reason is not None:
            note(reason)
        return reason is None

    return Stage(
        name="scene",
        settings=given.settings,
        make=make,
        load=load,
        stands_in=stands_in,
        shown=lambda record: with_present_names(record, lamp_names(record.settings), lamp_names(given.settings)),
    )


def trace_stage(
    inputs: Inputs,
    scan: StageResult[ScannedRoom],
    materials: StageResult[MaterialMap],
    scene: StageResult[RadianceScene],
) -> Stage[xr.Dataset]:
    """Stage 5: every lamp's light at every sensor point, with its standard error (paper, Sections 2.4.4 and 3.1)."""
    keys = ("trace.accuracy", "trace.noise", "trace.noise_of", "trace.method")
    given = inputs.declare(*SENSOR_KEYS, *keys, stages=(scan, materials, scene))
    sensors, section = given.run_file.sensors, given.run_file.trace
    names = lamp_names(inputs.declare("lamps").settings)  # for what is said; no number depends on them

    def make(folder: Path, progress: Progress) -> Notes:
        placing, tracing, opening, saving = shares(progress, TRACE_SHARES)
        placing(0.0, "sensor points")
        points = sensor_points(scan.value.scan, scan.value.room, sensors, folder=given.base)
        receptor = receptor_of_run(sensors, given.base)
        with trace_engine(inputs.cluster) as engine:
            if section.method == "rtrace":  # with the cosine receptor: the run file refuses any other
                transport = trace_plain(
                    scene.value,
                    points,
                    accuracy=section.accuracy,
                    noise=section.noise,
                    workers=inputs.workers,
                    engine=engine,
                    progress=tracing,
                )
            else:
                transport = trace(
                    scene.value,
                    points,
                    accuracy=section.accuracy,
                    noise=section.noise,
                    noise_of=section.noise_of,
                    seed=TRACE_SEED,
                    workers=inputs.workers,
                    receptor=receptor,
                    engine=engine,
                    progress=tracing,
                )
            light = opening_light(
                scene.value,
                scan.value.scan,
                scan.value.room,
                materials.value,
                points,
                accuracy=section.accuracy,
                receptor=receptor,
                seed=TRACE_SEED,
                workers=inputs.workers,
                engine=engine,
                progress=opening,
            )
        transport = with_opening(transport, share=light.share, coefficient=light.coefficient, closed=light.closed)
        if words := seen_by(sensors, receptor):
            transport.attrs[SEEN_BY] = words
        saving(0.0, "saving")
        save_transport(transport, folder / TRANSPORT_FILE)
        write_workflow(scene.value, points, folder / MODEL_FOLDER, accuracy=section.accuracy, noise=section.noise)
        return Notes(
            summary=f"{counted(len(points), 'point')}, {reflections_in_words(section.accuracy)}"
            f"{', by plain runs of rtrace' if section.method == 'rtrace' else ''}; "
            f"standard error {100 * transport.attrs['achieved_relative_se']:.2f} % of the mean "
            f"(wanted {100 * transport.attrs['target_relative_se']:.1f} %), "
            f"{truncation_in_words(transport)}",
            warnings=trace_warnings(transport, points, scene.value.left_out_m2),
            made=relit_transport(transport, scene.value),
        )

    return Stage(
        name="trace",
        settings=given.settings,
        make=make,
        load=lambda folder: relit_transport(load_transport(folder / TRANSPORT_FILE), scene.value),
        shown=lambda record: with_present_names(record, lamp_names(scene.record.settings), names),
    )


def map_stage(
    inputs: Inputs,
    scan: StageResult[ScannedRoom],
    materials: StageResult[MaterialMap],
    scene: StageResult[RadianceScene],
    transport: StageResult[xr.Dataset],
) -> Stage[xr.Dataset]:
    """Stage 6: the spectral map, the sum over lamps (paper, Section 3.3), and what of it is assumed.

    Its folder has the lamps as they are now: of a scene that was kept they may differ from those that were traced.
    """
    calibration = inputs.declare("calibration").run_file.calibration
    given = inputs.declare(
        *(*LAMP_KEYS, "lamps.assumed", "daylight.windows", "calibration", "scan.assumed", "panes", "panes.assumed"),
        databases=("lamps",),
        stages=(scan, materials, scene, transport),
        others=found_by_calibration(calibration, scan.folder.parent, (SUMMARY,)),
    )
    run_file = given.run_file

    def make(folder: Path, progress: Progress) -> Notes:
        finding, saving = shares(progress, MAP_SHARES)
        traced, scanned, bands = load_lamps(scene.folder), scan.value, scene.value.bands
        lamps = present_lamps(run_file, traced, materials.folder, base=given.base)
        save_lamps(lamps, folder)
        assumed = replace(
            assumed_lamps(run_file, [lamp.name for lamp in lamps]),
            scan=assumed_of_scan(run_file, scanned.scan.record, scanned.room),
        )
        finding(0.0, "what is not known")
        unknowns = unknowns_of_map(
            run_file,
            folder.parent,
            scanned,
            calibrated_materials(materials.value, scanned, run_file.calibration),
            lamps,
            bands,
            transport.value,
            workers=inputs.workers,
        )
        saving(0.0, "saving")
        save_unknowns(unknowns, folder)
        light_map = mark_assumed(spectral_map(transport.value, lamps=lamps, unknowns=unknowns), assumed)
        light_map = mark_partly_known(light_map, lamps, bands)
        save_map(light_map, folder / MAP_FILE)
        save_map_table(light_map, folder / MAP_TABLE_FILE)
        return Notes(
            summary=f"{counted(light_map.sizes['band'], 'channel')} x {counted(light_map.sizes['point'], 'point')}; "
            + levels_in_words(light_map)
            + (f" {words}" if (words := uncertainty_in_words(light_map.attrs)) else "")
            + (f"; assumed: {words}" if (words := assumed.in_words()) else ""),
            warnings=(
                *calibration_notes(run_file.calibration),
                *lost_calibration_note(run_file.calibration, folder.parent, [lamp.name for lamp in lamps]),
                *(lit_notes if run_file.lamps_from_scan else lamp_notes)(assumed, len(lamps)),
                *relit_notes(light_map, traced, lamps),
                *beyond_notes(lamps, bands),
            ),
        )

    return Stage(
        name="map",
        settings=given.settings,
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
    light_map: StageResult[xr.Dataset],
) -> Stage[Path]:
    """Stage 7: figures, tables and one page about all the others."""
    asked = inputs.declare("cells", "calibration").run_file
    cells, calibration = asked.cells, asked.calibration
    given = inputs.declare(
        "people_and_plants",
        "cells",
        "calibration",
        "rules",
        "report.figures",
        databases=("cells",) if cells else (),
        stages=(scan, views, materials, scene, transport, light_map),
        others={
            "title": inputs.name,
            "run_file_text": inputs.text,  # shown verbatim, so any change makes the page stale
            **found_by_calibration(calibration, scan.folder.parent, (SUMMARY, *REPORTED)),
        },
    )

    def make(folder: Path, progress: Progress) -> Notes:
        from lidarspectra.mapping.report.report import write_report  # these load what draws
        from lidarspectra.workflow.report.report_of_run import StagesBefore, report_of_run

        before = StagesBefore(
            scan=scan, views=views, materials=materials, scene=scene, transport=transport, spectral_map=light_map
        )
        applies = given.run_file.people_and_plants or given.run_file.cells
        reading, applying, writing = shares(progress, (READING_SHARE, APPLYING_SHARE if applies else 0.0, PAGE_SHARE))
        report = report_of_run(
            given,
            before,
            title=inputs.name,
            run_file_text=inputs.text,
            trace_seed=TRACE_SEED,
            reading=reading,
            applying=applying,
        )
        page = write_report(folder, report, workers=inputs.workers, progress=writing)
        return Notes(summary=f"{page.name}, with figures and tables beside it")

    return Stage(name="report", settings=given.settings, make=make, load=lambda folder: folder / REPORT_PAGE)


def _without_light(
    given: Declared, scanned: ScannedRoom, records: FrameRecords | None, progress: Progress
) -> Delighting:
    """De-light the scan's colours, given the lamps that were lit when it was scanned."""
    lamps = lamps_in_picture(given.run_file, scanned, base=given.base)
    found = given.run_file.lamps_from_scan
    stated = found is None or found.fluxes == "area"
    cards = cards_of_run(given.run_file.materials.cards)
    screens = [pane for pane in panes_of_run(given.run_file.panes) if pane.kind == "screen"]
    return take_light_out(
        scanned.scan, scanned.room, lamps,
        cards=cards, screens=screens, records=records, fluxes_stated=stated, progress=progress,
    )  # fmt: skip


def _materials_notes(materials: MaterialMap, face_areas: FloatArray, unlit: Delighting | None) -> Notes:
    left_in = unlit is None or unlit.face_color is None
    words, warnings = materials.in_words(face_areas), materials.warnings(face_areas, light_left_in=left_in)
    return Notes(
        summary=f"{words}; {unlit.words}" if unlit and unlit.words else words,
        warnings=(*warnings, *unlit.warnings) if unlit else warnings,
    )
