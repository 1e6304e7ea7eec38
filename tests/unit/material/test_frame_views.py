"""A frame held against the mesh: where points lie in its picture, how well they are shown, and what hides them."""

import numpy as np
import pytest

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.hardware.phone.frames import DepthMap, Frame
from lidarspectra.material.frames.frame_views import (
    BUFFER_PX,
    LOW_CONFIDENCE,
    MIN_COSINE,
    MeshView,
    Picture,
    Sight,
    averaged,
    linear_table,
    radius2_of,
    sampled,
)

SIZE_PX = (2 * BUFFER_PX, 2 * BUFFER_PX * 3 // 4)  # two pixels are one of the depth that the mesh would show
FOCAL_PX = 360.0
TABLE = linear_table().astype(np.float32)


def square(side_m: float, at: tuple[float, float, float]) -> tuple[FloatArray, np.ndarray]:
    """Two triangles across z, seen from above."""
    half = side_m / 2
    corners = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]]) + at
    return corners, np.array([[0, 1, 2], [0, 2, 3]])


def scan_of(*squares: tuple[FloatArray, np.ndarray]) -> Scan:
    vertices = np.concatenate([corners for corners, _ in squares])
    faces = np.concatenate([faces + 4 * number for number, (_, faces) in enumerate(squares)])
    return bare_scan(vertices, faces)


def frame(pose: FloatArray | None = None) -> Frame:
    """A frame that looks down along -z from the origin, if no other pose is said."""
    return Frame(
        name="0",
        camera_to_world=np.eye(4) if pose is None else pose,
        intrinsics=np.array([[FOCAL_PX, 0, SIZE_PX[0] / 2], [0, FOCAL_PX, SIZE_PX[1] / 2], [0, 0, 1]]),
        size_px=SIZE_PX,
        read_image=lambda least_px: np.zeros((SIZE_PX[1], SIZE_PX[0], 3), dtype=np.uint8),
        read_depth=lambda: None,
    )


def lidar_of(depth_m: float, confidence: int = 2) -> DepthMap:
    """The same depth everywhere."""
    shape = (48, 64)
    return DepthMap(
        depth_m=np.full(shape, depth_m, dtype=np.float32), confidence=np.full(shape, confidence, dtype=np.uint8)
    )


def sight_of(points: list[tuple[float, float, float]], scan: Scan, lidar: DepthMap | None = None) -> Sight:
    """What the usual frame shows of points that look up."""
    view, each = MeshView(RayCaster(scan)), np.array(points)
    return view.sight(frame(), view.depth(frame()), lidar, each, np.tile([0.0, 0.0, 1.0], (len(points), 1)))


def test_points_lie_where_the_camera_sees_them_and_count_by_angle_and_distance() -> None:
    sight = sight_of([(0.0, 0.0, -2.0), (0.4, 0.3, -2.0)], scan_of(square(4.0, (0, 0, -2.0))))
    assert sight.index.tolist() == [0, 1]
    middle = np.array(SIZE_PX) / 2 - 0.5  # of pixels, whose middles lie at whole numbers
    assert sight.pixel == pytest.approx(np.stack([middle, middle + (72.0, -54.0)]), abs=1e-3)
    corner2 = (np.array(SIZE_PX) ** 2).sum() / 4
    assert sight.radius2 == pytest.approx([0.0, (72.0**2 + 54.0**2) / corner2])
    distance = np.sqrt(4.25)
    assert sight.weight == pytest.approx([0.5, (2.0 / distance) / (1.0 + 4.25 / 4.0)])


@pytest.mark.parametrize(("lidar_m", "seen"), [(4.0, True), (4.27, True), (3.73, True), (4.3, False), (3.7, False)])
def test_what_the_lidar_measured_elsewhere_is_hidden_by_five_per_cent_and_eight_centimetres(
    lidar_m: float, seen: bool
) -> None:
    scan = scan_of(square(4.0, (0, 0, -4.0)))
    assert (sight_of([(0.1, 0.1, -4.0)], scan, lidar_of(lidar_m)).index.size == 1) == seen
    unsure = sight_of([(0.1, 0.1, -4.0)], scan, lidar_of(lidar_m, confidence=1))
    sure = sight_of([(0.1, 0.1, -4.0)], scan, lidar_of(4.0))
    assert unsure.weight == pytest.approx(LOW_CONFIDENCE * sure.weight)  # of which nothing is hidden


def test_what_faces_away_or_is_seen_too_flat_is_not_seen() -> None:
    cosine = np.array([1.0, 0.21, 0.19, -0.5, -1.0])
    normals = np.stack([np.sqrt(1.0 - cosine**2), np.zeros(5), cosine], axis=1)
    view = MeshView(RayCaster(scan_of(square(4.0, (0, 0, -2.0)))))
    sight = view.sight(frame(), view.depth(frame()), None, np.tile([0.0, 0.0, -2.0], (5, 1)), normals)
    assert sight.index.tolist() == [0, 1]
    assert sight.weight == pytest.approx(0.5 * cosine[:2])


def test_beside_the_edge_of_what_lies_in_front_nothing_is_seen_and_four_pixels_away_it_is() -> None:
    scan = scan_of(square(4.0, (0, 0, -2.0)), square(0.4, (0, 0.1, -1.0)))
    pixel_m = 2.0 / (FOCAL_PX / 2)
    left_m, low_m, high_m = -0.4, -0.2, 0.6  # of its shadow on what lies behind
    across = [(left_m - away * pixel_m, 0.2, -2.0) for away in (-2.0, 0.5, 1.5, 4.0)]
    below = [(0.05, low_m - away * pixel_m, -2.0) for away in (-2.0, 0.5, 1.5, 4.0)]
    above = [(0.05, high_m + away * pixel_m, -2.0) for away in (-2.0, 0.5, 1.5, 4.0)]
    for points in (across, below, above):
        assert sight_of(points, scan).index.tolist() == [3]


def test_a_point_may_lie_behind_the_mesh_by_two_per_cent_and_three_centimetres() -> None:
    """As where a wall was made flat after its frames were taken."""
    scan = scan_of(square(4.0, (0, 0, -2.0)))
    assert sight_of([(0.1, 0.1, -2.0 - behind) for behind in (0.0, 0.04, 0.068, 0.072, 0.2)], scan).index.size == 3


@pytest.mark.parametrize(
    ("lidar", "lost"),
    [
        (lidar_of(2.0), False),
        (lidar_of(2.2), False),
        (lidar_of(2.4), True),
        (lidar_of(1.7), True),
        (lidar_of(2.4, confidence=1), False),  # of which it is not sure
        (None, False),
    ],
)
def test_a_pose_is_lost_where_the_lidar_measured_another_room(lidar: DepthMap | None, lost: bool) -> None:
    view = MeshView(RayCaster(scan_of(square(4.0, (0, 0, -2.0)))))
    assert view.is_lost(view.depth(frame()), lidar) == lost


def test_a_few_sure_pixels_do_not_tell_that_a_pose_is_lost() -> None:
    view = MeshView(RayCaster(scan_of(square(4.0, (0, 0, -2.0)))))
    lidar = lidar_of(3.0, confidence=0)
    lidar.confidence[:4, :4] = 2  # 16 of its pixels, 144 of those in which it is held against the mesh
    assert not view.is_lost(view.depth(frame()), lidar)


def test_surfaces_that_are_seen_too_flat_are_not_shown_and_those_a_little_steeper_are() -> None:
    """A floor 1 m below, up to where it is seen under 11.5°, at any side of the picture."""
    scan = scan_of(square(30.0, (0, 0, -1.0)))
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])  # looks along y
    shown = MeshView(RayCaster(scan)).shown(frame(pose))
    points = np.einsum("nk,nkc->nc", shown.barycentric, scan.vertices[scan.faces[shown.face]])
    cosine = 1.0 / np.linalg.norm(points, axis=1)
    assert cosine.min() > MIN_COSINE
    assert cosine.min() < 1.05 * MIN_COSINE
    sideways = np.abs(points[:, 0]) > 0.45 * points[:, 1]
    assert cosine[sideways].min() < 1.05 * MIN_COSINE


def test_light_between_pixels_is_blended_from_the_four_around_it() -> None:
    rows, columns = np.mgrid[0:6, 0:8].astype(np.float32)
    picture = Picture(
        light=np.stack([0.1 * columns, 0.1 * rows, 0.05 * (rows + columns)], axis=-1),
        uneven=0.01 * columns, clipped=(rows == 2) & (columns == 3), sharpness=0.0, depth=None,
    )  # fmt: skip
    places = np.array([[3.0, 1.0], [2.25, 3.75], [7.0, 5.0], [0.0, 0.0], [2.5, 1.5], [4.5, 2.5]], dtype=np.float32)
    sight = Sight(index=np.arange(6), pixel=places, radius2=np.zeros(6), weight=np.ones(6))
    light, uneven, clipped = sampled(picture, sight)
    x, y = places.T
    assert light == pytest.approx(np.stack([0.1 * x, 0.1 * y, 0.05 * (x + y)], axis=1), abs=1e-6)
    assert uneven == pytest.approx(0.01 * np.floor(np.minimum(x, 6.0)), abs=1e-6)
    assert clipped.tolist() == [True, False, False, False, True, False]  # of one of the four


def test_unevenness_and_sharpness_are_those_of_the_surface_whatever_the_exposure() -> None:
    """Stripes of one and two thirds of the light: a deviation of a third."""
    dark = np.zeros((48, 64, 3), dtype=np.uint8)
    byte = {level: int(np.abs(TABLE[:, 0] - level).argmin()) for level in (0.1, 0.2, 0.4)}
    dark[:], dark[:, ::2] = byte[0.1], byte[0.2]
    bright = np.where(dark == byte[0.1], byte[0.2], byte[0.4]).astype(np.uint8)
    for image in (dark, bright):
        picture = averaged(image, TABLE)
        assert picture.uneven[10:-10, 10:-10] == pytest.approx(1 / 3, rel=0.06)  # 3 or 4 bright ones of 7
        assert picture.sharpness == pytest.approx(2 * np.log(2.0), rel=0.05)
    assert averaged(np.full_like(dark, 100), TABLE).uneven.max() < 1e-3


def test_the_distance_from_the_middle_is_that_of_the_principal_point_over_that_of_a_corner() -> None:
    radius2 = radius2_of(frame(), (72, 96))
    assert radius2[0, 0] == pytest.approx(1.0, abs=0.03)  # of a pixel's middle
    assert radius2[36, 48] < 1e-3
    assert radius2[36, 0] == pytest.approx(0.64, abs=0.02)
    off = frame()
    off.intrinsics[0, 2] += 0.05 * SIZE_PX[0]
    assert radius2_of(off, (72, 96)).argmin() % 96 == 52  # of 96
