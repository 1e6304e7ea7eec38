"""Pictures of the office for docs/howto-pictures.md and howto-rules.md, and how far a fisheye is from a sensor.

python -m research.benchmarks.pictures RUN [--docs docs/pictures]

RUN is a finished run of scenes/office, after `lidarspectra rules RUN`.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image

import lidarspectra as ls
from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.room_pictures import tone_mapped
from lidarspectra.mapping.rules.rule_figures import looks_figure, rules_figure
from lidarspectra.mapping.rules.rule_record import load_rules
from lidarspectra.radiance.pictures.observer_channels import xyz_of_channels
from lidarspectra.workflow.calibration.light import run_room
from lidarspectra.workflow.scenarios.picture_of_run import FALSE_COLOR, observer_scene, save_picture

EYE, TARGET = (2.9, 0.3, 1.6), (1.0, 2.2, 1.0)
LIGHTS = {
    "as run": (),
    "one panel off, the other a filament lamp": (
        ls.LampOrder(lamp="panel east", dim=0.0),
        ls.LampOrder(lamp="panel west", spectrum="A"),
    ),
}
FISHEYE_EYE = np.array([1.6, 1.2, 1.2])
FISHEYE_PIXELS = 300


def main() -> None:
    """Write the pictures and print the numbers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("--docs", type=Path, default=Path("docs/pictures"))
    given = parser.parse_args()
    _rules(given.run, given.docs)
    shown = []
    for name, orders in LIGHTS.items():
        start = time.perf_counter()
        found = ls.picture_run(given.run, eye=EYE, target=TARGET, orders=orders, pixels=(640, 480))
        print(f"{name}: 640 x 480 in {time.perf_counter() - start:.0f} s")
        shown.append(tone_mapped(found.picture.xyz, found.white_xyz))
        if not orders:
            with tempfile.TemporaryDirectory() as folder:
                save_picture(found, folder)
                with Image.open(Path(folder) / f"{FALSE_COLOR}.png") as picture:
                    picture.resize((900, round(900 * picture.height / picture.width))).save(
                        given.docs / "room-luminance.png", optimize=True
                    )
    Image.fromarray(np.concatenate(shown, axis=1)).save(given.docs / "room-pictures.jpg", quality=88)
    _fisheye(given.run)


def _rules(run: Path, docs: Path) -> None:
    """The figures of the rules."""
    record = load_rules(run / "rules")
    if record is None:
        raise SystemExit(f"{run}: expected a run after 'lidarspectra rules', found no rules in it")
    looks = []
    for look in record.looks:
        with Image.open(run / "rules" / look.picture) as picture:
            looks.append(np.asarray(picture.convert("RGB")))
    save_figure(rules_figure(record.rows), docs, "rules", kinds=("png",))
    save_figure(looks_figure(record.looks, looks), docs, "rules-glare", kinds=("png",))


def _fisheye(run: Path) -> None:
    """Illuminance and colour of a fisheye against those of a sensor that is traced without the cache."""
    direction = np.array([0.0, 1.0, 0.0])
    found = ls.picture_run(
        run,
        eye=FISHEYE_EYE,
        target=FISHEYE_EYE + direction,
        projection="fisheye",
        pixels=(FISHEYE_PIXELS, FISHEYE_PIXELS),
        smooth=False,
    ).picture
    directions, _ = found.view.directions()
    weight = found.view.solid_angles() * np.clip(directions @ direction, 0.0, None)
    picture = np.einsum("rcx,rc->x", found.xyz, weight)
    room = run_room(run)
    with tempfile.TemporaryDirectory() as folder:
        scene = observer_scene(room, room.lamps, Path(folder))
        points = ls.SensorPoints(positions=FISHEYE_EYE[None], normals=direction)
        traced = ls.trace(scene, points, accuracy="ultra", noise="fine", seed=1)
    band = (traced["coefficient"].to_numpy() * traced["flux"].to_numpy()[:, None]).sum(axis=0)[0]
    sensor = xyz_of_channels(band)
    error = 100.0 * float(traced.attrs["achieved_relative_se"])
    off = 100.0 * (picture / sensor - 1.0)
    print(f"fisheye {picture[1]:.1f} lx, sensor {sensor[1]:.1f} lx ({error:.2f} %), X, Y, Z off by {off.round(2)} %")


if __name__ == "__main__":
    main()
