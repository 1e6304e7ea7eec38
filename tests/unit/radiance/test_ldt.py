"""EULUMDAT files: the luminaire comes out as it went in, turned by a quarter and in candela."""

from pathlib import Path

import numpy as np
import pytest
from pyldt import Ldt, LdtHeader, LdtWriter

from lidarspectra.config import LampSection
from lidarspectra.errors import LampError
from lidarspectra.lamps.ies import read_ies, read_ies_text
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.lamps.ldt import ies_text_of_ldt
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps

PLANES = np.arange(0.0, 360.0, 15.0)
ANGLES = np.arange(0.0, 91.0, 5.0)
LUMENS = 3000.0


def per_klm(c_deg: np.ndarray, gamma_deg: np.ndarray, symmetry: int) -> np.ndarray:
    """A luminaire [cd/klm] that has just one symmetry; brighter across (C0) than along (C90)."""
    c, gamma = np.radians(c_deg)[:, None], np.radians(gamma_deg)[None, :]
    sides = {
        0: np.cos(c) + np.sin(2 * c),  # none
        1: 0.0 * c,  # the same all around
        2: np.cos(c),  # C and -C
        3: np.sin(c),  # C and 180° - C
        4: np.cos(2 * c),  # both
    }[symmetry]
    return np.asarray(300.0 * np.cos(gamma) * (1.0 + 0.3 * sides * np.sin(gamma)))


def write_ldt(path: Path, symmetry: int, **changes: object) -> Path:
    header = LdtHeader(
        company="Ours", ityp=2, isym=symmetry, mc=PLANES.size, dc=15.0, ng=ANGLES.size, dg=5.0,
        luminaire_name="Größe 1", length=1200.0, width=300.0, length_lum_area=1180.0, width_lum_area=280.0,
        n_sets=1, num_lamps=[1],
        lamp_types=["LED"], lamp_flux=[LUMENS], lamp_cct=["4000"], lamp_cri=["80"], lamp_watt=[25.0],
        direct_ratios=[0.0] * 10, c_angles=PLANES.tolist(), g_angles=ANGLES.tolist(),
    )  # fmt: skip
    for name, value in changes.items():
        setattr(header, name, value)
    table = per_klm(np.array(header.c_angles), ANGLES, symmetry)
    LdtWriter.write(Ldt(header=header, intensities=table.tolist()), path, overwrite=True)
    return path


@pytest.mark.parametrize("symmetry", range(5))
def test_every_symmetry_gives_the_luminaire_turned_from_across_to_along(symmetry: int, tmp_path: Path) -> None:
    table = read_ies(ies_text_of_ldt(write_ldt(tmp_path / "lamp.ldt", symmetry)), where="test")
    c, gamma = (grid.ravel() for grid in np.meshgrid(PLANES, ANGLES[:-1]))
    expected = [per_klm(np.array([a]), np.array([b]), symmetry)[0, 0] * LUMENS / 1000.0 for a, b in zip(c, gamma)]  # noqa: B905
    # The file has six decimals, our text seven digits.
    np.testing.assert_allclose(table.at(gamma, c - 90.0), expected, rtol=1e-5)
    assert table.opening_m == (1.18, 0.28)
    assert table.is_axial == (symmetry == 1)


def test_conversion_factor_and_lamps_scale_the_light(tmp_path: Path) -> None:
    variants: list[dict[str, object]] = [{}, {"conv_factor": 0.5}, {"lamp_flux": [2.0 * LUMENS]}]
    flux = [
        read_ies(ies_text_of_ldt(write_ldt(tmp_path / f"{n}.ldt", 4, **changes)), where="test").luminous_flux_lm()
        for n, changes in enumerate(variants)
    ]
    np.testing.assert_allclose(np.array(flux) / flux[0], [1.0, 0.5, 2.0], rtol=1e-6)


def test_lumens_of_its_lamps_are_kept_to_hold_its_candela_against(tmp_path: Path) -> None:
    table = read_ies(ies_text_of_ldt(write_ldt(tmp_path / "lamp.ldt", 4)), where="test")
    assert table.lamps_lm == LUMENS


def test_a_round_opening_is_a_disc(tmp_path: Path) -> None:
    path = write_ldt(tmp_path / "lamp.ldt", 1, length_lum_area=160.0, width_lum_area=0.0)
    assert read_ies(ies_text_of_ldt(path), where="test").opening_m == (0.16,)


def test_planes_that_miss_the_axis_are_interpolated_there(tmp_path: Path) -> None:
    planes = [0.0, 120.0, 240.0]
    path = write_ldt(tmp_path / "lamp.ldt", 0, mc=3, dc=120.0, c_angles=planes)
    table = read_ies(ies_text_of_ldt(path), where="test")
    candela = per_klm(np.array(planes), ANGLES, 0) * LUMENS / 1000.0
    along = 0.25 * candela[0] + 0.75 * candela[1]  # C90 lies between C0 and C120
    np.testing.assert_allclose(table.at(ANGLES[:-1], np.zeros(ANGLES.size - 1)), along[:-1], rtol=1e-5)


def test_a_lamp_with_an_ldt_file_has_its_lumens(tmp_path: Path) -> None:
    write_ldt(tmp_path / "lamp.LDT", 4)
    section = LampSection(name="one", shape="ies", center=(0, 0, 2), spectrum="LED-B3", file="lamp.LDT")
    (lamp,) = resolve_lamps([section], tmp_path)
    table = read_ies(ies_text_of_ldt(tmp_path / "lamp.LDT"), where="test")
    assert luminous_flux_lm(lamp.flux) == pytest.approx(table.luminous_flux_lm(), rel=1e-6)
    assert lamp.size == (1.18, 0.28)


@pytest.mark.parametrize(
    ("line", "text", "words"),
    [
        (3, "1000000", "C-planes in line 4"),
        (5, "999999999", "angles a plane in line 6"),
        (5, "²", "angles a plane in line 6"),
        (2, "many", "ValueError"),
        (28, "0", "lamps of 0 lm"),
        (28, "nan", "lamps of nan lm"),
    ],
)
def test_what_is_no_luminaire_is_refused(line: int, text: str, words: str, tmp_path: Path) -> None:
    path = write_ldt(tmp_path / "lamp.ldt", 4)
    lines = path.read_text(encoding="latin-1").splitlines()
    lines[line] = text
    path.write_text("\n".join(lines), encoding="latin-1")
    with pytest.raises(LampError, match=words):
        ies_text_of_ldt(path)


@pytest.mark.parametrize("kept", [0, 3, 20, 60, 70])
def test_a_file_that_is_cut_short_is_refused(kept: int, tmp_path: Path) -> None:
    path = write_ldt(tmp_path / "lamp.ldt", 0)
    lines = path.read_text(encoding="latin-1").splitlines()
    path.write_text("\n".join(lines[:kept]), encoding="latin-1")
    with pytest.raises(LampError, match="EULUMDAT"):
        ies_text_of_ldt(path)


@pytest.mark.parametrize(("ends", "coding"), [("\r", "latin-1"), ("\r\n", "utf-8-sig"), ("\n", "utf-16")])
def test_an_ies_file_is_read_whatever_its_line_ends_and_coding(tmp_path: Path, ends: str, coding: str) -> None:
    plain = ies_text_of_ldt(write_ldt(tmp_path / "lamp.ldt", 4)).replace("TILT", "[MANUFAC] Müller\nTILT", 1)
    (tmp_path / "lamp.ies").write_bytes(plain.replace("\n", ends).encode(coding))
    found = read_ies(read_ies_text(tmp_path / "lamp.ies"), where="test")
    assert found.luminous_flux_lm() == pytest.approx(read_ies(plain, where="test").luminous_flux_lm(), rel=1e-12)
