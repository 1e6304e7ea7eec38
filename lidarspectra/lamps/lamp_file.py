"""Lamps on disk: what a scene was lit with, for the report and for relighting."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lidarspectra.errors import LampError, WorkspaceError
from lidarspectra.io.array_files import read_arrays, write_arrays
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.patterns import Opening, SkyLight, SunBeam
from lidarspectra.lamps.shapes import shape_of
from lidarspectra.spectra.spectrum import Spectrum

LAMPS_RECORD = "lamps.json"
SKIES_FILE = "skies.npz"  # beside it, where windows have daylight: what comes in by direction
SAVED = (str, float, int)  # types of what the record keeps of a shape


def save_lamps(lamps: Sequence[Lamp], folder: Path) -> Path:
    """Write lamps, with their absolute spectra, as `lamps.json`, and the sky behind windows as `skies.npz`.

    Parameters
    ----------
    lamps : sequence of Lamp
    folder : Path
        The scene's.

    Returns
    -------
    path : Path
    """
    skies = {
        f"window{number}": lamp.shape.pattern.incoming.astype(np.float32)
        for number, lamp in enumerate(lamps)
        if isinstance(lamp.shape.pattern, SkyLight)
    }
    rows = [
        {
            "name": lamp.name,
            "shape": lamp.shape.word,
            "center_m": lamp.center.tolist(),
            "normal": lamp.normal.tolist(),
            "size_m": list(lamp.size),
            "rotation_deg": lamp.rotation_deg,
            "options": {name: value for name, value in lamp.shape.options.items() if isinstance(value, SAVED)},
            "openings": _openings(lamp),
            "sky": name if (name := f"window{number}") in skies else None,
            "spectrum_name": lamp.flux.name,
            "wavelengths_nm": lamp.flux.wavelengths_nm.tolist(),
            "flux_W_nm": lamp.flux.values.tolist(),
        }
        for number, lamp in enumerate(lamps)
    ]
    if skies:
        write_arrays(folder / SKIES_FILE, **skies)
    path = folder / LAMPS_RECORD
    path.write_text(
        json.dumps(rows, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8", newline="\n"
    )
    return path


def load_lamps(folder: Path) -> tuple[Lamp, ...]:
    """Read the lamps of a scene.

    Parameters
    ----------
    folder : Path
        Where `save_lamps` wrote them.

    Returns
    -------
    lamps : tuple of Lamp
        As saved: what light they give by how much, where the sun comes in, and what windows let in from where.

    Raises
    ------
    LampError
        If the file is missing or damaged.
    """
    path = folder / LAMPS_RECORD
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
        skies = read_arrays(folder / SKIES_FILE) if any(row.get("sky") for row in rows) else {}
        return tuple(
            Lamp(
                name=row["name"],
                shape=shape_of(row["shape"], tuple(row["size_m"]), **row["options"], **_given_light(row, skies)),
                center=np.array(row["center_m"]),
                normal=np.array(row["normal"]),
                rotation_deg=row["rotation_deg"],
                flux=Spectrum(
                    wavelengths_nm=np.array(row["wavelengths_nm"]),
                    values=np.array(row["flux_W_nm"]),
                    name=row["spectrum_name"],
                ),
            )
            for row in rows
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError, WorkspaceError) as cause:
        raise LampError(
            expected="the lamps of a scene, as this version writes them",
            found=f"{type(cause).__name__}: {cause}",
            where=str(path),
            todo="Make the scene again: lidarspectra run ROOM.toml --from scene.",
        ) from cause


def _openings(lamp: Lamp) -> list[dict[str, object]]:
    """What the sun shines through; nothing for other lamps."""
    pattern = lamp.shape.pattern
    if not isinstance(pattern, SunBeam):
        return []
    return [
        {"corners_m": each.corners.tolist(), "inward": each.inward.tolist(), "transmittance": each.transmittance}
        for each in pattern.openings
    ]


def _given_light(row: Mapping[str, Any], skies: Mapping[str, np.ndarray[Any, Any]]) -> dict[str, Any]:
    """The sun's openings, or what a window lets in, as options of its shape; none in files of earlier versions."""
    if row.get("sky"):
        return {"incoming": skies[row["sky"]].astype(np.float64)}
    if not row.get("openings"):
        return {}
    return {
        "openings": tuple(
            Opening(
                corners=np.array(each["corners_m"]),
                inward=np.array(each["inward"]),
                transmittance=float(each["transmittance"]),
            )
            for each in row["openings"]
        )
    }
