"""Gather the content of the report page from the stages of a run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import xarray as xr

from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamp_file import load_lamps
from lidarspectra.mapping.figures.figure_style import svg_width_in
from lidarspectra.mapping.figures.floor_plan import floor_plan
from lidarspectra.mapping.figures.material_figures import MaterialPictures, material_code, mean_shown_colors, painted
from lidarspectra.mapping.maps.interpolation import map_planes
from lidarspectra.mapping.report.report import ReportInput, ReportView, StageRow
from lidarspectra.mapping.report.room_view import RoomSurfaces
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.material.material_mesh import daylight_colors
from lidarspectra.material.views.views import ViewSet
from lidarspectra.progress import Progress
from lidarspectra.radiance.scene.scene import RadianceScene
from lidarspectra.room.furniture import under_furniture
from lidarspectra.workflow.calibration.report import calibration_sections
from lidarspectra.workflow.report.report_applications import report_applications, shown_cells
from lidarspectra.workflow.report.report_frames import frames_section
from lidarspectra.workflow.rules.report import rules_sections
from lidarspectra.workflow.run_folder.calibration_of_run import shown_materials
from lidarspectra.workflow.run_folder.declared import Declared
from lidarspectra.workflow.run_folder.lamps_of_run import ScannedRoom
from lidarspectra.workflow.run_folder.workspace import StageResult, versions

SEGMENTATION_FILE = "segmentation.svg"  # of the materials stage, which draws it for itself and for the page
SHOWN_VIEWS = 6  # the first six are the cube faces around the first viewpoint


@dataclass(frozen=True, kw_only=True)
class StagesBefore:
    """Results of all stages before the report."""

    scan: StageResult[ScannedRoom]
    views: StageResult[ViewSet]
    materials: StageResult[MaterialMap]
    scene: StageResult[RadianceScene]
    transport: StageResult[xr.Dataset]
    spectral_map: StageResult[xr.Dataset]

    @property
    def all(self) -> tuple[StageResult[Any], ...]:
        """All of them, in the order of the run."""
        return (self.scan, self.views, self.materials, self.scene, self.transport, self.spectral_map)


def report_of_run(
    given: Declared,
    before: StagesBefore,
    *,
    title: str,
    run_file_text: str,
    trace_seed: int,
    reading: Progress,
    applying: Progress,
) -> ReportInput:
    """Gather the content of a report.

    Parameters
    ----------
    given : Declared
        With `people_and_plants`, `cells`, `calibration`, `rules` and `report` of the run file.
    before : StagesBefore
    title : str
    run_file_text : str
        Shown verbatim.
    trace_seed : int
    reading, applying : Progress
        Of the stages' results, and of people, plants and cells.

    Returns
    -------
    report : ReportInput
    """
    mesh, found_room = before.scan.value.scan, before.scan.value.room
    views, transport = before.views.value, before.transport.value
    materials = shown_materials(before.materials.value, before.scan.value, given.run_file.calibration)
    lamps = load_lamps(before.spectral_map.folder)
    light = before.spectral_map.value
    places = np.stack([light[axis].to_numpy() for axis in "xyz"], axis=1)
    drawn = places[planes[0]] if (planes := map_planes(light)) else places
    floor_z = float(np.median(found_room.floor_at(drawn)))
    level_m = float(np.median(drawn[:, 2])) if planes else None
    plan = floor_plan(mesh, found_room, level_m=level_m, floor_z=floor_z)
    face_color = mesh.face_colors()
    segmentation = kept_svg(before.materials.folder / SEGMENTATION_FILE)
    is_drawn = segmentation and set(given.run_file.report.figures) <= {"svg"}
    pictures = material_pictures(mesh, replace(views, views=()) if is_drawn else views, materials)
    reading(1.0, "scan and materials are read")
    return ReportInput(
        title=title,
        spectral_map=light,
        transport=transport,
        plan=plan,
        applications=(
            *calibration_sections(given.run_file.calibration, before.scan.folder.parent / "calibration", plan),
            *rules_sections(given.run_file.rules, before.scan.folder.parent),
            *report_applications(
                given.run_file,
                transport,
                lamps,
                before.scene.value.bands,
                plan,
                base=given.base,
                progress=applying,
            ),
        ),
        frames=frames_section(before.scan.folder, plan),
        scan=mesh.record,
        materials=materials.materials,
        material_areas_m2=materials.areas(mesh.areas),
        surfaces=RoomSurfaces(
            vertices=mesh.vertices, faces=mesh.faces, face_material=materials.face_material, face_color=face_color
        ),
        lamps=lamps,
        views=_shown(views),
        material_pictures=pictures,
        segmentation_svg=segmentation,
        view_notes=before.views.record.summary,
        under_furniture=under_furniture(mesh, found_room, places),
        floor_z_m=floor_z,
        floor_scanned=found_room.floor_confidence,
        ceiling_scanned=found_room.ceiling_confidence,
        room_notes=before.scan.record.summary,
        stages=_rows(before.all),
        warnings=tuple(warning for result in before.all for warning in result.record.warnings),
        provenance=_provenance(before.all, trace_seed),
        run_file=run_file_text,
        figure_files=given.run_file.report.figures,
        bands=before.scene.value.bands,
        cells=shown_cells(given.run_file.cells, base=given.base),
        run=before.scan.folder.resolve().parent.name,
    )


def material_pictures(scan: Scan, views: ViewSet, materials: MaterialMap) -> MaterialPictures:
    """The first six views before and after segmentation, and the materials' colours before and after de-lighting."""
    areas = materials.areas(scan.areas)
    listed = materials.materials
    code = material_code(tuple(m.name for m in listed), tuple(m.category for m in listed), areas)
    first = views.views[:SHOWN_VIEWS]
    found = daylight_colors(listed)
    return MaterialPictures(
        views=_shown(views),
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


def kept_svg(path: Path) -> str:
    """A figure that an earlier stage drew; empty where it is missing, damaged or another's, to be drawn again."""
    try:
        svg = path.read_text(encoding="utf-8")
        svg_width_in(ElementTree.fromstring(svg.encode("utf-8")))
    except (OSError, ValueError, ElementTree.ParseError):
        return ""
    return svg


def _shown(views: ViewSet) -> tuple[ReportView, ...]:
    return tuple(ReportView(name=view.name, image=view.image) for view in views.views[:SHOWN_VIEWS])


def _rows(results: Sequence[StageResult[Any]]) -> tuple[StageRow, ...]:
    records = [result.record for result in results]
    return tuple(
        StageRow(
            stage=record.stage,
            summary=record.summary,
            seconds=record.seconds,
            peak_memory_mib=record.peak_memory_mib,
        )
        for record in records
    )


def _provenance(results: Sequence[StageResult[Any]], trace_seed: int) -> Mapping[str, str]:
    hashes = {
        f"sha256 of {name}": digest
        for result in results
        for part in ("files", "databases")
        for name, digest in result.record.settings.get(part, {}).items()
    }
    finished = {f"stage '{result.record.stage}' finished": result.record.finished for result in results}
    return {**versions(), **finished, **hashes, "trace seed": str(trace_seed)}
