"""Light at the points of a finished run, or measured at points, as input of the applications."""

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from lidarspectra.arguments import path_of
from lidarspectra.config import parse_run_file
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.measured_readings import read_readings
from lidarspectra.lamps.lamp_file import LAMPS_RECORD, load_lamps
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.maps.point_values import PLACE
from lidarspectra.mapping.photometry.point_light import PointLight, light_of_lamps
from lidarspectra.radiance.sampling.relit_transport import relit_transport
from lidarspectra.radiance.sampling.transport import TRANSPORT_FILE, load_transport
from lidarspectra.radiance.scene.relit_scene import relit_scene
from lidarspectra.radiance.scene.scene import RadianceScene, load_scene
from lidarspectra.spectra.spectrum import BandSet
from lidarspectra.workflow.run_folder.workspace import (
    hash_files,
    read_record,
    read_request,
    require_stage,
    stage_folder,
)

if TYPE_CHECKING:
    from lidarspectra.mapping.figures.floor_plan import FloorPlan


@dataclass(frozen=True, kw_only=True, eq=False)
class RunLight:
    """Light at the points of a run.

    Parameters
    ----------
    light : PointLight
        With the lamps' spectra.
    places : xarray.Dataset
        The transport: its points and lamps.
    bands : BandSet
        Its channels.
    plan : FloorPlan
        The room from above.
    """

    light: PointLight
    places: xr.Dataset
    bands: BandSet
    plan: "FloorPlan"

    @property
    def lamp_names(self) -> tuple[str, ...]:
        """Every lamp that was traced."""
        return tuple(map(str, self.places["lamp"].to_numpy()))


def light_of_run(run: str | PathLike[str], dims: Mapping[str, float] | None = None) -> RunLight:
    """Read a finished run.

    Parameters
    ----------
    run : str or path
        Run folder with a finished trace.
    dims : mapping of str to float, optional
        Factor on a lamp's flux, by name. [1]

    Raises
    ------
    WorkspaceError
        If the run has no finished trace.
    MapError
        If a lamp to dim is unknown.
    """
    run = path_of(run, name="run")
    transport = transport_of_run(run)
    names = [str(name) for name in transport["lamp"].to_numpy()]
    for name in dims or {}:
        if name not in names:
            raise MapError(expected=f"one of the run's lamps ({', '.join(names)})", found=f"'{name}'", where="dimming")
        if not 0 <= (dims or {})[name] <= 1:
            raise MapError(
                expected="a dim factor from 0 to 1, as in the run file",
                found=f"{(dims or {})[name]:g}",
                where=f"lamp '{name}'",
                todo="Give a fraction: 0.4 for 40 %.",
            )
    return RunLight(
        light=light_of_lamps(transport, {lamp.name: lamp.flux for lamp in present_lamps_of_run(run)}, dims),
        places=transport,
        bands=scene_of_run(run).bands,
        plan=plan_of_run(run),
    )


def transport_of_run(run: Path) -> xr.Dataset:
    """Transport of a finished run under its present lamps; raises WorkspaceError if its trace is not finished."""
    return relit_transport(load_transport(require_stage(run, "trace") / TRANSPORT_FILE), scene_of_run(run))


def scene_of_run(run: Path) -> RadianceScene:
    """Scene of a finished run under its present lamps; raises WorkspaceError if it is not finished."""
    folder = require_stage(run, "scene")
    return relit_scene(load_scene(folder), load_lamps(folder), present_lamps_of_run(run))


def present_lamps_of_run(run: Path) -> tuple[Lamp, ...]:
    """Lamps of a finished run with the names, fluxes and spectra of its map; those of its scene where it has no map.

    Raises
    ------
    WorkspaceError
        If its scene is not finished.
    """
    scene, map_folder = require_stage(run, "scene"), stage_folder(run, "map")
    traced, made = read_record(scene), read_record(map_folder)
    if traced is None or made is None or not (map_folder / LAMPS_RECORD).is_file():  # maps of early versions list none
        return load_lamps(scene)
    source = made.settings["stages"]["scene"]
    is_of_scene = source == traced.outputs or source == hash_files(scene)  # which the user may have edited
    return load_lamps(map_folder if is_of_scene else scene)


def dimmed_notes(run: Path) -> tuple[str, ...]:
    """A note where the run file dims lamps that a schedule dims again; none where the folder keeps no run file."""
    request = read_request(run)
    sections = () if request is None else parse_run_file(request.text, where=request.name).lamps
    dimmed = [f"'{lamp.name}' to {lamp.dim:g}" for lamp in sections if 0 < lamp.dim < 1]
    if not dimmed:
        return ()
    return (
        f"The run file dims {', '.join(dimmed)}, and a schedule's dim is a factor on that light: 1 is the lamp as it "
        "was run. For its full flux set dim = 1 in the run file and run it again, which takes the trace as it is.",
    )


def plan_of_run(run: Path) -> "FloorPlan":
    """Floor plan of a run's room; raises WorkspaceError if its scan is not finished."""
    from lidarspectra.geometry.scan import load_scan
    from lidarspectra.mapping.figures.floor_plan import floor_plan  # loads what draws
    from lidarspectra.room.room import load_room

    folder = require_stage(run, "scan")
    return floor_plan(load_scan(folder), load_room(folder))


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredLight:
    """Light at measured points.

    Parameters
    ----------
    light : PointLight
        From the channels alone.
    places : xarray.Dataset
        Its points.
    notes : tuple of str
        Notes to the user on readings that were left out.
    names : tuple of str
        Further columns of the table that tell a reading from others: its time, its sensor.
    """

    light: PointLight
    places: xr.Dataset
    notes: tuple[str, ...]
    names: tuple[str, ...] = ()


def light_of_table(path: Path, bands: BandSet, *, needs_places: bool = True) -> MeasuredLight:
    """Light that was measured: x, y, z [m], E_410 ... and, if there are, SE_410 ... [W/m²/nm].

    Parameters
    ----------
    path : Path
        CSV, as `sensor join` and the map stage write it. Without nx, ny, nz its points look up; without SE columns its
        channels have no error. Readings with a gap in any of these are left out, and that is noted.
    bands : BandSet
        The channels to take from it.
    needs_places : bool
        Whether a reading without a place is left out. The table of `sensor convert` has none.

    Returns
    -------
    measured : MeasuredLight

    Raises
    ------
    MapError
        If a column is missing, holds words, or no reading is whole.
    """
    table = read_readings(path, needs_places=needs_places)
    channels, errors = ([f"{kind}_{label}" for label in bands.labels] for kind in ("E", "SE"))
    spread = [name for name in errors if name in table.columns]
    for name in (*channels, *(errors if spread else ())):
        if name not in table.columns:
            raise MapError(
                expected=f"a column '{name}'",
                found=", ".join(map(str, table.columns[:20])),
                where=str(path),
                todo="A sensor's log becomes such a table by 'lidarspectra sensor convert LOG --out table.csv'.",
            )
    upward = {"nx": 0.0, "ny": 0.0, "nz": 1.0, "buried": 0.0}
    # copied first: a table of more than a hundred columns would be warned of by pandas
    table = table.copy().assign(**{name: value for name, value in upward.items() if name not in table.columns})
    values = table[[*PLACE, *channels, *spread]].to_numpy(dtype=np.float64)
    known = np.isfinite(values) | (np.arange(values.shape[1]) < (0 if needs_places else len(PLACE)))
    whole = known.all(axis=1)
    if not whole.any():
        raise MapError(expected="a reading with a place and a value in every channel", found="none", where=str(path))
    left_out = (
        f"{int((~whole).sum())} of {len(table)} readings are left out because a position, a channel or its standard "
        "error is missing. The results are those of the others; fill these gaps in the table to have them all."
    )
    place, irradiance, irradiance_se = np.split(values[whole], [len(PLACE), len(PLACE) + len(channels)], axis=1)
    columns = {name: ("point", place[:, index]) for index, name in enumerate(PLACE)}
    names = tuple(name for name in ("unix_s", "sensor", "label") if name in table.columns and not needs_places)
    columns |= {name: ("point", table[name].to_numpy()[whole]) for name in names}
    return MeasuredLight(
        light=PointLight(
            centers_nm=bands.centers_nm,
            irradiance=irradiance,
            irradiance_se=irradiance_se if spread else np.zeros_like(irradiance),
        ),
        places=xr.Dataset(coords=columns | {"buried": ("point", place[:, PLACE.index("buried")] != 0)}),
        notes=() if whole.all() else (left_out,),
        names=names,
    )
