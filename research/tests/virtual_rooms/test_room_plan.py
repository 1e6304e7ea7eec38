from pathlib import Path

import pytest

from lidarspectra.errors import PlanError
from research.virtual_rooms.room_plan import RoomPlan, parse_plan, read_plan


def test_a_plan_has_the_spectrum_of_each_material_in_its_order(plan: RoomPlan) -> None:
    assert [material.name for material in plan.materials] == ["grey", "white", "red"]
    assert plan.materials[plan.material_number("white")].reflectance.values == pytest.approx(0.8)
    assert plan.materials[2].source == "reflectances:red"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("texture_px = 256", "texture_px = 256\ntextur = 1", "camera.textur: unknown key"),
        ('name = "cell"\nref', 'name = "cell"\ncolour = 3\nref', "colour: unknown key"),
        ('leg_material = "grey"', 'leg_material = "gold"', "no [[materials]] has the name 'gold'"),
        ('accents = { north = "white" }', 'accents = { up = "white" }', "rooms.1.accents.up"),
        ('name = "red"', 'name = "white"', "two materials have the same name"),
        ('lamp = "panel"', 'lamp = "sun"', "lit face of 'sun'"),
        ("high = [1.6, 1.2, 1.4]", "high = [1.6, 0.0, 1.4]", "'low' must be below 'high'"),
        ("leg = 0.08", "leg = -0.08", "parts.1.table.leg"),
        ('shape = "box"', 'shape = "blob"', "parts.2"),
        ("hole_share = 0.02", "hole_share = nan", "phone.hole_share"),
        ("[camera]", "[camera", "valid TOML"),
    ],
)
def test_each_fault_of_a_plan_is_named_with_its_key(plan_text: str, old: str, new: str, told: str) -> None:
    assert old in plan_text
    with pytest.raises(PlanError) as caught:
        parse_plan(plan_text.replace(old, new, 1), where="plan.toml")
    assert told in str(caught.value)
    assert str(caught.value).startswith("plan.toml: ")


def test_a_spectrum_that_the_table_lacks_is_named_with_those_it_has(plan_file: Path, tmp_path: Path) -> None:
    (tmp_path / "reflectances.csv").write_bytes((plan_file.parent / "reflectances.csv").read_bytes())
    path = tmp_path / "plan.toml"
    path.write_text(plan_file.read_text().replace('reflectance = "red"', 'reflectance = "crimson"'), encoding="utf-8")
    with pytest.raises(PlanError, match=r"crimson.*It has grey, white, red"):
        read_plan(path)


def test_a_missing_plan_and_one_in_another_encoding_are_refused(tmp_path: Path) -> None:
    with pytest.raises(PlanError, match="readable plan"):
        read_plan(tmp_path / "plan.toml")
    (tmp_path / "plan.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(PlanError, match="readable plan"):
        read_plan(tmp_path / "plan.toml")
