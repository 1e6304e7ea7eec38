"""Numbers out of payloads, as Home Assistant's templates would give them."""

import math

import pytest

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.incoming.payloads import value_reader


@pytest.mark.parametrize(
    ("template", "payload", "number"),
    [
        (None, " 312.5\n", 312.5),
        (None, "ON", 1.0),
        (None, "off", 0.0),
        ("{{ value }}", "7", 7.0),
        ("{{ value | float * 0.1 }}", "312", 31.2),
        ("{{value_json.illuminance}}", '{"illuminance": 412, "battery": 80}', 412.0),
        ("{{ value_json.light['max lux'] | float(0) | round(1) }}", '{"light": {"max lux": "12.5"}}', 12.5),
        ("{{ value_json.channels[2] }}", '{"channels": [1, 2, 3]}', 3.0),
        ("{{ value_json['brightness'] / 255 }}", '{"brightness": 51}', 0.2),
        ("{{ value_json.celsius * 2 + 3 - 1e1 }}", '{"celsius": 5}', 3.0),
        ("{{ value | float + 3 * 2 - 8 / 4 }}", "1", 5.0),  # as Jinja does, not from left to right
        ("{{ value_json.state }}", '{"state": "ON"}', 1.0),
        ("{{ value_json.state }}", '{"state": true}', 1.0),
    ],
)
def test_a_template_gives_its_number(template: str | None, payload: str, number: float) -> None:
    assert value_reader(template)(payload) == pytest.approx(number)


@pytest.mark.parametrize("payload", ["unavailable", "unknown", "", "None", '{"lux": null}', '{"lux": "unavailable"}'])
def test_no_reading_is_no_number(payload: str) -> None:
    assert math.isnan(value_reader("{{ value_json.lux }}")(payload))


@pytest.mark.parametrize("payload", ["{", "[1]", "5", '{"other": 3}', '{"lux": "bright"}', '{"lux": {}}'])
def test_another_payload_is_an_error(payload: str) -> None:
    with pytest.raises(ValueError):
        value_reader("{{ value_json.lux }}")(payload)


@pytest.mark.parametrize(
    "template",
    ["", "lux", "{{ states('sensor.x') }}", "{{ value.x }}", "{{ value_json.a | log }}", "{% if 1 %}2{% endif %}"],
)
def test_a_template_that_is_not_known_is_refused(template: str) -> None:
    with pytest.raises(ReadingError, match=r"value_json\.illuminance"):
        value_reader(template)
