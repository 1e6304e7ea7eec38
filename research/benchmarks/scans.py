"""What comes out of scans in which something is wrong, of meshes of 50 to 5 million triangles, and of real files.

    python -m research.benchmarks.scans damage [--only ghost ...]    one room with what goes wrong in scans, one by one
    python -m research.benchmarks.scans faces [--counts 50 500 ...]  the same room of few and many triangles
    python -m research.benchmarks.scans files --scans FOLDER         all scans in a folder and those below it

`--keep FOLDER` keeps the files and runs. Every case goes through the command line, `lidarspectra init` and then `map`
(files: `run`, with the report), in processes of their own; what is said to be found is what they printed. Damaged rooms
are then lit by the true lamps, whatever `init` found, so that a map differs from the whole room's by the damage alone;
the real files' maps have the lamps that `init` proposed. Runs are cheap: the noise is `draft` (3 %), at most 8
reflections, 30 % of the surfaces seen, and materials are estimated from colours without the network.

Time is processor time of all processes; memory is the largest process's peak.
"""

import argparse
import csv
import os
import re
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.config import read_run_file
from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map
from lidarspectra.workflow.run_folder.workspace import stage_folder
from research.virtual_rooms import damaged_rooms as rooms
from research.virtual_rooms.damaged_rooms import Damage, Mesh
from research.virtual_rooms.model_files import furnished_room, write_roomplan

TRACE = {"accuracy": "medium", "noise": "draft"}
MATERIALS = {"coverage": 0.3, "model": "none"}
GRID = {"grid": {"height": 0.8, "count": 25}}
FLUX_LM = 3600.0
LAMP_DROP_M = 0.06  # [m] below the ceiling
POINT_SPACING_M, POINT_HEIGHT_M, POINT_MARGIN_M = 0.7, 0.85, 0.45
NEVER_IN_FURNITURE_M = 0.8  # [m] x from which a point is clear of the cabinet
FACE_COUNTS = (50, 500, 5_000, 50_000, 500_000, 5_000_000)
MEMORY_GB = 14  # of addresses of one process, so that a case too large ends with an error
SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".usdz")
WHOLE = "nothing is wrong"


@dataclass(frozen=True, kw_only=True)
class Case:
    """A damaged room.

    Parameters
    ----------
    name : str
        Of the case and its file.
    damage : callable or None
        Of the room's mesh; None for what a model of the room leaves out.
    whole : str
        Name of the case that it is held against.
    size_m, lamps_m
        Of the undamaged room.
    suffix : str
        Of the file.
    init : tuple of str
        Options of `lidarspectra init`.
    low_y_m : float
        The scan holds points from here on.
    close : bool
        Whether the run closes what is open.
    """

    name: str
    damage: Damage | None = None
    whole: str = WHOLE
    size_m: rooms.Vector = rooms.SIZE_M
    lamps_m: tuple[tuple[float, float], ...] = rooms.LAMPS_M
    suffix: str = ".glb"
    init: tuple[str, ...] = ()
    low_y_m: float = 0.0
    close: bool = False
    left_out: tuple[str, ...] = ()

    def write(self, folder: Path) -> Path:
        """The scan's file."""
        path = folder / (re.sub(r"\W+", "-", self.name) + self.suffix)
        if self.damage is None:
            write_roomplan(path, furnished_room(leave_out=self.left_out))
            return path
        mesh = self.damage(rooms.furnished(self.size_m, self.lamps_m), np.random.default_rng(rooms.SEED))
        path.write_bytes(rooms.ply(mesh) if self.suffix == ".ply" else rooms.glb(mesh))
        return path

    def points(self) -> list[tuple[float, float, float]]:
        """Places over the plan, clear of furniture."""
        x, y = (np.arange(POINT_MARGIN_M, side - 0.3, POINT_SPACING_M) for side in self.size_m[:2])
        start = NEVER_IN_FURNITURE_M if self.size_m == rooms.SIZE_M else 0.0
        return [(float(a), float(b), POINT_HEIGHT_M) for a in x for b in y if a > start and b > self.low_y_m]

    def lamps(self) -> list[dict[str, object]]:
        """The true ones, as the run file's tables."""
        return [
            {
                "name": f"panel {number}",
                "shape": "panel",
                "center": [x, y, self.size_m[2] - LAMP_DROP_M],
                "size": [rooms.PANEL_M, rooms.PANEL_M],
                "spectrum": "LED-B3",
                "luminous_flux_lm": FLUX_LM,
            }
            for number, (x, y) in enumerate(self.lamps_m, start=1)
        ]


CORRIDOR_WHOLE, MODEL_WHOLE = "corridor, closed at its ends", "RoomPlan with a ceiling"
ROOF_WHOLE, ROOF_LAMPS_M = "under a roof", ((1.4, 2.0), (3.6, 2.0))


def _as_it_is(mesh: Mesh, random: np.random.Generator) -> Mesh:
    return mesh


def _corridor(name: str, damage: Damage, *, close: bool = False) -> Case:
    return Case(
        name=name,
        damage=damage,
        whole=CORRIDOR_WHOLE,
        size_m=rooms.CORRIDOR_M,
        lamps_m=rooms.CORRIDOR_LAMPS_M,
        close=close,
    )


CASES = (
    Case(name=WHOLE, damage=_as_it_is),
    Case(name="stray faces", damage=rooms.stray_faces),
    Case(name="slivers", damage=rooms.slivers),
    Case(name="islands", damage=rooms.islands),
    Case(name="doubled walls", damage=rooms.doubled),
    Case(name="holes", damage=rooms.holes),
    Case(name="rough by 2 cm", damage=rooms.rough),
    Case(name="faces inside out", damage=rooms.turned_faces),
    Case(name="no ceiling", damage=rooms.without("ceiling")),
    Case(name="half a ceiling", damage=rooms.half_a_ceiling),
    Case(name="a ceiling around one lamp", damage=rooms.ceiling_around_a_lamp),
    Case(name="low walls, a ceiling around one lamp", damage=rooms.low_walls),
    Case(name="no floor", damage=rooms.without("floor")),
    Case(name="neither floor nor ceiling", damage=rooms.without("floor", "ceiling")),
    Case(name="ghost behind a mirror of 1 m", damage=rooms.mirrored_at_wall(1.0)),
    Case(name="ghost behind a window of 2 m", damage=rooms.mirrored_at_wall(2.0)),
    Case(name="polished floor", damage=rooms.polished_floor),
    Case(name="polished floor, --floor 0", damage=rooms.polished_floor, init=("--floor", "0")),
    Case(name="leans by 8 degrees", damage=rooms.leaning),
    Case(name=ROOF_WHOLE, damage=rooms.under_a_roof, whole=ROOF_WHOLE, lamps_m=ROOF_LAMPS_M),
    Case(name="two storeys, an open stairwell", damage=rooms.two_storeys),
    Case(name="open at one end", damage=rooms.without("east")),
    Case(name="open at one end, close = true", damage=rooms.without("east"), close=True),
    _corridor(CORRIDOR_WHOLE, _as_it_is),
    _corridor("corridor, open", rooms.without("west", "east")),
    _corridor("corridor, close = true", rooms.without("west", "east"), close=True),
    Case(name="one wall and a chair", damage=rooms.one_wall_and_a_chair, low_y_m=2.4),
    Case(name="one wall and a chair, close = true", damage=rooms.one_wall_and_a_chair, low_y_m=2.4, close=True),
    Case(name="sixty faces left", damage=rooms.few_faces),
    Case(name="a black picture", damage=rooms.dark),
    Case(name="in millimetres, as PLY", damage=rooms.in_millimetres, suffix=".ply"),
    Case(name=MODEL_WHOLE, whole=MODEL_WHOLE, suffix=".usdz"),
    Case(name="RoomPlan without a ceiling", whole=MODEL_WHOLE, suffix=".usdz", left_out=("Ceiling0",)),
    Case(name="RoomPlan without ceiling and floor", whole=MODEL_WHOLE, suffix=".usdz", left_out=("Ceiling0", "Floor0")),
)


@dataclass(frozen=True, kw_only=True)
class Done:
    """A command that ended.

    Parameters
    ----------
    status : int
    said : str
        What it printed, errors last.
    seconds : float
        Processor time. [s]
    memory_gb : float
        Peak of its largest process. [GB]
    """

    status: int
    said: str
    seconds: float
    memory_gb: float

    @property
    def sentence(self) -> str:
        """Its error in one line; empty where it ended well."""
        if self.status == 0:
            return ""
        error = self.said.partition("Error: ")[2] or self.said[-400:]
        return re.sub(r"(/\S*/)", "", " ".join(error.split()))

    def line(self, subject: str) -> str:
        """What it said of a subject, as 'room'."""
        found = re.search(rf"^{subject} +(.*)$", self.said, flags=re.MULTILINE)
        return found[1] if found else "-"


def command(*words: str | Path) -> Done:
    """Run `lidarspectra` with these words."""
    with tempfile.TemporaryFile() as said:
        line = [sys.executable, "-m", "lidarspectra", *map(str, words)]
        process = subprocess.Popen(line, stdout=said, stderr=said)
        resource.prlimit(process.pid, resource.RLIMIT_AS, (MEMORY_GB * 10**9,) * 2)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        text = said.read().decode(errors="replace")
    return Done(
        status=process.returncode,
        said=text,
        seconds=used.ru_utime + used.ru_stime,
        memory_gb=used.ru_maxrss * 1024 / 1e9,
    )


def mean_lux(run: Path) -> tuple[dict[tuple[float, float], float], float]:
    """Illuminance at each point (x, y) of a run's map, and its mean [lx]."""
    light = load_map(stage_folder(run, "map") / MAP_FILE)
    values = np.asarray(light["illuminance"].values, dtype=np.float64)
    places = np.column_stack([light["x"].values, light["y"].values])
    known = values > 0.0  # not buried in furniture
    return {(round(x, 2), round(y, 2)): v for (x, y), v in zip(places[known].tolist(), values[known], strict=True)}, (
        float(values[known].mean())
    )


def try_damage(case: Case, folder: Path) -> dict[tuple[float, float], float] | None:
    """Print a damaged room's row up to its map's mean; returns the map."""
    scan = case.write(folder)
    run_path = scan.with_suffix(".toml")
    looked = command("init", scan, "--force", *case.init)
    found = f"{case.name} | {looked.sentence or looked.line('room')}; {looked.line('lamps')} | {looked.seconds:.0f} s"
    if looked.status:
        print(f"| {found} | - | - |", flush=True)
        return None
    points = scan.with_suffix(".csv")
    with points.open("w", newline="") as file:
        csv.writer(file).writerows([("x", "y", "z"), *case.points()])
    _make_cheap(run_path, case, points.name)
    ran = command("map", run_path)
    if ran.status:
        print(f"| {found} | {ran.sentence} | {ran.seconds:.0f} s |", flush=True)
        return None
    light, mean = mean_lux(run_path.with_suffix(".run"))
    print(f"| {found} | {mean:.0f} lx | {ran.seconds:.0f} s |", end="", flush=True)
    return light


def _make_cheap(run_path: Path, case: Case | None = None, points: str = "") -> None:
    """Make a run file of `init` cheap, with a case's true lamps and a file of points where one is given."""
    run_file = read_run_file(run_path)
    if case is None:
        run_file.changed(trace=TRACE, materials=MATERIALS, sensors=GRID).save(run_path, force=True)
        return
    without_grid = run_file.model_copy(update={"sensors": run_file.sensors.model_copy(update={"grid": None})})
    changed = without_grid.changed(
        trace=TRACE,
        materials={**MATERIALS, "delight": False},
        sensors={"points": points},
        lamps=case.lamps(),
        scan={"close": case.close},
    )
    changed.save(run_path, force=True)


def damage_table(folder: Path, names: Sequence[str]) -> None:
    """Print what comes out of each damaged room."""
    print("| what is wrong | `init` | time | mean of the map | time | against the whole room |")
    print("|---|---|---|---|---|---|")
    whole: dict[str, dict[tuple[float, float], float]] = {}
    chosen = [case for case in CASES if not names or any(name in case.name for name in names)]
    needed = {case.whole for case in chosen}
    for case in CASES:
        if case not in chosen and case.name not in needed:
            continue
        light = try_damage(case, folder)
        if light is None:
            continue
        if case.name == case.whole:
            whole[case.name] = light
        true = whole.get(case.whole, {})
        shared = [place for place in light if place in true]
        ratio = np.mean([light[place] for place in shared]) / np.mean([true[place] for place in shared])
        worst = max(abs(light[place] / true[place] - 1.0) for place in shared)
        print(f" {100 * (ratio - 1.0):+.1f} %, at worst {100 * worst:.0f} % ({len(shared)} points) |", flush=True)


def mesh_of(count: int) -> Mesh:
    """The room of about so many triangles: the walls alone, or as finely cut as it takes."""
    if count <= 100:
        return rooms.furnished(step_m=99.0)
    step = rooms.STEP_M
    for _ in range(8):
        step *= np.sqrt(len(rooms.furnished(step_m=step).faces) / count)
    return rooms.furnished(step_m=float(step))


def faces_table(folder: Path, counts: Sequence[int]) -> None:
    """Print what `init` and the stages up to the scene take for meshes of few and many triangles."""
    print("| triangles | `init` | time | memory | up to the scene | time | memory |")
    print("|---|---|---|---|---|---|---|")
    for count in counts:
        mesh = mesh_of(count)
        scan = folder / f"{len(mesh.faces)}-faces.glb"
        scan.write_bytes(rooms.glb(mesh))
        looked = command("init", scan, "--force")
        words = looked.sentence or f"{looked.line('room')}; {looked.line('lamps')}"
        print(f"| {len(mesh.faces):,} | {words} | {_time(looked)} | {looked.memory_gb:.1f} GB |", end="", flush=True)
        if looked.status:
            print(" - | - | - |")
            continue
        _make_cheap(scan.with_suffix(".toml"))
        ran = command("scene", scan.with_suffix(".toml"))
        made = re.findall(r"^1 scan .*?(\d+) triangles", ran.said, flags=re.MULTILINE)
        words = ran.sentence or f"{int(made[0]):,} triangles"
        print(f" {words} | {_time(ran)} | {ran.memory_gb:.1f} GB |", flush=True)


def _time(done: Done) -> str:
    return f"{done.seconds:.0f} s" if done.seconds < 120 else f"{done.seconds / 60:.0f} min"


def files_in(folder: Path) -> Iterator[Path]:
    """Scans in a folder and those below it."""
    return (path for path in sorted(folder.rglob("*")) if path.suffix.lower() in SUFFIXES)


def files_table(scans: Path, folder: Path) -> None:
    """Print what comes out of each scan in a folder, with the lamps that `init` proposes."""
    print("| file | `init` | time | map | time | memory |")
    print("|---|---|---|---|---|---|")
    for scan in files_in(scans):
        run_path = folder / f"{scan.stem}.toml"
        looked = command("init", scan, "--out", run_path, "--force")
        words = looked.sentence or f"{looked.line('room')}; {looked.line('lamps')}"
        print(f"| {scan.name} | {words} | {_time(looked)} |", end="", flush=True)
        if looked.status:
            print(" - | - | - |")
            continue
        _make_cheap(run_path)
        ran = command("run", run_path)
        result = ran.sentence
        if not result:
            result = f"{mean_lux(run_path.with_suffix('.run'))[1]:.0f} lx in the mean"
        print(f" {result} | {_time(ran)} | {ran.memory_gb:.1f} GB |", flush=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", default=["damage", "faces"], help="damage, faces, files")
    parser.add_argument("--scans", type=Path, help="folder of scans for the table of files")
    parser.add_argument("--only", nargs="*", default=(), metavar="WORD", help="damages whose name has one of these")
    parser.add_argument("--counts", nargs="*", type=int, default=FACE_COUNTS, metavar="N", help="of triangles")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="for the scans made and their runs")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        tables = {*given.tables, *(["files"] if given.scans else [])}
        if "damage" in tables:
            damage_table(folder, given.only)
        if "faces" in tables:
            faces_table(folder, given.counts)
        if "files" in tables:
            if given.scans is None:
                parser.error("give a folder of scans by --scans")
            files_table(given.scans, folder)


if __name__ == "__main__":
    main()
