"""Glass, mirrors and screens: what is found in rooms with and without them, and what the map gains.

    python -m research.benchmarks.panes [found] [maps] [open] [--only WORD ...] [--scans SCAN ...] [--real SCAN]

`found` reads, repairs and searches the virtual rooms of `research.virtual_rooms.rooms_with_panes`, and then the scans
that are named. `maps` lights each room that truly has a pane by the true lamps, thrice: the whole room with its true
pane (the truth), the scan without a pane in the run file, and the scan with what `init` proposes. Colours are
reflectances there and are not de-lit, so that the maps differ by the pane alone; the traces aim at a noise of 1 %.
`open` tells which share of all directions leave each room, as its free space sees them, with its true pane in place and
with what `init` proposes.
`--real` runs a scan as `init` proposes it, with its panes and without, to the map: what the surfaces where panes are
proposed are made of, and how the maps differ.
"""

import argparse
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.config import RunFile
from lidarspectra.errors import LidarSpectraError
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.room.panes.pane import REACH_M, Pane
from lidarspectra.workflow.init.init_file import init
from lidarspectra.workflow.pipeline import RunSummary, run
from lidarspectra.workflow.run_folder.panes_of_run import panes_of_run
from lidarspectra.workflow.whole_room import whole_room
from research.benchmarks.scans import Case
from research.virtual_rooms.damaged_rooms import Mesh, glb
from research.virtual_rooms.rooms_with_panes import ROOMS, PaneRoom

TRACE = {"accuracy": "medium", "noise": "standard"}
MATERIALS = {"coverage": 0.3, "model": "none", "delight": False}


def found_in(path: Path) -> tuple[Pane, ...]:
    """What is found in a scan's file, as a run looks for it."""
    repaired = repair_scan(read_scan(path), flatten=True)
    return whole_room(repaired, close_ceiling=True, close_floor=True, close=False).proposed


def write(folder: Path, name: str, mesh: Mesh) -> Path:
    """A mesh as a file, named in plain letters."""
    path = folder / (re.sub(r"\W+", "-", name) + ".glb")
    path.write_bytes(glb(mesh))
    return path


def words_of(panes: Sequence[Pane]) -> str:
    """What was found."""
    return "; ".join(pane.in_words() for pane in panes) or "nothing"


def found_table(folder: Path, rooms: Sequence[PaneRoom], scans: Sequence[Path]) -> None:
    """Print what is found in each room and scan."""
    print("| room | what is there | found |")
    print("|---|---|---|")
    for room in rooms:
        found = found_in(write(folder, room.name, room.scanned()))
        true = "nothing" if room.true is None else room.true.in_words()
        print(f"| {room.name} | {true} | {words_of(found)} |", flush=True)
    for path in scans:
        try:
            words = words_of(found_in(path))
        except LidarSpectraError as cause:
            words = str(cause)
        print(f"| {path.parent.name}/{path.name} | | {words} |", flush=True)


def map_of(scan: Path, panes: Sequence[dict[str, object]], points: Path) -> FloatArray:
    """(point, band) irradiance in a scan with some panes, under the true lamps [W/m²/nm]."""
    run_file = RunFile.model_validate(
        {
            "scan": {"file": scan.name},
            "lamps": Case(name="lamps").lamps(),
            "panes": list(panes),
            "materials": MATERIALS,
            "sensors": {"points": points.name},
            "trace": TRACE,
        }
    ).with_origin(folder=scan.parent, name=scan.stem)
    summary = run(run_file, scan.parent / f"{scan.stem}-{len(panes)}.run", last="map")
    return np.asarray(summary.map["irradiance"], dtype=np.float64)


def open_share(path: Path, panes: Sequence[Pane]) -> float:
    """Share of all directions that leave a scan with some panes [0-1]."""
    repaired = repair_scan(read_scan(path), flatten=True)
    whole = whole_room(repaired, close_ceiling=True, close_floor=True, close=False, panes=panes)
    return whole.openness.total


def open_table(folder: Path, rooms: Sequence[PaneRoom]) -> None:
    """Print how open each room with glass or a mirror is with it in place: a pane closes what it stands in."""
    print("| room | with its true pane | as `init` proposes |")
    print("|---|---|---|")
    for room in rooms:
        if room.true is not None and room.true.kind != "screen":
            path = write(folder, room.name, room.scanned())
            shares = (open_share(path, panes) for panes in ([room.true], found_in(path)))
            print(f"| {room.name} | {' | '.join(f'{100 * share:.2f} %' for share in shares)} |", flush=True)


def as_table(pane: Pane) -> dict[str, object]:
    """A pane as the run file has it."""
    return {
        "name": pane.kind,
        "kind": pane.kind,
        "center": pane.center.tolist(),
        "size": list(pane.size_m),
        "normal": pane.normal.tolist(),
    }


def maps_row(room: PaneRoom, folder: Path) -> str:
    """How far a room's map is from the truth without the pane and with what `init` proposes."""
    assert room.true is not None
    points = folder / "points.csv"
    places = Case(name="points").points()
    points.write_text("x,y,z\n" + "\n".join(f"{x},{y},{z}" for x, y, z in places) + "\n", encoding="utf-8")
    scan = write(folder, room.name, room.scanned())
    truth = map_of(write(folder, f"{room.name} in truth", room.whole()), [as_table(room.true)], points)
    proposed = [each.model_dump() for each in init(scan).panes]
    maps = [map_of(scan, [], points), *([map_of(scan, proposed, points)] if proposed else [])]
    cells = []
    for each in maps:
        error = float(np.sqrt(np.mean((each - truth) ** 2)) / truth.mean())
        cells.append(f"{error:.3f}, {100 * (each.mean() / truth.mean() - 1.0):+.1f} %")
    return f"| {room.name} | {cells[0]} | {cells[1] if proposed else 'none proposed'} |"


def made_of(summary: RunSummary, pane: Pane) -> str:
    """Shares of the area at a pane, to the depth that something hangs before it, by class and kind of material."""
    scan, materials = summary.scan, summary.materials
    near = pane.covers(scan.centers) & (np.abs(pane.heights(scan.centers)) <= 2.0 * REACH_M)
    area: dict[str, float] = {}
    for face in np.flatnonzero(near):
        material = materials.materials[materials.face_material[face]]
        name = (
            material.kind if material.source.startswith("pane:") and material.kind != "plastic" else material.category
        )
        name = "screen" if material.source == "pane:screen" else name
        area[name] = area.get(name, 0.0) + float(scan.areas[face])
    shares = sorted(area.items(), key=lambda item: -item[1])
    return ", ".join(f"{name} {100 * each / sum(area.values()):.0f} %" for name, each in shares[:3])


def real_table(path: Path, folder: Path) -> None:
    """Print what a real scan's panes change."""
    scan = folder / path.name
    scan.write_bytes(path.read_bytes())
    proposed = init(scan)
    panes = panes_of_run(proposed.panes)
    without, with_them = (
        run(run_file, folder / f"{scan.stem}-{name}.run", last="map")
        for name, run_file in (("paint", proposed.changed(panes=[])), ("panes", proposed))
    )
    print("| proposed | its surfaces without it | with it |")
    print("|---|---|---|")
    for pane in panes:
        print(f"| {pane.in_words()} | {made_of(without, pane)} | {made_of(with_them, pane)} |")
    before, after = (np.asarray(each.map["irradiance"], dtype=np.float64) for each in (without, with_them))
    change = float(np.sqrt(np.mean((after - before) ** 2)) / before.mean())
    print(f"directions that leave the scan with them: {100 * with_them.scan.record.open_share:.2f} %")
    print(
        f"map: {100 * (after.mean() / before.mean() - 1.0):+.1f} % in the mean, {100 * change:.1f} % root mean square"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", default=["found", "maps"], help="found, maps, open")
    parser.add_argument("--scans", nargs="*", type=Path, default=(), metavar="SCAN")
    parser.add_argument("--only", nargs="*", default=(), metavar="WORD", help="rooms whose name has one of these")
    parser.add_argument("--real", type=Path, metavar="SCAN", help="that is run with its panes and without")
    given = parser.parse_args(arguments)
    chosen = [room for room in ROOMS if not given.only or any(word in room.name for word in given.only)]
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        if given.real is not None:
            real_table(given.real, folder)
            return
        if "found" in given.tables:
            found_table(folder, chosen, given.scans)
        if "open" in given.tables:
            open_table(folder, chosen)
        if "maps" in given.tables:
            print("| room | without a pane: NRMSE, bias | as `init` proposes |")
            print("|---|---|---|")
            for room in chosen:
                if room.true is not None:
                    print(maps_row(room, folder), flush=True)


if __name__ == "__main__":
    main()
