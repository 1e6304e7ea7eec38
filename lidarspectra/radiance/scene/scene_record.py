"""The record of a scene: what each pass carries, and which files it has."""

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import SceneError
from lidarspectra.radiance.engine.bands import BandGroup, Mode
from lidarspectra.radiance.scene.panes import RELAYS_GLASS
from lidarspectra.radiance.scene.shining import ShiningSurface, record_of_shining, shining_of_record
from lidarspectra.radiance.scene.slots import Slots, whole_channels
from lidarspectra.spectra.spectrum import BandSet
from lidarspectra.words import counted

SCENE_FILE = "scene.json"
BANDS_FILE = "bands.npz"
LAMPS_FILE = "lamps.rad"
SLOT_PREFIX = "slot_"  # of the slots' arrays in BANDS_FILE
_BAND_ARRAYS = ("centers_nm", "widths_nm", "wavelengths_nm", "responses")
MESH_FILE = "room.obj"
OPEN_MESH_FILE = "room_open.obj"
FORMAT = 2  # of scene.json; raised when its meaning changes. 1 had a slot for each channel, and is read still


@dataclass(frozen=True, kw_only=True)
class PlainTrace:
    """One run of rtrace whose answer, times its sign, is a part of a pass's light (`scene.pane_text`).

    Parameters
    ----------
    name : str
        Safe name, of files too.
    sign : {1, -1}
    bounces : int or None
        Diffuse reflections (`-ab`); None: as many as the accuracy has.
    """

    name: str
    sign: int = 1
    bounces: int | None = None

    @property
    def octree(self) -> str:
        """Octree's file name, in the scene folder."""
        return f"{self.name}.oct"


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
        The scene's slots that it carries.
    surfaces : str
        Name of the pass whose mesh and materials it shares: the first of its spectral and band group.
    mesh : str
        Mesh that is compiled for it; the sun's has holes at the windows.
    data_files : tuple of str
        Files that its scene reads besides.
    has_glass : bool
        Whether there are panes of glass, for which it has more octrees (`pane_text`).
    bins_file : str
        Function file by which light is binned by the direction that it comes from (`sky_patches`): the lamps are
        then patches of the sky, all of one modifier. Empty where each lamp is a modifier of its own.
    """

    name: str
    lamps: tuple[int, ...]
    group: BandGroup
    surfaces: str
    mesh: str = MESH_FILE
    data_files: tuple[str, ...] = ()
    has_glass: bool = False
    bins_file: str = ""

    @property
    def slots(self) -> tuple[int, ...]:
        """Indices of the scene's slots that it carries, ascending."""
        return self.group.bands

    @property
    def slot_count(self) -> int:
        """Values that the engine gives for a ray: its slots, and some to pad them."""
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
    def images_octree(self) -> str:
        """Octree in which lamps have images in panes of glass; the octree itself without such."""
        return f"{self.name}_images.oct" if self.has_glass else self.octree

    @property
    def glow_octree(self) -> str:
        """Octree in which panes of glass spread what they reflect of the lamps; the octree itself without such."""
        return f"{self.name}_glow.oct" if self.has_glass else self.octree

    @property
    def panes(self) -> str:
        """Name of the octree's files in which nothing reflects but glass and mirrors."""
        return f"{self.name}_panes"

    @property
    def panes_mesh_file(self) -> str:
        """Its compiled mesh."""
        return f"{self.surfaces}_panes_room.rtm"

    @property
    def panes_materials_file(self) -> str:
        """File with the materials of that mesh."""
        return f"{self.surfaces}_panes_materials.rad"

    @property
    def plain_traces(self) -> tuple[PlainTrace, ...]:
        """Runs of rtrace that add up to all of its light: one, and with panes of glass three."""
        if not self.has_glass:
            return (PlainTrace(name=self.name),)
        return (
            PlainTrace(name=f"{self.name}_glow"),
            PlainTrace(name=f"{self.name}_images", bounces=0),
            PlainTrace(name=self.panes, sign=-1, bounces=1),
        )

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
    slots : Slots
        The channels, in the parts that passes carry.
    mode : 'native' or 'rgb'
        How passes carry them.
    lamp_names : tuple of str
        The user's words.
    lamp_modifiers : tuple of str
        One safe modifier a lamp, for `rcontrib -m`; lamps of one shape in one place share theirs.
    slot_flux : (lamp, slot) float
        Spectral flux. [W/nm]
    written_flux : (lamp, slot) float
        The same with dark slots lifted to 1e-6 of the peak, in a small unit (`bands.WRITTEN_PER_WATT`): what the
        scene's lamps send. A contribution divided by it is the lamp's coefficient [m⁻²]. [µW/nm]
    slot_reflectance : (lamp, slot) float
        The room's mean reflectance in each slot, as each lamp's light weighs it. [1]
    passes : tuple of ScenePass
        Together they light every lamp in every slot once.
    shining : tuple of ShiningSurface
        Surfaces of those lamps whose direct light can be had by ray casting (`sampling.cast_light`).
    relays : int
        Reflections of lamps' light from pane to pane that are followed (`panes`).
    left_out_m2 : dict of str to float
        Area of 'glass' and 'mirror' that is in no flat pane. [m²]
    """

    folder: Path
    slots: Slots
    mode: Mode
    lamp_names: tuple[str, ...]
    lamp_modifiers: tuple[str, ...]
    slot_flux: FloatArray
    written_flux: FloatArray
    slot_reflectance: FloatArray
    passes: tuple[ScenePass, ...]
    shining: tuple[ShiningSurface, ...] = ()
    relays: int = RELAYS_GLASS
    left_out_m2: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        shape = (len(self.lamp_names), len(self.slots))
        flux = float_array(self.slot_flux, name="RadianceScene.slot_flux", shape=shape)
        object.__setattr__(self, "slot_flux", flux)
        written = float_array(self.written_flux, name="RadianceScene.written_flux", shape=shape)
        object.__setattr__(self, "written_flux", written)
        reflectance = float_array(self.slot_reflectance, name="RadianceScene.slot_reflectance", shape=shape)
        object.__setattr__(self, "slot_reflectance", reflectance)
        carried = np.zeros(shape, dtype=np.int64)
        for scene_pass in self.passes:
            carried[np.ix_(scene_pass.lamps, scene_pass.slots)] += 1
        if len(self.lamp_modifiers) != shape[0] or np.any(carried != 1) or np.any(written <= 0):
            raise SceneError(
                expected="passes that carry every lamp in every slot once, and a modifier for every lamp",
                found=f"{int((carried != 1).sum())} lamp-slots that are not",
                where=str(self.folder),
            )

    def __repr__(self) -> str:
        lamps = counted(len(self.lamp_names), "lamp")
        passes = "1 pass" if len(self.passes) == 1 else f"{len(self.passes)} passes"
        return (
            f"<RadianceScene in {self.folder}: {lamps}, {len(self.bands)} channels in {len(self.slots)} slots, "
            f"{passes}, mode {self.mode}>"
        )

    @property
    def bands(self) -> BandSet:
        """The sensor's channels."""
        return self.slots.channels

    @cached_property
    def flux(self) -> FloatArray:
        """(lamp, band) spectral flux of each lamp in each channel [W/nm]."""
        return self.slots.fold(self.slot_flux)


def save_scene(scene: RadianceScene) -> None:
    """Write the scene's record into its folder, beside the files that `write_scene` made there."""
    arrays = {
        f"{prefix}{name}": getattr(bands, name)
        for prefix, bands in (("", scene.bands), (SLOT_PREFIX, scene.slots.bands))
        for name in _BAND_ARRAYS
    }
    np.savez_compressed(
        scene.folder / BANDS_FILE,
        **arrays,
        channel=scene.slots.channel,
        share=scene.slots.share,
        error=scene.slots.error,
        mean_reflectance=scene.slots.mean_reflectance,
        slot_reflectance=scene.slot_reflectance,
    )
    record: dict[str, Any] = {
        "format": FORMAT,
        "bands": scene.bands.name,
        "mode": scene.mode,
        "lamps": [
            {"name": name, "modifier": modifier, "flux_W_nm": flux.tolist(), "written_flux_uW_nm": written.tolist()}
            for name, modifier, flux, written in zip(
                scene.lamp_names, scene.lamp_modifiers, scene.slot_flux, scene.written_flux, strict=True
            )
        ],
        "passes": [
            {
                "name": scene_pass.name,
                "lamps": scene_pass.lamps,
                "bands": scene_pass.slots,
                "slots": scene_pass.slot_count,
                "edges_nm": scene_pass.edges_nm,
                "octree": scene_pass.octree,
                "surfaces": scene_pass.surfaces,
                "mesh": scene_pass.mesh,
                "data_files": scene_pass.data_files,
                "has_glass": scene_pass.has_glass,
            }
            for scene_pass in scene.passes
        ],
    }
    record["relays"], record["left_out_m2"] = scene.relays, scene.left_out_m2
    record["shining"] = record_of_shining(scene.shining)
    plain = [name for each in scene.passes for name in (f"{each.panes}.oct", each.panes_mesh_file)]
    compiled = [*_compiled_files(scene), *(name for name in plain if (scene.folder / name).is_file())]
    record["bytes"] = {name: (scene.folder / name).stat().st_size for name in compiled}
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
        if record["format"] not in (1, FORMAT):
            raise _unreadable(folder, f"format {record['format']}")
        slots, slot_reflectance = _load_slots(folder, record)
        scene = RadianceScene(
            folder=folder,
            slots=slots,
            mode=record["mode"],
            lamp_names=tuple(lamp["name"] for lamp in record["lamps"]),
            lamp_modifiers=tuple(lamp["modifier"] for lamp in record["lamps"]),
            slot_flux=np.array([lamp["flux_W_nm"] for lamp in record["lamps"]]),
            written_flux=np.array([lamp["written_flux_uW_nm"] for lamp in record["lamps"]]),
            slot_reflectance=slot_reflectance,
            passes=tuple(_load_pass(entry, record["mode"]) for entry in record["passes"]),
            shining=shining_of_record(record.get("shining", {})),  # these three: later than 0.1.0
            relays=record.get("relays", RELAYS_GLASS),
            left_out_m2=record.get("left_out_m2", {}),
        )
    except (OSError, ValueError, KeyError, TypeError, EOFError) as cause:
        raise _unreadable(folder, f"{type(cause).__name__}: {cause}") from cause
    sizes = record.get("bytes", {})
    for name in sorted({*_compiled_files(scene), *sizes}):
        _check_size(folder, name, sizes.get(name))
    return scene


def _load_slots(folder: Path, record: dict[str, Any]) -> tuple[Slots, FloatArray]:
    with np.load(folder / BANDS_FILE, allow_pickle=False) as arrays:
        channels = BandSet(name=record["bands"], **{name: arrays[name] for name in _BAND_ARRAYS})
        if record["format"] == 1:
            return whole_channels(channels), np.zeros((len(record["lamps"]), len(channels)))
        parts = {name: arrays[f"{SLOT_PREFIX}{name}"] for name in _BAND_ARRAYS}
        slots = Slots(
            channels=channels,
            bands=BandSet(name=f"{channels.name} in slots", **parts),
            **{name: arrays[name] for name in ("channel", "share", "error", "mean_reflectance")},
        )
        return slots, arrays["slot_reflectance"]


def _compiled_files(scene: RadianceScene) -> list[str]:
    """What the engine reads: octrees, and the meshes beside them."""
    return sorted(
        {name for each in scene.passes for name in (each.octree, each.images_octree, each.glow_octree, each.mesh_file)}
    )


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
        has_glass=entry.get("has_glass", False),  # not in scenes of version 0.1.0
    )


def _unreadable(folder: Path, found: str) -> SceneError:
    return SceneError(
        expected="a scene that write_scene made",
        found=found,
        where=str(folder),
        todo="Make the scene stage again ('lidarspectra run' with '--from scene').",
    )
