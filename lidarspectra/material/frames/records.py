"""What each frame shows of places all over the surface, kept so that later stages can see how it changes with the view.

A texture has one colour a place. Whether it is brighter from where a lamp is mirrored in it, only the views tell.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, SmallFloatArray, SmallIntArray, float_array, int_array
from lidarspectra.errors import ArrayError, ScanError, WorkspaceError
from lidarspectra.io.array_files import read_arrays, write_arrays
from lidarspectra.io.files import writing

PLACES = 20_000  # at most
PLACE_SPACING_M = 0.05  # [m] on average, where that gives fewer
RECORDS_FILE = "frame-views.npz"


@dataclass(frozen=True, kw_only=True, eq=False)
class FrameRecords:
    """Views of places; one row is one place in one frame.

    Parameters
    ----------
    points, normals : (place, 3) float
        On the scan's surface. [m], [1]
    camera : (frame, 3) float
        Where each frame was taken. [m]
    place, frame : (row,) int
    light : (row,) float32
        Mean of the three channels of linear sRGB, on the scale of the scan's colours; a lower bound where clipped. [1]
    uneven : (row,) float32
        Relative deviation of the light around, in the picture. [1]
    clipped : (row,) bool
        Whether the frame is cut at white there.
    """

    points: FloatArray
    normals: FloatArray
    camera: FloatArray
    place: IntArray
    frame: IntArray
    light: SmallFloatArray
    uneven: SmallFloatArray
    clipped: BoolArray

    def __post_init__(self) -> None:
        rows = len(self.place)
        shapes: dict[str, tuple[int | None, ...]] = {
            "points": (None, 3), "normals": (len(self.points), 3), "camera": (None, 3),
        }  # fmt: skip
        for name, shape in shapes.items():
            object.__setattr__(self, name, float_array(getattr(self, name), name=f"FrameRecords.{name}", shape=shape))
        for name, count in (("place", len(self.points)), ("frame", len(self.camera))):
            number = int_array(getattr(self, name), name=f"FrameRecords.{name}", shape=(rows,))
            if rows and not (number.min() >= 0 and number.max() < count):
                found = f"{number.min()} to {number.max()}"
                raise ArrayError(expected=f"numbers below {count}", found=found, where=f"FrameRecords.{name}")
            object.__setattr__(self, name, number)
        for name in ("light", "uneven", "clipped"):
            if np.shape(getattr(self, name)) != (rows,):
                found = f"shape {np.shape(getattr(self, name))}"
                raise ArrayError(expected=f"{rows} values", found=found, where=f"FrameRecords.{name}")

    def scaled(self, factor: float) -> Self:
        """With all light multiplied by a factor [1]."""
        return replace(self, light=self.light * np.float32(factor))

    def save(self, folder: Path) -> None:
        """Write them into a folder; ScanError if that is not possible."""
        with writing(folder, error=ScanError):
            write_arrays(
                folder / RECORDS_FILE,
                points=self.points.astype(np.float32), normals=self.normals.astype(np.float32),
                camera=self.camera, place=self.place.astype(np.int32), frame=self.frame.astype(np.int32),
                light=self.light, uneven=self.uneven.astype(np.float16), clipped=self.clipped,
            )  # fmt: skip

    @classmethod
    def load(cls, folder: Path) -> Self | None:
        """Those of a scan stage's folder; None where it has none.

        Raises
        ------
        ScanError
            If the file is damaged.
        """
        path = folder / RECORDS_FILE
        if not path.is_file():
            return None
        try:
            kept = read_arrays(path)
            return cls(
                points=kept["points"].astype(np.float64), normals=kept["normals"].astype(np.float64),
                camera=kept["camera"].astype(np.float64), place=kept["place"].astype(np.int64),
                frame=kept["frame"].astype(np.int64), light=kept["light"].astype(np.float32),
                uneven=kept["uneven"].astype(np.float32), clipped=kept["clipped"].astype(np.bool_),
            )  # fmt: skip
        except (KeyError, ValueError, TypeError, ArrayError, WorkspaceError) as cause:
            raise ScanError(
                expected="what frames show, as the scan stage wrote it",
                found=str(cause),
                where=str(path),
                todo="Run the scan stage again.",
            ) from cause


class Recorder:
    """Keeps what frames show of some of the texels.

    Parameters
    ----------
    count : int
        Of all texels.
    area_m2 : float
        Of the scan, which says how many of them are kept. [m²]
    generator : numpy.random.Generator
        Chooses them.
    """

    def __init__(self, count: int, area_m2: float, generator: np.random.Generator) -> None:
        places = min(PLACES, round(area_m2 / PLACE_SPACING_M**2), count)
        self.texels = np.sort(generator.choice(count, places, replace=False))
        self._place = np.full(count, -1, dtype=np.int32)
        self._place[self.texels] = np.arange(places)
        self._rows: list[tuple[SmallIntArray, SmallIntArray, SmallFloatArray, SmallFloatArray, BoolArray]] = []

    def add(self, frame: int, texel: IntArray, light: FloatArray, uneven: FloatArray, clipped: BoolArray) -> None:
        """Add what a frame shows of some texels; each of them once.

        Parameters
        ----------
        frame : int
        texel : (seen,) int
        light : (seen, 3) float
        uneven : (seen,) float
        clipped : (seen,) bool
        """
        place = self._place[texel]
        kept = np.flatnonzero(place >= 0)
        level = light[kept].mean(axis=1).astype(np.float32)
        number = np.full(kept.size, frame, dtype=np.int32)
        self._rows.append((number, place[kept], level, uneven[kept].astype(np.float32), clipped[kept]))

    def records(self, *, points: FloatArray, normals: FloatArray, camera: FloatArray) -> FrameRecords:
        """All that was added, frame by frame.

        Parameters
        ----------
        points, normals : (place, 3) float
            Of `texels`. [m], [1]
        camera : (frame, 3) float
            Where each frame was taken. [m]
        """
        frame, place, light, uneven, clipped = (np.concatenate(each) for each in zip(*self._rows, strict=True))
        order = np.lexsort((place, frame))
        return FrameRecords(
            points=points, normals=normals, camera=camera, place=place[order], frame=frame[order], light=light[order],
            uneven=uneven[order], clipped=clipped[order],
        )  # fmt: skip
