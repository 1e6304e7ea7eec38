"""Write the Radiance scene: one octree a pass.

A pass lights a few lamps of one spectral group and carries the bands of one band group (see `bands`). Its octree holds
the room's mesh with that pass's reflectances, those lamps as lights, and all other lamps as black shapes, so that every
pass sees the same obstacles. Adding up the passes' lamps gives the room.

Lamps of one shape in one place, as the warm and the cold light of one luminaire, are one shape with one modifier, lit
by one of them in each pass: two surfaces in one place would hide one another.

    scene.json  bands.npz      the record (`scene_record`)
    lamps.rad                  shapes of all lamps;  lampN_candela.dat  how a luminaire's light is spread
    room.obj                   the mesh; passN_materials.rad  its materials;  passN_room.rtm  both, compiled
    passN.rad                  what the lamps send, and the mesh; with daylight also windows, sun and their data files
    passN.oct                  what rtrace and rcontrib read
    passN_images, _glow        with panes of glass: octrees with what lamps are reflected by, and their text; glass.cal
    passN_panes                as _glow, with all else in the room black (`pane_text`)
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.errors import SceneError
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp, are_one_shape
from lidarspectra.lamps.patterns import SkyLight, SunBeam
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.progress import Progress, shares, silent
from lidarspectra.radiance.engine.bands import (
    WRITTEN_PER_WATT,
    BandGroup,
    Mode,
    SpectralGroup,
    band_groups,
    lamp_band_flux,
    spectral_groups,
    with_floor,
)
from lidarspectra.radiance.engine.engine import Engine, find_engine
from lidarspectra.radiance.engine.octree import check_octree, compile_mesh, compile_octree
from lidarspectra.radiance.scene import primitives
from lidarspectra.radiance.scene.daylight import (
    mask_text,
    sky_data_texts,
    sun_text,
    window_shape_text,
    window_text,
)
from lidarspectra.radiance.scene.lamp_text import (
    candela_file,
    lamp_data_text,
    lamp_geometry_text,
    lamp_material_text,
)
from lidarspectra.radiance.scene.mesh_text import CREASE_DEG, mesh_text
from lidarspectra.radiance.scene.openings import open_windows
from lidarspectra.radiance.scene.pane_text import GLASS_FILE, GLASS_FUNCTIONS, glow_text, images_text, mirrors_text
from lidarspectra.radiance.scene.panes import Pane, find_panes
from lidarspectra.radiance.scene.primitives import Color
from lidarspectra.radiance.scene.scene_record import LAMPS_FILE, MESH_FILE, OPEN_MESH_FILE, save_scene
from lidarspectra.radiance.scene.scene_record import RadianceScene as RadianceScene
from lidarspectra.radiance.scene.scene_record import ScenePass as ScenePass
from lidarspectra.radiance.scene.scene_record import load_scene as load_scene
from lidarspectra.radiance.scene.shining import find_shining
from lidarspectra.radiance.scene.slots import Slots, choose_slots, whole_channels
from lidarspectra.radiance.scene.surfaces import surface_slots, surface_text
from lidarspectra.spectra.spectrum import BandSet, Spectrum

WRITING_SHARE, COMPILING_SHARE, OCTREE_SHARE = 1.0, 0.5, 0.05  # of the time: the mesh's text; a pass's mesh, octree
PANE_KINDS = ("glass", "mirror")  # of materials that are not black in `ScenePass.panes`
LAMPS_PER_PASS = 4  # a path asks every lamp of its pass for light: 64 lamps in one pass took 13 times 4 lamps' time


def write_scene(
    scan: Scan,
    materials: MaterialMap,
    lamps: Sequence[Lamp],
    bands: BandSet,
    folder: str | PathLike[str],
    *,
    mode: Mode = "native",
    engine: Engine | None = None,
    crease_deg: float = CREASE_DEG,
    fine_slots: bool = True,
    lamps_per_pass: int = LAMPS_PER_PASS,
    window_modifier: str | None = None,
    progress: Progress = silent,
) -> RadianceScene:
    """Write a room as a Radiance scene and compile it.

    Parameters
    ----------
    scan : Scan
        The room's mesh.
    materials : MaterialMap
        A material for each of its faces.
    lamps : sequence of Lamp
        One or more, of different names.
    bands : BandSet
        The sensor's channels.
    folder : str or path
        Made if it is not there; files of earlier scenes in it are replaced.
    mode : 'native' or 'rgb'
        Passes of up to 24 bands, or of 3.
    engine : Engine, optional
        Default: the one that pyradiance brings.
    crease_deg : float
        Faces that meet at less than this are shaded as one smooth surface. [deg]
    fine_slots : bool
        Cut channels in parts where lamps and surfaces need it (`slots`); direct light alone does without.
    lamps_per_pass : int
        Most lamps that one octree lights; 1 for `plain_rtrace`, which does not tell lamps apart.
    window_modifier : str, optional
        One modifier for all windows with daylight, whose light then adds up; each has its own if left out.
    progress : Progress, optional
        Receives the share that is done, as passes are compiled.

    Returns
    -------
    scene : RadianceScene
        Also saved in the folder (`load_scene`).

    Raises
    ------
    SceneError
        If the parts do not fit together, or a program refuses the scene.
    MaterialError, LampError
        If a surface or lamp cannot be written.
    """
    _check_parts(scan, materials, lamps)
    folder = path_of(folder, name="folder", meaning="the name of a folder, as a str or a Path")
    engine = find_engine() if engine is None else engine
    folder.mkdir(parents=True, exist_ok=True)
    modifiers = _modifiers(lamps, window_modifier)
    lamp_band_flux([lamp.flux for lamp in lamps], bands)  # refuses a lamp that the sensor does not see
    slots = _slots(scan, materials, lamps, bands, mode) if fine_slots else whole_channels(bands)
    flux = np.array([slots.bands.band_values(lamp.flux, outside="zero") for lamp in lamps])
    panes = find_panes(scan, materials)
    written = WRITTEN_PER_WATT * with_floor(flux)
    room = _Room(folder, lamps, modifiers, slots.bands, written, _bounds(scan, lamps), materials, panes.panes)
    plans = _plan_passes(lamps, modifiers, slots, mode, lamps_per_pass)
    writing, *compiling = shares(progress, _shares([planned for _, planned in plans]))
    writing(0.0, "writing the mesh")
    if room.has_glass:
        _write(folder / GLASS_FILE, GLASS_FUNCTIONS)
    _write_shapes(room)
    meshes = _write_meshes(scan, room, crease_deg=crease_deg)
    by_rtrace = all(len(planned.lamps) == 1 for _, planned in plans)  # which does not tell lamps apart
    passes = []
    for index, (light, planned) in enumerate(plans):
        compiling[index](0.0, f"compiling pass {index + 1} of {len(plans)}")
        scene_pass = _write_pass(replace(planned, mesh=meshes[_has_sun(light, lamps)]), light, room)
        if scene_pass.surfaces == scene_pass.name:
            _write_materials(scene_pass, light, room)
            compile_mesh(engine, folder, scene_pass.mesh, scene_pass.materials_file, scene_pass.mesh_file)
        _compile_octrees(engine, scene_pass, room)
        if scene_pass.has_glass and by_rtrace:
            _compile_panes(engine, scene_pass, room)
        if scene_pass.surfaces == scene_pass.name:
            check_octree(engine, folder, scene_pass.octree)
        passes.append(scene_pass)
    scene = RadianceScene(
        folder=folder,
        slots=slots,
        mode=mode,
        lamp_names=tuple(lamp.name for lamp in lamps),
        lamp_modifiers=modifiers,
        slot_flux=flux,
        written_flux=room.flux,
        slot_reflectance=_slot_reflectance(lamps, slots),
        passes=tuple(passes),
        shining=() if panes.panes else find_shining(lamps),
        relays=panes.relays,
        left_out_m2=panes.left_out_m2,
    )
    save_scene(scene)
    return scene


def _shares(passes: Sequence[ScenePass]) -> list[float]:
    """Shares of the time of the mesh's text and of each pass; one that shares the surfaces of another has no mesh."""
    compiled = [COMPILING_SHARE if each.surfaces == each.name else 0.0 for each in passes]
    return [WRITING_SHARE, *(share + OCTREE_SHARE for share in compiled)]


def _check_parts(scan: Scan, materials: MaterialMap, lamps: Sequence[Lamp]) -> None:
    if materials.face_material.size != len(scan.faces):
        raise SceneError(
            expected=f"a material for each of {len(scan.faces)} faces",
            found=f"materials for {materials.face_material.size}",
            where="material map",
            todo="Make the materials stage again: it belongs to another scan.",
        )
    if not lamps:
        raise SceneError(expected="one or more lamps", found="none", where="lamps", todo="A dark room has no map.")
    if sum(not lamp.is_in_room for lamp in lamps) > 1:
        raise SceneError(expected="one sun at most", found="several", where="lamps")
    names = [lamp.name for lamp in lamps]
    if len(set(names)) != len(names):
        raise SceneError(
            expected="lamps of different names", found=f"{len(names) - len(set(names))} twice", where="lamps"
        )


@dataclass(frozen=True, eq=False)
class _Room:
    """What all passes share."""

    folder: Path
    lamps: Sequence[Lamp]
    modifiers: tuple[str, ...]
    bands: BandSet  # the slots
    flux: FloatArray  # (lamp, slot) as written [µW/nm]
    bounds: FloatArray  # (2, 3) of all that is in the room [m]
    materials: MaterialMap
    panes: tuple[Pane, ...]  # in which lamps have images

    @property
    def has_glass(self) -> bool:
        return any(self.materials.materials[pane.material].kind == "glass" for pane in self.panes)


def _modifiers(lamps: Sequence[Lamp], window_modifier: str | None) -> tuple[str, ...]:
    """One for each shape in its place, named by the first lamp that has it."""
    found: list[str] = []
    for index, lamp in enumerate(lamps):
        if window_modifier and isinstance(lamp.shape.pattern, SkyLight):
            found.append(window_modifier)
        else:
            first = next((other for other in range(index) if are_one_shape(lamps[other], lamp)), index)
            found.append(f"lamp{first}")
    return tuple(found)


def _bounds(scan: Scan, lamps: Sequence[Lamp]) -> FloatArray:
    places = np.concatenate([scan.bounds, [lamp.center for lamp in lamps]])
    return np.stack([places.min(axis=0), places.max(axis=0)])


def _groups(lamps: Sequence[Lamp], bands: BandSet) -> list[SpectralGroup]:
    """Spectral groups; the sun is always its own, since its pass has holes in the mesh."""
    inside = [index for index, lamp in enumerate(lamps) if lamp.is_in_room]
    outside = [index for index, lamp in enumerate(lamps) if not lamp.is_in_room]
    groups = spectral_groups([lamps[index].flux for index in inside], bands)
    renamed = [
        SpectralGroup(lamps=tuple(inside[index] for index in group.lamps), light=group.light) for group in groups
    ]
    return [*renamed, *(SpectralGroup(lamps=(index,), light=lamps[index].flux) for index in outside)]


def _slots(scan: Scan, materials: MaterialMap, lamps: Sequence[Lamp], bands: BandSet, mode: Mode) -> Slots:
    """The channels, cut where the room's surfaces under these lamps need it."""
    areas = materials.areas(scan.areas)
    lights = [group.light for group in _groups(lamps, bands)]
    reflectances = [material.reflectance for material in materials.materials]
    return choose_slots(bands, lights, reflectances, areas / max(areas.sum(), 1e-300), mode=mode)


def _slot_reflectance(lamps: Sequence[Lamp], slots: Slots) -> FloatArray:
    """(lamp, slot) the room's mean reflectance as the light of each lamp's group weighs it."""
    mean = Spectrum(wavelengths_nm=slots.bands.wavelengths_nm, values=slots.mean_reflectance)
    found = np.zeros((len(lamps), len(slots)))
    for group in _groups(lamps, slots.channels):
        found[list(group.lamps)] = slots.bands.reflected_values(mean, group.light)
    return found


def _plan_passes(
    lamps: Sequence[Lamp], modifiers: Sequence[str], slots: Slots, mode: Mode, lamps_per_pass: int
) -> list[tuple[SpectralGroup, ScenePass]]:
    """Passes of every spectral group, band group, and handful of lamps; those of one group share their surfaces."""
    plans: list[tuple[SpectralGroup, ScenePass]] = []
    for light in _groups(lamps, slots.channels):
        for group in band_groups(len(slots), mode):
            surfaces = f"pass{len(plans)}"
            for part in _handfuls(light.lamps, lamps, modifiers, lamps_per_pass):
                plans.append((light, ScenePass(name=f"pass{len(plans)}", lamps=part, group=group, surfaces=surfaces)))
    return plans


def _handfuls(
    members: Sequence[int], lamps: Sequence[Lamp], modifiers: Sequence[str], most: int
) -> Iterator[tuple[int, ...]]:
    """So many lamps at a time, no two of which have one shape in one place."""
    left = list(members)
    while left:
        taken: dict[str, int] = {}
        for index in left:
            # windows that share a modifier are all lit by one pass: their light adds up
            name = f"window{index}" if isinstance(lamps[index].shape.pattern, SkyLight) else modifiers[index]
            taken.setdefault(name, index)
        for start in range(0, len(taken), most):
            yield tuple(taken.values())[start : start + most]
        left = [index for index in left if index not in taken.values()]


def _has_sun(light: SpectralGroup, lamps: Sequence[Lamp]) -> bool:
    return not all(lamps[index].is_in_room for index in light.lamps)


def _write_shapes(room: _Room) -> None:
    """Shapes of all lamps but daylight's, which differ from pass to pass."""
    shapes = []
    for index, (modifier, lamp) in enumerate(zip(room.modifiers, room.lamps, strict=True)):
        if isinstance(lamp.shape.pattern, SkyLight) or modifier in room.modifiers[:index]:
            continue
        shapes.append(lamp_geometry_text(modifier, lamp))
        if (data := lamp_data_text(lamp)) is not None:
            _write(room.folder / candela_file(modifier), data)
    _write(room.folder / LAMPS_FILE, "".join(shapes))


def _write_meshes(scan: Scan, room: _Room, *, crease_deg: float) -> dict[bool, str]:
    """Write the mesh, and where the sun shines one with open windows; file names by whether it is the sun's."""
    face_material = room.materials.face_material
    names = _material_names(room)
    _write(room.folder / MESH_FILE, mesh_text(scan, face_material, names=names, crease_deg=crease_deg))
    for sun in (lamp for lamp in room.lamps if not lamp.is_in_room):
        opened, opened_material = open_windows(scan, face_material, sun)
        _write(room.folder / OPEN_MESH_FILE, mesh_text(opened, opened_material, names=names, crease_deg=crease_deg))
    return {False: MESH_FILE, True: OPEN_MESH_FILE}


def _material_names(room: _Room) -> tuple[str, ...]:
    return tuple(f"m{index}" for index in range(len(room.materials.materials)))


def _colors(light: SpectralGroup, group: BandGroup, room: _Room) -> list[Color]:
    """Reflectance of the materials under the light of a group of lamps."""
    return [surface_slots(material, light.light, room.bands, group) for material in room.materials.materials]


def _write_materials(scene_pass: ScenePass, light: SpectralGroup, room: _Room) -> None:
    """The materials of the pass's mesh, and with panes of glass those of which nothing else reflects."""
    materials = room.materials.materials
    parts = list(zip(_material_names(room), materials, _colors(light, scene_pass.group, room), strict=True))
    _write(room.folder / scene_pass.materials_file, "".join(surface_text(*part) for part in parts))
    if scene_pass.has_glass:
        texts = [surface_text(*part) if part[1].kind in PANE_KINDS else primitives.black(part[0]) for part in parts]
        _write(room.folder / scene_pass.panes_materials_file, "".join(texts))


def _compile_octrees(engine: Engine, scene_pass: ScenePass, room: _Room) -> None:
    """The pass's octree, and with panes of glass two more (`pane_text`)."""
    files = [scene_pass.scene_file, LAMPS_FILE]
    compile_octree(engine, room.folder, files, scene_pass.octree)
    if not scene_pass.has_glass:
        return
    for octree, text in ((scene_pass.images_octree, images_text), (scene_pass.glow_octree, glow_text)):
        file = octree.replace(".oct", ".rad")
        _write(room.folder / file, text(room.panes, room.materials.materials))
        compile_octree(engine, room.folder, [*files, file], octree)


def _compile_panes(engine: Engine, scene_pass: ScenePass, room: _Room) -> None:
    """The octree in which nothing reflects but glass and mirrors, which only `plain_rtrace` reads."""
    mesh, materials = scene_pass.panes_mesh_file, scene_pass.panes_materials_file
    if scene_pass.surfaces == scene_pass.name:
        compile_mesh(engine, room.folder, scene_pass.mesh, materials, mesh)
    files = [f"{scene_pass.panes}.rad", LAMPS_FILE, f"{scene_pass.name}_glow.rad"]
    compile_octree(engine, room.folder, files, f"{scene_pass.panes}.oct")


def _write_pass(scene_pass: ScenePass, light: SpectralGroup, room: _Room) -> ScenePass:
    """Write the pass's scene and data files; the pass comes back with their names."""
    sunlit = not all(room.lamps[index].is_in_room for index in scene_pass.lamps)
    written = {room.modifiers[index] for index in scene_pass.lamps}
    texts: list[str] = []
    data: dict[str, str] = {}
    for index, (lamp, modifier) in enumerate(zip(room.lamps, room.modifiers, strict=True)):
        if index in scene_pass.lamps:
            text, files = _lit_text(index, scene_pass, room)
            texts.append(text)
            data |= files
        elif isinstance(lamp.shape.pattern, SkyLight):
            if not sunlit:
                texts += [primitives.black(modifier), window_shape_text(modifier, lamp)]
        elif lamp.is_in_room and modifier not in written:
            texts.append(primitives.black(modifier))
            written.add(modifier)
    texts.append(mirrors_text(room.panes, room.materials.materials, _colors(light, scene_pass.group, room)))
    for name, content in data.items():
        _write(room.folder / name, content)
    meshes = {scene_pass.scene_file: scene_pass.mesh_file}
    if room.has_glass:
        meshes[f"{scene_pass.panes}.rad"] = scene_pass.panes_mesh_file
    for file, mesh in meshes.items():
        _write(room.folder / file, "".join([*texts, primitives.mesh("void", "room", mesh)]))
    return replace(scene_pass, data_files=tuple(data), has_glass=room.has_glass)


def _lit_text(index: int, scene_pass: ScenePass, room: _Room) -> tuple[str, dict[str, str]]:
    """What a lit lamp sends, and its data files by name."""
    lamp, modifier, flux = room.lamps[index], room.modifiers[index], room.flux[index]
    slots = Color(group=scene_pass.group, slots=scene_pass.group.to_slots(flux))
    if isinstance(lamp.shape.pattern, SunBeam):
        file = f"{scene_pass.name}_{modifier}.cal"
        return sun_text(modifier, lamp, slots, room.bounds, file), {file: mask_text(lamp)}
    if isinstance(lamp.shape.pattern, SkyLight):
        data = sky_data_texts(lamp, room.bands, scene_pass.group)
        files = {f"{scene_pass.name}_lamp{index}_{part}.dat": text for part, text in enumerate(data)}
        return window_text(modifier, lamp, slots, list(files)), files
    return lamp_material_text(modifier, lamp, slots), {}


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
