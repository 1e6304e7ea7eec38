"""Whatever is wrong with a scanned room, it gives a run file and a room, or one sentence that says why not.

`campaign.py --only room` tries hundreds of rooms, up to the Radiance scene.
"""

from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lidarspectra as ls
from lidarspectra.errors import LidarSpectraError
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.workflow import stages
from lidarspectra.workflow.init import init_file
from lidarspectra.workflow.init.proposed_lamps import propose_panels

from . import rooms

pytestmark = pytest.mark.usefixtures("few_viewpoints")

ROOMS = 6  # of several changes each
QUICK = (rooms.holes, rooms.few_faces, rooms.slivers)


@pytest.fixture
def repaired_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The scan stage is given what `init` made of the same triangles: half of the time that a room takes."""
    kept: dict[tuple[bytes, bytes, str], Scan] = {}

    def once(scan: Scan, **more: Any) -> Scan:
        asked = signature(repair_scan).bind(scan, **more)
        asked.apply_defaults()
        options = [asked.arguments[name] for name in asked.arguments if name not in ("scan", "progress")]
        key = (scan.vertices.tobytes(), scan.faces.tobytes(), repr(options))
        if key not in kept:
            kept[key] = repair_scan(scan, **more)
        return kept[key]

    for module in (init_file, stages):
        monkeypatch.setattr(module, "repair_scan", once)


def looked_at(data: bytes, folder: Path) -> str:
    """What `init` and the scan stage say of a GLB file: the room in words, or the error."""
    path = folder / "room.glb"
    path.write_bytes(data)
    try:
        return repr(ls.run(ls.init(path), folder / "room.run", last="scan").room)
    except LidarSpectraError as error:
        return str(error)


@pytest.mark.usefixtures("repaired_once")
@pytest.mark.parametrize(
    "change",
    [pytest.param(each, id=each.__name__, marks=() if each in QUICK else pytest.mark.slow) for each in rooms.CHANGES],
)
def test_a_room_with_one_thing_wrong_gives_a_room_or_a_sentence(change: rooms.Change, tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    said = looked_at(rooms.glb(change(rooms.plain_room(rng), rng)), tmp_path)
    assert said.isprintable()
    assert "Room:" in said or "expected" in said.lower()


@pytest.mark.slow  # some seconds each
@pytest.mark.usefixtures("repaired_once")
@pytest.mark.parametrize("case", range(ROOMS))
def test_a_room_with_several_things_wrong_gives_a_room_or_a_sentence(case: int, tmp_path: Path) -> None:
    said = looked_at(rooms.another_room(b"", np.random.default_rng([12, case])), tmp_path)
    assert said.isprintable()


def test_where_no_place_below_the_ceiling_is_free_one_panel_is_proposed() -> None:
    model = ls.RoomModel.from_box(3.0, 2.5, 2.5)
    solid = FreeSpace(bare_scan(model.scan.vertices, model.scan.faces[:, ::-1]), model.room)
    assert len(propose_panels(model.room, solid)) == 1
