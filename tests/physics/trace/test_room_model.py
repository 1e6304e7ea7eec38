"""A room made in Python: the first example of docs/api.md runs as it stands, and its light has closed forms."""

import contextlib
import io
import re
from pathlib import Path

import numpy as np
import pytest

import lidarspectra as ls


def corner_factor(a: float, b: float) -> float:
    """Configuration factor of a rectangle of sides a and b, in distances, from a point under its corner, facing it.

    Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-3.
    """
    x, y = np.sqrt(1 + a * a), np.sqrt(1 + b * b)
    return float((a / x * np.arctan(b / x) + b / y * np.arctan(a / y)) / (2 * np.pi))


def test_the_first_example_of_the_page_runs_as_it_stands_and_its_room_keeps_its_light(project: Path) -> None:
    page = (project / "docs" / "api.md").read_text(encoding="utf-8")
    code = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)[0]
    assert len([line for line in code.splitlines() if line.strip()]) <= 10
    names: dict[str, object] = {}
    with contextlib.redirect_stdout(io.StringIO()) as told:
        exec(code, names)
    assert re.fullmatch(r"35 points, mean \d+ lx, standard error \d\.\d lx\n", told.getvalue())
    light, lamp = names["light"], names["lamp"]
    assert isinstance(lamp, ls.Lamp)
    # The least that any point may have is the panel's own light, by its configuration factor.
    x, y = (light[axis].to_numpy() for axis in "xy")  # type: ignore[index]
    lux = light["illuminance"].to_numpy()  # type: ignore[index]
    direct = np.array([direct_lux(a - 2.0, b - 1.5, 2.6 - 0.75) for a, b in zip(x, y, strict=True)])
    assert (lux > direct).all()
    assert lux.mean() < 3400 / 12 * 2  # and no more than twice the flux on the floor's area


def direct_lux(x: float, y: float, height: float) -> float:
    """Light of a panel of 0.6 m and 3400 lm at (x, y) from the point below its middle [lx]."""

    def corner(u: float, v: float) -> float:
        return float(np.sign(u) * np.sign(v) * corner_factor(abs(u) / height, abs(v) / height))

    factor = corner(x + 0.3, y + 0.3) - corner(x + 0.3, y - 0.3) - corner(x - 0.3, y + 0.3) + corner(x - 0.3, y - 0.3)
    return 3400 / 0.36 * factor


def test_a_black_box_has_the_direct_light_of_its_panel() -> None:
    room = ls.RoomModel.from_box(4.0, 3.0, 2.7, floor=0.0, walls=0.0, ceiling=0.0)
    lamp = ls.make_lamp("panel", (2.0, 1.5, 2.6), size=0.6, spectrum="LED-B3", luminous_flux_lm=3400)
    desks = room.grid(0.75, spacing=0.5)
    light = room.light([lamp], desks, accuracy="low", noise="fine", seed=3)
    wanted = [direct_lux(x - 2.0, y - 1.5, 2.6 - 0.75) for x, y, _ in desks.positions]
    # The sensor's bands end at 410 and 760 nm; the panel is cut into parts of a twentieth of its distance. A point has
    # a standard error of .4 %, and one of the 35 may be five of them off; their mean has .07 %.
    np.testing.assert_allclose(light["illuminance"], wanted, rtol=0.02)
    assert float(np.mean(light["illuminance"] / wanted)) == pytest.approx(1.0, abs=0.004)


def test_a_closed_box_of_one_reflectance_keeps_its_energy() -> None:
    room = ls.RoomModel.from_box(3.0, 3.0, 3.0, floor=0.5, walls=0.5, ceiling=0.5)
    bulb = ls.make_lamp("bulb", (1.5, 1.5, 1.5), spectrum="LED-B3", luminous_flux_lm=1000)
    ticks = (np.arange(8) + 0.5) * 3.0 / 8
    u, v = (each.ravel() for each in np.meshgrid(ticks, ticks))
    positions, normals = [], []
    for axis in range(3):
        for wall, inward in ((1e-3, 1.0), (3.0 - 1e-3, -1.0)):
            places = np.full((u.size, 3), wall)
            places[:, (axis + 1) % 3], places[:, (axis + 2) % 3] = u, v
            positions.append(places)
            normals.append(np.tile(inward * np.eye(3)[axis], (u.size, 1)))
    points = ls.SensorPoints(positions=np.vstack(positions), normals=np.vstack(normals))
    light = room.light([bulb], points, accuracy="ultra", seed=4)
    wanted = 1000 / (6 * 9 * (1 - 0.5))  # flux over area times what is absorbed, the mean over all walls [lx]
    # The midpoint rule over 64 points a wall is within .3 % for a bulb at 1.5 m; the noise of the mean is below 1 %.
    assert float(light["illuminance"].mean()) == pytest.approx(wanted, rel=0.012)


def test_the_room_is_traced_by_plain_rtrace_too_and_by_each_point_s_own_light() -> None:
    model = ls.RoomModel.from_box(2.0, 2.0, 2.0, floor=0.5, walls=0.5, ceiling=0.5)
    lamp = ls.make_lamp("panel", (1.0, 1.0, 1.9), size=0.4, spectrum="LED-B3", luminous_flux_lm=1000)
    points = model.grid(0.5, count=4)
    adaptive = model.light([lamp], points, accuracy="low", noise_of="point")
    plain = model.light([lamp], points, accuracy="low", method="rtrace")
    assert (adaptive.attrs["noise_of"], plain.attrs["method"]) == ("point", "rtrace")
    error = np.hypot(adaptive["illuminance_se"], plain["illuminance_se"])
    assert (np.abs(adaptive["illuminance"] - plain["illuminance"]) < 4.0 * error).all()
    with pytest.raises(ls.ArgumentError, match="noise_of"):
        model.trace([lamp], points, method="rtrace", noise_of="point")


def test_surfaces_are_polygons_and_meshes_with_numbers_names_and_spectra() -> None:
    square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    by_number = ls.Surface(corners=square, reflectance=0.3, name="plate")
    by_name = ls.Surface(corners=square, reflectance="white-wall")
    mesh = ls.Surface(corners=square, faces=[(0, 1, 2)], reflectance=0.3)
    model = ls.RoomModel(surfaces=[by_number, by_name, mesh])
    assert len(model.scan.faces) == 5
    assert model.materials.materials[1].source == "builtin:white-wall"
    np.testing.assert_array_equal(model.materials.face_material, [0, 0, 1, 1, 2])
    assert "plate" in repr(model)
    assert "0.30" in repr(by_number)


@pytest.mark.parametrize(
    ("corners", "words"),
    [
        ([(0, 0, 0), (1, 0, 0)], "three or more corners"),
        ([(0, 0, 0), (1, 0, 0), (1, 1, 0.2), (0, 1, 0)], "a flat polygon"),
        ([(0, 0, 0), (2, 0, 0), (0.5, 0.5, 0), (0, 2, 0)], "a convex polygon"),
        ([(0, 0), (1, 0), (1, 1)], "shape"),
        ("square", "numbers"),
    ],
)
def test_corners_that_span_no_plane_are_refused(corners: object, words: str) -> None:
    with pytest.raises(ls.LidarSpectraError, match=words):
        ls.Surface(corners=corners, reflectance=0.3)  # type: ignore[arg-type]


def test_what_is_no_lamp_no_surface_and_no_point_is_told_by_name() -> None:
    room = ls.RoomModel.from_box(3.0, 3.0, 3.0)
    lamp = ls.make_lamp("bulb", (1.5, 1.5, 1.5), spectrum="A", luminous_flux_lm=1000)
    points = ls.SensorPoints(positions=[(1, 1, 1)])
    with pytest.raises(ls.ArgumentError, match=r"lamps\[0\]: expected a Lamp, found a dict.* Make each with make_lamp"):
        room.light([{"shape": "bulb"}], points)  # type: ignore[list-item]
    with pytest.raises(ls.ArgumentError, match=r"lamps: expected a list of Lamp, found a single Lamp"):
        room.light(lamp, points)  # type: ignore[arg-type]
    with pytest.raises(ls.ArgumentError, match="points: expected a SensorPoints, found a list"):
        room.light([lamp], [(1, 1, 1)])  # type: ignore[arg-type]
    with pytest.raises(ls.LidarSpectraError, match="two lamps 'lamp'"):
        room.light([lamp, lamp], points)
    with pytest.raises(ls.ArgumentError, match=r"a number from 0 to 0\.99"):
        ls.Surface(corners=[(0, 0, 0), (1, 0, 0), (1, 1, 0)], reflectance=None)  # type: ignore[arg-type]
    with pytest.raises(ls.ArgumentError, match="accuracy: expected one of 'low'"):
        room.light([lamp], points, accuracy="best")  # type: ignore[arg-type]
