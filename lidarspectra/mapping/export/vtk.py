"""Maps and surfaces as VTK's XML files of unstructured grids (.vtu), which ParaView opens.

Arrays stand in the file as base64, each with its length before it.

References
----------
Kitware, "VTK XML Formats" (VTK documentation).
"""

import base64
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import MapError
from lidarspectra.io.files import write_whole, writing

VERTEX, TRIANGLE = 1, 5  # VTK's cell types
_KINDS = {"f4": "Float32", "f8": "Float64", "i8": "Int64", "u1": "UInt8"}


def save_vtu(
    path: Path,
    positions: FloatArray,
    cells: Sequence[IntArray],
    *,
    point_data: Mapping[str, NDArray[Any]] | None = None,
    cell_data: Mapping[str, NDArray[Any]] | None = None,
) -> Path:
    """Write an unstructured grid.

    Parameters
    ----------
    path : Path
    positions : (point, 3) float
        [m]
    cells : sequence of (cell, corner) int
        Blocks of triangles (three corners) or of points (one).
    point_data, cell_data : mapping of str to (point, ...) or (cell, ...) array
        By name, with the unit in it; cells in the order of the blocks.

    Raises
    ------
    MapError
        If the file cannot be written.
    """
    corners = np.concatenate([block.ravel() for block in cells]).astype(np.int64)
    sizes = np.concatenate([np.full(len(block), block.shape[1]) for block in cells])
    kinds = np.where(sizes == 1, VERTEX, TRIANGLE).astype(np.uint8)
    order = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
    topology: dict[str, NDArray[Any]] = {
        "connectivity": corners,
        "offsets": np.cumsum(sizes).astype(np.int64),
        "types": kinds,
    }
    text = (
        f'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="{order}" '
        f'header_type="UInt64">\n<UnstructuredGrid>\n<Piece NumberOfPoints="{len(positions)}" '
        f'NumberOfCells="{sizes.size}">\n<Points>\n{_array("Points", positions.astype(np.float64))}</Points>\n'
        f"<Cells>\n{_arrays(topology)}</Cells>\n<PointData>\n{_arrays(point_data or {})}</PointData>\n"
        f"<CellData>\n{_arrays(cell_data or {})}</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
    )
    with writing(path.parent, error=MapError):
        write_whole(path, text)
    return path


def _arrays(values: Mapping[str, NDArray[Any]]) -> str:
    return "".join(_array(name, each) for name, each in values.items())


def _array(name: str, values: NDArray[Any]) -> str:
    """A DataArray element; several numbers a row are its components."""
    parts = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
    content = np.ascontiguousarray(values).tobytes()
    header = np.array([len(content)], dtype=np.uint64).tobytes()
    kind = _KINDS[values.dtype.str[1:]]
    data = base64.b64encode(header + content).decode("ascii")
    return f'<DataArray type="{kind}" Name={quoteattr(name)}{parts} format="binary">\n{data}\n</DataArray>\n'
