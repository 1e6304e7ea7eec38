import numpy as np
import pytest

from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.channel_figures import ReportView
from lidarspectra.mapping.figures.figure_style import INK
from lidarspectra.mapping.figures.material_figures import (
    CODE_COLORS,
    NOTHING_COLOR,
    OTHER_COLOR,
    MaterialPictures,
    light_figure,
    material_code,
    mean_shown_colors,
    painted,
    segmentation_figure,
)

FACE = np.array([[0, 1], [2, -1]])


def test_where_classes_are_known_they_have_the_colours_the_largest_first() -> None:
    code = material_code(("a", "b", "c"), ("wood", "painted", "wood"), np.array([1.0, 2.5, 2.0]))
    assert (code.kind, code.names) == ("class", ("wood", "painted"))
    np.testing.assert_array_equal(code.of_material, [0, 1, 0])


def test_a_class_keeps_its_colour_from_room_to_room() -> None:
    areas = np.array([1.0, 2.5, 2.0])
    rooms = [
        material_code(("a", "b", "c"), classes, areas)
        for classes in (("wood", "painted", "moss"), ("painted", "straw", "wood"))
    ]
    of_room = [dict(zip(code.names, code.colors, strict=True)) for code in rooms]
    for name in ("wood", "painted"):
        assert of_room[0][name] == of_room[1][name]
    assert all(len(set(colors.values())) == 3 for colors in of_room)  # and no two kinds of a room share one


def test_without_classes_each_material_has_a_colour_and_small_ones_share_grey() -> None:
    count = len(CODE_COLORS) + 3
    code = material_code(("same name",) * count, ("unknown",) * count, np.arange(count, 0, -1.0))
    assert code.kind == "material"
    assert code.names[0] == "0 same name"
    np.testing.assert_array_equal(code.of_material[-3:], -1)


def test_a_pixel_has_its_faces_kinds_colour_and_black_where_nothing_was_met() -> None:
    count = len(CODE_COLORS) + 1
    code = material_code(("m",) * count, ("unknown",) * count, np.arange(count, 0, -1.0))
    image = code.image(FACE, np.array([0, 1, count - 1]))
    np.testing.assert_array_equal(image.reshape(-1, 3), [CODE_COLORS[0], CODE_COLORS[1], OTHER_COLOR, NOTHING_COLOR])


def test_painted_views_show_the_faces_own_colours() -> None:
    image = painted(FACE, np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))
    np.testing.assert_array_equal(image.reshape(-1, 3), [[255, 255, 255], [0, 0, 255], [255, 0, 0], [0, 0, 0]])


def test_shown_colours_are_means_by_area() -> None:
    color = np.array([[0.2, 0.2, 0.2], [0.8, 0.8, 0.8], [0.5, 0.1, 0.1]])
    mean = mean_shown_colors(color, np.array([0, 0, 2]), np.array([3.0, 1.0, 2.0]), 3)
    np.testing.assert_allclose(mean, [[0.35] * 3, [0.0] * 3, [0.5, 0.1, 0.1]])


def pictures(count: int) -> MaterialPictures:
    image = np.full((8, 8, 3), 90, dtype=np.uint8)
    views = tuple(ReportView(name=f"v{number}", image=image) for number in range(6))
    code = material_code(("a", "b"), ("wood", "painted"), np.ones(2))
    colors = np.full((2, 3), 0.5)
    return MaterialPictures(
        views=views, segmented=views[:count], lit_evenly=views, code=code, shown=colors, found=colors
    )


def test_the_six_views_stand_over_what_became_of_them() -> None:
    figure = segmentation_figure(pictures(6))
    (axes,) = figure.axes
    boxes = np.array([picture.get_extent() for picture in axes.images]).reshape(3, 6, 4)
    assert np.allclose(boxes[:, :, :2], boxes[:1, :, :2])  # one column for each view
    assert (boxes[:-1, :, 2] > boxes[1:, :, 3]).all()  # and what became of it below, apart
    titles = [text.get_text() for text in axes.texts]
    assert titles == [*(f"v{number}" for number in range(6)), "by class", "estimated reflectance, in even daylight"]
    assert all(text.get_color() == INK for text in axes.texts)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["wood", "painted"]


def test_a_view_without_its_segmentation_is_refused() -> None:
    with pytest.raises(MapError, match="same number"):
        segmentation_figure(pictures(5))


def test_the_light_figure_tells_luminances_before_and_after() -> None:
    figure = light_figure(("wall", "never used"), np.array([2.0, 0.0]), np.full((2, 3), 0.25), np.full((2, 3), 0.5))
    words = [text.get_text() for text in figure.axes[0].texts]
    assert "wall, 2.0 m²" in words
    assert {"0.25", "0.50"} <= set(words)
    assert not any("never" in word for word in words)
