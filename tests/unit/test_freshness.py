"""A change of the run file makes exactly the stages again that depend on it; no stage reads what it did not declare."""

import ast
import inspect
import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lidarspectra.config import RunFile
from lidarspectra.errors import UndeclaredError
from lidarspectra.io.toml_sections import Section
from lidarspectra.workflow import stages
from lidarspectra.workflow.kept_light import same_picture_light, same_room, with_present_names
from lidarspectra.workflow.pipeline import walk
from lidarspectra.workflow.run_folder.declared import FILES, declare
from lidarspectra.workflow.run_folder.inputs import Inputs
from lidarspectra.workflow.run_folder.workspace import (
    MARKER_FILE,
    STAGES,
    Stage,
    StageName,
    StageRecord,
    StageResult,
    stage_key,
)

LAMP = {
    "name": "one",
    "shape": "panel",
    "center": [1, 1, 2],
    "size": [0.5, 0.5],
    "spectrum": "LED-B3",
    "luminous_flux_lm": 900,
}
IES = {"name": "two", "shape": "ies", "center": [1, 1, 2], "cct_k": 3000, "radiant_flux_W": 5, "file": "two.ies"}
SPOT = {
    "name": "three",
    "shape": "spot",
    "center": [1, 1, 2],
    "cct_k": 3000,
    "luminous_flux_lm": 5,
    "beam_angle_deg": 30,
}
WINDOW = {"name": "south", "center": [0, 0, 1], "size": [1, 1], "normal": [1, 0, 0]}
DAYLIGHT = {
    "latitude_deg": 48,
    "longitude_deg": 9,
    "time": "2026-06-21T12:00:00+02:00",
    "weather": "year.epw",
    "windows": [WINDOW],
}
REST = {
    "panes": [
        {
            "name": "wall",
            "kind": "glass",
            "center": [0, 1, 1],
            "size": [1, 2],
            "normal": [1, 0, 0],
            "transmittance": 0.7,
        },
        {"name": "tv", "kind": "screen", "center": [3, 1, 1], "size": [1, 1], "normal": [-1, 0, 0], "reflectance": 0.1},
        {"name": "dark", "kind": "screen", "center": [3, 2, 1], "size": [1, 1], "normal": [-1, 0, 0]},
    ],
    "scan": {"file": "room.glb", "max_faces": 1000},
    "people_and_plants": {},
    "report": {"figures": ["svg", "pdf"]},
    "rules": {"areas": [{"name": "desk", "polygon": [[0, 0], [1, 0], [1, 1]], "dli_mol_m2": 12}]},
    "cells": [{"cell": "cell.csv", "area_cm2": 1, "hours": "8-17", "volt": 0.4}],
}
ROOMS: dict[str, dict[str, Any]] = {
    "lamps": {
        **REST,
        "lamps": [LAMP, IES, SPOT],
        "materials": {"cards": [{"center": [1, 1, 0], "reflectance": 0.18}]},
        "calibration": {"measured": "readings.csv", "lamps": {"one": 1.1}, "reflectance": {"floor": 0.9}},
        "daylight": DAYLIGHT,
        "sensors": {"grid": {"count": 9}, "field_of_view_deg": 30},
    },
    "lamps in the scan": {
        **REST,
        "lamps_from_scan": {"spectrum": "LED-B3"},
        "materials": {"method": "file", "file": "materials.csv"},
        "sensors": {"points": "points.csv", "receptor": "receptor.csv"},
    },
    "lamps in the scan, of a colour": {
        **REST,
        "lamps_from_scan": {"cct_k": 3000},
        "sensors": {"grid": {"spacing": 0.5}},
        "materials": {"delight": False},
    },
}  # fmt: skip

MATERIALS_ON = ("materials", "scene", "trace", "map", "report")
FIRST_STAGES = {  # the first stage that reads a key; the longest name that fits counts
    "scan": STAGES,
    "panes": STAGES,
    "materials": MATERIALS_ON,
    "materials.coverage": STAGES[1:],
    "materials.method": STAGES[1:],  # no views of what is given one material
    "lamps": MATERIALS_ON,
    "lamps.assumed": STAGES[5:],  # its note
    "lamps_from_scan": MATERIALS_ON,
    "daylight": STAGES[3:],
    "daylight.weather": STAGES[6:],  # `annual` reads it, but the page shows the run file
    "daylight.summer_time": STAGES[6:],
    "sensors": STAGES[4:],
    "sensors.device": STAGES[3:],
    "trace": STAGES[4:],
    "trace.mode": STAGES[3:],
    "trace.method": STAGES[3:],  # plain rtrace wants a pass for each lamp
    "trace.workers": STAGES[6:],  # the same numbers, but the page shows the run file
    "calibration": STAGES[3:],
    "people_and_plants": STAGES[6:],
    "cells": STAGES[6:],
    "report": STAGES[6:],
    "rules": STAGES[6:],
}
WITHOUT_DELIGHTING = {**FIRST_STAGES, "lamps": STAGES[3:], "lamps_from_scan": STAGES[3:]}


class Walk:
    """Takes the stages in order without making any: a stage's results are as new as what it depends on."""

    def __init__(self) -> None:
        self.keys: dict[StageName, str] = {}
        self.settings: dict[StageName, Any] = {}

    def __call__(self, stage: Stage[Any]) -> StageResult[Any]:
        self.keys[stage.name] = stage_key(stage)
        self.settings[stage.name] = {**stage.settings, "stages": {}}
        record = StageRecord(
            stage=stage.name, key="", settings={}, finished="", seconds=0.0, peak_memory_mib=0.0, summary="",
            warnings=(), outputs={}, versions={},
        )  # fmt: skip
        result: StageResult[Any] = StageResult(record, Path(), stage.load, fresh=True)
        result.contents = lambda: {"result": self.keys[stage.name]}  # type: ignore[method-assign]
        return result

    def note(self, words: str) -> None:
        """Ignore it."""


def keys_of(run_file: RunFile, base: Path) -> dict[StageName, str]:
    """The key of every stage."""
    return walked(run_file, base).keys


def walked(run_file: RunFile, base: Path) -> Walk:
    """Keys and settings of every stage."""
    text = run_file.model_dump_json()
    found = Walk()
    walk(found, Inputs(run_file=run_file, base=base, name="room", text=text))
    return found


def changed(before: dict[StageName, str], after: dict[StageName, str]) -> tuple[StageName, ...]:
    return tuple(stage for stage in STAGES if before[stage] != after[stage])


def leaves(value: Any, at: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Every key of a run file, those of each of its lamps, windows and cells too."""
    if isinstance(value, Section):
        for name in type(value).model_fields:
            yield from leaves(getattr(value, name), (*at, name))
    elif isinstance(value, tuple) and value and isinstance(value[0], Section):
        for number, each in enumerate(value):
            yield from leaves(each, (*at, number))
    else:
        yield at


OTHER_WORDS = {
    "shape": "disc", "size": [0.4, 0.4], "unit": "cm", "up": "+z", "fluxes": "area", "method": "default",
    "model": "none", "matching": "nearest", "databases": ["builtin", "mine"], "accuracy": "low", "noise": "fine",
    "noise_of": "point", "mode": "rgb", "hours": "9-18", "time": "2026-06-21T13:00:00+02:00", "file": "another",
    "workers": 3, "assumed": ["unit"], "determined": ["one"], "figures": ["png"], "activity": "archive",
    "kind": "glass", "summer_time": ["03-30", "10-26"],
}  # fmt: skip


def others(key: str, value: Any) -> Iterator[Any]:
    """Values that may stand there in place of this one."""
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, dict):
        yield {name: 2.0 * factor for name, factor in value.items()}
    elif isinstance(value, (int, float)):
        yield from (value + 1, value * 0.5, value + 1000)
    elif isinstance(value, tuple) and value and isinstance(value[0], tuple):
        yield [[each + 0.25 for each in corner] for corner in value]
    elif isinstance(value, tuple) and key not in OTHER_WORDS:
        yield [each + 0.25 for each in value]
    elif isinstance(value, str) and key not in OTHER_WORDS:
        yield value + "2"
    elif key in OTHER_WORDS:
        yield OTHER_WORDS[key]
        if key == "method":
            yield "rtrace"  # of the trace, which has no default one
    yield from (None, 0.5, 2, [0.5, 0.5])


def with_other(run_file: RunFile, at: tuple[str | int, ...]) -> RunFile | None:
    """The run file with another valid value there; None where the keys beside it leave no choice."""
    value: Any = run_file
    for part in at:
        value = value[part] if isinstance(part, int) else getattr(value, part)
    for other in others(str(at[-1]), value):
        tree = run_file.model_dump()
        holder: Any = tree
        for part in at[:-1]:
            holder = holder[part]
        holder[at[-1]] = other
        try:
            changed_file = RunFile.model_validate(tree)
        except ValueError:
            continue
        if changed_file != run_file:
            return changed_file
    return None


def dotted(at: tuple[str | int, ...]) -> str:
    return ".".join(part for part in at if isinstance(part, str))


def expected(at: tuple[str | int, ...], table: dict[str, tuple[StageName, ...]]) -> tuple[StageName, ...]:
    name = dotted(at)
    return table[max((key for key in table if f"{name}.".startswith(f"{key}.")), key=len)]


def test_a_change_of_any_key_makes_the_stages_stale_that_read_it_and_those_after_them(tmp_path: Path) -> None:
    tried: set[str] = set()
    for room in ROOMS.values():
        run_file = RunFile.model_validate(room)
        before = keys_of(run_file, tmp_path)
        table = FIRST_STAGES if run_file.materials.delight else WITHOUT_DELIGHTING
        for at in leaves(run_file):
            other = with_other(run_file, at)
            if other is not None and at != ("materials", "delight"):
                tried.add(dotted(at))
                assert changed(before, keys_of(other, tmp_path)) == expected(at, table), dotted(at)
    every = {dotted(at) for room in ROOMS.values() for at in leaves(RunFile.model_validate(room))}
    absent = {name for name in every if any(other.startswith(f"{name}.") for other in every)}  # there in another room
    assert every - absent - tried == {"materials.delight"}, "changed nowhere"


KEPT_BY_EDITS: dict[str, tuple[StageName, ...]] = {  # of keys that materials or scene read: what stays all the same
    "": (),
    "lamps.name": ("materials", "scene"),
    "lamps.flux_deviation": ("materials", "scene"),
    "lamps.dim": ("materials", "scene"),
    "lamps.dim_in_scan": ("scene",),
    "lamps.luminous_flux_lm": ("scene",),  # of one lamp of several: the picture's light is another
    "lamps.radiant_flux_W": ("scene",),
    "lamps.spectrum": ("scene",),  # where its slots carry the spectrum
    "lamps.cct_k": ("scene",),
    "calibration.measured": ("scene",),
    "calibration.determined": ("scene",),
    "calibration.lamps": ("scene",),  # of a lamp; not of a window
    "lamps_from_scan.luminous_exitance_lm_m2": ("materials", "scene"),
    "lamps_from_scan.spectrum": ("scene",),
    "lamps_from_scan.cct_k": ("scene",),
}


def test_an_edit_of_lamps_keeps_the_stages_whose_light_it_does_not_touch(tmp_path: Path) -> None:
    tried: set[str] = set()
    for name in ("lamps", "lamps in the scan"):
        run_file = RunFile.model_validate(ROOMS[name])
        before = walked(run_file, tmp_path)
        for at in leaves(run_file):
            other = with_other(run_file, at)
            after = walked(other, tmp_path) if other is not None else before
            kept = KEPT_BY_EDITS.get(dotted(at), ())
            tried.add(dotted(at))
            for stage, same in (("materials", same_picture_light), ("scene", same_room)):
                if before.settings[stage] != after.settings[stage]:
                    assert same(before.settings[stage], after.settings[stage]) == (stage in kept), (dotted(at), stage)
    assert tried >= KEPT_BY_EDITS.keys() - {""}


def test_a_factor_on_all_fluxes_leaves_the_picture_s_light(tmp_path: Path) -> None:
    def settings(*factors: float, spectrum: str = "LED-B3") -> Any:
        lamps = [{**LAMP, "name": f"{i}", "luminous_flux_lm": 900 * factor} for i, factor in enumerate(factors)]
        lamps[0]["spectrum"] = spectrum
        room = {"scan": {"file": "room.glb"}, "lamps": lamps}
        return walked(RunFile.model_validate(room), tmp_path).settings["materials"]

    assert same_picture_light(settings(1.0, 2.0), settings(0.37, 0.74))
    assert same_picture_light(settings(1.0), settings(3.0))
    assert not same_picture_light(settings(1.0, 2.0), settings(1.0, 2.1))
    assert not same_picture_light(settings(1.0, 2.0), settings(1.0, 2.0, spectrum="LED-B1"))
    assert not same_picture_light(settings(1.0, 2.0), settings(1.0, 2.0, 1.0))


def test_notes_call_lamps_by_their_present_names() -> None:
    record = StageRecord(
        stage="scene", key="", settings={}, finished="", seconds=0.0, peak_memory_mib=0.0, summary="",
        warnings=("Lamps 'a' and 'b' are too close, 'ab' is not.",), outputs={}, versions={},
    )  # fmt: skip
    shown = with_present_names(record, ("a", "b", "ab"), ("b", "a", "ab"))
    assert shown.warnings == ("Lamps 'b' and 'a' are too close, 'ab' is not.",)


def test_taking_the_light_out_or_not_makes_the_materials_again(tmp_path: Path) -> None:
    run_file = RunFile.model_validate(ROOMS["lamps"])
    materials = run_file.materials.model_copy(update={"delight": False})
    other = run_file.model_copy(update={"materials": materials})
    assert changed(keys_of(run_file, tmp_path), keys_of(other, tmp_path)) == MATERIALS_ON


@pytest.mark.parametrize(
    ("room", "file", "stale"),
    [
        ("lamps", "room.glb", STAGES),
        ("lamps", "two.ies", MATERIALS_ON),
        ("lamps", "cell.csv", STAGES[6:]),
        ("lamps in the scan", "points.csv", STAGES[4:]),
        ("lamps in the scan", "receptor.csv", STAGES[4:]),
        ("lamps in the scan, of a colour", "as7265x-14", STAGES[3:]),
    ],
)
def test_a_changed_file_counts_as_the_key_that_names_it(
    tmp_path: Path, room: str, file: str, stale: tuple[StageName, ...]
) -> None:
    run_file = RunFile.model_validate(ROOMS[room])
    (tmp_path / "materials.csv").write_text("material,spectrum\n", encoding="utf-8")
    (tmp_path / file).write_text("before", encoding="utf-8")
    before = keys_of(run_file, tmp_path)
    (tmp_path / file).write_text("after", encoding="utf-8")
    assert changed(before, keys_of(run_file, tmp_path)) == stale


@pytest.mark.parametrize(
    ("scan", "text", "named", "further"),
    [
        ("room.obj", "mtllib room.mtl", "room.mtl", "map_Kd textures\\wall.png"),
        ("room.gltf", '{"images": [{"uri": "my%20pictures/wall.png"}]}', "", ""),
        ("room.usda", "@./layers/walls.usda@", "layers/walls.usda", "@textures/wall.png@"),
        ("room.ply", "comment TextureFile textures/wall.png", "", ""),
    ],
)
def test_a_texture_in_a_folder_that_the_scan_names_is_one_of_its_files(
    tmp_path: Path, scan: str, text: str, named: str, further: str
) -> None:
    run_file = RunFile.model_validate(ROOMS["lamps"] | {"scan": {"file": f"scans/{scan}"}})
    folders = ("textures", "my pictures", "layers", "other", "textures.run")
    for folder in folders:
        (tmp_path / "scans" / folder).mkdir(parents=True)
        (tmp_path / "scans" / folder / "wall.png").write_text("before", encoding="utf-8")
    (tmp_path / "scans" / "textures.run" / MARKER_FILE).write_text("{}", encoding="utf-8")
    (tmp_path / "scans" / scan).write_text(text, encoding="utf-8")
    if named:
        (tmp_path / "scans" / named).write_text(further, encoding="utf-8")
    before = keys_of(run_file, tmp_path)
    for folder in ("other", "textures.run"):
        (tmp_path / "scans" / folder / "wall.png").write_text("after", encoding="utf-8")
    assert changed(before, keys_of(run_file, tmp_path)) == ()
    folder = "my pictures" if "%20" in text else "textures"
    (tmp_path / "scans" / folder / "wall.png").write_text("after", encoding="utf-8")
    assert changed(before, keys_of(run_file, tmp_path)) == STAGES


def test_a_glb_s_files_are_those_that_it_names(tmp_path: Path) -> None:
    document = json.dumps({"images": [{"uri": "wände/a.png"}, {"uri": "floor.jfif"}]}).encode()  # escaped: w\\u00e4nde
    chunk = struct.pack("<II", len(document), 0x4E4F534A) + document
    (tmp_path / "wände").mkdir()
    names = ("wände/a.png", "floor.jfif", "other.png")
    for name in names:
        (tmp_path / name).write_text("before", encoding="utf-8")
    rest = b"other.png, in the second chunk"
    (tmp_path / "room.glb").write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunk + rest)) + chunk + rest)
    run_file = RunFile.model_validate(ROOMS["lamps"])
    for name in names:
        before = keys_of(run_file, tmp_path)
        (tmp_path / name).write_text("after", encoding="utf-8")
        assert changed(before, keys_of(run_file, tmp_path)) == (() if name == "other.png" else STAGES), name


def test_the_plan_that_init_draws_beside_a_scan_is_none_of_its_files(tmp_path: Path) -> None:
    (tmp_path / "room.obj").write_text("mtllib room.mtl", encoding="utf-8")
    run_file = RunFile.model_validate(ROOMS["lamps"] | {"scan": {"file": "room.obj"}})
    before = keys_of(run_file, tmp_path)
    (tmp_path / "room.plan.png").write_bytes(b"picture")
    assert keys_of(run_file, tmp_path) == before


def test_what_a_file_manager_leaves_beside_a_scan_or_in_a_capture_is_none_of_its_files(tmp_path: Path) -> None:
    capture = tmp_path / "capture"
    capture.mkdir()
    for path in (capture / "info.json", tmp_path / "room.obj"):
        path.write_text("{}", encoding="utf-8")
    rooms = [RunFile.model_validate(ROOMS["lamps"] | {"scan": {"file": file}}) for file in ("capture", "room.obj")]
    before = [keys_of(room, tmp_path) for room in rooms]
    for path in (capture / ".DS_Store", capture / "Thumbs.db", tmp_path / "._wall.png"):
        path.write_bytes(b"icons")
    assert [keys_of(room, tmp_path) for room in rooms] == before
    for path in (capture / "frame.jpg", tmp_path / "wall.png"):
        path.write_bytes(b"picture")
    assert all(changed(old, keys_of(room, tmp_path)) == STAGES for old, room in zip(before, rooms, strict=True))


def test_a_run_and_its_run_file_in_the_folder_of_a_capture_are_none_of_its_files(tmp_path: Path) -> None:
    run_file = RunFile.model_validate(ROOMS["lamps"] | {"scan": {"file": "."}})
    (tmp_path / "info.json").write_text("{}", encoding="utf-8")
    before = keys_of(run_file, tmp_path)
    (tmp_path / "room.run" / "1-scan").mkdir(parents=True)
    names = ("room.toml", "room.plan.png", f"room.run/{MARKER_FILE}", "room.run/1-scan/scan.npz")
    for name in names:
        (tmp_path / name).write_text("{}", encoding="utf-8")
    assert keys_of(run_file, tmp_path) == before
    (tmp_path / "keyframes").mkdir()
    (tmp_path / "keyframes" / "1.jpg").write_bytes(b"picture")
    assert changed(before, keys_of(run_file, tmp_path)) == STAGES


def test_what_a_calibration_found_belongs_to_the_map_and_its_tables_to_the_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # where a `Walk` has its run folder
    (tmp_path / "calibration").mkdir()

    def stale_by(room: str, file: str) -> tuple[StageName, ...]:
        run_file = RunFile.model_validate(ROOMS[room])
        before = keys_of(run_file, tmp_path)
        (tmp_path / "calibration" / file).write_text(f"{room}: of more readings, the same factors", encoding="utf-8")
        return changed(before, keys_of(run_file, tmp_path))

    assert stale_by("lamps", "calibration.json") == STAGES[5:]
    assert stale_by("lamps", "readings.csv") == STAGES[6:]
    assert stale_by("lamps", "plan.csv") == ()
    assert stale_by("lamps in the scan", "calibration.json") == ()  # of a run file without [calibration]


def test_views_depend_on_a_file_of_assignments_by_whether_it_gives_all_surfaces_one_reflectance(tmp_path: Path) -> None:
    def keys(rows: str) -> dict[StageName, str]:
        (tmp_path / "materials.csv").write_text(f"group,reflectance\n{rows}\n", encoding="utf-8")
        return keys_of(RunFile.model_validate(ROOMS["lamps in the scan"]), tmp_path)

    assert changed(keys("0,white-wall"), keys("0,non-reflective")) == MATERIALS_ON
    assert changed(keys("*,white-wall"), keys("*,non-reflective")) == MATERIALS_ON
    assert changed(keys("0,white-wall"), keys("*,white-wall")) == STAGES[1:]


def test_a_stage_reads_no_key_that_it_did_not_declare(tmp_path: Path) -> None:
    run_file = RunFile.model_validate(ROOMS["lamps"])
    seen = declare(run_file, tmp_path, "trace.noise", "materials").run_file
    assert seen.trace.noise == run_file.trace.noise
    assert seen.materials == run_file.materials
    with pytest.raises(UndeclaredError, match=r"trace\.accuracy"):
        _ = seen.trace.accuracy
    with pytest.raises(UndeclaredError, match="lamps"):
        _ = seen.lamps
    with pytest.raises(UndeclaredError):
        seen.model_dump()
    with pytest.raises(AttributeError):
        declare(run_file, tmp_path, "trace.nose")


def test_what_is_assumed_is_seen_only_where_it_is_declared_by_name(tmp_path: Path) -> None:
    marked = {**ROOMS["lamps"], "scan": {"file": "room.glb", "unit": "cm", "assumed": ["unit"]}}
    marked["lamps"] = [{**LAMP, "assumed": True}, IES]
    run_file = RunFile.model_validate(marked)
    without = declare(run_file, tmp_path, "lamps", "scan")
    assert [lamp.assumed for lamp in without.run_file.lamps] == [False, False]
    assert without.run_file.scan.assumed == ()
    assert without.run_file.scan.unit == "cm"
    assert "assumed" not in str(without.settings)
    told = declare(run_file, tmp_path, "lamps", "lamps.assumed", "scan.assumed")
    assert [lamp.assumed for lamp in told.run_file.lamps] == [True, False]
    assert told.run_file.scan.assumed == ("unit",)
    assert told.settings["run_file"]["lamps.assumed"] == [True, False]


def test_stages_reach_the_run_file_by_what_they_declare_alone() -> None:
    reached = {
        node.attr
        for node in ast.walk(ast.parse(inspect.getsource(stages)))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "inputs"
    }
    assert reached == {"declare", "workers", "cluster", "name", "text"}


def test_every_key_that_may_name_a_file_is_one_of_the_run_file(tmp_path: Path) -> None:
    declare(
        RunFile.model_validate(ROOMS["lamps in the scan"]),
        tmp_path / "without materials.csv",
        *(FILES.keys() - {"materials.file"}),
    )
