"""What the columns of a log mean, by their names: time, sensor, channel, setting, cell."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import ASCENDING_LETTERS, CHANNEL_COUNT, CHANNEL_LABELS, channel_letter
from lidarspectra.hardware.sensor.log_times import PER_SECOND

Family = Literal["count", "module", "flag", "plain", "irradiance", "derived"]
"""Whole counts, the module's values, flags, either of the first two; irradiances, and what else is computed of them."""

MIN_CHANNELS = 6  # of a sensor: one die
TIME_NAMES = (
    "unix_s", "unix", "epoch", "timestamp", "time", "utc", "date", "datetime", "_time", "last_changed", "last_updated",
    "ts", "created_at", "zeitstempel", "zeit", "datum", "time_s", "seconds", "elapsed", "millis", "time_ms", "ms",
)  # fmt: skip
DAY_NAMES = ("date", "datum")  # beside one of `CLOCK_NAMES`
CLOCK_NAMES = ("time", "uhrzeit", "zeit")
SENSOR_NAMES = (
    "sensor", "sensor_id", "sensorid", "sensor_name", "node", "node_id", "device", "device_id", "board", "mac",
    "address", "addr", "knoten", "gerät", "geraet", "id", "entity",
)  # fmt: skip
LABEL_NAMES = ("label", "loc", "location", "position", "place")
_FAMILIES: dict[str, Family] = {
    "count": "count", "counts": "count", "raw": "count", "module": "module", "cal": "module", "calibrated": "module",
    "flag": "flag", "e": "irradiance", "se": "derived", "sd": "derived", "u": "derived", "su": "derived",
    "basic": "derived", "basic_se": "derived", "channel": "plain", "ch": "plain", "wavelength": "plain",
}  # fmt: skip
_OF_UNIT: dict[str, Family] = {
    "count": "count", "counts": "count", "uW/cm2": "module", "W/m2/nm": "irradiance",
}  # fmt: skip
_PLAIN_LETTERS = str.maketrans({"µ": "u", "μ": "u", "²": "2", "^": None, " ": None})
_SERIES = re.compile(r"(?P<field>[^{]*?)\s*\{(?P<labels>.*)\}")
_LABEL = re.compile(r"\s*\"?(?P<key>[\w.]+)\"?\s*[=:]\s*\"?(?P<value>[^\",]*)\"?\s*(?:,|$)")
_OF_SENSOR = re.compile(r"(?P<sensor>.*[^\s_.:/-])[\s_.:/-]+(?P<channel>w\d{1,2}|[A-LR-W]|[4-9]\d\d)(?:\s*_?nm)?", re.I)
_NM_FIRST = re.compile(r"(?P<channel>[4-9]\d\d)\s*_?nm[\s_.:/-]+(?P<sensor>.+)", re.I)
_FAMILY_LAST = re.compile(
    r"(?P<sensor>.*?)[\s_.:/-]*(?<![A-Za-z])(?P<family>counts?|raw|cal|calibrated|module|channel|ch)$", re.I
)
MEANINGS = "time, time_ms, sensor, label, a channel (410 ... 940 or its letter), gain, integration_ms, cell_1, ignore"


@dataclass(frozen=True, kw_only=True)
class ChannelColumn:
    """A column of one channel.

    Parameters
    ----------
    sensor : str
        '' where the name says none.
    family : Family
    letter : str
        Of the channel.
    """

    sensor: str
    family: Family
    letter: str


def channel_column(name: str) -> ChannelColumn | None:
    """The channel that a column's name means, and the sensor if it says one.

    Known are 410, '410 nm', A, wavelength1 (the shortest), count_410, s1_410, s1_w1, 's1 A', 'desk_count_410nm', and
    names with labels as Grafana writes them: '410nm {sensor="desk"}', 'value {channel="A", node="3"}'. A unit behind a
    name says what it holds: (counts), (µW/cm²), which are module values, or (W/m²/nm). None for any other, and for
    names of times: 'unix_s' is no channel S of a sensor 'unix'.
    """
    if name.strip().lower() in TIME_NAMES:
        return None
    bare, family = _without_unit(name.strip())
    if family is not None:
        column = channel_column(bare)
        return column if column is None or column.family != "plain" else replace(column, family=family)
    labelled = _SERIES.fullmatch(name.strip())
    if labelled is not None:
        return _of_labels(labelled["field"], labelled["labels"])
    prefix, _, last = name.strip().lower().rpartition("_")
    letter = _channel(last)
    if letter is not None and prefix in _FAMILIES:
        return ChannelColumn(sensor="", family=_FAMILIES[prefix], letter=letter)
    letter = channel_letter(name)
    if letter is None and name.strip().lower().startswith("wavelength"):
        letter = _channel(name.strip())
    if letter is not None:
        word = re.match(r"[A-Za-z]+(?=[\s_:-])", name.strip())
        return ChannelColumn(sensor="", family=_FAMILIES.get(word[0].lower() if word else "", "plain"), letter=letter)
    found = _OF_SENSOR.fullmatch(name.strip()) or _NM_FIRST.fullmatch(name.strip())
    letter = _channel(found["channel"]) if found is not None else None
    if found is None or letter is None:
        return None
    sensor = re.sub(
        rf"(?<=[^\s_.:/-])[\s_.:/-]+{letter}$", "", found["sensor"], flags=re.IGNORECASE
    )  # A as well as 410
    last_word = _FAMILY_LAST.fullmatch(sensor)
    if last_word is not None:
        return ChannelColumn(sensor=last_word["sensor"], family=_FAMILIES[last_word["family"].lower()], letter=letter)
    return ChannelColumn(sensor=sensor, family="plain", letter=letter)


def _without_unit(name: str) -> tuple[str, Family | None]:
    """A channel's name without the unit behind it, and what the unit says; None where it ends in none."""
    start = max(name.rfind("("), name.rfind("["))
    if start < 0 or name[-1] not in ")]" or any(mark in name[:start] for mark in "()[]"):
        return name, None
    return name[:start].strip(), _OF_UNIT.get(name[start + 1 : -1].translate(_PLAIN_LETTERS))


def _of_labels(field: str, text: str) -> ChannelColumn | None:
    """The channel of a series that is named by labels, as 'field {key="value", ...}'."""
    labels = {found["key"].lower(): found["value"].strip() for found in _LABEL.finditer(text)}
    plain = channel_column(field) if field else None
    letter = plain.letter if plain is not None else None
    for key in ("channel", "wavelength", "wavelength_nm", "band", "nm"):
        if letter is None and key in labels:
            letter = _channel(labels.pop(key))
    if letter is None:
        return None
    named = [labels[key] for key in (*SENSOR_NAMES, "entity_id", "topic", "host") if labels.get(key)]
    others = [value for key, value in labels.items() if not key.startswith("__") and value]
    sensor = named[0] if named else "/".join(others)
    return ChannelColumn(sensor=sensor, family=plain.family if plain is not None else "plain", letter=letter)


def _channel(word: str) -> str | None:
    """Letter of a channel by its number counted by wavelength (w1, wavelength1 ...), its letter or its wavelength."""
    numbered = re.fullmatch(r"w(?:avelength)?(\d{1,2})", word, re.IGNORECASE)
    if numbered is not None:
        number = int(numbered[1])
        return ASCENDING_LETTERS[number - 1] if 1 <= number <= CHANNEL_COUNT else None
    return channel_letter(word)


def channels_of(names: Sequence[str]) -> dict[str, dict[Family, dict[str, str]]]:
    """Columns by sensor, family and channel letter; a sensor has six channels or more in one family.

    Raises
    ------
    ReadingError
        If a channel comes twice.
    """
    found: dict[str, dict[Family, dict[str, str]]] = {}
    for name in names:
        column = channel_column(name)
        if column is None:
            continue
        letters = found.setdefault(column.sensor, {}).setdefault(column.family, {})
        if column.letter in letters and column.family != "derived":
            raise ReadingError(
                expected="each channel of a sensor once",
                found=f"'{letters[column.letter]}' and '{name}'",
                where="the log's header",
                todo="Leave one of them out with --columns, as '" + name + "=ignore'.",
            )
        letters[column.letter] = name
    wide = {
        sensor: {family: letters for family, letters in families.items() if len(letters) >= MIN_CHANNELS}
        for sensor, families in found.items()
    }
    return {
        sensor: families
        for sensor, families in wide.items()
        if {"count", "module", "plain", "irradiance"} & set(families)
    }


def time_column(names: Sequence[str]) -> tuple[str, str | None] | None:
    """The column of times, and the unit that its name states."""
    for wanted in TIME_NAMES:
        for name in names:
            base, unit = _base(name)
            if base == wanted:
                unit = {"millis": "ms", "time_ms": "ms", "ms": "ms", "time_s": "s", "seconds": "s"}.get(base, unit)
                return name, unit
    return None


def sensor_column(names: Sequence[str]) -> str | None:
    """The column that names the sensor."""
    return next((name for wanted in SENSOR_NAMES for name in names if _base(name)[0].replace(" ", "_") == wanted), None)


def label_column(names: Sequence[str]) -> str | None:
    """The column that names the place of a person."""
    return next((name for wanted in LABEL_NAMES for name in names if name.lower() == wanted), None)


def _base(name: str) -> tuple[str, str | None]:
    """A name in small letters without its unit, and the unit: 'Time (ms)' is 'time' and 'ms'."""
    found = re.fullmatch(r"(?P<base>.*?)[\s_]*[(\[](?P<unit>.*)[)\]]", name.strip())
    if found is None:
        return name.strip().lower(), None
    unit = found["unit"].strip().lower()
    return found["base"].strip().lower(), unit if unit in PER_SECOND else None


def columns_by_user(text: str) -> dict[str, str]:
    """Meanings of columns from what the user gave as --columns: 'Zeit=time,Knoten=sensor,Kanal 1=410'.

    Raises
    ------
    ReadingError
        If a part has no '=', or says no known meaning.
    """
    found: dict[str, str] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, _, meaning = (word.strip() for word in part.rpartition("="))
        known = {*TIME_NAMES, *SENSOR_NAMES, *LABEL_NAMES, "gain", "integration_ms", "ignore", "angle_deg",
                 "cell_temperature_c"}  # fmt: skip
        is_known = meaning in known or channel_column(meaning) is not None or re.fullmatch(r"cell_\d+", meaning)
        if not name or not is_known:
            raise ReadingError(
                expected=f"NAME=MEANING with one of {MEANINGS}",
                found=f"'{part}'",
                where="--columns",
                todo=f"Channels are {', '.join(CHANNEL_LABELS)} nm.",
            )
        found[name] = meaning
    return found
