"""A finished run as the Blender extension reads it."""

from importlib.metadata import version
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import load_scan
from lidarspectra.mapping.export.blender import BlenderRoom, Layer
from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map
from lidarspectra.mapping.maps.visible_bands import covers_vision
from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.mapping.report.room_view import point_triangles
from lidarspectra.room.partitions import Partitions
from lidarspectra.room.room import load_room
from lidarspectra.spectra.databases import list_databases, list_lamps, load_reflectances
from lidarspectra.workflow.run_folder.calibration_of_run import materials_of_run
from lidarspectra.workflow.run_folder.light_of_run import RunLight, light_of_run, present_lamps_of_run
from lidarspectra.workflow.run_folder.workspace import read_record, require_stage

QUANTITIES = ("illuminance_lx", "melanopic_edi_lx", "ppfd_umol_m2_s", "irradiance_W_m2")
"""Before the channels, where these cover what the eye sees."""


def blender_room(run: Path) -> BlenderRoom:
    """Read a finished run.

    Raises
    ------
    LidarSpectraError
        If the run is not finished, or its materials belong to another scan.
    """
    folder = require_stage(run, "scan")
    scan = load_scan(folder)
    _, materials = materials_of_run(run, scan)
    light_map = load_map(require_stage(run, "map") / MAP_FILE)
    lit = light_of_run(run)
    layers, shares, error = lamp_layers(lit)
    known = {lamp.name: lamp for lamp in present_lamps_of_run(run)}
    dims = _dims(run)
    names = dict.fromkeys(file.database for file in list_databases() if file.kind == "reflectance")
    return BlenderRoom(
        run=run.resolve().name,
        version=version("lidarspectra"),
        vertices=scan.vertices,
        faces=scan.faces,
        face_material=materials.face_material,
        face_color=scan.face_colors(),
        points=np.stack([light_map[name].to_numpy() for name in ("x", "y", "z")], axis=1),
        normals=np.stack([light_map[name].to_numpy() for name in ("nx", "ny", "nz")], axis=1),
        triangles=point_triangles(light_map, Partitions(scan, load_room(folder).ceiling_z)),
        buried=light_map["buried"].to_numpy(),
        layers=layers,
        shares=shares,
        standard_error=error,
        lamps=tuple(known[name] for name in lit.lamp_names),
        dims=tuple(dims.get(name) for name in lit.lamp_names),
        materials=materials.materials,
        lamp_spectra=tuple(lamp.name for lamp in list_lamps()),
        reflectances=tuple(row.key for row in load_reflectances(tuple(names)).rows),
    )


def lamp_layers(lit: RunLight) -> tuple[tuple[Layer, ...], FloatArray, FloatArray]:
    """Each lamp's share of every quantity and channel.

    Parameters
    ----------
    lit : RunLight

    Returns
    -------
    layers : tuple of Layer
        Quantities of light, then channels.
    shares : (lamp, point, layer) float
        [unit of the layer]
    standard_error : (point, layer) float
        Of their sum. [unit of the layer]
    """
    light = lit.light
    quantities = [light_quantity(name) for name in QUANTITIES] if covers_vision(light.centers_nm) else []
    layers = [Layer(name=each.name, words=each.words, unit=each.unit) for each in quantities]
    layers += [
        Layer(name=f"E_{label}", words=f"spectral irradiance, {label} nm", unit="W/m²/nm")
        for label in map(str, lit.places["band_label"].to_numpy())
    ]
    flux = lit.places["flux"].transpose("lamp", "band").to_numpy().astype(np.float64)
    shares, error = [], [light.weigh(each.response)[1] for each in quantities]
    for row, lamp in enumerate(light.lamps):
        whole = [lamp.weigh(light.centers_nm, each.response).sum(axis=1) for each in quantities]
        shares.append(np.column_stack([*whole, lamp.coefficient * flux[row]]))
    return tuple(layers), np.array(shares), np.column_stack([*error, light.irradiance_se])


def _dims(run: Path) -> dict[str, float]:
    """What the run file of the map dims its `[[lamps]]` to, by name."""
    record = read_record(require_stage(run, "map"))
    lamps = (record.settings.get("run_file", {}).get("lamps") or []) if record is not None else []
    return {str(lamp["name"]): float(lamp.get("dim", 1.0)) for lamp in lamps}
