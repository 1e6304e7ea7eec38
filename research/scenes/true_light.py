"""Make the true light of a scene at its sensors, and have another engine check it.

    python -m research.scenes.true_light office [--noise fine] [--unchecked]

    truth/light.nc   spectral irradiance at truth/points.csv [W/m²/nm]: at 81 wavelengths from 380 to 780 nm, and as the
                     sensor's channels weigh it, each with its standard error; how far Mitsuba is from it

No scan and no estimate is in it: the plan's own surface, the true reflectances and lamps, traced at single
wavelengths (`research.experiments.true_light`). Mitsuba (extra `validate`) computes the same room at the
sensor's 14 wavelengths. Both trace at random: the file differs by its error from one run to the next.
"""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.room.sensor_points import read_points
from lidarspectra.spectra.sensor_files import find_bands
from lidarspectra.spectra.spectrum import BandSet
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from research.experiments.true_light import (
    FLAT_DEG,
    TrueLight,
    single_wavelengths,
    true_light,
    true_materials,
    true_points,
)
from research.experiments.true_light_file import SecondOpinion, save_true_light
from research.second_opinion import reference_irradiance
from research.second_opinion.variants import find_mitsuba
from research.virtual_rooms.room_plan import read_plan
from research.virtual_rooms.true_room import TrueRoom, true_room

SCENES = Path(__file__).parents[2] / "scenes"
SEED = 11
CELLS = 24  # a side: 576 paths a point in each of the repeats
REPEATS = 12


def second_opinion(room: TrueRoom, lamps: Sequence[Lamp], light: TrueLight, channels: BandSet) -> SecondOpinion:
    """What Mitsuba says of the same room at the wavelengths of the channels' centres."""
    single = single_wavelengths()
    wanted = [int(np.abs(single.centers_nm - center).argmin()) for center in channels.centers_nm if center <= 780.0]
    cells = CELLS if len(light.points) > 50 else 2 * CELLS  # few points: more paths for each
    reference = reference_irradiance(
        room.scan,
        true_materials(room),
        lamps,
        single,
        light.points,
        only_bands=wanted,
        cells=cells,
        repeats=REPEATS,
        seed=SEED,
        crease_deg=FLAT_DEG,
    )
    free = ~light.points.buried
    ours, error = light.irradiance[free][:, wanted], light.irradiance_se[free][:, wanted]
    theirs, their_error = reference.irradiance[free], reference.standard_error[free]
    mean = theirs.mean(axis=0)
    return SecondOpinion(
        engine=f"Mitsuba {find_mitsuba().mi.__version__} ({reference.variant})",
        wavelengths=len(wanted),
        nrmse_percent=_nrmse(ours - theirs, their_error, mean),
        bias_percent=float(100.0 * ((ours - theirs).mean(axis=0) / mean).mean()),
        bias_se_percent=float(100.0 * (np.sqrt((error**2 + their_error**2).sum(axis=0)) / free.sum() / mean).mean()),
    )


def _nrmse(difference: FloatArray, noise: FloatArray, mean: FloatArray) -> float:
    squared = np.maximum((difference**2).mean(axis=0) - (noise**2).mean(axis=0), 0.0)
    return float(100.0 * np.sqrt((squared / mean**2).mean()))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Make the true light of a scene.")
    parser.add_argument("scene", help="folder in scenes/, or the path of one that holds plan.toml")
    parser.add_argument("--noise", choices=("draft", "standard", "fine"), default="fine")
    parser.add_argument("--unchecked", action="store_true", help="without Mitsuba")
    choice = parser.parse_args(arguments)
    folder = SCENES / choice.scene if (SCENES / choice.scene).is_dir() else Path(choice.scene)
    plan = read_plan(folder / "plan.toml")
    room, lamps = true_room(plan), resolve_lamps(plan.file.lamps, folder)
    channels = find_bands(plan.file.sensors.device, folder)
    points = true_points(room, *read_points(folder / "truth" / "points.csv"))
    with tempfile.TemporaryDirectory() as scratch:
        light = true_light(room, lamps, points, channels, Path(scratch), noise=choice.noise, seed=SEED)
    opinion = None if choice.unchecked else second_opinion(room, lamps, light, channels)
    path = save_true_light(light, folder / "truth" / "light.nc", opinion)
    relative = np.sqrt((light.channel_se**2).mean(axis=0)) / light.channel_irradiance.mean(axis=0)
    print(
        f"{path}: {len(points)} points ({points.buried.sum()} buried), {path.stat().st_size / 1e3:.0f} kB; standard "
        f"error {100 * relative.mean():.2f} % of the mean ({100 * relative.max():.2f} % in the worst channel)"
    )
    if opinion:
        print(
            f"{opinion.engine} at {opinion.wavelengths} wavelengths: NRMSE {opinion.nrmse_percent:.2f} %, bias "
            f"{opinion.bias_percent:+.2f} ± {opinion.bias_se_percent:.2f} %"
        )


if __name__ == "__main__":
    main()
