"""A week of light by the hour: on a grow shelf, and at the eyes of people in an office with a window.

    python -m research.benchmarks.weeks FOLDER [--only shelf office] [--pictures docs/pictures]

Both are in `scenes/office`, scanned with its ceiling lamps alone. The shelf is the northern desk under two strips of
4000 lm that are lit from 6 to 22 every day; its points lie where leaves are. The office has a south window, the ceiling
lamps dimmed by a schedule on working days, and seven days of daylight from March 25th on (the synthetic year); its
points are eyes at 1.2 m, looking level to all sides. Printed are the tables of `lidarspectra photometry --week`, and
the map's own uncertainty. FOLDER keeps the runs; a second call traces nothing anew.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.tables import table_markdown
from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map
from lidarspectra.mapping.photometry.annual_light import YEAR_FILE
from lidarspectra.mapping.photometry.week import week_figure, week_table
from lidarspectra.workflow.applications.annual import annual_daylight
from lidarspectra.workflow.applications.week_of_run import week_of_run
from lidarspectra.workflow.pipeline import run
from lidarspectra.workflow.run_folder.annual_inputs import FOLDER
from lidarspectra.workflow.run_folder.inputs import copy_scene
from lidarspectra.workflow.run_folder.workspace import require_stage

CASES = ("shelf", "office")
STRIPS = "".join(
    f'[[lamps]]\nname = "grow {number}"\nshape = "strip"\ncenter = [1.15, {y}, 1.2]\nsize = [1.2, 0.05]\n'
    f'spectrum = "LED-B1"\nluminous_flux_lm = 4000\ndim_in_scan = 0\n\n'
    for number, y in ((1, 2.52), (2, 2.72))
)
WINDOW = """[daylight]
latitude_deg = 48.1
longitude_deg = 11.6
time = "2024-03-18T12:00:00+01:00"
weather = "synthetic"

[[daylight.windows]]
name = "south window"
center = [1.5, 0.05, 1.6]
size = [1.8, 1.3]
normal = [0, 1, 0]

"""
SHELF_WEEK = """days,lamp,from,to,dim
mon-sun,grow 1,6,22,1
mon-sun,grow 2,6,22,1
mon-fri,panel west,8:30,17,1
mon-fri,panel east,8:30,17,1
"""
OFFICE_WEEK = """days,lamp,from,to,dim
mon-fri,panel west,8,18,1
mon-fri,panel east,8,11,0.6
mon-fri,panel east,11,15,0.2
mon-fri,panel east,15,18,0.6
"""
FIRST_DAY = "03-25"
LEAVES_M = 0.85  # height of the leaves: the desk's top is at .74
EYES_M = 1.2  # of somebody who sits


def shelf_points() -> list[tuple[float, ...]]:
    """x, y, z, nx, ny, nz of leaves that look up, 20 x 10 cm apart [m]."""
    return [(x, y, LEAVES_M, 0.0, 0.0, 1.0) for y in np.linspace(2.42, 2.82, 5) for x in np.linspace(0.55, 1.75, 7)]


def eye_points() -> list[tuple[float, ...]]:
    """The same of eyes at six seats, each looking level to four sides [m]."""
    sides = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))
    return [(x, y, EYES_M, *side, 0.0) for y in (1.0, 1.9) for x in (0.85, 1.55, 2.25) for side in sides]


def room_of(case: str, folder: Path) -> Path:
    """The run file of a case, in a folder of its own."""
    path = folder / case / "room.toml"
    if path.is_file():
        return path
    path = copy_scene("office", folder / case)
    points = shelf_points() if case == "shelf" else eye_points()
    rows = "\n".join(",".join(f"{value:.3f}" for value in point) for point in points)
    (path.parent / "points.csv").write_text(f"x,y,z,nx,ny,nz\n{rows}\n", encoding="utf-8")
    text = path.read_text(encoding="utf-8")
    text = text.replace("[sensors.grid]\nheight = 0.3\ncount = 176\n", "")
    text = text.replace('device = "as7265x-14"', 'device = "as7265x-14"\npoints = "points.csv"')
    text = text.replace("[materials]", (STRIPS if case == "shelf" else WINDOW) + "[materials]")
    path.write_text(text, encoding="utf-8")
    (path.parent / "week.csv").write_text(SHELF_WEEK if case == "shelf" else OFFICE_WEEK, encoding="utf-8")
    return path


def print_case(case: str, folder: Path, pictures: Path | None) -> None:
    """Run a case and print its week."""
    path = room_of(case, folder)
    made = path.with_suffix(".run")
    run(path, last="map")
    if case == "office" and not (made / FOLDER / YEAR_FILE).is_file():
        annual_daylight(path)
    found = week_of_run(made, path.parent / "week.csv", daylight_from=FIRST_DAY if case == "office" else None)
    table = week_table(found.week, found.kept)
    print(f"\n{case}: {table.caption}\n\n{table_markdown(table)}")
    light = load_map(require_stage(made, "map") / MAP_FILE)
    share = light["illuminance_sd"] / light["illuminance"]
    print(f"uncertainty of a point's illuminance, median: {100 * float(share[found.kept].median()):.0f} %; "
          f"{light.sizes['point'] - found.kept.size} points within a surface")  # fmt: skip
    for note in found.notes:
        print(f"note: {note}")
    if pictures is not None:
        save_figure(week_figure(found.week, found.kept), pictures, f"{case}-week")


def main(words: Sequence[str] | None = None) -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--pictures", type=Path, help="folder for the figures")
    given = parser.parse_args(words)
    for case in given.only:
        print_case(case, given.folder, given.pictures)


if __name__ == "__main__":
    main()
