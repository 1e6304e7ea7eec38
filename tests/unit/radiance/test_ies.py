"""Candela files: every symmetry unfolds to the same luminaire, and its flux is the integral."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import dblquad

from lidarspectra.config import LampSection
from lidarspectra.errors import LampError
from lidarspectra.lamps.ies import CandelaTable, read_ies, read_ies_text
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps

HEAD = "IESNA:LM-63-2002\n[TEST] none\n[LUMCAT] TEST 1\nTILT=NONE\n"


def ies_text(
    horizontal: np.ndarray,
    vertical: np.ndarray,
    candela: np.ndarray,
    *,
    head: str = HEAD,
    kind: int = 1,
    unit: int = 2,
    opening: tuple[float, float, float] = (0.3, 1.2, 0.0),
    multiplier: float = 1.0,
) -> str:
    rows = "\n".join(" ".join(f"{value:.6g}" for value in row) for row in candela)
    size = " ".join(map(str, opening))
    return (
        f"{head}1 -1 {multiplier} {len(vertical)} {len(horizontal)} {kind} {unit} {size}\n"
        f"1.0 1.0 36\n{' '.join(map(str, vertical))}\n{' '.join(map(str, horizontal))}\n{rows}\n"
    )


def shape(horizontal_deg: np.ndarray, vertical_deg: np.ndarray) -> np.ndarray:
    """A luminaire that is the same in all four quadrants, brighter along its length."""
    phi, theta = np.radians(horizontal_deg)[:, None], np.radians(vertical_deg)[None, :]
    return 500.0 * np.cos(theta).clip(0) * (1.0 + 0.5 * np.cos(2 * phi) * np.sin(theta))


THETA = np.arange(0.0, 91.0, 10.0)


@pytest.mark.parametrize(
    "phi",
    [
        np.arange(0.0, 91.0, 15.0),
        np.arange(0.0, 181.0, 15.0),
        np.arange(90.0, 271.0, 15.0),
        np.arange(0.0, 361.0, 15.0),
        np.arange(0.0, 360.0, 15.0),
    ],
)
def test_every_symmetry_unfolds_to_the_whole_circle(phi: np.ndarray) -> None:
    table = read_ies(ies_text(phi, THETA, shape(phi, THETA)), where="test")
    np.testing.assert_array_equal(table.horizontal_deg, np.arange(0.0, 361.0, 15.0))
    expected = shape(table.horizontal_deg, THETA)
    np.testing.assert_allclose(table.candela[:, : len(THETA)], expected, rtol=1e-5, atol=1e-6)


def test_one_plane_is_an_axial_luminaire() -> None:
    table = read_ies(ies_text(np.zeros(1), THETA, 100.0 * np.cos(np.radians(THETA))[None]), where="test")
    assert table.is_axial
    np.testing.assert_allclose(table.at([0.0, 45.0, 120.0], [0.0, 77.0, 0.0])[::2], [100.0, 0.0], atol=1e-9)
    # π I0 for a cosine; linear between steps of 10 degrees it bulges by up to 0.4 %.
    assert table.luminous_flux_lm() == pytest.approx(100 * np.pi, rel=4e-3)


def test_the_flux_is_the_integral_of_the_interpolated_table() -> None:
    generator = np.random.default_rng(1)
    table = CandelaTable(
        vertical_deg=[0, 30, 50, 110, 180],
        horizontal_deg=[0, 100, 250, 360],
        candela=generator.uniform(10, 100, (4, 5)),
        opening_m=(0.1,),
    )
    cells = [
        dblquad(
            lambda theta, phi: float(table.at([theta], [phi])[0]) * np.sin(np.radians(theta)),
            *(left + 1e-9, right - 1e-9, low, high),
        )[0]
        for left, right in ((0, 100), (100, 250), (250, 360))
        for low, high in ((0, 30), (30, 50), (50, 110), (110, 180))
    ]
    assert table.luminous_flux_lm() == pytest.approx(sum(cells) * np.radians(1.0) ** 2, rel=1e-6)
    halves = table.luminous_flux_lm(upward=True) + table.luminous_flux_lm(upward=False)
    assert halves == pytest.approx(table.luminous_flux_lm(), rel=1e-12)


def test_feet_multipliers_and_tilt_tables_are_taken_in() -> None:
    text = ies_text(
        np.zeros(1), THETA, np.full((1, THETA.size), 10.0),
        head="IESNA91\nTILT=INCLUDE\n1\n3\n0 45 90\n1 0.9 0.8\n", unit=1, opening=(1.0, 2.0, 0.0), multiplier=2.5,
    )  # fmt: skip
    table = read_ies(text, where="test")
    assert table.candela[0, 0] == 25.0
    np.testing.assert_allclose(table.opening_m, (2 * 0.3048, 0.3048))
    assert table.lamps_lm is None  # absolute photometry, -1 lm a lamp


def test_a_nought_for_future_use_does_not_put_the_light_out() -> None:
    text = ies_text(np.zeros(1), THETA, shape(np.zeros(1), THETA))
    given, nought = (read_ies(each, where="test") for each in (text, text.replace("1.0 1.0 36", "1.0 0 36")))
    np.testing.assert_array_equal(nought.candela, given.candela)


def test_the_lamps_lumens_are_of_all_lamps_on_their_ballast_and_not_of_the_candelas_multiplier() -> None:
    text = ies_text(np.zeros(1), THETA, np.ones((1, THETA.size)), multiplier=2.5)
    of_two = text.replace("1 -1 2.5", "2 900 2.5").replace("1.0 1.0 36", "0.9 1.0 36")
    assert read_ies(of_two, where="test").lamps_lm == pytest.approx(2 * 900 * 0.9)


def test_how_a_file_of_2019_was_made_is_no_factor() -> None:
    text = ies_text(np.zeros(1), THETA, np.full((1, THETA.size), 10.0)).replace("1.0 1.0 36", "0.9 1.10100 36")
    assert read_ies(text, where="test").candela[0, 0] == pytest.approx(10.0 * 0.9 * 1.101)
    of_2019 = text.replace("IESNA:LM-63-2002", "IES:LM-63-2019")
    assert read_ies(of_2019, where="test").candela[0, 0] == pytest.approx(10.0 * 0.9)


def test_decimal_commas_do_not_shift_the_table() -> None:
    text = ies_text(np.zeros(1), THETA, np.full((1, THETA.size), 10.5))
    delimited = text.replace(" ", ", ") + "\x1a\n"  # with DOS's end of file
    assert read_ies(delimited, where="test").candela[0, 0] == 10.5
    with pytest.raises(LampError, match=r"10 more numbers than 1 x 10 candela.*with points"):
        read_ies(text.replace("10.5", "10,5"), where="test")


@pytest.mark.parametrize(
    ("opening", "expected"),
    [
        ((0.3, 1.2, 0.0), (1.2, 0.3)),
        ((-0.2, -0.2, 0.0), (0.2,)),
        ((-0.2, 0.0, 0.1), (0.2,)),
        ((0, 0, 0), (0.1,)),
        ((-0.03, 1.2, -0.03), (1.2, 0.03)),  # a tube along, LM-63-2002
        ((1.2, -0.03, -0.03), (0.03, 1.2)),  # and across
        ((0.0, -1.2, 0.03), (1.2, 0.03)),  # along, LM-63-1995
        ((0.0, 1.2, 0.0), (1.2, 0.026)),
        ((0.6, 0.0, 0.1), (0.1, 0.6)),  # upright, facing along
        ((-0.3, -1.2, 0.0), (1.2 * np.sqrt(np.pi) / 2, 0.3 * np.sqrt(np.pi) / 2)),  # an ellipse
    ],
)
def test_openings_are_rectangles_discs_or_small(opening: tuple[float, ...], expected: tuple[float, ...]) -> None:
    read = read_ies(ies_text(np.zeros(1), THETA, np.ones((1, THETA.size)), opening=opening), where="t")
    assert read.opening_m == pytest.approx(expected)


GOOD = ies_text(np.zeros(1), THETA, np.ones((1, THETA.size)))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "no candela file",
        GOOD[:-8],  # cut short
        GOOD.replace("TILT=NONE", "TILT=other.tlt"),
        GOOD.replace(" 1 2 0.3", " 2 2 0.3"),  # type B
        GOOD.replace(" 1 2 0.3", " 1 7 0.3"),  # unit 7
        GOOD.replace("0.0 10.0 20.0", "0.0 20.0 10.0"),
        GOOD.replace("1 -1 1.0 10", "1 -1 1.0 1e9"),
        GOOD.replace("1 -1 1.0 10", "1 -1 nan 10"),
        GOOD.replace("1 -1 1.0 10", "1 -1 0 10"),
        GOOD.replace("1 -1 1.0 10", "1 -1 x 10"),
        ies_text(np.array([10.0, 50.0]), THETA, np.ones((2, THETA.size))),
    ],
)
def test_what_is_no_type_c_table_is_refused_with_its_name(text: str) -> None:
    with pytest.raises(LampError, match=r"lamp\.ies"):
        read_ies(text, where="lamp.ies")


def test_umlauts_of_any_encoding_do_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "lamp.ies"
    path.write_bytes(GOOD.replace("TEST 1", "Lämpchen").encode("latin-1"))
    assert read_ies(read_ies_text(path), where="lamp.ies").name == "Lämpchen"
    with pytest.raises(LampError, match="missing"):
        read_ies_text(tmp_path / "missing.ies")


@pytest.mark.parametrize("color", [{"spectrum": "LED-B3"}, {"cct_k": 4000.0}])
def test_a_luminaire_without_stated_flux_has_its_files_lumens(tmp_path: Path, color: dict[str, Any]) -> None:
    (tmp_path / "lamp.ies").write_text(GOOD, encoding="utf-8")
    section = LampSection(name="one", shape="ies", center=(0, 0, 2), file="lamp.ies", **color)
    (lamp,) = resolve_lamps([section], tmp_path)
    assert luminous_flux_lm(lamp.flux) == pytest.approx(2 * np.pi, rel=1e-4)  # 1 cd over half the sphere
    assert lamp.size == (1.2, 0.3)
