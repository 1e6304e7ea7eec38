"""The run file: a TOML text into records that check themselves; an unknown key is an error."""

import math
import shlex
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypedDict

from pydantic import AwareDatetime, Field, PrivateAttr, model_validator

from lidarspectra.arguments import path_of
from lidarspectra.errors import RunFileError
from lidarspectra.io.file_names import from_folder, renamed, renamed_text
from lidarspectra.io.files import write_whole, writing
from lidarspectra.io.toml_sections import Section, check_sections, parse_sections
from lidarspectra.io.toml_text import toml_value

Vector = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Name = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]
"""Of a lamp: any words in one line; what files of results cannot hold, control characters, is refused."""
Height = Annotated[float, Field(allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0, le=1)]
DayOfYear = Annotated[str, Field(pattern=r"^(0[1-9]|1[0-2])-(0[1-9]|[12][0-9]|3[01])$")]
DEFAULT_POINTS = 176  # of the grid where a run file asks for none: the paper's
MAX_PANE_LEAN = 0.2  # [1] vertical part of a pane's normal over its level part: panes stand upright
MIN_AREA_M2 = 1e-3  # [m²] of an area of the plan: less is corners in one line, or given out of order


class ScanSection(Section):
    """`[scan]`: the phone's file and what is done to its mesh."""

    file: str = Field(min_length=1)
    unit: Literal["auto", "m", "cm", "mm", "in", "ft"] = "auto"
    up: Literal["auto", "+x", "-x", "+y", "-y", "+z", "-z"] = "auto"
    level: bool = True
    """Set a scan upright that leans about its upward axis."""
    floor: Height | None = None
    """Height of the floor, z in the scan's axes; None finds it. [m]"""
    ceiling: Height | None = None
    """Height of the main ceiling, z in the scan's axes; None finds it. [m]"""
    close_holes: bool = True
    close_ceiling: bool = True
    """Close a ceiling that was not scanned at the height where the walls end, with the typical reflectance of one; and
    what is open of one that was scanned in part."""
    close_floor: bool = True
    """The same for a floor."""
    close: bool = False
    """Close all that is open, sides and ends too, with a default wall."""
    max_hole_m: Positive = 1.0
    """Longest extent of a hole that is closed; a larger one is left open and reported. [m]"""
    flatten: bool = True
    """Draw vertices onto the planes of walls, tables and other flat things, and straighten their edges."""
    max_faces: Annotated[int, Field(ge=100)] | None = None
    """Decimate to at most so many triangles."""
    frames: bool = True
    """Take the colours from the frames, where the scan is an app's raw data; else the mesh's own."""
    assumed: tuple[Literal["unit", "up"], ...] = ()
    """Which of them are guesses, not known: said in the notes, the map and the report."""

    @model_validator(mode="after")
    def _ceiling_above_floor(self) -> Self:
        if self.floor is not None and self.ceiling is not None and self.ceiling <= self.floor:
            raise ValueError(
                f"ceiling = {self.ceiling:g} is not above floor = {self.floor:g}: both are heights z in the scan's "
                "axes, in metres"
            )
        return self


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
    dim_in_scan: Fraction = 1.0
    """Factor on the flux while the room was scanned; 0 where it was off."""
    flux_deviation: Annotated[float, Field(gt=0, lt=1)] | None = None
    """Relative standard deviation of the flux; None is that of data sheets, or of guesses where it is assumed. [1]"""
    file: str | None = None
    """IES LM-63 or EULUMDAT (.ldt) file, for shape 'ies'."""
    assumed: bool | tuple[Literal["flux", "spectrum", "place"], ...] = False
    """Which of its flux and spectrum are guesses, not known: said in notes, map and report. True is both. 'place' is of
    a lamp that stands in place of the room's own, which nothing tells."""

    @property
    def guesses(self) -> frozenset[str]:
        """Of 'flux', 'spectrum' and 'place' those that are assumed."""
        return frozenset(("flux", "spectrum") if self.assumed is True else self.assumed or ())

    @model_validator(mode="after")
    def _one_flux(self) -> Self:
        if self.luminous_flux_lm is not None and self.radiant_flux_W is not None:
            raise ValueError("give luminous_flux_lm or radiant_flux_W, not both")
        if (self.spectrum is None) == (self.cct_k is None):
            raise ValueError("give either spectrum or cct_k")
        fluxes = (self.luminous_flux_lm, self.radiant_flux_W, self.file)  # a candela file has its own lumens
        if self.cct_k is not None and fluxes == (None, None, None):
            raise ValueError("cct_k is a relative spectrum: give luminous_flux_lm or radiant_flux_W")
        if (self.shape == "ies") != (self.file is not None):
            raise ValueError("'file' goes with shape 'ies', and only with it")
        if (self.shape == "spot") != (self.beam_angle_deg is not None):
            raise ValueError("'beam_angle_deg' goes with shape 'spot', and only with it")
        return self


class PaneSection(Section):
    """`[[panes]]`: an upright rectangle of glass, a mirror or a screen."""

    name: Name
    kind: Literal["glass", "mirror", "screen"]
    center: Vector
    """[m]"""
    size: tuple[Positive, Positive]
    """Width and height. [m]"""
    normal: Vector
    """Into the room, without vertical part."""
    transmittance: Fraction | None = None
    """Of glass, at normal incidence; None is that of clear double glazing."""
    reflectance: Annotated[float, Field(ge=0, le=0.99)] | None = None
    """Of a mirror or a screen; None is the usual one."""
    assumed: bool = False
    """Proposed by `init`, and not yet looked at: map and notes say so. Changes no number."""

    @model_validator(mode="after")
    def _is_pane(self) -> Self:
        if self.kind == "glass" and self.reflectance is not None:
            raise ValueError("glass takes transmittance; what it reflects follows from that")
        if self.kind != "glass" and self.transmittance is not None:
            raise ValueError(f"nothing goes through a {self.kind}: give reflectance, or kind = 'glass'")
        x, y, z = self.normal
        if not (x or y) or abs(z) > MAX_PANE_LEAN * math.hypot(x, y):
            raise ValueError("normal must point from the pane level into the room, for instance [1, 0, 0]")
        return self


class LampsFromScanSection(Section):
    """`[lamps_from_scan]`: find lit lamps in the texture."""

    spectrum: str | None = None
    cct_k: Annotated[float, Field(ge=1000, le=25000)] | None = None
    luminous_exitance_lm_m2: Positive | None = None
    """Luminous flux each square metre of lamp sends; None assumes that of common panels. [lm/m²]"""
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
    weather: Annotated[str, Field(min_length=1)] | None = None
    """EPW file of a year, or 'synthetic', for `lidarspectra annual`."""
    summer_time: tuple[DayOfYear, DayOfYear] | None = None
    """First and last day, as "03-31", on which clocks are an hour ahead of standard time."""
    windows: Annotated[tuple[WindowSection, ...], Field(min_length=1)]


class CardSection(Section):
    """`[[materials.cards]]`: a matt grey or white card of known reflectance that lay or hung in the room."""

    center: Vector
    """Its middle. [m]"""
    size: Annotated[float, Field(ge=0.05, le=2.0)] = 0.2
    """Its shorter side. [m]"""
    reflectance: Annotated[float, Field(gt=0.01, lt=1)]
    """The same at all wavelengths: 0.18 of a photographer's grey card, about 0.85 of office paper."""


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
    names: bool = True
    """Take the names of parts (wall, door, table) as evidence, and typical reflectances where colours are drawn."""
    colors: Annotated[int, Field(ge=1, le=200)] = 24
    """Most primary colours that K-means may find."""
    coverage: Fraction = 0.95
    """Completeness threshold T of Algorithm 1."""
    delight: bool = True
    """Take the room's light out of the scan's colours, from the lamps' known light."""
    cards: tuple[CardSection, ...] = ()
    """Cards of known reflectance in the picture, witnesses of the level of all others; with `delight` alone."""

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
        if self.grid is not None and self.points is not None:
            raise ValueError("give either a grid or a points file, not both")
        if self.grid is None and self.points is None:
            object.__setattr__(
                self, "grid", GridSection(count=DEFAULT_POINTS)
            )  # not a set field: `changed` may give points
        if self.field_of_view_deg is not None and self.receptor is not None:
            raise ValueError("give field_of_view_deg or receptor, not both")
        return self


class TraceSection(Section):
    """`[trace]`: how far light is followed, and how much noise is left."""

    accuracy: Literal["low", "medium", "high", "ultra", "all"] = "high"
    noise: Literal["draft", "standard", "fine"] = "standard"
    noise_of: Literal["mean", "point"] = "mean"
    """Whether the target holds for the mean irradiance, or at each point for its own light."""
    mode: Literal["native", "rgb"] = "native"
    method: Literal["adaptive", "rtrace"] = "adaptive"
    """'adaptive' samples where the noise is; 'rtrace' runs plain rtrace, as the exported model's Makefile does."""
    workers: Annotated[int, Field(ge=1, le=1024)] | None = None
    """Processes; None is one a core."""

    @model_validator(mode="after")
    def _target_with_method(self) -> Self:
        if self.method == "rtrace" and self.noise_of == "point":
            raise ValueError(
                "method = 'rtrace' takes a fixed number of rays and comes down to no target: leave out noise_of, "
                "or trace with method = 'adaptive'"
            )
        return self


class PeopleAndPlantsSection(Section):
    """`[people_and_plants]`: lx, CCT, melanopic EDI, PPFD and more in the report."""

    rendering: bool = True
    """Colour rendering too, some 50 ms a point."""


class AreaSection(Section):
    """`[[rules.areas]]`: an area of the plan that people or plants need light in."""

    name: Name
    polygon: Annotated[tuple[tuple[float, float], ...], Field(min_length=3)]
    """Corners in the plan, in the scan's axes. [m]"""
    height: Annotated[float, Field(ge=0)] = 0.75
    """Of the task above the floor. [m]"""
    eye_height: Annotated[float, Field(gt=0)] = 1.2
    """Of people's eyes above the floor: 1.2 seated, 1.6 standing. [m]"""
    activity: Literal[
        "writing", "filing", "drawing", "meeting", "reception", "archive", "corridor", "classroom", "plants"
    ] = "writing"
    """Row of EN 12464-1 that the limits are of; none of people's for plants."""
    illuminance_lx: Positive | None = None
    """Maintained illuminance in place of the activity's. [lx]"""
    uniformity: Fraction | None = None
    """U0 in place of the activity's. [1]"""
    cylindrical_lx: Positive | None = None
    """[lx]"""
    ugr: Positive | None = None
    looks_deg: tuple[float, ...] | None = None
    """Where its people look, counter-clockwise from the x axis; along the walls to all four sides if None. [deg]"""
    dli_mol_m2: Positive | None = None
    """Daily light integral that its plants need. [mol/m²]"""

    @model_validator(mode="after")
    def _has_area_and_looks(self) -> Self:
        corners = zip(self.polygon, (*self.polygon[1:], self.polygon[0]), strict=True)
        area_m2 = 0.5 * abs(sum(x * after_y - after_x * y for (x, y), (after_x, after_y) in corners))
        if not area_m2 >= MIN_AREA_M2:
            raise ValueError(
                f"the area {self.name!r} has {area_m2:g} m², less than {MIN_AREA_M2:g}: give its corners in metres, "
                "one after the other around it"
            )
        if self.looks_deg is not None and not self.looks_deg:
            raise ValueError(f"looks_deg of {self.name!r} is empty: give an angle, or leave it out for four looks")
        return self


class RulesSection(Section):
    """`[rules]`: what the light is held against by `lidarspectra rules`."""

    maintenance_factor: Annotated[float, Field(gt=0, le=1)] = 0.8
    """Of the run's light, what is left before lamps and room are cleaned. [1]"""
    walls_lx: Positive | None = None
    """Mean on the walls, in place of the activities' highest. [lx]"""
    ceiling_lx: Positive | None = None
    """[lx]"""
    photoperiod_h: Annotated[float, Field(gt=0, le=24)] = 16.0
    """Hours a day that the lamps are lit, for plants. [h]"""
    well_daylight_points: bool = False
    """Whether the room earns points for daylight (WELL v2, L05 or L06), which lower what L03 asks of electric light."""
    glare: bool = True
    """Render what people see, for UGR and DGP."""
    areas: tuple[AreaSection, ...] = ()

    @model_validator(mode="after")
    def _names_tell_areas_apart(self) -> Self:
        names = [area.name for area in self.areas]
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise ValueError(f"two areas have the name {twice[0]!r}; names tell areas apart in the results")
        return self


class CellSection(Section):
    """`[[cells]]`: a solar cell whose current the report maps."""

    cell: str = Field(min_length=1)
    """Database name, or a CSV of wavelength and quantum efficiency."""
    area_cm2: Positive | None = None
    """None is the area that the database has. [cm²]"""
    scale: Positive = 1.0
    """On the cell's curve, from a calibration."""
    hours: str | None = None
    """'8:30-17': all electric lamps lit so, for charge and energy of a day."""
    volt: Positive | None = None
    """At which a converter holds the cell; None is its maximum power point. [V]"""


class ReflectanceFactors(Section):
    """`[calibration.reflectance]`: factors on the reflectances of the room's parts."""

    floor: Positive = 1.0
    ceiling: Positive = 1.0
    walls: Positive = 1.0
    furniture: Positive = 1.0


class CalibrationSection(Section):
    """`[calibration]`: the room's factors that readings determined; `lidarspectra calibrate` writes it."""

    measured: str | None = None
    """The readings, for the reader; not read again."""
    lamps: dict[str, Positive] = Field(default_factory=dict)
    """Factors on the fluxes of lamps, windows and the sun, by name."""
    determined: tuple[str, ...] = ()
    """Lamps whose flux the readings determined: it is assumed no longer."""
    reflectance: ReflectanceFactors = ReflectanceFactors()


class _Named(TypedDict):
    """How errors name a run file."""

    kind: str
    error: type[RunFileError]
    page: str


FILE_KEYS = ("file", "points", "receptor")  # of the run file: a value is a file's name
FILE_OR_NAME_KEYS = (
    "spectrum",
    "model",
    "databases",
    "device",
    "cell",
    "weather",
)  # a file's name, or one of a database
RUN_FILE_SUFFIX = ".toml"
_NAMED: _Named = {"kind": "run file", "error": RunFileError, "page": "docs/run-file.md"}


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Where a run file comes from.

    Parameters
    ----------
    folder : Path
        Where its relative names start.
    name : str
        Without ending.
    text : str
        Its text with comments; empty where it was made or changed in Python.
    """

    folder: Path
    name: str
    text: str


class ReportSection(Section):
    """`[report]`: what lies beside the report's page."""

    figures: tuple[Literal["svg", "png", "pdf"], ...] = ("svg",)
    """Kinds of files that every figure of the page is written as."""


def require_no_run_file(path: Path) -> None:
    """Raise a RunFileError if there is a file where a run file is to be written."""
    if path.exists():
        raise RunFileError(
            expected="no file there yet",
            found="one, which may hold your edits",
            where=str(path),
            todo="Rename it to keep it, or overwrite it: --force (force=True in Python).",
        )


class RunFile(Section):
    """The whole run file.

    Parameters
    ----------
    scan, lamps, lamps_from_scan, daylight, panes, materials, sensors, trace
        Its tables; see docs/run-file.md for every key.
    people_and_plants, cells, calibration, rules, report
        What else is asked for, and what readings determined.
    """

    scan: ScanSection
    lamps: tuple[LampSection, ...] = ()
    lamps_from_scan: LampsFromScanSection | None = None
    daylight: DaylightSection | None = None
    panes: tuple[PaneSection, ...] = ()
    materials: MaterialsSection = MaterialsSection()
    sensors: SensorsSection = SensorsSection()
    trace: TraceSection = TraceSection()
    people_and_plants: PeopleAndPlantsSection | None = None
    cells: tuple[CellSection, ...] = ()
    calibration: CalibrationSection | None = None
    rules: RulesSection | None = None
    report: ReportSection = ReportSection()
    _origin: "Origin | None" = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _names_tell_apart(self) -> Self:
        if self.lamps and self.lamps_from_scan is not None:
            raise ValueError("give either [[lamps]] or [lamps_from_scan], not both")
        names = [lamp.name for lamp in self.lamps]
        if self.daylight is not None:
            names += [*(window.name for window in self.daylight.windows), "sun"]
        panes = [pane.name for pane in self.panes]
        if doubled := sorted({name for name in panes if panes.count(name) > 1}):
            raise ValueError(f"two panes have the name {doubled[0]!r}; names tell panes apart in notes")
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two lamps have the name {twice[0]!r}; names tell lamps apart in relighting")
        return self

    @model_validator(mode="after")
    def _receptor_with_method(self) -> Self:
        given = [name for name in ("receptor", "field_of_view_deg") if getattr(self.sensors, name) is not None]
        if self.trace.method == "rtrace" and given:
            raise ValueError(
                f"[trace] method = 'rtrace' has the cosine receptor alone: leave out {given[0]} under [sensors], "
                "or trace with method = 'adaptive'"
            )
        return self

    def __eq__(self, other: object) -> bool:
        """Whether both say the same, wherever they come from."""
        return isinstance(other, RunFile) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash(self.to_toml())  # its values may hold tables, which have no hash

    @property
    def folder(self) -> Path:
        """Where relative file names start: the folder that the file was read from, or the current one."""
        return Path() if self._origin is None else self._origin.folder

    @property
    def name(self) -> str:
        """Its name without ending; the scan's where it is no file yet."""
        return Path(self.scan.file).stem if self._origin is None else self._origin.name

    @property
    def text(self) -> str:
        """As it was read or made by `init`, with its comments; as `to_toml` writes it where there is no such text."""
        text = "" if self._origin is None else self._origin.text
        return text or self.to_toml()

    def with_origin(self, *, folder: Path, name: str, text: str = "") -> "RunFile":
        """The same with the place that its relative names start from, its name, and its commented text."""
        copy = self.model_copy()
        copy._origin = Origin(folder=folder, name=name, text=text)
        return copy

    def changed(self, **tables: object) -> "RunFile":
        """The same with other keys, checked anew: `run_file.changed(trace={"noise": "draft"}, lamps=[...])`.

        Parameters
        ----------
        **tables : dict, list of dict or None
            Keys of a table to set, the others stay; a list is a new list of tables; None removes a table.

        Returns
        -------
        run_file : RunFile

        Raises
        ------
        RunFileError
            If a table or key is unknown, or a value does not fit.
        """
        content = self.model_dump(exclude_unset=True)
        for name, given in tables.items():
            present = content.get(name)
            both = isinstance(given, Mapping) and isinstance(present, Mapping)
            content[name] = {**present, **given} if both else given  # type: ignore[dict-item]
            if given is None and name in RunFile.model_fields:
                del content[name]
        checked = check_sections(RunFile, content, **_NAMED, where="changed run file")
        return checked.with_origin(folder=self.folder, name=self.name)

    def to_toml(self) -> str:
        """The run file as TOML without comments: every key that is not at its default."""
        blocks = []
        for name, value in self.model_dump(exclude_defaults=True).items():
            rows = value if isinstance(value, tuple | list) else (value,)
            heading = f"[[{name}]]" if isinstance(value, tuple | list) else f"[{name}]"
            for row in rows:
                keys = [f"{key} = {toml_value(item)}" for key, item in row.items() if item is not None]
                blocks.append("\n".join([heading, *keys]))
        return "\n\n".join(blocks) + "\n"

    def save(self, path: str | PathLike[str], *, force: bool = False) -> Path:
        """Write it as TOML, with its comments where it has them.

        In another folder every relative file name in it is made to start there: names that can only be files (the
        scan, IES files, assignments, sensor points, a receptor), and those of spectra, devices, models, databases and
        cells where such a file is beside this run file. The files themselves stay where they are. Comments are lost
        where a name is written so that it cannot be replaced in the text, in a string over several lines for instance.

        Parameters
        ----------
        path : str or path
            The run file, NAME.toml.
        force : bool
            Replace a file that is there.

        Returns
        -------
        path : Path

        Raises
        ------
        RunFileError
            If there is a file already, or it cannot be written.
        """
        target = path_of(path, name="path of the run file")
        if not force:
            require_no_run_file(target)
        text = self.text
        if target.parent.resolve() != self.folder.resolve():
            names = self._file_names(target.parent)
            moved = renamed(self.model_dump(exclude_unset=True), names)
            commented = "" if self._origin is None else renamed_text(self._origin.text, names)
            plain = check_sections(RunFile, moved, **_NAMED, where=str(target)).to_toml()
            text = commented if _says(commented, moved) else plain
        with writing(target, error=RunFileError):
            write_whole(target, text)
        return target

    def _file_names(self, folder: Path) -> dict[tuple[str, str], str]:
        """Relative file names in it as a run file in another folder says them, by (key, name here)."""
        rows: list[Section] = [self.scan, self.materials, self.sensors, *self.lamps, *self.cells]
        rows += [section for section in (self.lamps_from_scan, self.daylight) if section is not None]
        found = {}
        for key in (*FILE_KEYS, *FILE_OR_NAME_KEYS):
            given = [getattr(row, key) for row in rows if getattr(row, key, None) is not None]
            for name in (each for value in given for each in (value if isinstance(value, tuple) else (value,))):
                if not Path(name).is_absolute() and (key in FILE_KEYS or (self.folder / name).is_file()):
                    found[key, name] = from_folder(self.folder / name, folder)
        return found

    def __repr__(self) -> str:
        guesses = sum(bool(lamp.assumed) for lamp in self.lamps)
        lamps = f"{len(self.lamps)} {'lamp' if len(self.lamps) == 1 else 'lamps'}" if self.lamps else ""
        lamps += f" ({guesses} assumed)" if guesses else ""
        lamps = lamps or ("lamps lit in the scan" if self.lamps_from_scan else "")
        light = " and ".join(word for word in (lamps, "daylight" if self.daylight else "") if word) or "no light yet"
        return (
            f"<RunFile '{self.name}': scan {self.scan.file}, {light}, sensor {self.sensors.device}, "
            f"accuracy {self.trace.accuracy}, noise {self.trace.noise}>"
        )


def _says(text: str, content: Any) -> bool:
    """Whether a text is a run file of these tables."""
    try:
        said = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return False
    return bool(said) and RunFile.model_validate(said) == RunFile.model_validate(content)


def require_light(run_file: RunFile, *, where: str | None = None) -> RunFile:
    """The same run file; raises RunFileError, which names `where`, if it has no light of any kind."""
    if not run_file.lamps and run_file.lamps_from_scan is None and run_file.daylight is None:
        raise RunFileError(
            expected="one or more [[lamps]], a [lamps_from_scan], or [daylight]",
            found="none of them: a dark room has no map",
            where=run_file.name if where is None else where,
            todo="docs/run-file.md shows a lamp.",
        )
    return run_file


def read_run_file(path: str | PathLike[str]) -> RunFile:
    """Read a run file.

    Parameters
    ----------
    path : str or path
        A TOML text in UTF-8.

    Returns
    -------
    run_file : RunFile

    Raises
    ------
    RunFileError
        If the file is missing, no TOML, or has unknown keys or values that do not fit; all faults are named at once.
    """
    path = path_of(path, name="run file")
    try:
        text = path.read_text(encoding="utf-8-sig")  # editors of Windows may begin a text with a mark
    except (OSError, UnicodeDecodeError) as cause:
        raise RunFileError(
            expected="a readable run file (TOML, UTF-8)",
            found=str(cause) if isinstance(cause, OSError) else f"no text in UTF-8 ({cause.reason})",
            where=str(path),
            todo=_run_file_instead(path),
        ) from cause
    checked = parse_run_file(text, where=str(path))
    return checked.with_origin(folder=path.resolve().parent, name=path.stem, text=text)


def _run_file_instead(path: Path) -> str:
    """What to give in place of a path that is no run file: one of its name, where it lies, or the scan to `init`."""
    if not path.name:  # "." and "/" have none
        return "Name a run file in it, ROOM.toml, or make one with 'lidarspectra init SCAN'."
    beside = path.with_suffix(".toml") if path.suffix else path.with_name(f"{path.name}.toml")
    if beside != path and beside.is_file():
        return f"Give the run file, {beside}."
    if path.suffix.lower() == RUN_FILE_SUFFIX and path.is_file():
        return "Save it as UTF-8, which is an encoding that editors offer where they save a text."
    return f"Make one with 'lidarspectra init {shlex.quote(str(path)) if path.is_file() else 'SCAN'}'."


def parse_run_file(text: str, *, where: str) -> RunFile:
    """Check the text of a run file; `where` names it in errors (see `read_run_file`)."""
    return require_light(parse_sections(RunFile, text, **_NAMED, where=where), where=where)
