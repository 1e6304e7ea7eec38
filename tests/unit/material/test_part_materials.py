"""What the name of a part says of its material."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.geometry.appearance import DRAWN, NO_COLOR, PHOTOGRAPHED, Appearance
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.delighting.light_objective import LOG_SCATTER
from lidarspectra.material.estimate import estimate_materials
from lidarspectra.material.lit_lamps.lit_lamps import search_lit_lamps
from lidarspectra.material.part_materials import NAMED_PRIORS, TYPICAL, named_prior, typical_materials
from lidarspectra.material.segmentation.place_priors import KINDS, PRIORS
from lidarspectra.material.segmentation.segmentation import SHIPPED_MODEL, Classifier
from lidarspectra.material.views.views import ViewSet
from lidarspectra.room.room import find_room
from lidarspectra.spectra.colorimetry import encode_srgb
from lidarspectra.workflow.materials.delighting import Delighting, take_light_out
from lidarspectra.workflow.materials.light_uncertainty import LEFT_IN_DEVIATION, with_light_uncertainty

from .conftest import box_scan


def named(scan, *, kind: str = "wall", source: int = DRAWN, faces=slice(None)):
    """A scan of which some faces are part of a kind of thing, and have a colour from a source."""
    count = len(scan.faces)
    kinds, sources = np.full(count, -1), np.full(count, PHOTOGRAPHED)
    kinds[faces], sources[faces] = 0, source
    appearance = replace(scan.appearance, kinds=(kind,), face_kind=kinds, color_source=sources)
    return replace(scan, appearance=appearance)


def no_views(scan) -> ViewSet:
    return ViewSet(
        views=(),
        viewpoints=np.zeros((0, 3)),
        face_seen=np.ones(len(scan.faces)),
        threshold=0.95,
        area_coverage=1.0,
        point_coverage=1.0,
        history=np.zeros(0),
        stopped="",
    )


@pytest.fixture
def box():
    scan, _ = box_scan(4)
    white = replace(scan.appearance, corner_color=np.ones((len(scan.faces), 3, 3)))
    return replace(scan, appearance=white)


def test_a_drawn_wall_gets_the_typical_reflectance_and_a_photographed_one_its_own(box) -> None:
    half = np.arange(len(box.faces)) < len(box.faces) // 2
    scan = named(box, faces=half)
    darker = replace(scan.appearance, corner_color=np.full((len(box.faces), 3, 3), 0.5))
    found = estimate_materials(replace(scan, appearance=darker), no_views(scan), model=None)
    wall = TYPICAL["wall"]
    for face, material in zip(half, found.face_material, strict=True):
        assert (found.materials[material].source == "typical:wall") == face
    typical = next(material for material in found.materials if material.source == "typical:wall")
    assert typical.reflectance.at([410.0, 760.0], outside="nearest") == pytest.approx(wall.reflectance)
    assert typical.uncertainty.at([555.0], outside="nearest") == pytest.approx(wall.deviation)
    said = "\n".join(found.warnings(box.areas))
    assert "wall 0.65 ± 0.15" in said
    unseen = replace(found, face_seen=np.zeros(len(box.faces))).warnings(box.areas)
    pictured = f"{100 * box.areas[~half].sum() / box.areas.sum():.1f} %"
    assert any(f"{pictured} of the area was seen by no view" in words for words in unseen), "names need no view"


@pytest.mark.parametrize("scanned_share", [0.5, 0.0])
def test_what_closes_a_ceiling_is_of_what_was_scanned_of_it(scanned_share) -> None:
    """A dark ceiling goes on as a dark one; where nothing was scanned of it, as a typical one."""
    cube, part = box_scan(6)
    scan = replace(cube, vertices=3.0 * cube.vertices)
    ceiling = part == 1
    closed = ceiling & (scan.centers[:, 0] > 3.0 * scanned_share)
    color = np.full((len(scan.faces), 3, 3), encode_srgb(0.7))
    color[ceiling] = encode_srgb(0.3)
    scan = replace(scan, appearance=replace(scan.appearance, corner_color=color))
    scan = named(scan, kind="closed ceiling", source=NO_COLOR, faces=closed)
    found = estimate_materials(scan, no_views(scan), model=None)
    numbers = np.unique(found.face_material[closed])
    assert numbers.size == 1
    material = found.materials[int(numbers[0])]
    expected = 0.3 if scanned_share else TYPICAL["closed ceiling"].reflectance
    assert material.reflectance.at([555.0], outside="nearest") == pytest.approx(expected, abs=0.03)
    assert (material.source == "typical:closed ceiling") == (scanned_share == 0.0)


def test_without_names_the_drawn_colour_counts(box) -> None:
    grey = replace(box.appearance, corner_color=np.full((len(box.faces), 3, 3), 0.5))
    scan = named(replace(box, appearance=grey))
    plain = replace(scan, appearance=scan.appearance.without_names())
    found = estimate_materials(plain, no_views(plain), model=None)
    assert not any(material.source.startswith("typical") for material in found.materials)
    assert found.mean_reflectance(box.areas) == pytest.approx(0.214, abs=0.02)  # sRGB .5 in linear light


def test_what_was_closed_keeps_its_kind_without_names(box) -> None:
    scan = named(box, kind="closed ceiling", source=NO_COLOR)
    plain = scan.appearance.without_names()
    materials, number = typical_materials(plain, np.ones(len(box.faces), dtype=bool))
    assert [material.name for material in materials] == ["typical closed ceiling"]
    assert (number == 0).all()


def test_a_white_wall_that_a_program_drew_is_no_lamp_and_shows_no_light(box) -> None:
    scan = named(box)
    assert search_lit_lamps(scan, find_room(scan)).lamps == ()
    _, known = surface_colors(scan)
    assert not known.any()
    found = take_light_out(scan, find_room(scan), ())
    assert found.face_color is None
    assert found.warnings == (), "there is no light in a drawn colour that could be left in"


def test_a_reflectance_whose_light_was_left_in_is_as_uncertain_as_shown_colours_are(box) -> None:
    half = np.arange(len(box.faces)) < len(box.faces) // 2
    scan = named(box, faces=half)
    grey = replace(scan.appearance, corner_color=np.full((len(box.faces), 3, 3), 0.5))
    found = estimate_materials(replace(scan, appearance=grey), no_views(scan), model=None)
    stated = with_light_uncertainty(found, None, scan.areas)
    for before, after in zip(found.materials, stated.materials, strict=True):
        of_typical = before.source.startswith("typical:")
        own, both = (float(each.uncertainty.at([555.0], outside="nearest")[0]) for each in (before, after))
        assert both == pytest.approx(own if of_typical else np.hypot(own, LEFT_IN_DEVIATION))
        assert np.array_equal(before.reflectance.values, after.reflectance.values), "the estimate itself stays"


@pytest.mark.parametrize("of_places", [0.0, LOG_SCATTER, 0.3])
def test_what_the_places_of_a_paint_err_by_is_stated_once(box, of_places: float) -> None:
    """A paint's own deviation has it; less than a square metre of what is of none errs as one place does."""
    scan, count = box, len(box.faces)
    small = scan.areas / scan.areas.sum()
    grey = replace(scan.appearance, corner_color=np.full((count, 3, 3), 0.5))
    found = estimate_materials(replace(scan, appearance=grey), no_views(scan), model=None)
    taken_out = Delighting(
        face_color=np.full((count, 3), 0.5), face_deviation=np.full((count, 3), 0.03), fit=None, words="",
        face_place_deviation=np.full(count, of_places),
    )  # fmt: skip
    stated = with_light_uncertainty(found, taken_out, small)
    before, after = (each.materials[0] for each in (found, stated))
    own, both = (float(each.uncertainty.at([545.0], outside="nearest")[0]) for each in (before, after))
    light = float(before.reflectance.at([545.0], outside="nearest")[0]) * np.hypot(0.03, of_places)
    assert both == pytest.approx(np.hypot(own, light), rel=0.01)


def test_the_name_of_a_window_makes_glass_likely_and_leaves_other_faces_alone(box) -> None:
    scan = named(box, kind="window", source=PHOTOGRAPHED, faces=slice(0, 5))
    classes = Classifier(SHIPPED_MODEL).classes
    even = np.full((len(box.faces), len(classes)), 1.0 / len(classes))
    prior = named_prior(scan.appearance, classes, even)
    assert prior[0, classes.index("glass")] > 0.5
    assert prior.sum(axis=1) == pytest.approx(1.0)
    assert np.array_equal(prior[5:], even[5:])


@pytest.mark.parametrize("table", [NAMED_PRIORS, PRIORS])
def test_priors_leave_something_to_classes_that_they_do_not_name(table) -> None:
    assert all(0.9 < sum(named.values()) + 0.1 < 1.1 for named in table.values())
    assert KINDS


def test_appearances_joined_keep_their_kinds() -> None:
    def made(kinds: tuple[str, ...], face_kind: list[int]) -> Appearance:
        count = len(face_kind)
        return Appearance(
            images=(),
            face_image=np.full(count, -1),
            corner_uv=np.zeros((count, 3, 2)),
            corner_color=np.zeros((count, 3, 3)),
            kinds=kinds,
            face_kind=np.array(face_kind),
        )

    both = made(("wall", "door"), [0, 1, -1]).with_more(made(("table", "wall"), [0, 1, -1]))
    assert [both.kinds[kind] if kind >= 0 else "" for kind in both.face_kinds] == [
        "wall", "door", "", "table", "wall", "",
    ]  # fmt: skip
