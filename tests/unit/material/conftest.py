"""A small room whose surfaces are plain colours, made without files."""

import numpy as np
import pytest

from lidarspectra.geometry.scan import Appearance, Scan, ScanRecord
from lidarspectra.spectra.colorimetry import encode_srgb

SIZE_M = np.array([4.0, 3.0, 2.5])
COLORS = {
    "floor": (0.05, 0.08, 0.20),
    "ceiling": (0.60, 0.60, 0.58),
    "walls": (0.50, 0.20, 0.05),
}  # linear sRGB


def box_scan(cells: int = 10, *, noise: float = 0.0, known: bool = True) -> tuple[Scan, np.ndarray]:
    """A closed box seen from inside, and what each face belongs to: 0 floor, 1 ceiling, 2 walls."""
    corners, part = [], []
    for axis in range(3):
        for end in (0, 1):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            grid = np.arange(cells) / cells
            first, second = (values.ravel() for values in np.meshgrid(grid, grid, indexing="ij"))
            square = np.zeros((first.size, 4, 3))
            for corner, (a, b) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
                square[:, corner, u] = first + a / cells
                square[:, corner, v] = second + b / cells
                square[:, corner, axis] = end
            # Right-handed (u, v) points along +axis: kept at 0, turned round at 1, so that normals face inwards.
            order = [[0, 1, 2], [0, 2, 3]] if end == 0 else [[0, 2, 1], [0, 3, 2]]
            for triangle in order:
                corners.append(square[:, triangle] * SIZE_M)
                part.append(np.full(first.size, 2 if axis < 2 else end))
    triangles, parts = np.concatenate(corners), np.concatenate(part)
    palette = np.array([COLORS["floor"], COLORS["ceiling"], COLORS["walls"]])[parts]
    random = np.random.default_rng(1)
    linear = np.clip(palette * (1 + noise * random.standard_normal((len(parts), 1))), 0, 1)
    color = np.repeat(encode_srgb(linear)[:, None], 3, axis=1)
    count = len(parts)
    appearance = Appearance(
        images=(),
        face_image=np.full(count, -1),
        corner_uv=np.zeros((count, 3, 2)),
        corner_color=color,
        known=known,
    )
    record = ScanRecord(
        file="box", unit="m", unit_confidence=1.0, up_axis="+z", up_confidence=1.0, faces_read=count, faces_kept=count
    )
    # Corners are not shared between faces, as at a real scan's texture seams.
    scan = Scan(
        vertices=triangles.reshape(-1, 3),
        faces=np.arange(3 * count).reshape(-1, 3),
        appearance=appearance,
        record=record,
    )
    return scan, parts


@pytest.fixture(scope="session")
def box() -> tuple[Scan, np.ndarray]:
    """The box without noise."""
    return box_scan()
