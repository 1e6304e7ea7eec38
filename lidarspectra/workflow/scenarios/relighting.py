"""Relight a traced room: other spectra, other fluxes, dimming, in under a second (docs/concepts.md, Eq. 3)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from os import PathLike
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arguments import all_of, number_of, path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.errors import LampError
from lidarspectra.lamps.lamp_spectra import beyond_ends, luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.calibration.model import FLUX_SD, SHEET_ALIKE, alike_in_groups
from lidarspectra.mapping.maps.assumptions import mark_assumed
from lidarspectra.mapping.maps.channel_levels import beyond_notes
from lidarspectra.mapping.maps.light_unknowns import load_unknowns
from lidarspectra.mapping.maps.map_files import MAP_FILE, MAP_TABLE_FILE, save_map, save_map_table
from lidarspectra.mapping.maps.spectral_map import LampChange, relight
from lidarspectra.mapping.photometry.point_light import PointLight, light_of_lamps
from lidarspectra.radiance.sampling.folding import with_spectrum
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.spectra.spectrum import BandSet, Spectrum
from lidarspectra.workflow.run_folder.assumed import assumptions_of_run
from lidarspectra.workflow.run_folder.light_of_run import (
    plan_of_run,
    present_lamps_of_run,
    scene_of_run,
    transport_of_run,
)
from lidarspectra.workflow.run_folder.workspace import current_stage, writing_run

OFF = 1e-9  # [1] of its flux that a lamp sends which is off: a lamp without any is none


@dataclass(frozen=True, kw_only=True)
class LampOrder:
    """Requested change of one lamp, or of all whose names fit a pattern.

    Parameters
    ----------
    lamp : str
        Its name in the run file. ``panel *`` is each lamp whose name fits and that has no order of its own.
    spectrum : str or None
        Database name or file; None keeps the spectrum.
    luminous_flux_lm : float or None
        New flux; None keeps the lumens, or takes those of a spectrum in W/nm. [lm]
    dim : float
        Factor on the flux. [0-1]
    """

    lamp: str
    spectrum: str | None = None
    luminous_flux_lm: float | None = None
    dim: float = 1.0

    def __post_init__(self) -> None:
        number_of(self.dim, name=f"LampOrder of '{self.lamp}', dim")
        if self.luminous_flux_lm is not None:
            number_of(self.luminous_flux_lm, name=f"LampOrder of '{self.lamp}', luminous_flux_lm", unit="lm")


@dataclass(frozen=True, kw_only=True, eq=False)
class RelitRun:
    """A run under changed lamps, and before.

    Parameters
    ----------
    light_map : xarray.Dataset
        See `relight_run`.
    before, after : PointLight
        At its points.
    lamps : tuple of Lamp
        Of the run.
    lamps_now : tuple of (str, float, float)
        Of each lamp now: its spectrum's name, its full flux [lm], its dimming [1].
    notes : tuple of str
        What new spectra do not tell, as full sentences.
    """

    light_map: xr.Dataset
    before: PointLight
    after: PointLight
    lamps: tuple[Lamp, ...]
    lamps_now: tuple[tuple[str, float, float], ...]
    notes: tuple[str, ...]


def relight_run(
    run: str | PathLike[str], orders: Sequence[LampOrder], *, base: str | PathLike[str] = Path()
) -> xr.Dataset:
    """Spectral map of a finished run under changed lamps, without tracing again.

    Parameters
    ----------
    run : str or path
        Run folder with a finished trace.
    orders : sequence of LampOrder
        Lamps without one are unchanged.
    base : str or path
        Where relative names of spectrum files start; the current folder by default.

    Returns
    -------
    map : xarray.Dataset
        As `mapping.spectral_map.spectral_map` gives it.

    Raises
    ------
    WorkspaceError
        If the run has no finished trace.
    LampError, DatabaseError, MapError
        If a lamp or spectrum is unknown, or the spectrum cannot be scaled to the flux.
    """
    return relit_run(run, orders, base=base).light_map


def relit_run(run: str | PathLike[str], orders: Sequence[LampOrder], *, base: str | PathLike[str] = Path()) -> RelitRun:
    """As `relight_run`, with what it was before and is now."""
    run, base = path_of(run, name="run"), path_of(base, name="base")
    orders = all_of(orders, LampOrder, name="orders", todo="Write LampOrder(lamp='panel 1', dim=0.5).")
    transport, bands = transport_of_run(run), scene_of_run(run).bands
    lamps = {lamp.name: lamp for lamp in present_lamps_of_run(run)}
    orders = orders_by_lamp(orders, tuple(lamps))
    changes = _changes(lamps, orders, base)
    given = [order for order in orders if order.luminous_flux_lm is not None or _is_absolute(order, base)]
    recoloured = [order.lamp for order in orders if order.spectrum is not None]
    map_folder = current_stage(run, "map")
    unknowns = None if map_folder is None else load_unknowns(map_folder)
    if unknowns is not None:
        traced = [str(name) for name in transport["lamp"].to_numpy()]
        rows = np.array([traced.index(order.lamp) for order in given], dtype=np.int64)
        unknowns = unknowns.with_given_fluxes(rows, _covariance(given))
        places = np.flatnonzero(np.isin(traced, recoloured))
        spectra = [flux for place in places if isinstance(flux := changes[traced[place]].flux, Spectrum)]
        unknowns = unknowns.with_given_spectra(places, beyond_ends(spectra, bands))
    light = relight(transport, changes, bands=bands, lamps=tuple(lamps.values()), unknowns=unknowns)
    assumed = assumptions_of_run(run).without(fluxes=[order.lamp for order in given], spectra=recoloured)
    before = {name: lamp.flux for name, lamp in lamps.items()}
    now = before | {name: change.flux for name, change in changes.items() if isinstance(change.flux, Spectrum)}
    dims = {name: changes[name].dim if name in changes else 1.0 for name in lamps}
    return RelitRun(
        light_map=mark_assumed(light, assumed),
        before=light_of_lamps(transport, before),
        after=light_of_lamps(_with_fluxes(transport, changes, now, bands), now, dims),
        lamps=tuple(lamps.values()),
        lamps_now=tuple((now[name].name, luminous_flux_lm(now[name]), dims[name]) for name in lamps),
        notes=beyond_notes([replace(lamps[name], flux=now[name]) for name in recoloured if dims[name] > 0], bands),
    )


def _covariance(orders: Sequence[LampOrder]) -> FloatArray:
    """(order, order) of the logarithms of fluxes that are given: those of one data sheet err in part alike."""
    sheets = [(order.luminous_flux_lm, order.spectrum) for order in orders]
    sheet = np.array([sheets.index(each) for each in sheets], dtype=np.int64)
    return FLUX_SD**2 * alike_in_groups(sheet, SHEET_ALIKE)


def orders_by_lamp(orders: Sequence[LampOrder], names: Sequence[str]) -> tuple[LampOrder, ...]:
    """Orders lamp by lamp, a pattern's for every lamp that fits it and is not named by another order.

    Parameters
    ----------
    orders : sequence of LampOrder
    names : sequence of str
        Of the run's lamps. One that has * or ? in itself is meant as it stands.

    Returns
    -------
    orders : tuple of LampOrder
        A name that no lamp has and no lamp fits stays, for whoever looks it up.
    """
    named = {order.lamp for order in orders}
    found: list[LampOrder] = []
    for order in orders:
        fitting = [name for name in names if name not in named and fnmatchcase(name, order.lamp)]
        found += [order] if order.lamp in names or not fitting else [replace(order, lamp=name) for name in fitting]
    return tuple(found)


def changed_lamps(lamps: Sequence[Lamp], orders: Sequence[LampOrder], base: Path) -> tuple[Lamp, ...]:
    """Lamps with what orders say of their flux, spectrum and dimming; one that is off keeps next to nothing of it.

    Raises
    ------
    LampError, DatabaseError
        If a lamp or spectrum is unknown, or the spectrum cannot be scaled to the flux.
    """
    orders = orders_by_lamp(orders, [lamp.name for lamp in lamps])
    changes = _changes({lamp.name: lamp for lamp in lamps}, orders, base)
    found = []
    for lamp in lamps:
        change = changes.get(lamp.name)
        flux = lamp.flux if change is None or not isinstance(change.flux, Spectrum) else change.flux
        found.append(replace(lamp, flux=flux if change is None else flux.scaled(max(change.dim, OFF))))
    return tuple(found)


def _with_fluxes(
    transport: xr.Dataset, changes: Mapping[str, LampChange], now: Mapping[str, Spectrum], bands: BandSet
) -> xr.Dataset:
    """The transport for the spectra that were changed, with the flux of all."""
    for name in changes:
        transport = with_spectrum(transport, name, now[name])
    names = [str(name) for name in transport["lamp"].to_numpy()]
    flux = np.stack([bands.band_values(now[name], outside="zero") for name in names])
    return transport.assign(flux=(("lamp", "band"), flux, transport["flux"].attrs))


def _changes(lamps: Mapping[str, Lamp], orders: Sequence[LampOrder], base: Path) -> dict[str, LampChange]:
    changes: dict[str, LampChange] = {}
    for order in orders:
        if order.lamp not in lamps:
            raise LampError(
                expected=f"one of the run's lamps ({', '.join(lamps)})",
                found=f"'{order.lamp}'",
                where="relighting",
                todo="Name one of those, or add the lamp to the run file and run it: only traced lamps can be relit.",
            )
        if order.lamp in changes:
            raise LampError(
                expected="each lamp once",
                found=f"'{order.lamp}' twice",
                where="relighting",
                todo="Give its changes together.",
            )
        changes[order.lamp] = _change(lamps[order.lamp], order, base)
    return changes


def _is_absolute(order: LampOrder, base: Path) -> bool:
    """Whether an order's spectrum has its flux too."""
    return order.spectrum is not None and lamp_spectrum(order.spectrum, base).absolute


def _change(lamp: Lamp, order: LampOrder, base: Path) -> LampChange:
    flux = lamp.flux
    wanted_lm = order.luminous_flux_lm
    if order.spectrum is not None:
        found = lamp_spectrum(order.spectrum, base)
        if wanted_lm is None and not found.absolute:
            wanted_lm = luminous_flux_lm(flux)  # as if the tube were replaced by one of the same lumens
        flux = found.spectrum
    if wanted_lm is not None:
        present_lm = luminous_flux_lm(flux)
        if present_lm <= 0:
            raise LampError(
                expected=f"a spectrum that can be scaled to {wanted_lm:g} lm",
                found="one without visible light",
                where=f"lamp '{order.lamp}'",
                todo="Give a spectrum file in W/nm, which is absolute and needs no luminous flux.",
            )
        flux = flux.scaled(wanted_lm / present_lm)
    return LampChange(flux=flux, dim=order.dim)


def save_relit(light: xr.Dataset, folder: Path) -> tuple[Path, ...]:
    """Write a relit map as NetCDF and CSV.

    Parameters
    ----------
    light : xarray.Dataset
        Of `relight_run`.
    folder : Path
        Made if absent; files of an earlier relighting there are replaced.

    Returns
    -------
    paths : tuple of Path
        The files written.

    Raises
    ------
    WorkspaceError
        If the folder cannot be written.
    """
    with writing_run(folder):
        folder.mkdir(parents=True, exist_ok=True)
        return save_map(light, folder / MAP_FILE), save_map_table(light, folder / MAP_TABLE_FILE)


def draw_relit(light: xr.Dataset, folder: Path, run: Path) -> tuple[Path, ...]:
    """Draw a relit map, which takes longer than to compute it: its libraries are loaded here.

    Parameters
    ----------
    light : xarray.Dataset
        Of `relight_run`.
    folder : Path
        Exists.
    run : Path
        The run, for the room's outline.

    Returns
    -------
    paths : tuple of Path
        The files written.

    Raises
    ------
    WorkspaceError
        If the folder cannot be written, or the run's scan stage is gone.
    """
    from lidarspectra.mapping.figures.figure_style import save_figure
    from lidarspectra.mapping.figures.map_figures import maps_figure

    plan = plan_of_run(run)
    with writing_run(folder):
        return save_figure(maps_figure(light, plan), folder, "maps", kinds=("png",))
