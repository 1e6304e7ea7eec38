"""Maps of the light spectrum in a room, from a phone's LiDAR scan, by Radiance.

    import lidarspectra as ls
    summary = ls.run(ls.init("scan.glb"))

The names below are those that a user needs, and what the project promises to keep (docs/api.md); they load their
libraries when first used.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lidarspectra.config import RunFile, read_run_file
    from lidarspectra.errors import ArgumentError, LidarSpectraError
    from lidarspectra.geometry.scan import Scan
    from lidarspectra.hardware.phone.readers import read_scan
    from lidarspectra.hardware.phone.repair import repair_scan
    from lidarspectra.lamps.lamps import Lamp
    from lidarspectra.lamps.make_lamp import make_lamp
    from lidarspectra.mapping.localization.fingerprint_files import read_fingerprints
    from lidarspectra.mapping.localization.location_model import train_locator
    from lidarspectra.mapping.localization.location_model_files import load_locator
    from lidarspectra.mapping.localization.person import Person
    from lidarspectra.mapping.localization.sensor_places import choose_to_locate
    from lidarspectra.mapping.localization.traced_fingerprints import (
        FingerprintRequest,
        PlacedPerson,
        trace_fingerprints,
    )
    from lidarspectra.mapping.maps.map_files import load_map, save_map, save_map_table
    from lidarspectra.mapping.maps.metrics import compare_maps
    from lidarspectra.mapping.maps.spectral_map import LampChange, relight, spectral_map
    from lidarspectra.mapping.photometry.illuminance import illuminance
    from lidarspectra.mapping.photometry.people_and_plants import light_at_points
    from lidarspectra.mapping.photometry.point_light import light_of_lamps, light_of_map
    from lidarspectra.mapping.photometry.quantities import light_quantity
    from lidarspectra.mapping.photovoltaics.cells import find_cell
    from lidarspectra.mapping.photovoltaics.current_map import current_map
    from lidarspectra.mapping.photovoltaics.currents import photocurrent_density
    from lidarspectra.material.estimate import estimate_materials, one_material
    from lidarspectra.material.material_map import Material, MaterialMap
    from lidarspectra.material.views.viewpoints import render_views
    from lidarspectra.radiance.sampling.plain_rtrace import trace_plain
    from lidarspectra.radiance.sampling.trace import trace
    from lidarspectra.radiance.scene.scene import write_scene
    from lidarspectra.radiance.scene.scene_record import RadianceScene
    from lidarspectra.room.room import Room, find_room
    from lidarspectra.room.sensor_points import SensorPoints, grid_points, place_points, read_points
    from lidarspectra.spectra.databases import lamp_spectrum, load_reflectances, scenes_folder
    from lidarspectra.spectra.spectrum import BandSet, Spectrum, gaussian_bands, sensor_bands
    from lidarspectra.workflow.applications.annual import AnnualDaylight, annual_daylight
    from lidarspectra.workflow.applications.evaluation import evaluate_run
    from lidarspectra.workflow.applications.fingerprints import FingerprintOrder, fingerprint_room
    from lidarspectra.workflow.calibration.calibrating import Calibration, calibrate_run, save_calibration
    from lidarspectra.workflow.calibration.plan import plan_readings, save_plan
    from lidarspectra.workflow.check import RunCheck, check
    from lidarspectra.workflow.design.designing import Design, check_design, design_lighting, save_design
    from lidarspectra.workflow.init.init_file import init
    from lidarspectra.workflow.live.live_run import present_light
    from lidarspectra.workflow.pipeline import RunSummary, run
    from lidarspectra.workflow.progress_printer import ProgressPrinter
    from lidarspectra.workflow.room_model import RoomModel, Surface
    from lidarspectra.workflow.rules.rules_of_run import RuleCheck, rules_run
    from lidarspectra.workflow.run_folder.inputs import copy_scene
    from lidarspectra.workflow.run_folder.light_of_run import light_of_run
    from lidarspectra.workflow.scenarios.picture_of_run import RoomPicture, picture_run, save_picture
    from lidarspectra.workflow.scenarios.relighting import LampOrder, relight_run

_HOMES = {
    "AnnualDaylight": "workflow.applications.annual",
    "ArgumentError": "errors",
    "BandSet": "spectra.spectrum",
    "Calibration": "workflow.calibration.calibrating",
    "Design": "workflow.design.designing",
    "FingerprintOrder": "workflow.applications.fingerprints",
    "FingerprintRequest": "mapping.localization.traced_fingerprints",
    "Lamp": "lamps.lamps",
    "LampChange": "mapping.maps.spectral_map",
    "LampOrder": "workflow.scenarios.relighting",
    "LidarSpectraError": "errors",
    "Material": "material.material_map",
    "MaterialMap": "material.material_map",
    "Person": "mapping.localization.person",
    "PlacedPerson": "mapping.localization.traced_fingerprints",
    "ProgressPrinter": "workflow.progress_printer",
    "RadianceScene": "radiance.scene.scene_record",
    "Room": "room.room",
    "RoomPicture": "workflow.scenarios.picture_of_run",
    "RoomModel": "workflow.room_model",
    "RuleCheck": "workflow.rules.rules_of_run",
    "RunCheck": "workflow.check",
    "RunFile": "config",
    "RunSummary": "workflow.pipeline",
    "Scan": "geometry.scan",
    "SensorPoints": "room.sensor_points",
    "Spectrum": "spectra.spectrum",
    "Surface": "workflow.room_model",
    "check": "workflow.check",
    "calibrate_run": "workflow.calibration.calibrating",
    "annual_daylight": "workflow.applications.annual",
    "check_design": "workflow.design.designing",
    "choose_to_locate": "mapping.localization.sensor_places",
    "compare_maps": "mapping.maps.metrics",
    "copy_scene": "workflow.run_folder.inputs",
    "current_map": "mapping.photovoltaics.current_map",
    "design_lighting": "workflow.design.designing",
    "estimate_materials": "material.estimate",
    "evaluate_run": "workflow.applications.evaluation",
    "find_cell": "mapping.photovoltaics.cells",
    "find_room": "room.room",
    "fingerprint_room": "workflow.applications.fingerprints",
    "gaussian_bands": "spectra.spectrum",
    "grid_points": "room.sensor_points",
    "illuminance": "mapping.photometry.illuminance",
    "init": "workflow.init.init_file",
    "lamp_spectrum": "spectra.databases",
    "light_at_points": "mapping.photometry.people_and_plants",
    "light_of_lamps": "mapping.photometry.point_light",
    "light_of_map": "mapping.photometry.point_light",
    "light_of_run": "workflow.run_folder.light_of_run",
    "light_quantity": "mapping.photometry.quantities",
    "load_locator": "mapping.localization.location_model_files",
    "load_map": "mapping.maps.map_files",
    "load_reflectances": "spectra.databases",
    "make_lamp": "lamps.make_lamp",
    "one_material": "material.estimate",
    "photocurrent_density": "mapping.photovoltaics.currents",
    "picture_run": "workflow.scenarios.picture_of_run",
    "place_points": "room.sensor_points",
    "plan_readings": "workflow.calibration.plan",
    "present_light": "workflow.live.live_run",
    "read_fingerprints": "mapping.localization.fingerprint_files",
    "read_points": "room.sensor_points",
    "read_run_file": "config",
    "read_scan": "hardware.phone.readers",
    "relight": "mapping.maps.spectral_map",
    "relight_run": "workflow.scenarios.relighting",
    "render_views": "material.views.viewpoints",
    "repair_scan": "hardware.phone.repair",
    "rules_run": "workflow.rules.rules_of_run",
    "run": "workflow.pipeline",
    "save_calibration": "workflow.calibration.calibrating",
    "save_design": "workflow.design.designing",
    "save_map": "mapping.maps.map_files",
    "save_map_table": "mapping.maps.map_files",
    "save_picture": "workflow.scenarios.picture_of_run",
    "save_plan": "workflow.calibration.plan",
    "scenes_folder": "spectra.databases",
    "sensor_bands": "spectra.spectrum",
    "spectral_map": "mapping.maps.spectral_map",
    "trace": "radiance.sampling.trace",
    "trace_fingerprints": "mapping.localization.traced_fingerprints",
    "trace_plain": "radiance.sampling.plain_rtrace",
    "train_locator": "mapping.localization.location_model",
    "write_scene": "radiance.scene.scene",
}

__version__ = version("lidarspectra")
__all__ = [
    "AnnualDaylight",
    "ArgumentError",
    "BandSet",
    "Calibration",
    "Design",
    "FingerprintOrder",
    "FingerprintRequest",
    "Lamp",
    "LampChange",
    "LampOrder",
    "LidarSpectraError",
    "Material",
    "MaterialMap",
    "Person",
    "PlacedPerson",
    "ProgressPrinter",
    "RadianceScene",
    "Room",
    "RoomModel",
    "RoomPicture",
    "RuleCheck",
    "RunCheck",
    "RunFile",
    "RunSummary",
    "Scan",
    "SensorPoints",
    "Spectrum",
    "Surface",
    "__version__",
    "annual_daylight",
    "calibrate_run",
    "check",
    "check_design",
    "choose_to_locate",
    "compare_maps",
    "copy_scene",
    "current_map",
    "design_lighting",
    "estimate_materials",
    "evaluate_run",
    "find_cell",
    "find_room",
    "fingerprint_room",
    "gaussian_bands",
    "grid_points",
    "illuminance",
    "init",
    "lamp_spectrum",
    "light_at_points",
    "light_of_lamps",
    "light_of_map",
    "light_of_run",
    "light_quantity",
    "load_locator",
    "load_map",
    "load_reflectances",
    "make_lamp",
    "one_material",
    "photocurrent_density",
    "picture_run",
    "place_points",
    "plan_readings",
    "present_light",
    "read_fingerprints",
    "read_points",
    "read_run_file",
    "read_scan",
    "relight",
    "relight_run",
    "render_views",
    "repair_scan",
    "rules_run",
    "run",
    "save_calibration",
    "save_design",
    "save_map",
    "save_map_table",
    "save_picture",
    "save_plan",
    "scenes_folder",
    "sensor_bands",
    "spectral_map",
    "trace",
    "trace_fingerprints",
    "trace_plain",
    "train_locator",
    "write_scene",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'lidarspectra' has no attribute {name!r}")
    return getattr(import_module(f"lidarspectra.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
