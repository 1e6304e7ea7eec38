"""The run file of a designed room: its lamps with the dimming, the spectra and the places that were chosen.

What the scan was photographed under stays: lamps that are taken away are off in the map (`dim = 0`), new ones were off
in the scan (`dim_in_scan = 0`), so that the colours of the scan mean the same reflectances as before.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lidarspectra.config import RunFile
from lidarspectra.io.file_names import from_folder
from lidarspectra.io.files import hash_text
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.spectra.databases import FILE_SUFFIXES
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.spectrum_files import spectrum_text
from lidarspectra.workflow.calibration.light import RunRoom
from lidarspectra.workflow.design.lamps import DesignedLamp, DesignLamps
from lidarspectra.workflow.materials.materials_of_run import all_given

FOLDER = "design"  # in the run folder
SUFFIX = ".designed"  # of the run file's name
DIM_DIGITS = 10  # after the point, of dims that are four digits long
DIGITS = 8  # of the hash in a mixture's file name
FLUX_KEYS = ("spectrum", "cct_k", "luminous_flux_lm", "radiant_flux_W")
Table = dict[str, Any]


def designed_run_file(
    designed: Sequence[DesignedLamp], lamps: DesignLamps, room: RunRoom, *, run: Path, base: Path
) -> RunFile:
    """The run file with the lamps as designed.

    Parameters
    ----------
    designed : sequence of DesignedLamp
    lamps : DesignLamps
    room : RunRoom
    run : Path
        The run folder, in whose folder `design` the files of mixtures will be.
    base : Path
        Where relative names of spectra in the target file start.

    Returns
    -------
    run_file : RunFile
        Named NAME.designed, in the run file's folder.
    """
    by_name = {each.of.lamp.name: each for each in designed}
    mixtures = {name: file for name, (file, _) in mixtures_of(designed, room).items()}
    rows: list[Table] = []
    for table in _present_tables(room):
        each = by_name.get(table["name"])
        if table["name"] in lamps.removed:
            rows.append(table | {"dim": 0.0})
        elif each is None:  # it stays as it is, or is off
            rows.append(table)
        else:
            rows += _changed(table, each, room, _spectrum_keys(each, room, run, base, mixtures))
    candidates = [each for each in designed if each.of.is_candidate and each.shares]
    rows += [_candidate(each, room, _spectrum_keys(each, room, run, base, mixtures)) for each in candidates]
    changes: Table = {"lamps": rows}
    if room.run_file.lamps_from_scan is not None:
        changes["lamps_from_scan"] = None
    calibration = room.run_file.calibration
    if calibration is not None:
        lit = {row["name"] for row in rows if row.get("dim", 1.0) > 0} | {lamp.name for lamp in lamps.fixed}
        factors = {name: factor for name, factor in calibration.lamps.items() if name in lit}
        changes["calibration"] = {"lamps": factors}
    origin = room.run_file.with_origin(folder=room.base, name=f"{room.name}{SUFFIX}")
    return origin.changed(**changes)


def mixtures_of(designed: Sequence[DesignedLamp], room: RunRoom) -> dict[str, tuple[str, Spectrum]]:
    """File name and spectrum of every lamp that is lit with several, by lamp.

    A file is named for its content: a run file of an earlier design, which the user kept, goes on to mean its own.
    """
    found = {}
    for each in designed:
        if len(each.shares) > 1:
            name = each.of.lamp.name
            flux = nominal_flux(name, each.flux, room)
            found[name] = f"mixture-{hash_text(spectrum_text(flux))[:DIGITS]}.csv", flux
    return found


def same_trace(designed: Sequence[DesignedLamp], lamps: DesignLamps) -> bool:
    """Whether the run's trace serves the design as it is: the same lamps are lit, with the same spectra."""
    kept = all(
        not each.of.is_candidate and len(each.shares) == 1 and each.shares[0][0].name is None for each in designed
    )
    return kept and not lamps.removed


def nominal_flux(lamp: str, flux: Spectrum, room: RunRoom) -> Spectrum:
    """What a lamp's table must say for it to send a flux: the calibration multiplies it [W/nm]."""
    return flux.scaled(1.0 / _factor(lamp, room))


def _factor(lamp: str, room: RunRoom) -> float:
    calibration = room.run_file.calibration
    return 1.0 if calibration is None else calibration.lamps.get(lamp, 1.0)


def _present_tables(room: RunRoom) -> list[Table]:
    """The run file's lamps; those that were found in the scan, written out."""
    section = room.run_file.lamps_from_scan
    if section is None:
        return [lamp.model_dump(exclude_unset=True) for lamp in room.run_file.lamps]
    daylight = room.run_file.daylight
    outside = set() if daylight is None else {"sun", *(window.name for window in daylight.windows)}
    light = {"spectrum": section.spectrum} if section.spectrum is not None else {"cct_k": section.cct_k}
    guessed = {} if section.luminous_exitance_lm_m2 is not None else {"assumed": True}
    return [
        {**_shape(lamp), **light, **_flux_key(lamp.name, lamp.flux, room), **guessed}
        for lamp in room.lamps
        if lamp.name not in outside
    ]


def _shape(lamp: Lamp) -> Table:
    return {
        "name": lamp.name,
        "shape": lamp.shape.word,
        "center": _rounded(lamp.center.tolist()),
        "size": tuple(round(float(side), 4) for side in lamp.size),
        "normal": _rounded(lamp.normal.tolist(), 5),
        "rotation_deg": round(float(lamp.rotation_deg), 3),
    }


def _changed(table: Table, each: DesignedLamp, room: RunRoom, keys: Table) -> list[Table]:
    """A lamp's table as designed; with the lamp that the scan was photographed under, where its spectrum changes."""
    if not keys:
        return [table | {"dim": round(each.dim, DIM_DIGITS)}]
    new = {key: value for key, value in table.items() if key not in FLUX_KEYS} | keys
    materials = room.run_file.materials
    reads_light = materials.delight and not all_given(materials, room.base)
    if reads_light and table.get("dim_in_scan", 1.0) > 0:
        old = table | {"name": f"{table['name']} as scanned", "dim": 0.0}
        return [old, new | {"dim_in_scan": 0.0}]
    return [new]


def _candidate(each: DesignedLamp, room: RunRoom, keys: Table) -> Table:
    """The table of a new lamp: that of the lamp whose kind it is, in another place."""
    lamp = each.of.lamp
    section = each.of.section
    like = _shape(lamp) if section is None else section.model_dump(exclude_unset=True)
    if not keys and section is None:
        found = room.run_file.lamps_from_scan
        assert found is not None  # since the lamp has no table
        like |= {"spectrum": found.spectrum} if found.spectrum is not None else {"cct_k": found.cct_k}
    kept = {key: value for key, value in like.items() if not (keys and key in FLUX_KEYS)}
    kept.pop("radiant_flux_W", None)
    light = keys or _flux_key(lamp.name, lamp.flux, room) | {"dim": round(each.dim, DIM_DIGITS)}
    return kept | {"name": lamp.name, "center": _rounded(lamp.center.tolist()), "dim_in_scan": 0.0} | light


def _spectrum_keys(each: DesignedLamp, room: RunRoom, run: Path, base: Path, mixtures: dict[str, str]) -> Table:
    """Keys that give a lamp its spectrum, flux and dimming; none where it keeps its spectrum."""
    name = each.of.lamp.name
    if not each.shares or (len(each.shares) == 1 and each.shares[0][0].name is None):
        return {}
    if name in mixtures:
        return {"spectrum": from_folder(run / FOLDER / mixtures[name], room.base), "dim": 1.0}
    choice, share = each.shares[0]
    assert choice.name is not None  # as it is otherwise
    is_file = Path(choice.name).suffix.lower() in FILE_SUFFIXES and (base / choice.name).is_file()
    spectrum = from_folder(base / choice.name, room.base) if is_file else choice.name
    return {"spectrum": spectrum, **_flux_key(name, choice.flux, room), "dim": round(share, DIM_DIGITS)}


def _flux_key(lamp: str, flux: Spectrum, room: RunRoom) -> Table:
    """The key that states a flux: in lumens, or in watts where the eye sees none of it."""
    nominal = nominal_flux(lamp, flux, room)
    lumens = luminous_flux_lm(nominal)
    key, value = ("luminous_flux_lm", lumens) if lumens > 0 else ("radiant_flux_W", nominal.integral())
    return {key: float(f"{value:.7g}")}


def _rounded(values: Sequence[float], digits: int = 4) -> list[float]:
    return [round(value, digits) for value in values]
