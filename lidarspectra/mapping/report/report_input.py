"""The content of a report, in one record."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import xarray as xr

from lidarspectra.arrays import BoolArray, FloatArray, float_array
from lidarspectra.geometry.scan import ScanRecord
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.figures.channel_figures import ReportView
from lidarspectra.mapping.figures.figure_style import FileType
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.figures.material_figures import MaterialPictures
from lidarspectra.mapping.maps.map_schema import check_map
from lidarspectra.mapping.photovoltaics.cells import Cell
from lidarspectra.mapping.report.applications import Application
from lidarspectra.mapping.report.report_tables import StageRow
from lidarspectra.mapping.report.room_view import RoomSurfaces
from lidarspectra.material.material_map import Material
from lidarspectra.spectra.spectrum import BandSet


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportInput:
    """The content of a report.

    Parameters
    ----------
    title : str
        Name of the room or run file.
    spectral_map : xarray.Dataset
        See `spectral_map`.
    transport : xarray.Dataset
        The traced coefficients; its attributes state accuracy and noise.
    plan : FloorPlan
        Outline of the room and silhouettes of its furniture, from above.
    scan : ScanRecord
        What was read from the file and repaired.
    materials : tuple of Material
        See `MaterialMap`.
    material_areas_m2 : (material,) float
        [m²]
    lamps : tuple of Lamp
        In the order of the transport's lamps, or of the run file.
    surfaces : RoomSurfaces, optional
        The room's mesh, for the 3D view.
    views : tuple of ReportView
        Pictures of the room, the six of the first viewpoint first.
    view_notes : str
        One sentence on coverage.
    material_pictures : MaterialPictures, optional
        Pictures of how the materials were found.
    segmentation_svg : str
        The figure of these as SVG, where it is drawn already.
    under_furniture : (point,) bool, optional
        Points that something of the furniture is over.
    floor_z_m : float
        Height of the floor below the maps in the scan's coordinates. [m]
    floor_scanned, ceiling_scanned : float, optional
        Of the plan, what of it was scanned. [0-1]
    room_notes : str
        One sentence on the room that was found.
    stages : tuple of StageRow
        Time and memory.
    warnings : tuple of str
        Notes that a reader must know before using the numbers: full sentences.
    provenance : mapping of str to str
        Versions, database hashes, seeds.
    run_file : str
        Text of the run file.
    applications : tuple of Application
        Sections on people, plants and solar cells.
    frames : Application, optional
        The section on the frames of the scan, if its colours come of frames.
    figure_files : tuple of str
        Kinds of the figures' files beside the page: 'svg', 'png', 'pdf'.
    bands : BandSet, optional
        The transport's channels, without which the page's lamps can only be dimmed.
    cells : tuple of (Cell, float)
        Solar cells whose current the page shows, each with a factor on its curve. [1]
    run : str
        Name of the run's folder, for commands that the page gives.
    """

    title: str
    spectral_map: xr.Dataset
    transport: xr.Dataset
    plan: FloorPlan
    scan: ScanRecord
    materials: tuple[Material, ...]
    material_areas_m2: FloatArray
    lamps: tuple[Lamp, ...]
    surfaces: RoomSurfaces | None = None
    views: tuple[ReportView, ...] = ()
    view_notes: str = ""
    material_pictures: MaterialPictures | None = None
    segmentation_svg: str = ""
    under_furniture: BoolArray | None = None
    floor_z_m: float = 0.0
    floor_scanned: float | None = None
    ceiling_scanned: float | None = None
    room_notes: str = ""
    stages: tuple[StageRow, ...] = ()
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)
    run_file: str = ""
    applications: tuple[Application, ...] = ()
    frames: Application | None = None
    figure_files: tuple[FileType, ...] = ("svg",)
    bands: BandSet | None = None
    cells: tuple[tuple[Cell, float], ...] = ()
    run: str = "RUN"

    def __post_init__(self) -> None:
        check_map(self.spectral_map, where="map of the report")
        areas = float_array(self.material_areas_m2, name="ReportInput.material_areas_m2", shape=(len(self.materials),))
        object.__setattr__(self, "material_areas_m2", areas)
