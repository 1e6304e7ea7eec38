"""The record of a scene: what each pass carries, and which files it has."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import SceneError
from lidarspectra.radiance.engine.bands import BandGroup, Mode
from lidarspectra.spectra.spectrum import BandSet

SCENE_FILE = "scene.json"
BANDS_FILE = "bands.npz"
LAMPS_FILE = "lamps.rad"
MESH_FILE = "room.obj"
OPEN_MESH_FILE = "room_open.obj"
FORMAT = 1  # [1] of scene.json; raised when its meaning changes


@dataclass(frozen=True, kw_only=True)
class ScenePass:
    """What one octree carries.

    Parameters
    ----------
    name : str
        Safe name, 'pass0', 'pass1', ...
    lamps : tuple of int
        Indices of the lamps that it lights.
    group : BandGroup
        Its bands and slots.
    surfaces : str
        Name of the pass whose mesh and materials it shares: the first of its spectral and band group.
    mesh : str
        Mesh that is compiled for it; the sun's has holes at the windows.
    data_files : tuple of str
        Files that its scene reads besides.
    """

    name: str
    lamps: tuple[int, ...]
    group: BandGroup
    surfaces: str
    mesh: str = MESH_FILE
    data_files: tuple[str, ...] = ()

    @property
    def bands(self) -> tuple[int, ...]:
        """Indices of the bands that it carries, ascending."""
        return self.group.bands

    @property
    def slot_count(self) -> int:
        """Values that the engine gives for a ray."""
        return self.group.slot_count

    @property
    def edges_nm(self) -> tuple[int, int]:
        """Edges for `-cw` [nm]."""
        return self.group.edges_nm

    @property
    def octree(self) -> str:
        """Octree's file name, in the scene folder."""
        return f"{self.name}.oct"

    @property
    def scene_file(self) -> str:
        """File with what its lamps send, and its mesh."""
        return f"{self.name}.rad"

    @property
    def materials_file(self) -> str:
        """File with the mesh's materials."""
        return f"{self.surfaces}_materials.rad"

    @property
    def mesh_file(self) -> str:
        """Compiled mesh."""
        return f"{self.surfaces}_room.rtm"


@dataclass(frozen=True, kw_only=True, eq=False)
class RadianceScene:
    """A scene on disk, ready to be traced.

    Parameters
    ----------
    folder : Path
        Where its files are; programs run there, so that they see simple names only.
    bands : BandSet
        The channels.
    mode : 'native' or 'rgb'
        How passes carry them.
    lamp_names : tuple of str
        The user's words.
    lamp_modifiers : tuple of str
        One safe modifier a lamp, for `rcontrib -m`.
    flux : (lamp, band) float
        Spectral flux. [W/nm]
    written_flux : (lamp, band) float
        The same with dark bands lifted to 1e-6 of the peak, in a small unit (`bands.WRITTEN_PER_WATT`): what the
        scene's lamps send. A contribution divided by it is the lamp's coefficient [m⁻²]. [µW/nm]
    passes : tuple of ScenePass
        Together they light every lamp in every band once.
    """

    folder: Path
    bands: BandSet
    mode: Mode
    lamp_names: tuple[str, ...]
    lamp_modifiers: tuple[str, ...]
    flux: FloatArray
    written_flux: FloatArray
    passes: tuple[ScenePass, ...]

    def __post_init__(self) -> None:
        shape = (len(self.lamp_names), len(self.bands))
        object.__setattr__(self, "flux", float_array(self.flux, name="RadianceScene.flux", shape=shape))
        written = float_array(self.written_flux, name="RadianceScene.written_flux", shape=shape)
        object.__setattr__(self, "written_flux", written)
        carried = np.zeros(shape, dtype=np.int64)
        for scene_pass in self.passes:
            carried[np.ix_(scene_pass.lamps, scene_pass.bands)] += 1
        if len(self.lamp_modifiers) != shape[0] or np.any(carried != 1) or np.any(written <= 0):
            raise SceneError(
                expected="passes that carry every lamp in every band once, and a modifier for every lamp",
                found=f"{int((carried != 1).sum())} lamp-bands that are not",
                where=str(self.folder),
            )


def save_scene(scene: RadianceScene) -> None:
    """Write the scene's record into its folder, beside the files that `write_scene` made there."""
    np.savez_compressed(
        scene.folder / BANDS_FILE,
        centers_nm=scene.bands.centers_nm,
        widths_nm=scene.bands.widths_nm,
        wavelengths_nm=scene.bands.wavelengths_nm,
        responses=scene.bands.responses,
    )
    record: dict[str, Any] = {
        "format": FORMAT,
        "bands": scene.bands.name,
        "mode": scene.mode,
        "lamps": [
            {"name": name, "modifier": modifier, "flux_W_nm": flux.tolist(), "written_flux_uW_nm": written.tolist()}
            for name, modifier, flux, written in zip(
                scene.lamp_names, scene.lamp_modifiers, scene.flux, scene.written_flux, strict=True
            )
        ],
        "passes": [
            {
                "name": scene_pass.name,
                "lamps": scene_pass.lamps,
                "bands": scene_pass.bands,
                "slots": scene_pass.slot_count,
                "edges_nm": scene_pass.edges_nm,
                "octree": scene_pass.octree,
                "surfaces": scene_pass.surfaces,
                "mesh": scene_pass.mesh,
                "data_files": scene_pass.data_files,
            }
            for scene_pass in scene.passes
        ],
    }
    record["bytes"] = {name: (scene.folder / name).stat().st_size for name in _compiled_files(scene)}
    text = json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False)
    (scene.folder / SCENE_FILE).write_text(text + "\n", encoding="utf-8", newline="\n")


def load_scene(folder: Path) -> RadianceScene:
    """Read the record of a scene that `write_scene` wrote.

    Parameters
    ----------
    folder : Path
        The scene folder; it may have moved since.

    Returns
    -------
    scene : RadianceScene

    Raises
    ------
    SceneError
        If the record is missing, of another format or damaged, or an octree or mesh that it names is not there or of
        another size: of a cut octree the engine may read what is left, and tell of no light.
    """
    try:
        record: dict[str, Any] = json.loads((folder / SCENE_FILE).read_text(encoding="utf-8"))
        with np.load(folder / BANDS_FILE, allow_pickle=False) as arrays:
            bands = BandSet(name=record["bands"], **{name: arrays[name] for name in arrays.files})
        if record["format"] != FORMAT:
            raise _unreadable(folder, f"format {record['format']}")
        scene = RadianceScene(
            folder=folder,
            bands=bands,
            mode=record["mode"],
            lamp_names=tuple(lamp["name"] for lamp in record["lamps"]),
            lamp_modifiers=tuple(lamp["modifier"] for lamp in record["lamps"]),
            flux=np.array([lamp["flux_W_nm"] for lamp in record["lamps"]]),
            written_flux=np.array([lamp["written_flux_uW_nm"] for lamp in record["lamps"]]),
            passes=tuple(_load_pass(entry, record["mode"]) for entry in record["passes"]),
        )
    except (OSError, ValueError, KeyError, TypeError, EOFError) as cause:
        raise _unreadable(folder, f"{type(cause).__name__}: {cause}") from cause
    for name in _compiled_files(scene):
        _check_size(folder, name, record.get("bytes", {}).get(name))
    return scene


def _compiled_files(scene: RadianceScene) -> list[str]:
    """What the engine reads: octrees, and the meshes beside them."""
    return sorted({name for scene_pass in scene.passes for name in (scene_pass.octree, scene_pass.mesh_file)})


def _check_size(folder: Path, name: str, written: int | None) -> None:
    try:
        size = (folder / name).stat().st_size
    except OSError as cause:
        raise _unreadable(folder, f"no {name}") from cause
    if written is not None and size != written:
        raise _unreadable(folder, f"{name} of {size} bytes, of which {written} were written")


def _load_pass(entry: dict[str, Any], mode: Mode) -> ScenePass:
    group = BandGroup(bands=tuple(entry["bands"]), slot_count=entry["slots"], mode=mode)
    return ScenePass(
        name=entry["name"],
        lamps=tuple(entry["lamps"]),
        group=group,
        surfaces=entry["surfaces"],
        mesh=entry["mesh"],
        data_files=tuple(entry["data_files"]),
    )


def _unreadable(folder: Path, found: str) -> SceneError:
    return SceneError(
        expected="a scene that write_scene made",
        found=found,
        where=str(folder),
        todo="Make the scene stage again ('lidarspectra run' with '--from scene').",
    )
