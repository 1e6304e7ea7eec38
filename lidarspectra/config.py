"""The run file: a TOML text into records that check themselves; an unknown key is an error."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, Field, model_validator

from lidarspectra.errors import RunFileError
from lidarspectra.io.toml_sections import Section, parse_sections

Vector = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Name = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]
"""Of a lamp: any words in one line; what files of results cannot hold, control characters, is refused."""
Fraction = Annotated[float, Field(ge=0, le=1)]


class ScanSection(Section):
    """`[scan]`: the phone's file and what is done to its mesh."""

    file: str = Field(min_length=1)
    unit: Literal["auto", "m", "cm", "mm", "in", "ft"] = "auto"
    up: Literal["auto", "+x", "-x", "+y", "-y", "+z", "-z"] = "auto"
    close_holes: bool = True
    max_hole_m: Positive = 1.0
    """Longest extent of a hole that is closed; a larger one is left open and reported. [m]"""
    flatten: bool = True
    """Draw vertices onto the planes of walls, tables and other flat things, and straighten their edges."""
    max_faces: Annotated[int, Field(ge=100)] | None = None
    """Decimate to at most so many triangles."""


class LampSection(Section):
    """`[[lamps]]`: one lamp. Give one of luminous flux, radiant flux, or neither where the spectrum is absolute."""

    name: Name
    shape: Literal["panel", "disc", "strip", "bulb", "spot", "point", "ies", "window"]
    center: Vector
    size: tuple[Positive, Positive] | tuple[Positive] | Positive | None = None
    normal: Vector = (0.0, 0.0, -1.0)
    rotation_deg: float = 0.0
    beam_angle_deg: Annotated[float, Field(gt=0, lt=180)] | None = None
    spectrum: str | None = None
    cct_k: Annotated[float, Field(ge=1000, le=25000)] | None = None
    """Correlated colour temperature in place of a spectrum. [K]"""
    luminous_flux_lm: Positive | None = None
    radiant_flux_W: Positive | None = None  # noqa: N815 - watts are W
    """Over the spectrum's whole range. [W]"""
    dim: Fraction = 1.0
    file: str | None = None
    """IES LM-63 or EULUMDAT (.ldt) file, for shape 'ies'."""

    @model_validator(mode="after")
    def _one_flux(self) -> Self:
        if self.luminous_flux_lm is not None and self.radiant_flux_W is not None:
            raise ValueError("give luminous_flux_lm or radiant_flux_W, not both")
        if (self.spectrum is None) == (self.cct_k is None):
            raise ValueError("give either spectrum or cct_k")
        if self.cct_k is not None and self.luminous_flux_lm is None and self.radiant_flux_W is None:
            raise ValueError("cct_k is a relative spectrum: give luminous_flux_lm or radiant_flux_W")
        if (self.shape == "ies") != (self.file is not None):
            raise ValueError("'file' goes with shape 'ies', and only with it")
        if (self.shape == "spot") != (self.beam_angle_deg is not None):
            raise ValueError("'beam_angle_deg' goes with shape 'spot', and only with it")
        return self


class LampsFromScanSection(Section):
    """`[lamps_from_scan]`: find lit lamps in the texture."""

    spectrum: str | None = None
    cct_k: Annotated[float, Field(ge=1000, le=25000)] | None = None
    luminous_exitance_lm_m2: Positive = 10000.0
    """Luminous flux each square metre of lamp sends, 10,000 for a common 3600 lm panel of 0.6 m x 0.6 m. [lm/m²]"""
    fluxes: Literal["walls", "area"] = "walls"
    """Share of each lamp in all light: by the light on the walls where that tells it, or by its area alone."""

    @model_validator(mode="after")
    def _one_spectrum(self) -> Self:
        if (self.spectrum is None) == (self.cct_k is None):
            raise ValueError("give either spectrum or cct_k")
        return self


class WindowSection(Section):
    """`[[daylight.windows]]`: an opening to the outside."""

    name: Name
    center: Vector
    """Middle, just inside the pane. [m]"""
    size: tuple[Positive, Positive]
    """Length and width of the glass. [m]"""
    normal: Vector
    """Into the room."""
    rotation_deg: float = 0.0
    transmittance: Fraction = 0.8
    """Of pane and frame together, at normal incidence."""


class DaylightSection(Section):
    """`[daylight]`: sky and sun for a place and time, through the windows."""

    latitude_deg: Annotated[float, Field(ge=-90, le=90)]
    longitude_deg: Annotated[float, Field(ge=-180, le=180)]
    """East is positive."""
    time: AwareDatetime
    """With its offset from UTC."""
    north_deg: float = 0.0
    """Turn of north from the scan's y axis, counter-clockwise seen from above. [deg]"""
    cloud_cover: Fraction = 0.0
    aerosol_optical_depth: Fraction = 0.1
    ground_reflectance: Annotated[float, Field(ge=0, le=0.99)] = 0.2
    windows: Annotated[tuple[WindowSection, ...], Field(min_length=1)]


class MaterialsSection(Section):
    """`[materials]`: how faces get their reflectance."""

    method: Literal["estimate", "default", "file"] = "estimate"
    default: str = "white-plastic"
    """Database ID of the material for all faces (method 'default'), and for faces without colour."""
    file: str | None = None
    """CSV of assignments, for method 'file'."""
    databases: tuple[str, ...] = ("builtin",)
    matching: Literal["wiener", "nearest"] = "wiener"
    """From a colour to a spectrum: estimated over the nearest colours, or the nearest surface's (paper)."""
    model: Annotated[str, Field(pattern=r"^(builtin|none|.+\.onnx)$")] = "builtin"
    """Network that tells material classes: 'builtin', 'none', or an ONNX file with its card beside it."""
    colors: Annotated[int, Field(ge=1, le=200)] = 24
    """Most primary colours that K-means may find."""
    coverage: Fraction = 0.95
    """Completeness threshold T of Algorithm 1."""
    delight: bool = True
    """Take the room's light out of the scan's colours, from the lamps' known light."""

    @model_validator(mode="after")
    def _file_with_method(self) -> Self:
        if (self.method == "file") != (self.file is not None):
            raise ValueError("'file' goes with method = 'file', and only with it")
        return self


class GridSection(Section):
    """`[sensors.grid]`: points on a horizontal plane inside the room; give `count` or `spacing`."""

    height: float = 0.3
    """Above the floor. [m]"""
    count: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    spacing: Positive | None = None
    """[m]"""
    margin: Annotated[float, Field(ge=0)] = 0.1
    """Least distance from walls and furniture. [m]"""
    normal: Vector = (0.0, 0.0, 1.0)

    @model_validator(mode="after")
    def _count_or_spacing(self) -> Self:
        if (self.count is None) == (self.spacing is None):
            raise ValueError("give either count or spacing")
        return self


class SensorsSection(Section):
    """`[sensors]`: the device, and where it stands."""

    device: str = "as7265x-14"
    grid: GridSection | None = None
    points: str | None = None
    """CSV with columns x, y, z [m] and optionally nx, ny, nz."""
    field_of_view_deg: Annotated[float, Field(gt=0, le=90)] | None = None
    """Half angle of a restricted view; None is the cosine receptor. [deg]"""
    receptor: str | None = None
    """CSV of a measured angular response, with columns angle_deg and response."""
    lift: Annotated[float, Field(ge=0, le=1)] = 0.02
    """Points are lifted so far along their normal, clear of a noisy surface. [m]"""

    @model_validator(mode="after")
    def _grid_or_points(self) -> Self:
        if (self.grid is None) == (self.points is None):
            raise ValueError("give either a grid or a points file")
        if self.field_of_view_deg is not None and self.receptor is not None:
            raise ValueError("give field_of_view_deg or receptor, not both")
        return self


class TraceSection(Section):
    """`[trace]`: how far light is followed, and how much noise is left."""

    accuracy: Literal["low", "medium", "high", "ultra"] = "high"
    noise: Literal["draft", "standard", "fine"] = "standard"
    mode: Literal["native", "rgb"] = "native"
    workers: Annotated[int, Field(ge=1, le=1024)] | None = None
    """Processes; None is one a core."""


class PeopleAndPlantsSection(Section):
    """`[people_and_plants]`: lx, CCT, melanopic EDI, PPFD and more in the report."""

    rendering: bool = True
    """Colour rendering too, some 50 ms a point."""


class CellSection(Section):
    """`[[cells]]`: a solar cell whose current the report maps."""

    cell: str = Field(min_length=1)
    """Database name, or a CSV of wavelength and quantum efficiency."""
    area_cm2: Positive | None = None
    """None is the area that the database has. [cm²]"""
    scale: Positive = 1.0
    """On the cell's curve, from a calibration."""
    hours: str | None = None
    """'8:30-17': all lamps lit so, for charge and energy of a day."""
    volt: Positive | None = None
    """At which a converter holds the cell; None is its maximum power point. [V]"""


class RunFile(Section):
    """The whole run file.

    Parameters
    ----------
    scan, lamps, lamps_from_scan, daylight, materials, sensors, trace, people_and_plants, cells
        Its tables; see docs/run-file.md for every key.
    """

    scan: ScanSection
    lamps: tuple[LampSection, ...] = ()
    lamps_from_scan: LampsFromScanSection | None = None
    daylight: DaylightSection | None = None
    materials: MaterialsSection = MaterialsSection()
    sensors: SensorsSection = SensorsSection(grid=GridSection(count=176))
    trace: TraceSection = TraceSection()
    people_and_plants: PeopleAndPlantsSection | None = None
    cells: tuple[CellSection, ...] = ()

    @model_validator(mode="after")
    def _lamps_given(self) -> Self:
        if self.lamps and self.lamps_from_scan is not None:
            raise ValueError("give either [[lamps]] or [lamps_from_scan], not both")
        if not self.lamps and self.lamps_from_scan is None and self.daylight is None:
            raise ValueError("give one or more [[lamps]], a [lamps_from_scan], or [daylight]: a dark room has no map")
        names = [lamp.name for lamp in self.lamps]
        if self.daylight is not None:
            names += [*(window.name for window in self.daylight.windows), "sun"]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two lamps have the name {twice[0]!r}; names tell lamps apart in relighting")
        return self


def read_run_file(path: Path) -> RunFile:
    """Read a run file.

    Parameters
    ----------
    path : Path
        A TOML text in UTF-8.

    Returns
    -------
    run_file : RunFile

    Raises
    ------
    RunFileError
        If the file is missing, no TOML, or has unknown keys or values that do not fit; all faults are named at once.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as cause:
        raise RunFileError(
            expected="a readable run file (TOML, UTF-8)",
            found=str(cause) if isinstance(cause, OSError) else f"no text in UTF-8 ({cause.reason})",
            where=str(path),
            todo="Make one with 'lidarspectra init SCAN'.",
        ) from cause
    return parse_run_file(text, where=str(path))


def parse_run_file(text: str, *, where: str) -> RunFile:
    """Check the text of a run file; `where` names it in errors (see `read_run_file`)."""
    return parse_sections(RunFile, text, kind="run file", where=where, error=RunFileError, page="docs/run-file.md")
