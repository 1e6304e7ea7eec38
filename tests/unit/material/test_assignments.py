"""The user's word on materials is done as written, or refused by line."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.config import MaterialsSection
from lidarspectra.errors import MaterialError
from lidarspectra.material.assignments import assign, give_all, read_assignments, spectrum_files
from lidarspectra.material.estimate import estimate_materials
from lidarspectra.material.material_map import MaterialMap, save_materials
from lidarspectra.material.pane_materials import pane_material, with_pane_materials
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.material.views.views import no_views
from lidarspectra.room.panes.pane import Pane
from lidarspectra.spectra.colorimetry import hex_color
from lidarspectra.spectra.databases import load_reflectances
from lidarspectra.workflow.materials.materials_of_run import materials_of_run, with_assignments_of_run

from .conftest import box_scan


@pytest.fixture(scope="module")
def room():
    scan, _ = box_scan(cells=4)
    return scan, render_views(scan, settings=ViewSettings(width=16, height=16, samples=1))


@pytest.fixture(scope="module")
def estimated(room) -> MaterialMap:
    return estimate_materials(*room, model=None)


def done(estimated: MaterialMap, folder: Path, text: str) -> MaterialMap:
    path = folder / "assignments.csv"
    path.write_text(text, encoding="utf-8")
    return assign(estimated, read_assignments(path), load_reflectances(), where=path)


def test_a_group_gets_the_surface_that_is_named(estimated, tmp_path):
    found = done(estimated, tmp_path, "group,reflectance\n1,builtin:cc-orange\n")
    assert found.materials[1].source == "builtin:cc-orange"
    assert found.materials[1].provenance == "assigned"
    assert found.materials[1].color == estimated.materials[1].color
    assert found.materials[0] is estimated.materials[0]
    assert np.array_equal(found.face_material, estimated.face_material)


def test_a_star_stands_for_all_groups_without_a_row(estimated, tmp_path):
    found = done(estimated, tmp_path, "group,reflectance\n*,white-wall\n1,non-reflective\n")
    assert [m.source for m in found.materials] == ["builtin:white-wall", "builtin:non-reflective", "builtin:white-wall"]


def test_a_spectrum_file_lies_beside_the_assignments(estimated, tmp_path):
    (tmp_path / "carpet.csv").write_text("wavelength_nm,value\n400,0.1\n700,0.3\n", encoding="utf-8")
    found = done(estimated, tmp_path, "group,reflectance\n0,carpet.csv\n")
    assert found.materials[0].reflectance.values.tolist() == [0.1, 0.3]
    assert found.materials[0].measured_range_nm == (400, 700)


def test_a_file_may_be_saved_by_a_german_spreadsheet_and_begin_with_its_name(estimated, tmp_path):
    text = "# my-materials.csv\ngroup;reflectance;specularity\n0;builtin:wooden-cabinet;0,05\n;;\n1;;\n"
    materials = done(estimated, tmp_path, text)
    assert materials.materials[0].source == "builtin:wooden-cabinet"
    assert materials.materials[0].specularity == pytest.approx(0.05)
    assert materials.materials[1].provenance == estimated.materials[1].provenance


def test_the_spectrum_files_of_assignments_are_known_before_they_are_read(tmp_path):
    path = tmp_path / "assignments.csv"
    path.write_text("group,reflectance\n0,carpet.csv\n1,white-wall\n2,sub/Wall.CSV\n", encoding="utf-8")
    assert spectrum_files(path) == ("carpet.csv", "sub/Wall.CSV")
    path.write_text("no such columns\n", encoding="utf-8")
    assert spectrum_files(path) == spectrum_files(tmp_path / "missing.csv") == ()


def test_a_surface_can_be_made_shiny_without_another_spectrum(estimated, tmp_path):
    found = done(estimated, tmp_path, "group,reflectance,kind,specularity,roughness\n0,,metal,0.8,0.1\n")
    assert (found.materials[0].kind, found.materials[0].specularity, found.materials[0].roughness) == (
        "metal",
        0.8,
        0.1,
    )
    assert found.materials[0].reflectance is estimated.materials[0].reflectance


def test_single_faces_can_be_assigned(estimated, tmp_path):
    found = done(estimated, tmp_path, "face,reflectance\n0,white-wall\n5,white-wall\n7,cc-blue\n")
    sources = [found.materials[n].source for n in found.face_material]
    assert (sources[0], sources[5], sources[7]) == ("builtin:white-wall", "builtin:white-wall", "builtin:cc-blue")
    assert found.face_material[0] == found.face_material[5]
    assert sources[1] == estimated.materials[estimated.face_material[1]].source


def test_faces_that_only_become_shiny_keep_their_own_reflectances(estimated, tmp_path):
    """They all got the reflectance of the first of them."""
    faces = [int(np.flatnonzero(estimated.face_material == group)[0]) for group in (0, 1)]
    rows = "".join(f"{face},,0.3\n" for face in faces)
    found = done(estimated, tmp_path, f"face,reflectance,specularity\n{rows}")
    for group, face in enumerate(faces):
        material = found.materials[found.face_material[face]]
        assert material.specularity == 0.3
        assert material.reflectance is estimated.materials[group].reflectance


def test_faces_of_another_scan_are_refused(estimated, tmp_path):
    """A pane more cuts the mesh: the numbers of its faces were taken for those of others, in silence."""
    count = estimated.face_material.size
    text = "# of {} faces\nface,reflectance\n3,builtin:white-wall\n"
    found = done(estimated, tmp_path, text.format(count))
    assert found.materials[found.face_material[3]].source == "builtin:white-wall"
    with pytest.raises(MaterialError, match=f"{count} faces.*those of {count + 8}"):
        done(estimated, tmp_path, text.format(count + 8))


def of_one_source(estimated: MaterialMap, group: int, **changes: object) -> MaterialMap:
    materials = list(estimated.materials)
    materials[group] = replace(materials[group], **changes)
    return replace(estimated, materials=tuple(materials))


@pytest.mark.parametrize(
    ("source", "provenance"),
    [
        ("recovered (wiener), near builtin:white-wall", "recovered"),
        ("builtin:white-wall", "measured"),  # the nearest surface, scaled to what was seen
        ("builtin:white-plastic", "default"),
        ("typical:wall", "default"),
    ],
)
def test_rows_as_a_run_wrote_them_stay_as_they_were(estimated, tmp_path, source, provenance):
    """Names of databases were looked up, and their spectra taken as they are; other words ended the run."""
    before = of_one_source(estimated, 1, source=source, provenance=provenance)
    save_materials(before, tmp_path)
    found = done(before, tmp_path, (tmp_path / "materials.csv").read_text(encoding="utf-8"))
    assert found.materials[1].reflectance is before.materials[1].reflectance
    assert found.materials[1].provenance == provenance


def test_a_row_of_ones_own_is_followed_where_the_estimate_names_the_same_surface(estimated, tmp_path):
    before = of_one_source(estimated, 1, source="builtin:white-wall", provenance="measured")
    found = done(before, tmp_path, "group,reflectance\n1,builtin:white-wall\n")
    assert found.materials[1].provenance == "assigned"


def test_panes_keep_their_materials_where_all_else_is_given(estimated, room, tmp_path):
    scan, _ = room
    face = int(np.flatnonzero(estimated.face_material == 0)[0])
    pane = Pane(kind="mirror", center=scan.centers[face], size_m=(0.2, 0.2), normal=scan.normals[face])
    with_pane = with_pane_materials(estimated, scan, [(pane, pane_material("mirror", name="mirror 1"))])
    found = done(with_pane, tmp_path, "group,reflectance\n*,white-wall\n")
    assert found.materials[found.face_material[face]].source == "pane:mirror"
    found = done(with_pane, tmp_path, f"face,reflectance\n{face},white-wall\n")
    assert found.materials[found.face_material[face]].source == "pane:mirror"
    save_materials(with_pane, tmp_path)
    found = done(with_pane, tmp_path, (tmp_path / "materials.csv").read_text(encoding="utf-8"))
    assert found.materials[-1].source == "pane:mirror"


def test_a_row_of_a_group_that_is_another_surface_now_is_refused(estimated, tmp_path):
    """Numbers are by area: of another scan they are other surfaces, which got the material in silence."""
    orange = hex_color(estimated.materials[1].color)
    text = "group,reflectance,color\n{},builtin:cc-blue,{}\n"
    assert done(estimated, tmp_path, text.format(1, orange)).materials[1].source == "builtin:cc-blue"
    with pytest.raises(MaterialError, match=f"color {orange}"):
        done(estimated, tmp_path, text.format(0, orange))
    left = done(estimated, tmp_path, f"group,reflectance,color\n0,recovered,{orange}\n")
    assert left.materials[0].reflectance is estimated.materials[0].reflectance


def as_written(folder: Path, materials: MaterialMap) -> str:
    """The file that a run of these materials writes."""
    save_materials(materials, folder)
    return (folder / "materials.csv").read_text(encoding="utf-8")


def test_a_row_that_a_run_wrote_of_a_pane_makes_no_wall_a_mirror(estimated, tmp_path):
    """A pane less in the run file, and its number is a wall's, which may be as light as a mirror is."""
    mirror = pane_material("mirror", name="mirror 1")
    panes = of_one_source(estimated, 1, **{key: getattr(mirror, key) for key in vars(mirror)})
    text = as_written(tmp_path, replace(panes, materials=(*panes.materials[:1], mirror, *panes.materials[2:])))
    light = of_one_source(estimated, 1, color=mirror.color)
    found = done(light, tmp_path, text)
    assert found.materials[1] is light.materials[1]
    back = done(panes, tmp_path, as_written(tmp_path, light))
    assert (back.materials[1].kind, back.materials[1].specularity) == ("mirror", 1.0)


def test_gloss_that_a_run_wrote_of_another_group_is_refused(estimated, tmp_path):
    glossy = of_one_source(estimated, 1, specularity=0.04, roughness=0.1)
    text = as_written(tmp_path, glossy)
    assert done(glossy, tmp_path, text).materials[1].specularity == pytest.approx(0.04)
    others = replace(estimated, materials=(estimated.materials[1], estimated.materials[0], *estimated.materials[2:]))
    with pytest.raises(MaterialError, match="groups are others now"):
        done(others, tmp_path, text)
    left = done(others, tmp_path, as_written(tmp_path, estimated))  # says nothing that is not so
    assert [each.reflectance for each in left.materials] == [each.reflectance for each in others.materials]


@pytest.mark.parametrize(
    ("name", "source", "provenance"),
    [
        ("white painted, as White wall paint 2", "builtin:white-wall", "measured"),
        ("White wall paint", "builtin:white-wall", "default"),
    ],
)
def test_a_surface_that_a_run_took_for_the_nearest_is_not_given_by_hand(estimated, tmp_path, name, source, provenance):
    """In other light another one is the nearest: the old one came unscaled, and was taken for known to 3 %."""
    text = as_written(tmp_path, of_one_source(estimated, 1, name=name, source=source, provenance=provenance))
    now = of_one_source(estimated, 1, name="grey, as ColorChecker neutral 8", source="builtin:cc-neutral-8")
    left = done(now, tmp_path, text).materials[1]
    assert left.reflectance is now.materials[1].reflectance
    assert left.provenance == "recovered"
    given = text.replace("builtin:white-wall", "builtin:wooden-cabinet")
    assert done(now, tmp_path, given).materials[1].provenance == "assigned"


def test_the_file_that_a_run_writes_changes_nothing_as_it_is_and_can_be_edited(room, estimated, tmp_path):
    save_materials(estimated, tmp_path, face_areas=room[0].areas)
    section = MaterialsSection(method="file", file="materials.csv", model="none")
    alone = materials_of_run(room[0], room[1], section, folder=tmp_path)
    same = with_assignments_of_run(alone, section, folder=tmp_path)
    for one, other in zip(same.materials, estimated.materials, strict=True):
        assert np.array_equal(one.reflectance.values, other.reflectance.values)
    with (tmp_path / "materials.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    rows[1][rows[0].index("reflectance")] = "builtin:wooden-cabinet"
    with (tmp_path / "materials.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(rows)
    edited = with_assignments_of_run(alone, section, folder=tmp_path)
    assert edited.materials[0].source == "builtin:wooden-cabinet"
    assert edited.materials[1].provenance == "recovered"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "line 1"),
        ("a,b\n", "line 1"),
        ("group,reflectance\nx,white-wall\n", "line 2"),
        ("group,reflectance\n-1,white-wall\n", "line 2"),
        ("group,reflectance\n0,white-wall\n0,white-wall\n", "line 3"),
        ("group,reflectance\n99,white-wall\n", "group from 0 to 2"),
        ("face,reflectance\n*,white-wall\n", "line 2"),
        ("face,reflectance\n999999,white-wall\n", "face from 0"),
        ("group,reflectance\n0,no-such-thing\n", "no-such-thing"),
        ("group,reflectance\n0,no-such-file.csv\n", "no-such-file"),
        ("group,reflectance,kind\n0,white-wall,wool\n", "wool"),
        ("group,reflectance,roughness\n0,white-wall,2\n", "roughness"),
        ("group,reflectance,specularity\n0,white-wall,shiny\n", "specularity"),
    ],
)
def test_what_does_not_fit_is_refused_by_line(estimated, tmp_path, text, words):
    with pytest.raises(MaterialError, match=words):
        done(estimated, tmp_path, text)


def test_percent_in_a_spectrum_file_is_refused(estimated, tmp_path):
    (tmp_path / "carpet.csv").write_text("400,10\n700,30\n", encoding="utf-8")
    with pytest.raises(MaterialError, match="percent"):
        done(estimated, tmp_path, "group,reflectance\n0,carpet.csv\n")


def test_percent_in_a_heading_makes_fractions(estimated, tmp_path):
    """Black velvet of half a percent was taken for a surface that reflects half."""
    (tmp_path / "velvet.csv").write_text("wavelength_nm,reflectance [%]\n400,0.5\n700,0.8\n", encoding="utf-8")
    found = done(estimated, tmp_path, "group,reflectance\n0,velvet.csv\n")
    assert found.materials[0].reflectance.values == pytest.approx([0.005, 0.008])


def test_a_spectrum_file_beside_visible_light_is_refused(estimated, tmp_path):
    (tmp_path / "carpet.csv").write_text("4000,0.1\n7000,0.3\n", encoding="utf-8")
    with pytest.raises(MaterialError, match="visible"):
        done(estimated, tmp_path, "group,reflectance\n0,carpet.csv\n")


def test_a_missing_file_of_assignments_is_our_error(room, tmp_path):
    section = MaterialsSection(method="file", file="nothing.csv")
    with pytest.raises(MaterialError, match=r"nothing\.csv"):
        with_assignments_of_run(materials_of_run(room[0], room[1], section, folder=tmp_path), section, folder=tmp_path)


def test_one_surface_for_all_keeps_the_groups(estimated, tmp_path):
    found = done(estimated, tmp_path, "group,reflectance\n*,white-wall\n")
    assert len(found.materials) == len(estimated.materials)
    assert replace(found, materials=estimated.materials).face_material is not None


@pytest.mark.parametrize(
    ("text", "all_of_them"),
    [
        ("group,reflectance\n*,white-wall\n", True),
        ("group,reflectance\n*,white-wall\n1,non-reflective\n", False),  # which one is 1, estimates tell
        ("group,reflectance\n*,\n", False),
        ("group,reflectance\n*,recovered\n", False),
        ("group,reflectance\n0,white-wall\n", False),
        ("face,reflectance\n0,white-wall\n", False),
        ("nonsense", False),
    ],
)
def test_a_file_gives_all_surfaces_one_reflectance_only_by_a_star_alone(tmp_path, text, all_of_them):
    (tmp_path / "assignments.csv").write_text(text, encoding="utf-8")
    assert give_all(tmp_path / "assignments.csv") is all_of_them


def test_where_one_reflectance_is_given_to_all_nobody_asks_what_surfaces_look_like(room, tmp_path):
    scan, seen = room
    unseen = no_views(len(scan.faces), coverage=0.9, why="nobody looks")
    (tmp_path / "assignments.csv").write_text("group,reflectance\n*,white-wall\n", encoding="utf-8")
    section = MaterialsSection(method="file", file="assignments.csv")

    def ask(progress):
        raise AssertionError("the network was asked")

    alone = materials_of_run(scan, unseen, section, folder=tmp_path, votes=ask)
    (material,) = with_assignments_of_run(alone, section, folder=tmp_path).materials
    assert (material.source, material.provenance) == ("builtin:white-wall", "assigned")
    estimated = done(estimate_materials(scan, seen, model=None), tmp_path, "group,reflectance\n*,white-wall\n")
    for each in estimated.materials:
        assert np.array_equal(each.reflectance.values, material.reflectance.values)
        assert (each.specularity, each.roughness) == (material.specularity, material.roughness)
    mean = np.average(scan.face_colors(), axis=0, weights=scan.areas)
    assert material.color == pytest.approx(tuple(mean), abs=1e-9)  # the file says nothing of the colour in pictures
