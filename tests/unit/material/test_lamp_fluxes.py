"""Relative fluxes of lamps in a scan: told, saved, and used without changing their sum."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.config import read_run_file
from lidarspectra.errors import MaterialError
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.lit_lamps.fluxes import (
    FLUXES_FILE,
    LampFlux,
    flux_factors,
    flux_notes,
    load_lamp_fluxes,
    save_lamp_fluxes,
)
from lidarspectra.room.room import find_room
from lidarspectra.workflow.materials.delighting import take_light_out
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps

FLUXES = (
    LampFlux(lamp="lit 1", factor=2.0, log_deviation=0.05, identifiable=True),
    LampFlux(lamp="lit 2", factor=0.5, log_deviation=0.04, identifiable=True),
    LampFlux(lamp="lit 3", factor=3.0, log_deviation=0.7, identifiable=False),
)
NAMES = ("lit 1", "lit 2", "lit 3")


def test_told_fluxes_change_the_ratios_and_not_the_sum() -> None:
    powers = np.array([10.0, 20.0, 30.0])
    after = powers * flux_factors(NAMES, FLUXES, powers)
    assert after.sum() == pytest.approx(powers.sum())
    assert after[0] / after[1] == pytest.approx(2.0 / 0.5 * 10.0 / 20.0)
    assert after[2] / after[0] == pytest.approx(30.0 / (2.0 * 10.0))  # what is not told stays as its area says


def test_the_notes_say_which_fluxes_the_walls_tell_and_which_not() -> None:
    told, silent = flux_notes(FLUXES)
    assert "'lit 1' 2.00 ± 5 %, 'lit 2' 0.50 ± 4 %" in told
    assert "does not determine the relative flux of 'lit 3'" in silent
    assert flux_notes(()) == ()


def test_fluxes_come_back_as_they_were_saved_and_go_when_there_are_none(tmp_path: Path) -> None:
    save_lamp_fluxes(FLUXES, tmp_path)
    assert load_lamp_fluxes(tmp_path) == FLUXES
    save_lamp_fluxes((), tmp_path)
    assert load_lamp_fluxes(tmp_path) == ()


@pytest.mark.parametrize(
    "line",
    [
        b"lit 1,0,0.1,yes",
        b"lit 1,nan,0.1,yes",
        b"lit 1,1.0,nan,yes",
        b"lit 1,1.0,0.1,perhaps",
        b"lit 1,x,0.1,yes",
        b"lit 1,1.0",
        b"lit \xff,1.0,0.1,yes",
        b"l" * 200_000 + b",1.0,0.1,yes",
    ],
    ids=lambda line: line[:20].decode("latin-1"),
)
def test_a_damaged_file_of_fluxes_is_refused(tmp_path: Path, line: bytes) -> None:
    (tmp_path / FLUXES_FILE).write_bytes(b"lamp,factor,log_deviation,told\n" + line + b"\n")
    with pytest.raises(MaterialError, match="one line per lamp"):
        load_lamp_fluxes(tmp_path)


@pytest.mark.slow
def test_the_light_on_the_walls_tells_that_one_panel_is_weaker_than_was_guessed(project: Path) -> None:
    """The office's panels are equal; one is taken for three times as strong, and found out."""
    folder = project / "scenes" / "office"
    scan = repair_scan(read_scan(folder / "scan.glb"), flatten=True)
    west, east = resolve_lamps(read_run_file(folder / "room.toml").lamps, folder)
    found = take_light_out(scan, find_room(scan), (west, _times(east, 3.0)), fluxes_stated=False)
    factors = [flux.factor for flux in found.lamp_fluxes]
    assert all(flux.identifiable for flux in found.lamp_fluxes)
    assert not any("no lamp of the run file" in warning for warning in found.warnings), "blinds are drawn here"
    # 2 % is what other builds and seeds of the room leave; 6 % never came near to failing.
    assert factors[0] / factors[1] == pytest.approx(3.0, rel=0.06)


def _times(lamp: Lamp, factor: float) -> Lamp:
    return replace(lamp, flux=lamp.flux.scaled(factor))
