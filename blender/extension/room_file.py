"""What `lidarspectra export RUN --blender` writes: the room, its points, and each lamp's share of the light."""

import io
import json
import zipfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .faults import ExtensionError

FORMAT = 1
FILE_NAME = "room.npz"
ARRAYS = {  # name: dimensions
    "vertices": 2, "faces": 2, "face_material": 1, "face_color": 2, "points": 2, "normals": 2, "triangles": 2,
    "buried": 1, "shares": 3, "standard_error": 2, "scale": 2,
}  # fmt: skip

Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True, kw_only=True, eq=False)
class RoomFile:
    """What the file holds.

    Parameters
    ----------
    path : Path
    run, version : str
        Name of the run, version of the program that wrote it.
    layers : list of dict
        'name', 'words' and 'unit' of each quantity and channel.
    lamps : list of dict
        'name', 'shape', 'center', 'normal', 'rotation_deg', 'size', 'luminous_flux_lm', 'color', 'dim' (None for lamps
        that are not in the run file's [[lamps]]).
    materials : list of dict
        'name', 'category', 'source', 'provenance', 'specularity', 'roughness', 'color'.
    lamp_spectra, reflectances : list of str
        Names of the databases.
    arrays : dict
        As `lidarspectra.mapping.export.blender` describes them: lengths in metres, z up.
    """

    path: Path
    run: str
    version: str
    layers: list[dict[str, Any]]
    lamps: list[dict[str, Any]]
    materials: list[dict[str, Any]]
    lamp_spectra: list[str]
    reflectances: list[str]
    arrays: dict[str, NDArray[Any]]

    def light(self, factors: dict[str, float], layer: int | None = None) -> Floats:
        """Light under dimmed lamps, Q = Σ_lamp factor x share.

        Parameters
        ----------
        factors : dict of str to float
            On the light that a lamp has in the run, by name; 1 for those that are left out.
        layer : int, optional
            One layer alone.

        Returns
        -------
        light : (point, layer) or (point,) float
            [unit of the layer]
        """
        shares = self.arrays["shares"] if layer is None else self.arrays["shares"][:, :, layer]
        light = np.zeros(shares.shape[1:])
        for lamp, share in zip(self.lamps, shares, strict=True):
            light += factors.get(lamp["name"], 1.0) * share.astype(np.float64)
        return light


def read_room(path: Path) -> RoomFile:
    """Read the file, or give what was read of it before.

    Raises
    ------
    ExtensionError
        If it is not there, damaged, or of another version's format.
    """
    try:
        changed = path.stat().st_mtime_ns
    except OSError as cause:
        raise ExtensionError(
            expected="the run's light for Blender", found="no such file", where=str(path), todo="Load the run again."
        ) from cause
    return _read(path, changed)


@lru_cache(maxsize=4)
def _read(path: Path, changed: int) -> RoomFile:
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as held:
            about = json.loads(str(held["about"]))
            arrays = {name: held[name] for name in ARRAYS}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as cause:
        raise ExtensionError(
            expected="what 'lidarspectra export RUN --blender' writes", found=str(cause), where=str(path),
            todo="Delete it and load the run again.",
        ) from cause  # fmt: skip
    if about.get("format") != FORMAT:
        raise ExtensionError(
            expected=f"format {FORMAT}", found=str(about.get("format")), where=str(path),
            todo="Use extension and program of the same version, and load the run again.",
        )  # fmt: skip
    _check(path, about, arrays)
    return RoomFile(path=path, arrays=arrays, **{name: about[name] for name in (
        "run", "version", "layers", "lamps", "materials", "lamp_spectra", "reflectances")})  # fmt: skip


def _check(path: Path, about: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> None:
    points = arrays["points"].shape[0]
    wanted = (len(about["lamps"]), points, len(about["layers"]))
    for name, dimensions in ARRAYS.items():
        if arrays[name].ndim != dimensions:
            raise ExtensionError(
                expected=f"{name} of {dimensions} dimensions", found=str(arrays[name].shape), where=str(path)
            )
    if arrays["shares"].shape != wanted or not np.isfinite(arrays["shares"]).all():
        raise ExtensionError(
            expected=f"finite shares of light, {wanted}", found=str(arrays["shares"].shape), where=str(path)
        )
    for name, count in (
        ("faces", len(arrays["vertices"])),
        ("triangles", points),
        ("face_material", len(about["materials"])),
    ):
        indices = arrays[name]
        if indices.size and (indices.min() < 0 or indices.max() >= count):
            raise ExtensionError(expected=f"{name} from 0 to {count - 1}", found=f"{indices.max()}", where=str(path))
