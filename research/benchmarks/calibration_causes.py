"""What is left of a map's error after six readings, cause by cause: the scans of `research.scenes.by_day`.

    python -m research.benchmarks.calibration_causes SCENE-LIGHT-SEED [...] --scans FOLDER [--draws 100]

Each lamp's flux is off by 20 %, up or down, and the true room is read where the plan says, with 3 % of noise
(`research.benchmarks.scan_after_scan`; traces that it left beside a scan are taken). Beside that: readings without
noise; a scan that is right, so that fluxes alone are off; both; and fluxes known, so that the scan alone is. The bound
is what is left of the fluxes if any combinations of lamps could be measured exactly, the principal ones of the map's
error: no six numbers tell more of them.
"""

import argparse
import pickle
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.mapping.figures.tables import Table, table_markdown
from lidarspectra.material.estimate import estimate_materials
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.room.room import find_room
from lidarspectra.spectra.databases import load_reflectances
from lidarspectra.workflow.materials.delighting import take_light_out
from research.benchmarks.calibration_draws import FROM_SCAN, METER_NOISE, READINGS, outcomes, planned
from research.benchmarks.calibration_rooms import KNOWN_METER_SD, RoomLight
from research.benchmarks.delighting import read_case
from research.benchmarks.scan_after_scan import LIGHT_FILE, SEED, room_light

COUNTS = (READINGS, 12)
NO_NOISE = 1e-6  # [1]
FLUX_OFF = FROM_SCAN.flux_off  # [1] of each lamp


def room_of(folder: Path) -> RoomLight:
    """Light of a scan's run and of its true room, traced, or as an earlier call or `scan_result` kept it there."""
    path = folder / LIGHT_FILE
    if path.is_file():
        with path.open("rb") as stored:
            kept: RoomLight = pickle.load(stored)
        return kept
    case = read_case(folder)
    delit = take_light_out(case.scan, find_room(case.scan), case.lamps)
    views = render_views(case.scan, settings=ViewSettings(width=128, height=128))
    found = estimate_materials(case.scan, views, library=load_reflectances(), face_color=delit.face_color)
    room = room_light(case, found, folder.name.rsplit("-", 2)[0])
    path.write_bytes(pickle.dumps(room))
    return room


def flux_bound(room: RoomLight, count: int) -> float:
    """NRMSE that fluxes alone leave after so many exact combinations of them: the smaller principal components [1]."""
    light = room.model.light[room.on_map]
    effect = FLUX_OFF * light / light.sum(axis=1).mean()
    of_components = np.linalg.svd(effect, compute_uv=False) ** 2
    return float(np.sqrt(of_components[count:].sum() / len(light)))


def row(room: RoomLight, count: int, draws: int) -> dict[str, object]:
    """A line of the table: errors as root mean squares over the draws."""
    chosen = planned(room, KNOWN_METER_SD, count)
    exact = replace(room, truth={"scan": room.model.light})

    def error(of: RoomLight, flux_off: float, noise: float) -> tuple[float, float]:
        case = replace(FROM_SCAN, flux_off=flux_off)
        found = [each.nrmse for each in outcomes(of, case, chosen, draws, SEED, noise=noise)]
        before, after = np.sqrt(np.mean(np.square(found), axis=0))
        return float(before), float(after)

    before, after = error(room, FLUX_OFF, METER_NOISE)
    places = room.place[chosen(np.random.default_rng(0))]
    return {
        "readings": count,
        "places": np.unique(places).size,
        "before": before,
        "after": after,
        "no noise": error(room, FLUX_OFF, NO_NOISE)[1],
        "scan right": error(exact, FLUX_OFF, METER_NOISE)[1],
        "scan right, no noise": error(exact, FLUX_OFF, NO_NOISE)[1],
        "fluxes known": error(room, NO_NOISE, METER_NOISE)[0],
        "bound of fluxes": flux_bound(room, count),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="+")
    parser.add_argument("--scans", type=Path, required=True)
    parser.add_argument("--draws", type=int, default=100)
    choice = parser.parse_args(arguments)
    rows = []
    for name in choice.names:
        room = room_of(choice.scans / name)
        rows += [{"scan": name} | row(room, count, choice.draws) for count in COUNTS]
        print(rows[-2:], flush=True)
    frame = pd.DataFrame(rows)
    formats = dict.fromkeys(frame.columns[3:], ".3f")
    caption = f"NRMSE of illuminance [1], {choice.draws} draws."
    print(f"\n{caption}\n\n{table_markdown(Table(name='causes', caption=caption, frame=frame, formats=formats))}")


if __name__ == "__main__":
    main()
