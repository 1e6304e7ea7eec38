"""Pictures of frames, each decoded once and kept in a temporary file.

Texels are combined tile by tile, each tile by all frames, so that every picture is used many times. In memory they
would grow with the number of frames: 3 MB each.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from lidarspectra.arrays import BoolArray, ByteArray, FloatArray, SmallFloatArray
from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.frames import DepthMap, Frame
from lidarspectra.io.scratch import ScratchArray, ScratchFile
from lidarspectra.material.frames.frame_views import Picture, pictures
from lidarspectra.progress import Progress


@dataclass(frozen=True, kw_only=True, eq=False)
class _Kept:
    """A picture's arrays in the file, its sharpness [1], and its depth and confidence, if it has them."""

    light: ScratchArray
    uneven: ScratchArray
    clipped: ScratchArray
    sharpness: float
    depth: tuple[ScratchArray, ScratchArray] | None


class KeptPictures:
    """Averaged pictures of frames in a temporary file, until it is closed.

    Parameters
    ----------
    frames : sequence of Frame
    table : (256, 3) float
        Light of each byte in each channel. [1]
    progress : callable

    Raises
    ------
    ScanError
        If the disk is full.
    """

    def __init__(self, frames: Sequence[Frame], table: FloatArray, progress: Progress) -> None:
        self._file = ScratchFile(error=ScanError)
        self._kept: list[_Kept | None] = []
        for number, picture in enumerate(pictures(frames, table)):
            progress(number / len(frames), "reading frames again, by one radiometry")
            self._kept.append(self._keep(picture) if isinstance(picture, Picture) else None)

    def __getitem__(self, number: int) -> Picture | None:
        """A frame's picture; None if it is damaged."""
        kept = self._kept[number]
        if kept is None:
            return None
        return Picture(
            light=cast("SmallFloatArray", self._file.read(kept.light)),
            uneven=cast("SmallFloatArray", self._file.read(kept.uneven)),
            clipped=cast("BoolArray", self._file.read(kept.clipped)),
            sharpness=kept.sharpness,
            depth=self._depth(kept),
        )

    def close(self) -> None:
        """Remove the file."""
        self._file.close()

    def _keep(self, picture: Picture) -> _Kept:
        keep, lidar = self._file.keep, picture.depth
        return _Kept(
            light=keep(picture.light), uneven=keep(picture.uneven), clipped=keep(picture.clipped),
            sharpness=picture.sharpness, depth=None if lidar is None else (keep(lidar.depth_m), keep(lidar.confidence)),
        )  # fmt: skip

    def _depth(self, kept: _Kept) -> DepthMap | None:
        if kept.depth is None:
            return None
        depth, confidence = (self._file.read(each) for each in kept.depth)
        return DepthMap(depth_m=cast("FloatArray", depth), confidence=cast("ByteArray", confidence))
