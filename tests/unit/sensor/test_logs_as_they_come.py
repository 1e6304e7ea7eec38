"""Logs as programs and people write them: nothing is merged or dropped without a word."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import ASCENDING_LETTERS, CHANNEL_LABELS, UART_LETTERS
from lidarspectra.hardware.sensor.calibrated_light import spectral_irradiance
from lidarspectra.hardware.sensor.identify import order_by_user
from lidarspectra.hardware.sensor.log_columns import channel_column, columns_by_user
from lidarspectra.hardware.sensor.log_layouts import one_sensor, read_sensor_log, readings_from_csv, sensors_of
from lidarspectra.hardware.sensor.log_times import OF_DAY, SINCE_START, lacks_zone, parse_times
from lidarspectra.hardware.sensor.measured_readings import irradiance_of
from lidarspectra.hardware.sensor.readings import write_readings

BY_WAVELENGTH = 10.0 + np.arange(18)


def saved(folder: Path, text: str) -> Path:
    path = folder / "log.csv"
    path.write_text(text, encoding="utf-8", newline="")
    return path


def row(letters: tuple[str, ...] = ASCENDING_LETTERS, shift: float = 0.0, form: str = ".0f", mark: str = ",") -> str:
    return mark.join(f"{10.0 + shift + ASCENDING_LETTERS.index(letter):{form}}" for letter in letters)


def test_a_column_of_sensor_ids_keeps_the_sensors_apart(tmp_path: Path) -> None:
    lines = ["time(ms),sensor_id," + ",".join(ASCENDING_LETTERS)]
    lines += [f"{1000 * i + 20 * node},{node},{row(shift=100.0 * node)}" for i in range(4) for node in (1, 2, 3)]
    path = saved(tmp_path, "\n".join(lines) + "\n")
    readings = read_sensor_log(path).readings
    assert sensors_of(readings) == ("1", "2", "3")
    second = one_sensor(readings, "2")
    assert np.array_equal(second["counts"].to_numpy(), np.tile(210.0 + np.arange(18), (4, 1)))
    assert second["unix_s"].to_numpy().tolist() == [0.04, 1.04, 2.04, 3.04]
    assert SINCE_START in readings.attrs["notes"]
    with pytest.raises(ReadingError, match="--sensor"):
        readings_from_csv(path)  # whoever wants one sensor is asked which
    with pytest.raises(ReadingError, match="'7'"):
        readings_from_csv(path, sensor="7")


def test_a_table_of_several_sensors_survives_being_converted(tmp_path: Path) -> None:
    lines = ["unix_s,sensor," + ",".join(CHANNEL_LABELS)]
    lines += [f"{1.7e9 + i},desk,{row()}\n{1.7e9 + i},door,{row(shift=5)}" for i in range(3)]
    first = read_sensor_log(saved(tmp_path, "\n".join(lines))).readings
    write_readings(first, tmp_path / "table.csv")
    again = read_sensor_log(tmp_path / "table.csv").readings
    assert sensors_of(again) == ("desk", "door")
    assert np.array_equal(again["counts"], first["counts"])


def test_a_number_for_each_row_is_no_sensor(tmp_path: Path) -> None:
    text = "id,time," + ",".join(CHANNEL_LABELS) + "\n" + "".join(f"{i},{1.7e9 + i},{row()}\n" for i in range(5))
    assert sensors_of(readings_from_csv(saved(tmp_path, text))) == ()


@pytest.mark.parametrize("names", [[f"s{s}_w{c + 1}" for s in (1, 2) for c in range(18)],
                                   [f"s{s} {label} nm" for s in (1, 2) for label in CHANNEL_LABELS]])  # fmt: skip
def test_sensors_side_by_side_are_told_apart(names: list[str], tmp_path: Path) -> None:
    text = ",".join([*names, "loc"]) + "\n" + f"{row()},{row(shift=50)},7\n" * 3
    readings = read_sensor_log(saved(tmp_path, text)).readings
    assert sensors_of(readings) == ("s1", "s2")
    assert np.array_equal(one_sensor(readings, "s2")["counts"].to_numpy()[0], BY_WAVELENGTH + 50)
    assert readings["label"].to_numpy().tolist() == ["7"] * 6


@pytest.mark.parametrize("mark", [";", "\t"])
def test_semicolons_and_decimal_commas_are_read(mark: str, tmp_path: Path) -> None:
    cells = row(shift=0.25, form=".2f", mark="|").replace(".", ",").replace("|", mark)
    head = mark.join(("Datum", *(f"{label} nm" for label in CHANNEL_LABELS)))
    text = f"{head}\n" + "".join(f"20.04.2023 14:36:0{i}{mark}{cells}\n" for i in range(3))
    readings = readings_from_csv(saved(tmp_path, text), columns={"Datum": "time"})
    assert np.array_equal(readings["module_value"].to_numpy()[0], BY_WAVELENGTH + 0.25)
    assert np.diff(readings["unix_s"].to_numpy()).tolist() == [1.0, 1.0]
    bare = f"{mark.join(ASCENDING_LETTERS)}\n{cells}\n{cells}\n"
    assert np.array_equal(readings_from_csv(saved(tmp_path, bare))["module_value"].to_numpy()[0], BY_WAVELENGTH + 0.25)


def test_two_decimal_signs_and_marks_of_thousands_are_refused(tmp_path: Path) -> None:
    head = "time;" + ";".join(CHANNEL_LABELS) + "\n"
    mixed = f"1700000000;{row(mark=';', form='.1f')}\n".replace("10.0", "10,0", 1)
    other = f"1700000001;{row(mark=';', form='.1f')}\n"
    with pytest.raises(ReadingError, match="one decimal sign"):
        readings_from_csv(saved(tmp_path, head + mixed + other))
    quoted = head.replace(";", ",") + '1700000000,"1,234"' + "," + row(ASCENDING_LETTERS[1:]) + "\n"
    with pytest.raises(ReadingError, match="thousands"):
        readings_from_csv(saved(tmp_path, quoted))


def test_the_arduino_monitors_stamps_become_times_past_midnight(tmp_path: Path) -> None:
    stamps = ["23:59:58.500", "23:59:59.500", "00:00:00.500"]
    lines = [f"23:59:57.000 -> {','.join(ASCENDING_LETTERS)}", *(f"{stamp} -> {row(form='.2f')}" for stamp in stamps)]
    readings = readings_from_csv(saved(tmp_path, "\r\n".join(lines) + "\r\n"))
    assert np.array_equal(readings["module_value"].to_numpy()[0], BY_WAVELENGTH)
    assert np.allclose(np.diff(readings["unix_s"].to_numpy()), 1.0)
    assert OF_DAY in readings.attrs["notes"]
    assert readings.attrs["rows_left_out"] == "0"  # the header is no row
    damaged = "\r\n".join([*lines[:3], f"00:00:00.000 -> {row()[:9]}", lines[3]])
    assert readings_from_csv(saved(tmp_path, damaged)).attrs["rows_left_out"] == "1"


def test_the_modules_own_answers_are_read_die_by_die(tmp_path: Path) -> None:
    counts = ", ".join(f"{10 + ASCENDING_LETTERS.index(letter)}" for letter in UART_LETTERS)
    module = ", ".join(f"{20 + ASCENDING_LETTERS.index(letter)}.5" for letter in UART_LETTERS)
    text = "ATGAIN=3\nOK\nATGAIN=1\nERROR\nATINTTIME\n59 OK\n" + f"ATDATA\n{counts} OK\nATCDATA\n{module} OK\n" * 2
    readings = readings_from_csv(saved(tmp_path, text))
    assert readings.sizes["reading"] == 2
    assert np.array_equal(readings["counts"].to_numpy()[1], BY_WAVELENGTH)
    assert np.array_equal(readings["module_value"].to_numpy()[0], BY_WAVELENGTH + 10.5)
    assert readings["gain"].to_numpy().tolist() == [64.0, 64.0]  # the second setting was refused
    assert np.allclose(readings["integration_ms"], 165.2)
    burst = f"ATBURST=2\n{counts} OK\n{counts} OK\n"
    assert readings_from_csv(saved(tmp_path, burst)).sizes["reading"] == 2
    header = ",".join(UART_LETTERS) + "\n" + row(UART_LETTERS) + "\n"
    assert np.array_equal(readings_from_csv(saved(tmp_path, header))["counts"].to_numpy()[0], BY_WAVELENGTH)


def test_home_assistants_history_keeps_a_state_until_it_changes(tmp_path: Path) -> None:
    lines = ["entity_id,state,last_changed"]
    for label, value in zip(CHANNEL_LABELS, BY_WAVELENGTH, strict=True):
        lines.append(f"sensor.desk_{label}nm,{value},2024-01-01T10:00:00.0{int(value) % 10}0Z")
    lines += ["sensor.desk_410nm,99,2024-01-01T10:00:05.000Z", "sensor.desk_435nm,unavailable,2024-01-01T10:00:09Z"]
    lines += ["light.desk,on,2024-01-01T10:00:00Z"]
    readings = readings_from_csv(saved(tmp_path, "\n".join(lines)))
    values = readings["counts"].to_numpy()
    assert sensors_of(readings) == ("desk",)
    assert np.array_equal(values[0], BY_WAVELENGTH)
    assert values[1, :3].tolist() == [99.0, 11.0, 12.0]
    assert np.isnan(values[2, 1])
    assert "light.desk" in readings.attrs["notes"]


def test_grafanas_exports_are_read_joined_by_time_and_by_series(tmp_path: Path) -> None:
    names = [f'"{label} nm {{sensor=""{sensor}""}}"' for sensor in ("a", "b") for label in CHANNEL_LABELS]
    joined = "sep=,\n" + ",".join(["Time", *names]) + "\n" + f"1700000000000,{row()},{row(shift=3)}\n" * 2
    first = read_sensor_log(saved(tmp_path, joined)).readings
    assert sensors_of(first) == ("a", "b")
    assert float(first["unix_s"][0]) == 1.7e9
    assert np.array_equal(one_sensor(first, "b")["counts"].to_numpy()[0], BY_WAVELENGTH + 3)
    names = [f'"light.mean {{channel: {label}, node: {sensor}}}"' for sensor in ("a", "b") for label in CHANNEL_LABELS]
    cells = row(mark='";"')
    joined = ";".join(['"Time"', *names]) + "\n" + f'"2024-01-01T10:00:00.000Z";"{cells}";"{cells}"\n' * 2
    assert sensors_of(read_sensor_log(saved(tmp_path, joined)).readings) == ("a", "b")  # as many commas as semicolons
    lines = ['"Series";"Time";"Value"']
    lines += [f"desk_{label};2024-01-01T10:00:0{i}+00:00;{value}" for i in (1, 2)
              for label, value in zip(CHANNEL_LABELS, BY_WAVELENGTH, strict=True)]  # fmt: skip
    second = readings_from_csv(saved(tmp_path, "\n".join(lines)))
    assert np.array_equal(second["counts"].to_numpy(), np.tile(BY_WAVELENGTH, (2, 1)))


def test_numbers_with_units_are_refused_with_the_way_out(tmp_path: Path) -> None:
    text = "Time,gain," + ",".join(CHANNEL_LABELS) + "\n" + f"1700000000,1,{row()} µW\n" * 3
    with pytest.raises(ReadingError, match="without units"):
        readings_from_csv(saved(tmp_path, text))


def test_an_unknown_layout_gets_its_columns_and_a_way_to_name_them(tmp_path: Path) -> None:
    names = [f"Kanal {i}" for i in range(1, 19)]
    path = saved(tmp_path, ";".join(["Zeit", "Knoten", *names]) + "\n" + f"1700000000;k1;{row(mark=';')}\n" * 2)
    with pytest.raises(ReadingError, match="Zeit, Knoten, Kanal 1") as refused:
        readings_from_csv(path)
    assert "--columns" in str(refused.value)
    words = ",".join(f"{name}={label}" for name, label in zip(names, CHANNEL_LABELS, strict=True))
    columns = columns_by_user(f"Zeit=time,Knoten=sensor,{words}")
    readings = readings_from_csv(path, columns=columns)
    assert np.array_equal(readings["counts"].to_numpy()[0], BY_WAVELENGTH)
    assert sensors_of(readings) == ("k1",)
    with pytest.raises(ReadingError, match="Kanal 1"):
        readings_from_csv(path, columns={"Kanal": "410"})
    with pytest.raises(ReadingError, match="NAME=MEANING"):
        columns_by_user("Zeit=Zeitpunkt")


def test_what_is_left_out_or_not_used_is_told(tmp_path: Path) -> None:
    text = "time,humidity," + ",".join(CHANNEL_LABELS) + "\n"
    text += f"1700000000,40,{row()}\n1700000001,41,{row()},5\n" + text + f"1700000002,42,{row()}\n"
    readings = readings_from_csv(saved(tmp_path, text))
    assert readings.sizes["reading"] == 2
    notes = readings.attrs["notes"]
    assert "1 of 3 rows were left out" in notes
    assert "header comes 2 times" in notes
    assert "humidity" in notes


@pytest.mark.parametrize(
    ("name", "sensor", "family", "letter"),
    [("count_410", "", "count", "A"), ("s1_410", "s1", "plain", "A"), ("s12_w18", "s12", "plain", "L"),
     ("desk_count_610nm", "desk", "count", "R"), ("B (435 nm)", "", "plain", "B"), ("SE_410", "", "derived", "A"),
     ('value {channel="C", node="3"}', "3", "plain", "C"), ("410nm_desk", "desk", "plain", "A"),
     ("as7265x_channel_a_410nm", "as7265x", "plain", "A"), ("desk a 410 nm", "desk", "plain", "A"),
     ("E_410", "", "irradiance", "A")],
)  # fmt: skip
def test_names_of_columns_are_understood(name: str, sensor: str, family: str, letter: str) -> None:
    column = channel_column(name)
    assert column is not None
    assert (column.sensor, column.family, column.letter) == (sensor, family, letter)


def test_days_and_months_that_may_be_either_are_refused() -> None:
    assert parse_times(["13/04/2023 14:36:08"], name="t")[0].tolist() == [1681396568.0]
    assert parse_times(["4/13/2023 2:36:08 PM"], name="t")[0].tolist() == [1681396568.0]
    with pytest.raises(ReadingError, match="day and month"):
        parse_times(["03/04/2023 14:36:08"], name="t")


def test_german_headers_and_windows_letters_are_read(tmp_path: Path) -> None:
    head = ";".join(("Datum", "Uhrzeit", "Gerät", *(f"{label} nm" for label in CHANNEL_LABELS)))
    lines = [f"20.04.2023;14:36:0{i};Küche {i % 2};{row(mark=';')}" for i in range(4)]
    path = tmp_path / "log.csv"
    path.write_bytes("\r\n".join([head, *lines]).encode("cp1252"))
    readings = read_sensor_log(path).readings
    assert sensors_of(readings) == ("Küche 0", "Küche 1")
    assert readings["unix_s"].to_numpy().tolist() == [1682001360.0 + i for i in range(4)]


@pytest.mark.parametrize("name", ["unix_s", "time_s", "ts", "created_at", "Zeitstempel"])
def test_a_column_of_times_is_no_channel_of_a_sensor(name: str, tmp_path: Path) -> None:
    text = (
        f"{name}," + ",".join(CHANNEL_LABELS) + "\n" + f"1700000000,{row()}\n1700000001,,{row(ASCENDING_LETTERS[1:])}\n"
    )
    readings = readings_from_csv(saved(tmp_path, text))
    assert readings["unix_s"].to_numpy().tolist() == [1.7e9, 1.7e9 + 1]
    assert channel_column(name) is None
    assert np.isnan(readings["counts"].to_numpy()[1, 0])
    assert readings.attrs["notes"] == ""


def test_a_second_header_in_another_order_is_refused_and_the_same_one_is_told(tmp_path: Path) -> None:
    first = "time," + ",".join(ASCENDING_LETTERS) + "\n" + f"1700000000,{row()}\n"
    second = "time," + ",".join(UART_LETTERS) + "\n" + f"1700000001,{row(UART_LETTERS)}\n"
    with pytest.raises(ReadingError, match=r"line 3.*one order"):
        readings_from_csv(saved(tmp_path, first + second))
    damaged = first.replace("time,A,B", "time,A,?")
    readings = readings_from_csv(saved(tmp_path, first + damaged))
    assert readings.sizes["reading"] == 2
    assert "header comes 2 times" in readings.attrs["notes"]


def test_names_that_take_turns_are_told_though_their_column_is_not_known(tmp_path: Path) -> None:
    text = "time,mux,humidity," + ",".join(CHANNEL_LABELS) + "\n"
    text += "".join(f"{1.7e9 + i},{'ab'[i % 2]},4{i},{row(shift=9 * (i % 2))}\n" for i in range(8))
    path = saved(tmp_path, text)
    notes = readings_from_csv(path).attrs["notes"]
    assert "'mux=sensor'" in notes
    assert "'humidity=sensor'" not in notes
    assert sensors_of(read_sensor_log(path, columns={"mux": "sensor"}).readings) == ("a", "b")


def test_the_newest_row_first_is_turned_round_and_a_jumble_is_told(tmp_path: Path) -> None:
    head = "time,sensor," + ",".join(CHANNEL_LABELS) + "\n"
    lines = [f"{1.7e9 + i},{sensor},{row(shift=i)}\n" for i in range(3) for sensor in ("a", "b")]
    readings = one_sensor(read_sensor_log(saved(tmp_path, head + "".join(reversed(lines)))).readings, "a")
    assert readings["unix_s"].to_numpy().tolist() == [1.7e9, 1.7e9 + 1, 1.7e9 + 2]
    assert readings["counts"].to_numpy()[:, 0].tolist() == [10.0, 11.0, 12.0]
    jumbled = read_sensor_log(saved(tmp_path, head + "".join([*lines[2:], *lines[:2]]))).readings
    assert "2 readings have a time before" in jumbled.attrs["notes"]
    restarted = head + "".join(f"{time},a,{row()}\n" for time in (5, 6, 1, 2))
    assert "1 readings have a time before" in read_sensor_log(saved(tmp_path, restarted)).readings.attrs["notes"]


def test_points_at_thousands_between_semicolons_are_refused_and_three_decimals_are_not(tmp_path: Path) -> None:
    head = "time;" + ";".join(CHANNEL_LABELS) + "\n"
    marked = f"1700000000;950;1.210;12.400;{row(ASCENDING_LETTERS[3:], mark=';')}\n" * 2
    with pytest.raises(ReadingError, match="thousands"):
        readings_from_csv(saved(tmp_path, head + marked))
    decimals = f"1700000000;{row(shift=0.25, mark=';', form='.3f')}\n" * 2
    values = readings_from_csv(saved(tmp_path, head + decimals))["module_value"].to_numpy()
    assert np.array_equal(values[0], BY_WAVELENGTH + 0.25)


def test_rows_of_another_delimiter_than_the_header_are_told(tmp_path: Path) -> None:
    text = "time," + ",".join(CHANNEL_LABELS) + "\n" + f"1700000000;{row(mark=';')}\n" * 3
    with pytest.raises(ReadingError, match="3 of 3 rows were left out"):
        readings_from_csv(saved(tmp_path, text))


def test_what_convert_writes_is_read_again_to_the_millisecond_and_without_notes(tmp_path: Path) -> None:
    text = "time,gain,integration_ms," + ",".join(CHANNEL_LABELS) + "\n" + f"1700000000.125,64,140,{row()}\n" * 2
    readings = readings_from_csv(saved(tmp_path, text))
    write_readings(readings, tmp_path / "table.csv", light=spectral_irradiance(readings))
    again = readings_from_csv(tmp_path / "table.csv")
    assert again["unix_s"].to_numpy().tolist() == [1700000000.125] * 2
    assert again.attrs["notes"] == ""


def test_an_object_a_line_is_a_row(tmp_path: Path) -> None:
    lines = [
        json.dumps({
            "Time": f"2024-01-01T10:00:0{i}Z", "node": f"n{i % 2}", "battery": None,
            "AS7265X": dict(zip(ASCENDING_LETTERS, (BY_WAVELENGTH + i).tolist(), strict=True)),
        })
        for i in range(4)
    ]  # fmt: skip
    nested = read_sensor_log(saved(tmp_path, "\n".join([*lines * 4, "Client disconnected"]))).readings
    assert sensors_of(nested) == ("n0", "n1")
    assert np.array_equal(nested["counts"].to_numpy()[1], BY_WAVELENGTH + 1)
    assert "1 line was left out: no JSON object" in nested.attrs["notes"]
    two = json.dumps({"time": 1.7e9, **{n: dict(zip(CHANNEL_LABELS, BY_WAVELENGTH, strict=True)) for n in ("a", "b")}})
    assert sensors_of(read_sensor_log(saved(tmp_path, f"{two}\n{two}\n")).readings) == ("a", "b")
    with pytest.raises(ReadingError, match="names its channels"):
        read_sensor_log(saved(tmp_path, '{"a":' * 100_000))
    listed = json.dumps({"time": 1.7e9, "raw": BY_WAVELENGTH.tolist()})
    with pytest.raises(ReadingError, match="time, raw_1, raw_2"):  # which number is which channel is not said
        read_sensor_log(saved(tmp_path, f"{listed}\n{listed}\n"))


def test_a_cell_without_an_end_is_one_clear_error(tmp_path: Path) -> None:
    text = "time," + ",".join(CHANNEL_LABELS) + "\n" + f"1700000000,{row()}\n" + '"' + "1,2\n" * 50_000
    with pytest.raises(ReadingError, match="quotation mark"):
        read_sensor_log(saved(tmp_path, text))
    with pytest.raises(ReadingError, match="names its channels"):
        read_sensor_log(saved(tmp_path, "7" * 200_000))


def test_lines_that_begin_with_a_name_are_not_read_as_one_sensor_with_a_channel_lost(tmp_path: Path) -> None:
    text = ",".join(ASCENDING_LETTERS) + "\n" + "".join(f"S{i % 2}: {row()}\n" for i in range(6))
    with pytest.raises(ReadingError, match="'sensor,' before the header"):
        read_sensor_log(saved(tmp_path, text))
    mended = "sensor," + text.replace(": ", ",")
    assert sensors_of(read_sensor_log(saved(tmp_path, mended)).readings) == ("S0", "S1")


def test_a_boards_greeting_in_json_makes_no_objects_of_the_table_below_it(tmp_path: Path) -> None:
    header = ",".join(("unix_s", *CHANNEL_LABELS))
    rows = [f"{1.7e9 + i},{','.join(f'{value + i:.0f}' for value in BY_WAVELENGTH)}" for i in range(4)]
    found = read_sensor_log(saved(tmp_path, "\n".join(['{"boot": 1}', header, *rows]))).readings
    assert np.array_equal(found["counts"].to_numpy()[2], BY_WAVELENGTH + 2)


ROBOT_NAMES = ["date", *(f"wavelength{i}" for i in range(1, 19)), "solar1", "solar2", "solar3"]


def robot_table(names: list[str], seconds: range) -> str:
    """A table as the authors' robot wrote it: channel i reads 10.25 + i, cell i counts 100 i."""
    cells = dict(zip(ROBOT_NAMES[1:], [*row(form=".2f", shift=0.25).split(","), "100", "200", "300"], strict=True))
    stamps = [f"2023-04-20 14:36:{second:02d}" for second in seconds]
    lines = [",".join({**cells, "date": stamp, "board": "b"}[name] for name in names) for stamp in stamps]
    return "\n".join([",".join(names), *lines]) + "\n"


def test_the_robots_table_is_known_by_its_names_in_any_order(tmp_path: Path) -> None:
    readings = readings_from_csv(saved(tmp_path, robot_table(["board", *ROBOT_NAMES[::-1]], range(2))))
    assert np.array_equal(readings["module_value"].to_numpy()[0], BY_WAVELENGTH + 0.25)
    assert readings["adc"].to_numpy()[0].tolist() == [100.0, 200.0, 300.0]
    assert readings["unix_s"].to_numpy().tolist() == [1682001360.0, 1682001361.0]
    assert sensors_of(readings) == ("b",)
    assert readings.attrs["notes"] == ""


def test_what_a_robots_table_and_its_lines_lose_is_told(tmp_path: Path) -> None:
    table = robot_table(ROBOT_NAMES, range(20, 0, -1)).replace("10.25,11.25", "10.25,word", 1)
    notes = readings_from_csv(saved(tmp_path, table[:-30])).attrs["notes"]
    for words in ("1 of 20 rows were left out", "1 cells of the column 'wavelength2'", "newest row came first"):
        assert words in notes
    line = f"2023-04-20 14:36:01,{row(form='.2f')}\n"
    cut = f"{line}2023-04-20 14:36:01,solar 1:110\n{line[:60]}\n2023-04-20 14:36:02,solar 1:111\n"
    readings = readings_from_csv(saved(tmp_path, cut))
    assert readings["adc"].to_numpy().tolist() == [[110.0]]  # not the one of the row that was cut
    assert "2 lines were left out" in readings.attrs["notes"]
    assert "line 3" in readings.attrs["notes"]


def test_cells_are_numbered_by_their_names_and_other_numbers_are_told(tmp_path: Path) -> None:
    head = "time," + ",".join(CHANNEL_LABELS)
    readings = readings_from_csv(saved(tmp_path, f"{head},cell_2,cell_1\n1700000000,{row()},22,11\n"))
    assert readings["adc"].to_numpy().tolist() == [[11.0, 22.0]]
    assert readings.attrs["notes"] == ""
    readings = readings_from_csv(saved(tmp_path, f"{head},adc_34,adc_0\n1700000000,{row()},34,1\n"))
    assert readings["adc"].to_numpy().tolist() == [[1.0, 34.0]]
    assert "'adc_0', 'adc_34' count as cells 1 to 2" in readings.attrs["notes"]


def test_rows_that_are_twice_in_a_file_are_told_and_equal_light_is_not(tmp_path: Path) -> None:
    head = "time," + ",".join(CHANNEL_LABELS) + "\n"
    lines = "".join(f"{1_700_000_000 + i},{row()}\n" for i in range(6))
    assert readings_from_csv(saved(tmp_path, head + lines)).attrs["notes"] == ""
    assert "6 of 12 rows are the same as another" in readings_from_csv(saved(tmp_path, head + lines * 2)).attrs["notes"]


@pytest.mark.parametrize(
    ("stamp", "stated"),
    [("2023-04-20 14:36:08", False), ("20.04.2023 14:36:08", False), ("2023-04-20T14:36:08+02:00", True),
     ("2023-04-20T14:36:08Z", True), ("2023-04-20 14:36:08 UTC", True), ("1681994168", True)],
)  # fmt: skip
def test_a_zone_that_no_time_states_is_told(stamp: str, stated: bool, tmp_path: Path) -> None:
    text = "time," + ",".join(CHANNEL_LABELS) + "\n" + f"{stamp},{row()}\n"
    assert ("time_zone" in readings_from_csv(saved(tmp_path, text)).attrs) != stated


def test_what_is_no_text_or_empty_is_said_so(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    for data, words in ((bytes(range(256)) * 9, "no text"), (b"", "empty file"), (b"\n\n", "empty file")):
        path.write_bytes(data)
        with pytest.raises(ReadingError, match=words):
            readings_from_csv(path)


@pytest.mark.parametrize("form", ["2023-04-20 14:36:08,{}", "{},25.5", "{},5", "1700000000,{}", "lab,{},1,2,3"])
def test_bare_rows_with_more_columns_than_the_order_given_are_refused(form: str, tmp_path: Path) -> None:
    """The last of them would be taken for the longest wavelength."""
    path = saved(tmp_path, (form.format(row()) + "\n") * 4)
    with pytest.raises(ReadingError, match=r"rows of 18 numbers.*line 1: .*in a first line above"):
        readings_from_csv(path, order=order_by_user("A,B,C,D,E,F,G,H,R,I,S,J,T,U,V,W,K,L"))


def test_columns_to_name_by_hand_are_those_that_are_not_understood(tmp_path: Path) -> None:
    names = ["sensor", "date", *(f"Kanal {i}" for i in range(1, 19))]
    with pytest.raises(ReadingError, match='--columns "Kanal 1=410,'):
        readings_from_csv(saved(tmp_path, ",".join(names) + "\n" + f"a,2023-04-20 14:36:08,{row()}\n"))


def test_channels_of_another_sensor_are_not_to_be_named_as_an_as7265x_s(tmp_path: Path) -> None:
    names = "unix_s,415nm,445nm,480 nm,515nm,555nm,590nm,630nm,680nm"  # an AS7341
    with pytest.raises(
        ReadingError, match=r"Channels at 415, 445, 480, 515 \.\.\. nm are another sensor's.*E_415"
    ) as refused:
        readings_from_csv(saved(tmp_path, f"{names}\n1700000000,1,2,3,4,5,6,7,8\n"))
    assert "--columns" not in str(refused.value)


@pytest.mark.parametrize("code", [0, 2, 3])
def test_codes_of_gains_are_refused_as_gains(tmp_path: Path, code: int) -> None:
    header = ",".join(["unix_s", "gain", "integration_ms", *CHANNEL_LABELS])
    rows = [",".join(["1700000000", str(gain), "165.2", *["1000"] * 18]) for gain in (1, code)]
    (tmp_path / "log.csv").write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    with pytest.raises(ReadingError, match=rf"found {code}\. .*16 for 2"):
        read_sensor_log(tmp_path / "log.csv")
    table = pd.DataFrame({"A": [1000.0, 900.0], "gain": [1, code], "integration_ms": 165.2})
    with pytest.raises(ReadingError, match="16 or 64"):
        irradiance_of(table, ["A"], "counts", "none", tmp_path)
    known = table.assign(gain=[3.7, np.nan])  # a row without
    assert np.isfinite(irradiance_of(known, ["A"], "counts", "none", tmp_path)).tolist() == [[True], [False]]


@pytest.mark.parametrize("first", ["count", "cal"])
def test_counts_and_module_values_of_one_sensor_by_series_are_kept_apart(tmp_path: Path, first: str) -> None:
    second = {"count": "cal", "cal": "count"}[first]
    lines = ["entity_id,state,last_changed"]
    for minute in range(2):
        for place, family in enumerate((first, second)):
            for label, value in zip(CHANNEL_LABELS, BY_WAVELENGTH, strict=True):
                state = value + minute if family == "count" else 0.5 * value + 0.25
                lines.append(f"sensor.desk_{family}_{label}nm,{state:g},2024-01-01T10:0{minute}:00.{place}00Z")
    lines += [f"sensor.desk_{label}nm,77,2024-01-01T10:01:00.000Z" for label in CHANNEL_LABELS]  # whatever it is
    lines += [f"sensor.shelf_{label}nm,{value}.5,2024-01-01T10:01:30Z" for label, value in zip(
        CHANNEL_LABELS, range(18), strict=True)]  # fmt: skip
    readings = read_sensor_log(saved(tmp_path, "\n".join(lines))).readings
    desk, shelf = (one_sensor(readings, name) for name in ("desk", "shelf"))
    assert np.array_equal(desk["counts"].to_numpy(), [BY_WAVELENGTH, BY_WAVELENGTH + 1])
    assert np.array_equal(desk["module_value"].to_numpy(), np.tile(0.5 * BY_WAVELENGTH + 0.25, (2, 1)))
    assert "18 rows were left out" in readings.attrs["notes"]
    assert np.array_equal(shelf["module_value"].to_numpy()[0], np.arange(18) + 0.5)
    assert not readings["flag"].to_numpy().any()


def test_rows_by_series_tell_a_zone_that_is_not_stated_and_times_that_are_none(tmp_path: Path) -> None:
    lines = ["Time,series,value"]
    lines += [f"2024-03-31 02:30:0{second},{label}nm,5.5" for second in (1, 2) for label in CHANNEL_LABELS]
    readings = read_sensor_log(saved(tmp_path, "\n".join([*lines, "soon,410nm,5.5"]))).readings
    assert "UTC" in readings.attrs["time_zone"]
    assert "1 row was left out, whose time" in readings.attrs["notes"]


def test_dates_of_fourteen_digits_are_dates_and_times_before_a_clock_was_set_are_none() -> None:
    times, _ = parse_times(["20230420143608", "20231029023001"], name="time")
    assert times.tolist() == [1682001368.0, 1698546601.0]
    assert lacks_zone(["20230420143608"])
    times, _ = parse_times(["12", "1700000000", "1700000001"], name="time")  # a board that then asked for the time
    assert np.isnan(times).tolist() == [True, False, False]
    times, _ = parse_times(["12000", "1700000000000", "1700000001000"], name="time", unit="ms")
    assert np.isnan(times).tolist() == [True, False, False]


@pytest.mark.parametrize(
    ("unit", "name"),
    [("uW/cm2", "module_value"), ("µW/cm²", "module_value"), ("W/m²/nm", "irradiance"), ("W/m^2/nm", "irradiance"),
     ("counts", "counts")],
)  # fmt: skip
def test_a_unit_behind_a_channel_is_no_sensor_and_says_what_the_numbers_are(
    tmp_path: Path, unit: str, name: str
) -> None:
    for form in (f"{{}}nm ({unit})", f"{{}} nm [{unit}]", f"{{}} ({unit})", f"desk_{{}}nm ({unit})"):
        header = ",".join(["time", *(form.format(label) for label in CHANNEL_LABELS)])
        readings = read_sensor_log(saved(tmp_path, f"{header}\n2024-01-01T10:00:01Z,{row()}\n")).readings
        assert sensors_of(readings) == (("desk",) if "desk" in form else ())
        assert np.array_equal(readings[name].to_numpy()[0], BY_WAVELENGTH)
        others = {"counts", "module_value"} - {name}
        assert all(np.isnan(readings[other].to_numpy()).all() for other in others)
