"""The run file says what it means, or is refused in words."""

from pathlib import Path

import pytest

from lidarspectra.config import RunFile, parse_run_file, read_run_file
from lidarspectra.errors import RunFileError

MINIMAL = """
[scan]
file = "room.glb"
[[lamps]]
name = "panel 1"
shape = "panel"
center = [0.9, 1.5, 2.66]
size = [0.6, 0.6]
spectrum = "LED-B3"
luminous_flux_lm = 3400
"""


def parse(text: str) -> RunFile:
    return parse_run_file(text, where="room.toml")


def test_the_smallest_run_file_gets_the_paper_s_sensor_grid() -> None:
    run_file = parse(MINIMAL)
    assert run_file.sensors.grid is not None
    assert run_file.sensors.grid.count == 176
    assert run_file.sensors.device == "as7265x-14"
    assert run_file.trace.accuracy == "high"


def test_another_device_keeps_that_grid_until_points_are_given() -> None:
    run_file = parse(MINIMAL + '[sensors]\ndevice = "as7265x-18"\n')
    assert run_file.sensors.grid is not None
    assert run_file.sensors.grid.count == 176
    assert parse(run_file.to_toml()).sensors.grid == run_file.sensors.grid
    assert run_file.changed(sensors={"points": "desk.csv"}).sensors.grid is None
    with pytest.raises(RunFileError, match="not both"):
        parse(MINIMAL + '[sensors]\npoints = "desk.csv"\n[sensors.grid]\ncount = 4\n')


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[cells]\ncell = "silicon"', r"cells: one table each is written \[\[cells\]\], in double brackets"),
        ('[rules]\n[[rules.areas]]\nname = "a"\npolygon = [[0, 0], [1, 0]]', "polygon: at least 3 values, not 2"),
        ('[rules]\n[[rules.areas]]\nname = "a"\npolygon = 3', r"polygon: a list is written in brackets"),
        (
            '[daylight]\nlatitude_deg = 60\nlongitude_deg = 25\ntime = "2024-06-21 12:00"\n[[daylight.windows]]\n'
            'name = "w"\ncenter = [0, 1, 1]\nsize = [1, 1]\nnormal = [1, 0, 0]',
            r"daylight\.time: a time has its offset from UTC, as 2024-",
        ),
    ],
)
def test_tables_lists_and_times_that_are_none_are_told_in_toml_s_words(text: str, words: str) -> None:
    with pytest.raises(RunFileError, match=words):
        parse(f"{MINIMAL}{text}\n")


def test_every_fault_is_named_at_once_and_with_its_place() -> None:
    with pytest.raises(RunFileError) as caught:
        parse(MINIMAL + '\n[trace]\nacuracy = "high"\nnoise = "loud"\n')
    assert "trace.acuracy: unknown key (did you mean 'accuracy'?)" in str(caught.value)
    assert "trace.noise" in str(caught.value)
    assert "room.toml" in str(caught.value)


def test_a_slip_deep_in_the_file_is_told_with_the_key_that_was_meant() -> None:
    with pytest.raises(RunFileError, match=r"lamps\.1\.centre: unknown key \(did you mean 'center'\?\)"):
        parse(MINIMAL + "centre = [0, 0, 0]\n")
    with pytest.raises(RunFileError, match=r"sensors\.grid\.heigth: unknown key \(did you mean 'height'\?\)"):
        parse(MINIMAL + "[sensors.grid]\ncount = 4\nheigth = 1\n")
    with pytest.raises(RunFileError, match=r"music: unknown key(?! \(did)"):
        parse(MINIMAL + "[music]\nloud = true\n")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("radiant_flux_W = 20", "not both"),
        ("cct_k = 4000", "either spectrum or cct_k"),
        ("beam_angle_deg = 30", "shape 'spot'"),
        ('file = "a.ies"', "shape 'ies'"),
        ("dim = 1.5", "less than or equal to 1"),
        ("center = [nan, 0, 0]", "TOML"),
    ],
)
def test_lamps_that_contradict_themselves_are_refused(change: str, words: str) -> None:
    with pytest.raises(RunFileError, match=words):
        parse(MINIMAL + change + "\n")


@pytest.mark.parametrize("key", ['receptor = "dome.csv"', "field_of_view_deg = 30"])
def test_plain_rtrace_is_refused_for_a_sensor_that_it_does_not_have(key: str) -> None:
    text = f"{MINIMAL}[sensors]\n{key}\ngrid.count = 4\n[trace]\nmethod = "
    with pytest.raises(RunFileError, match=f"leave out {key.partition(' ')[0]}"):
        parse(f'{text}"rtrace"')
    parse(f'{text}"adaptive"')


def test_plain_rtrace_is_refused_for_a_target_at_each_point() -> None:
    with pytest.raises(RunFileError, match="comes down to no target"):
        parse(MINIMAL + '\n[trace]\nmethod = "rtrace"\nnoise_of = "point"\n')


def test_not_a_number_is_refused_where_toml_allows_it() -> None:
    with pytest.raises(RunFileError, match="finite"):
        parse(MINIMAL.replace("0.9, 1.5", "nan, 1.5"))


def test_a_room_without_any_lamp_is_refused() -> None:
    with pytest.raises(RunFileError, match="lamps_from_scan"):
        parse('[scan]\nfile = "room.glb"\n')


def test_two_lamps_of_one_name_are_refused() -> None:
    lamp = MINIMAL.split("[[lamps]]")[1]
    with pytest.raises(RunFileError, match="panel 1"):
        parse(MINIMAL + "[[lamps]]" + lamp)


def test_a_missing_run_file_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(RunFileError, match="lidarspectra init"):
        read_run_file(tmp_path / "none.toml")


def test_a_run_file_that_is_no_text_is_one_clear_error(tmp_path: Path) -> None:
    path = tmp_path / "room.toml"
    for content in (b"\xff\xfe\x00\x01", MINIMAL.encode("utf-16"), f"# Büro{MINIMAL}".encode("cp1252")):
        path.write_bytes(content)
        with pytest.raises(RunFileError, match="Save it as UTF-8"):
            read_run_file(path)


def test_a_run_file_as_windows_editors_save_it_is_the_same(tmp_path: Path) -> None:
    path = tmp_path / "room.toml"
    path.write_bytes(MINIMAL.replace("\n", "\r\n").encode("utf-8-sig"))
    assert read_run_file(path) == parse(MINIMAL)


AREA = "[[rules.areas]]\nname = 'desk'\npolygon = [[0, 0], [1, 0], [1, 1]]\n"


@pytest.mark.parametrize(
    ("areas", "words"),
    [
        (AREA + AREA, "two areas have the name 'desk'"),
        (AREA + "looks_deg = []\n", "looks_deg of 'desk' is empty"),
        (AREA.replace("[1, 1]", "[2, 0]"), "the area 'desk' has 0 m²"),
        (AREA.replace("[1, 0], [1, 1]", "[1, 1], [1, 0], [0, 1]"), "one after the other"),
    ],
)
def test_areas_of_rules_that_no_light_can_be_judged_in_are_refused_at_once(areas: str, words: str) -> None:
    parse(MINIMAL + AREA)
    with pytest.raises(RunFileError, match=words):
        parse(MINIMAL + areas)


def test_a_scan_or_a_run_in_place_of_a_run_file_names_the_run_file(tmp_path: Path) -> None:
    (tmp_path / "room.glb").write_bytes(b"glTF\xff")
    with pytest.raises(RunFileError, match=r"lidarspectra init \S*room\.glb"):
        read_run_file(tmp_path / "room.glb")
    (tmp_path / "room.toml").write_text("", encoding="utf-8")
    (tmp_path / "room.run").mkdir()
    for name in ("room.glb", "room.run", "room"):
        with pytest.raises(RunFileError, match=r"Give the run file, .*room\.toml"):
            read_run_file(tmp_path / name)
