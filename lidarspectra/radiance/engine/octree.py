"""Compile scene text and meshes: oconv and obj2mesh."""

from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from lidarspectra.errors import EngineError, SceneError
from lidarspectra.radiance.engine.engine import Engine, EngineRun

OCTREE_END = b"\xff"
"""What closes the objects of a frozen octree; the engine takes a file's early end for it, and says nothing."""


def compile_octree(engine: Engine, folder: Path, rad_files: Sequence[str], out: str) -> EngineRun:
    """Compile scene files into an octree that holds them whole (`oconv -f`).

    The frozen octree needs none of the scene files again, so that a later change of one cannot mix two scenes;
    meshes (`.rtm`) stay files of their own, which rtrace looks for in the scene folder.

    Parameters
    ----------
    engine : Engine
    folder : Path
        The scene folder; all names are relative to it.
    rad_files : sequence of str
        Scene files, materials before their use.
    out : str
        Octree to write.

    Returns
    -------
    run : EngineRun

    Raises
    ------
    SceneError
        If a name is unsafe, or oconv refuses the scene.
    """
    if not rad_files:
        raise SceneError(expected="one or more scene files", found="none", where=str(folder))
    return _compile(engine, folder, "oconv", ["-f", *rad_files], out, names=[*rad_files, out], end=OCTREE_END)


def extend_octree(engine: Engine, folder: Path, base: str, rad_files: Sequence[str], out: str) -> EngineRun:
    """Add scene files to a compiled octree (`oconv -f -i`); what it holds already is not compiled again.

    Parameters
    ----------
    engine : Engine
    folder : Path
        The scene folder; all names are relative to it.
    base : str
        Octree that is added to, and stays as it is. What is added must lie within its bounds.
    rad_files : sequence of str
        Scene files, materials before their use.
    out : str
        Octree to write.

    Returns
    -------
    run : EngineRun

    Raises
    ------
    SceneError
        If a name is unsafe, or oconv refuses the scene.
    """
    names = [base, *rad_files, out]
    return _compile(engine, folder, "oconv", ["-f", "-i", base, *rad_files], out, names=names, end=OCTREE_END)


def compile_mesh(engine: Engine, folder: Path, obj: str, rad_materials: str | None, out: str) -> EngineRun:
    """Compile a Wavefront mesh into a Radiance mesh (`obj2mesh`).

    Parameters
    ----------
    engine : Engine
    folder : Path
        The scene folder; all names are relative to it.
    obj : str
        Mesh with `usemtl` names that the material file defines.
    rad_materials : str or None
        Scene file of materials to embed.
    out : str
        Mesh to write (`.rtm`).

    Returns
    -------
    run : EngineRun

    Raises
    ------
    SceneError
        If a name is unsafe, or obj2mesh refuses the mesh.
    """
    materials = [] if rad_materials is None else ["-a", rad_materials]
    names = [obj, out] if rad_materials is None else [obj, rad_materials, out]
    return _compile(engine, folder, "obj2mesh", [*materials, obj], out, names=names)


def check_octree(engine: Engine, folder: Path, octree: str) -> None:
    """Have the engine read an octree with its meshes, and trace nothing.

    Parameters
    ----------
    engine : Engine
    folder : Path
        The scene folder.
    octree : str
        In it.

    Raises
    ------
    SceneError
        If it is cut off, or a mesh that it names is missing or cut off.
    """
    _check_name(octree, folder)
    try:
        engine.run("rtrace", ["-h", octree], folder=folder)
    except EngineError as cause:
        raise SceneError(
            expected="an octree and meshes that the engine can read",
            found=cause.found,
            where=str(folder / octree),
            todo="Make the scene stage again.",
        ) from cause


def _compile(
    engine: Engine,
    folder: Path,
    program: str,
    arguments: Sequence[str],
    out: str,
    *,
    names: Sequence[str],
    end: bytes = b"",
) -> EngineRun:
    for name in names:
        _check_name(name, folder)
    try:
        run = engine.run(program, arguments, folder=folder)
    except EngineError as cause:
        raise SceneError(
            expected=f"a scene that {program} accepts", found=cause.found, where=str(folder / out), todo=cause.todo
        ) from cause
    if not run.output:
        raise SceneError(expected=f"an answer from {program}", found=run.stderr or "nothing", where=str(folder / out))
    if not run.output.endswith(end):
        found = f"{len(run.output)} bytes that break off"
        raise SceneError(expected=f"a whole answer from {program}", found=found, where=str(folder / out))
    unfinished = folder / f"{out}.part"
    unfinished.write_bytes(run.output)
    unfinished.replace(folder / out)  # a cut run leaves no octree that a later run trusts
    return run


def _check_name(name: str, folder: Path) -> None:
    """Refuse what oconv would run ('!command'), take for an option, or split in its header."""
    path = PurePosixPath(name)
    plain = name.replace("/", "").replace(".", "").replace("_", "").replace("-", "")
    if not (plain.isascii() and plain.isalnum()) or name[0] in "-!." or path.is_absolute() or ".." in path.parts:
        raise SceneError(
            expected="a plain relative file name (letters, digits, '_', '-', '.')", found=repr(name), where=str(folder)
        )
