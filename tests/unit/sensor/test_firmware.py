"""The Arduino sketches: built for the Uno where its tools are, and run on this computer against our driver."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS, DIE_INDEX, FLAG_SATURATED, UART_LETTERS, SensorSettings
from lidarspectra.hardware.sensor.drivers import LineSplitter
from lidarspectra.hardware.sensor.line_frames import frames_in
from lidarspectra.hardware.sensor.line_protocol import LineProtocolDriver
from lidarspectra.hardware.sensor.sensor_records import CellReading, Item, Moment, Note, Reading, Trouble

SKETCHES = ("spectral_sensor", "cell_adc")
HOST = Path(__file__).resolve().parent.parent / "firmware_host"
CORE = Path(os.environ.get("ARDUINO_AVR_CORE", "/usr/share/arduino/hardware/arduino/avr"))  # Debian's arduino-core-avr
UNO_FLASH_BYTES, UNO_RAM_BYTES = 32256, 2048  # ATmega328P, less the boot loader
STACK_BYTES = 700  # what the sketch's calls need at their deepest, generously


@pytest.fixture(scope="module")
def firmware(project: Path) -> Path:
    return project / "lidarspectra" / "hardware" / "firmware"


@pytest.fixture(scope="module")
def host_programs(firmware: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    compiler = next((found for name in ("c++", "g++", "clang++") if (found := shutil.which(name))), None)
    if compiler is None:
        pytest.skip("no C++ compiler")
    folder = tmp_path_factory.mktemp("host")
    programs = {}
    for name in SKETCHES:
        programs[name] = folder / name
        sketch = (firmware / name / f"{name}.ino").as_posix()
        subprocess.run(
            [compiler, "-std=c++11", "-Wall", "-Wextra", "-Werror", "-DLIDARSPECTRA_HAS_EEPROM", f'-DSKETCH="{sketch}"',
             f"-I{HOST}", f"-I{firmware / name}", str(HOST / "host.cpp"), "-o", str(programs[name])],
            check=True,
        )  # fmt: skip
    return programs


def run(program: Path, milliseconds: int, script: str = "", *, starts: int = 0) -> bytes:
    answer = subprocess.run(
        [str(program), str(milliseconds), str(starts)],
        input=script.encode(),
        capture_output=True,
        check=True,
        timeout=60,
    )
    return answer.stdout


def driven(output: bytes, **wanted: object) -> tuple[list[Item], LineProtocolDriver]:
    driver = LineProtocolDriver(settings=wanted.get("settings"), period_s=1.0)  # type: ignore[arg-type]
    items = list(driver.connect(Moment(unix_s=0.0, monotonic_s=0.0)))
    for second, line in enumerate(LineSplitter().feed(output)):
        items += driver.receive(line + b"\n", Moment(unix_s=second, monotonic_s=second))
    return items, driver


def test_our_driver_understands_the_spectral_sketch(host_programs: dict[str, Path]) -> None:
    items, driver = driven(run(host_programs["spectral_sensor"], 5500))
    readings = [item for item in items if isinstance(item, Reading)]
    assert [reading.sequence for reading in readings] == [0, 1, 2, 3, 4]
    assert not [item for item in items if isinstance(item, Trouble)]
    # the sensor of the test counts 1000 (die + 1) + place in its die
    places = [UART_LETTERS.index(letter) % 6 for letter in "ABCDEFGHRISJTUVWKL"]
    assert np.array_equal(readings[0].counts, 1000 * (DIE_INDEX + 1) + np.array(places))
    assert (readings[0].gain, readings[0].integration_ms) == (16.0, 165.2)
    assert readings[0].temperatures_c == (30.0, 31.0, 32.0)
    assert readings[3].device_ms is not None
    assert abs(readings[3].device_ms - 4000) < 5
    # the last channel of its last die is saturated by the module's own value, and the one before is not a number
    assert readings[0].flags[CHANNEL_LABELS.index("535")] == FLAG_SATURATED
    assert np.isnan(readings[0].module_values[CHANNEL_LABELS.index("510")])
    assert any("said by header" in line for line in driver.describe())


def test_commands_are_obeyed_read_back_and_refused(host_programs: dict[str, Path]) -> None:
    script = (
        "1100 G=3\n1100 I=100\n1200 P=500\n1300 G=4\n1300 I=0\n1300 I=256\n1300 P=10\n1300 nonsense\n1300 G=\n1300 ?x\n"
    )
    output = run(host_programs["spectral_sensor"], 6000, script)
    answers = [body for line in output.split(b"\n") for body in frames_in(line) if body.startswith("A,")]
    assert answers[:3] == ["A,1,G,3", "A,1,I,100", "A,1,P,500"]
    assert len(answers) == 10
    assert all(answer.endswith(",ERROR") for answer in answers[3:])
    items, _ = driven(output, settings=SensorSettings(gain_code=3, integration_steps=100))
    readings = [item for item in items if isinstance(item, Reading)]
    assert (readings[0].gain, readings[-1].gain) == (16.0, 64.0)
    assert readings[-1].integration_ms == 280.0
    assert (
        sum(isinstance(item, Note) and "read back" in item.text for item in items) == 2
    )  # gain and time; not this period
    spacing = np.diff([reading.device_ms for reading in readings[2:]])  # type: ignore[arg-type]
    assert np.abs(spacing - 500).max() <= 10


def test_no_reading_mixes_two_settings(host_programs: dict[str, Path]) -> None:
    output = run(host_programs["spectral_sensor"], 5000, "1950 I=255\n")
    items, _ = driven(output)
    readings = [item for item in items if isinstance(item, Reading)]
    changed = next(reading for reading in readings if reading.integration_ms == 714.0)
    assert changed.device_ms is not None
    assert changed.device_ms >= 1950 + 3 * 714  # three integrations after the change


def test_a_sensor_that_is_pulled_is_told_and_set_again_when_it_is_back(host_programs: dict[str, Path]) -> None:
    output = run(host_programs["spectral_sensor"], 12000, "1100 G=3\n3300 pull\n6500 plug\n")
    items, _ = driven(output)
    told = [item.detail for item in items if isinstance(item, Trouble)]
    assert told[0] == "sensor does not answer"
    assert "sensor missing" in told
    readings = [item for item in items if isinstance(item, Reading)]
    assert readings[-1].gain == 64.0  # it lost its settings with its power, and has them again
    assert [reading.sequence for reading in readings] == list(range(len(readings)))


def test_the_header_comes_every_thirty_readings_and_starts_are_counted(host_programs: dict[str, Path]) -> None:
    output = run(host_programs["spectral_sensor"], 65000, starts=41)
    bodies = [body for line in output.split(b"\n") for body in frames_in(line)]
    headers = [i for i, body in enumerate(bodies) if body.startswith("H,1,as7265x,42,S,")]
    assert len(headers) == 3
    readings = [body for body in bodies if body.startswith("D,42,S,")]
    assert len(readings) == 64
    assert max(len(body) for body in bodies) < 1000  # what the driver takes for one frame


def test_our_driver_understands_the_cells_sketch(host_programs: dict[str, Path]) -> None:
    items, driver = driven(run(host_programs["cell_adc"], 4500, "1500 G=2\n"))
    cells = [item for item in items if isinstance(item, CellReading)]
    assert [cell.counts for cell in cells] == [(100.0, 200.0, 300.0)] * 4
    assert "reference_mV = 5000" in driver.describe()


def test_both_sketches_share_their_headers(firmware: Path) -> None:
    for name in ("line_protocol.h", "board.h"):
        first, second = ((firmware / sketch / name).read_bytes() for sketch in SKETCHES)
        assert first == second


@pytest.mark.slow
@pytest.mark.parametrize("name", SKETCHES)
def test_a_sketch_builds_for_the_uno_and_fits(name: str, firmware: Path, tmp_path: Path) -> None:
    if shutil.which("avr-g++") is None or not (CORE / "cores" / "arduino").is_dir():
        pytest.skip("no AVR compiler or no Arduino core (Debian: gcc-avr avr-libc arduino-core-avr)")
    source = tmp_path / "sketch.cpp"
    source.write_text(
        "#include <Arduino.h>\n" + (firmware / name / f"{name}.ino").read_text(encoding="utf-8"), encoding="utf-8"
    )
    folders = ("cores/arduino", "variants/standard", "libraries/Wire/src", "libraries/EEPROM/src")
    defines = ("F_CPU=16000000L", "ARDUINO=10819", "ARDUINO_AVR_UNO", "ARDUINO_ARCH_AVR", "DECIMAL_DIG=__DECIMAL_DIG__")
    common = ["-mmcu=atmega328p", "-Os", "-ffunction-sections", "-fdata-sections", f"-I{firmware / name}"]
    common += [f"-I{CORE / folder}" for folder in folders] + [f"-D{define}" for define in defines]
    objects: list[Path] = []
    for path in [source, *(CORE / "cores/arduino").glob("*.c*"), *(CORE / "libraries/Wire/src").rglob("*.c*")]:
        objects.append(tmp_path / f"{len(objects)}.o")
        is_c = path.suffix == ".c"
        own = ["-Wall", "-Wextra", "-Werror"] if path == source else ["-w"]
        language = ["-std=gnu11"] if is_c else ["-std=gnu++11", "-fno-exceptions", "-fno-threadsafe-statics"]
        compiler = "avr-gcc" if is_c else "avr-g++"
        subprocess.run([compiler, *common, *own, *language, "-c", str(path), "-o", str(objects[-1])], check=True)
    program = tmp_path / "sketch.elf"
    subprocess.run(
        ["avr-g++", "-mmcu=atmega328p", "-Os", "-Wl,--gc-sections", *map(str, objects), "-o", str(program), "-lm"],
        check=True,
    )
    told = subprocess.run(["avr-size", str(program)], check=True, capture_output=True, text=True).stdout
    text, data, bss = (int(word) for word in told.splitlines()[1].split()[:3])
    assert text + data < UNO_FLASH_BYTES
    assert data + bss + STACK_BYTES < UNO_RAM_BYTES
