"""A finished run as files of other programs: GLB and USDZ for viewers, VTK for ParaView, arrays for Blender."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError, WorkspaceError
from lidarspectra.geometry.scan import Scan, load_scan
from lidarspectra.mapping.export.blender import BLENDER_FILE, save_blender_room
from lidarspectra.mapping.export.gltf import save_glb
from lidarspectra.mapping.export.lit_room import TexturedMesh, legend_mesh, map_mesh, room_mesh
from lidarspectra.mapping.export.vtk import save_vtu
from lidarspectra.mapping.figures.plan_drawing import color_norm
from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map
from lidarspectra.mapping.maps.map_schema import kept_points
from lidarspectra.mapping.photometry.quantities import light_quantities
from lidarspectra.mapping.report.room_view import point_triangles
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.room.partitions import Partitions
from lidarspectra.room.room import load_room
from lidarspectra.workflow.applications.blender_of_run import blender_room
from lidarspectra.workflow.run_folder.calibration_of_run import materials_of_run
from lidarspectra.workflow.run_folder.light_of_run import light_of_run
from lidarspectra.workflow.run_folder.workspace import made_folder, require_stage

Kind = Literal["glb", "usdz", "vtk", "blender"]
KINDS: tuple[Kind, ...] = ("glb", "usdz", "vtk", "blender")
CEILING_M = 0.15  # [m] surfaces so close under the ceiling are its own, with its lamps
ILLUMINANCE = "illuminance_lx"


@dataclass(frozen=True, kw_only=True, eq=False)
class _RunToShow:
    """What is shown of a run."""

    scan: Scan
    ceiling_z: float  # [m]
    materials: MaterialMap
    light_map: xr.Dataset
    values: Mapping[str, FloatArray]  # of each quantity at the points
    words: Mapping[str, str]  # for legends


def export_run(run: Path, kinds: Sequence[Kind], *, quantity: str | None, out: Path) -> tuple[Path, ...]:
    """Write a run's room and map for other programs.

    Parameters
    ----------
    run : Path
        A finished run.
    kinds : sequence of 'glb', 'usdz', 'vtk', 'blender'
    quantity : str or None
        In false colour in GLB and USDZ: a name of `light_quantities`, or a channel's label ('560'); the illuminance by
        default, or the channel nearest 560 nm where the channels do not cover V(λ).
    out : Path
        Folder; made if absent.

    Returns
    -------
    files : tuple of Path

    Raises
    ------
    LidarSpectraError
        If the run is not finished, the quantity is unknown, or the extra 'usd' is missing.
    """
    if "usdz" in kinds:
        _require_usd()
    files: list[Path] = []
    if "blender" in kinds:
        room = blender_room(run)
        files.append(save_blender_room(room, made_folder(out) / BLENDER_FILE))
        if len(kinds) == 1:
            return tuple(files)
    shown = _read(run)
    chosen = _chosen(shown, quantity)
    folder = made_folder(out)  # not before it is known that there is a run
    if "glb" in kinds or "usdz" in kinds:
        meshes = lit_meshes(shown.scan, shown.ceiling_z, shown.light_map, shown.values[chosen], shown.words[chosen])
        stem = f"room-{re.sub(r'[^A-Za-z0-9]+', '-', chosen)}"
        if "glb" in kinds:
            files.append(save_glb(meshes, folder / f"{stem}.glb"))
        if "usdz" in kinds:
            from lidarspectra.mapping.export.usdz import save_usdz

            files.append(save_usdz(meshes, folder / f"{stem}.usdz"))
    if "vtk" in kinds:
        files += [_save_map(shown, folder / "map.vtu"), _save_room(shown, folder / "room.vtu")]
    return tuple(files)


def lit_meshes(
    scan: Scan, ceiling_z: float, light_map: xr.Dataset, values: FloatArray, label: str
) -> tuple[TexturedMesh, ...]:
    """The room without its ceiling, so that one looks in from above; the map in false colour, and the legend.

    Parameters
    ----------
    scan : Scan
    ceiling_z : float
        Height of the ceiling. [m]
    light_map : xarray.Dataset
        A checked spectral map.
    values : (point,) float
        What the map shows.
    label : str
        Its name and unit.
    """
    kept = values[kept_points(light_map)]
    norm = color_norm(kept if kept.size else values)
    positions, normals = (
        np.stack([light_map[name].to_numpy().astype(np.float64) for name in names], axis=1)
        for names in (("x", "y", "z"), ("nx", "ny", "nz"))
    )
    triangles = point_triangles(light_map, Partitions(scan, ceiling_z))
    below = scan.vertices[:, 2][scan.faces].min(axis=1) < ceiling_z - CEILING_M
    room = room_mesh(scan.vertices, scan.faces[below], scan.face_colors()[below])
    legend = legend_mesh(scan.vertices, norm, label)
    if not triangles.size:
        raise MapError(
            expected="sensor points on a plane, between which a map can be drawn",
            found=f"{len(positions)} points with none",
            where="map in false colour",
            todo="Write [sensors.grid] into the run file, or export with --vtk, which has single points too.",
        )
    return room, map_mesh(positions, normals, triangles, values, norm), legend


def _require_usd() -> None:
    try:
        import pxr  # noqa: F401
    except ImportError as cause:
        raise WorkspaceError(
            expected="the library usd-core for --usdz",
            found="none",
            where="this Python",
            todo="Install it: pip install 'lidarspectra[usd]'; --glb needs nothing more.",
        ) from cause


def _read(run: Path) -> _RunToShow:
    folder = require_stage(run, "scan")
    scan = load_scan(folder)
    materials, _ = materials_of_run(run, scan)
    light_map = load_map(require_stage(run, "map") / MAP_FILE)
    values: dict[str, FloatArray] = {}
    words: dict[str, str] = {}
    light = light_of_run(run).light
    for quantity in light_quantities():
        values[quantity.name] = light.weigh(quantity.response)[0]
        words[quantity.name] = f"{quantity.words} [{quantity.unit}]"
    irradiance = light_map["irradiance"].transpose("point", "band").to_numpy().astype(np.float64)
    for number, label in enumerate(map(str, light_map["band_label"].to_numpy())):
        values[label] = irradiance[:, number]
        words[label] = f"spectral irradiance, {label} nm [W/m²/nm]"
    return _RunToShow(
        scan=scan,
        ceiling_z=load_room(folder).ceiling_z,
        materials=materials,
        light_map=light_map,
        values=values,
        words=words,
    )


def _chosen(shown: _RunToShow, quantity: str | None) -> str:
    if quantity is None:
        if "illuminance" in shown.light_map:
            return ILLUMINANCE
        centers = shown.light_map["band"].to_numpy()
        return str(shown.light_map["band_label"].to_numpy()[np.abs(centers - 560.0).argmin()])
    if quantity not in shown.values:
        raise MapError(expected=f"one of {', '.join(shown.values)}", found=f"'{quantity}'", where="--quantity")
    return quantity


def _save_map(shown: _RunToShow, path: Path) -> Path:
    """Points with all their light, and the triangles between them."""
    light = shown.light_map
    positions = np.stack([light[name].to_numpy().astype(np.float64) for name in ("x", "y", "z")], axis=1)
    labels = list(map(str, light["band_label"].to_numpy()))
    error = light["irradiance_se"].transpose("point", "band").to_numpy().astype(np.float64)
    data: dict[str, NDArray[Any]] = {name: each for name, each in shown.values.items() if name not in labels}
    for number, label in enumerate(labels):
        data[f"E_{label}_W_m2_nm"], data[f"SE_{label}_W_m2_nm"] = shown.values[label], error[:, number]
    data["normal"] = np.stack([light[name].to_numpy().astype(np.float64) for name in ("nx", "ny", "nz")], axis=1)
    data["buried"] = light["buried"].to_numpy().astype(np.uint8)
    cells = [np.arange(len(positions))[:, None], point_triangles(light, Partitions(shown.scan, shown.ceiling_z))]
    return save_vtu(path, positions, [block for block in cells if len(block)], point_data=data)


def _save_room(shown: _RunToShow, path: Path) -> Path:
    """The surfaces with their materials' numbers and reflectances."""
    bands = shown.light_map["band"].to_numpy().astype(np.float64)
    labels = list(map(str, shown.light_map["band_label"].to_numpy()))
    number = shown.materials.face_material.astype(np.int64)
    reflectance = np.stack([each.reflectance.at(bands, outside="nearest") for each in shown.materials.materials])
    data: dict[str, NDArray[Any]] = {"material": number}
    data |= {f"reflectance_{label}": reflectance[number, band] for band, label in enumerate(labels)}
    data["color_linear_srgb"] = shown.scan.face_colors()
    return save_vtu(path, shown.scan.vertices, [shown.scan.faces], cell_data=data)
