"""What six readings do for a map whose room is not what the run takes it for: every scene, many draws of every fault.

    python -m research.benchmarks.calibration [box office apartment large-office] [--draws 200] [--keep FOLDER]

Each scene is traced as a run has it (its scan, true materials, stated lamps) and with faults that the model does not
know; draws then change fluxes, reflectances and the meter, and read it with noise where the plan says. Printed
for each fault: the map's error before and after against the truth at up to 60 of the scene's own sensor points, and how
many points lie within one and two of the deviations that are stated. Then the plan against readings by lot and habit.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from research.benchmarks.calibration_draws import (
    CASES,
    READINGS,
    Choice,
    Outcome,
    by_habit,
    by_lot,
    outcomes,
    planned,
)
from research.benchmarks.calibration_rooms import RoomLight, room_light

SCENES = ("box", "office", "apartment", "large-office")
MORE = 12  # readings, where six are too few for the lamps
SEED = 7
HEADER = (
    f"{'scene':13s} {'fault':17s} {'NRMSE':>13s} {'mean |bias|':>13s} {'mean bias':>9s} {'stated':>6s} "
    f"{'1 sd':>5s} {'2 sd':>5s} {'not worse':>9s}"
)


def row(scene: str, label: str, found: Sequence[Outcome]) -> str:
    """A line of the table: means over the draws; NRMSE as root mean square."""
    nrmse, bias, within, stated = (
        np.array([getattr(each, name) for each in found]) for name in ("nrmse", "bias", "within", "stated")
    )
    root = 100 * np.sqrt((nrmse**2).mean(axis=0))
    size = 100 * np.abs(bias).mean(axis=0)
    return (
        f"{scene:13s} {label:17s} {root[0]:5.1f} -> {root[1]:4.1f} {size[0]:5.1f} -> {size[1]:4.1f} "
        f"{100 * bias[:, 1].mean():+8.1f}  {100 * np.sqrt((stated[:, 1] ** 2).mean()):5.1f} "
        f"{within[:, 0].mean():5.0%} {within[:, 1].mean():5.0%} {(nrmse[:, 1] <= nrmse[:, 0]).mean():9.0%}"
    )


def print_faults(rooms: Sequence[RoomLight], draws: int) -> None:
    """Every fault in every scene, by plan; and all scenes together."""
    print(f"{READINGS} readings by plan, {draws} draws; before -> after, in %\n{HEADER}")
    together: dict[str, list[Outcome]] = {label: [] for label in CASES}
    for room in rooms:
        for label, case in CASES.items():
            found = outcomes(room, case, planned(room, case.meter_sd), draws, SEED)
            together[label] += found
            print(row(room.name, label, found), flush=True)
    for label, found in together.items():
        print(row("all scenes", label, found))
    whole = [each for label, found in together.items() for each in found if label != "nothing"]
    print(row("all scenes", "all faults", whole))


def print_choices(rooms: Sequence[RoomLight], draws: int) -> None:
    """The plan against readings by lot and by habit."""
    print(f"\nfluxes off by 20 %: where {READINGS} readings are taken\n{HEADER}")
    case = CASES["fluxes 20 %"]
    for room in rooms:
        choices: dict[str, Choice] = {
            "by plan": planned(room, case.meter_sd),
            "by lot": by_lot(room),
            "below the lamps": by_habit(room),
            f"plan, {MORE} readings": planned(room, case.meter_sd, MORE),
        }
        for label, choose in choices.items():
            print(row(room.name, label, outcomes(room, case, choose, draws, SEED)), flush=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--keep", type=Path, help="folder for the traced light, taken from there if it is there")
    choice = parser.parse_args(arguments)
    rooms = [room_light(name, choice.keep) for name in choice.scenes]
    print_faults(rooms, choice.draws)
    print_choices(rooms, choice.draws)


if __name__ == "__main__":
    main()
