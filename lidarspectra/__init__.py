"""Maps of the light spectrum in a room, from a phone's LiDAR scan, by Radiance.

The names below are those that a user needs, and what the project promises to keep (docs/api.md); they load their
libraries when first used.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lidarspectra.config import read_run_file
    from lidarspectra.errors import LidarSpectraError
    from lidarspectra.hardware.phone.readers import read_scan
    from lidarspectra.mapping.localization.fingerprint_files import read_fingerprints
    from lidarspectra.mapping.localization.location_model import load_locator, train_locator
    from lidarspectra.mapping.maps.spectral_map import load_map, spectral_map
    from lidarspectra.material.estimate import estimate_materials
    from lidarspectra.radiance.sampling.trace import trace
    from lidarspectra.radiance.scene.scene import write_scene
    from lidarspectra.spectra.spectrum import BandSet, Spectrum, gaussian_bands, sensor_bands
    from lidarspectra.workflow.fingerprints import FingerprintOrder, fingerprint_room
    from lidarspectra.workflow.pipeline import run
    from lidarspectra.workflow.relighting import LampOrder, relight_run

_HOMES = {
    "BandSet": "spectra.spectrum",
    "FingerprintOrder": "workflow.fingerprints",
    "LampOrder": "workflow.relighting",
    "LidarSpectraError": "errors",
    "Spectrum": "spectra.spectrum",
    "estimate_materials": "material.estimate",
    "fingerprint_room": "workflow.fingerprints",
    "gaussian_bands": "spectra.spectrum",
    "load_locator": "mapping.localization.location_model",
    "load_map": "mapping.maps.spectral_map",
    "read_fingerprints": "mapping.localization.fingerprint_files",
    "read_run_file": "config",
    "read_scan": "hardware.phone.readers",
    "relight_run": "workflow.relighting",
    "run": "workflow.pipeline",
    "sensor_bands": "spectra.spectrum",
    "spectral_map": "mapping.maps.spectral_map",
    "trace": "radiance.sampling.trace",
    "train_locator": "mapping.localization.location_model",
    "write_scene": "radiance.scene.scene",
}

__version__ = version("lidarspectra")
__all__ = [
    "BandSet",
    "FingerprintOrder",
    "LampOrder",
    "LidarSpectraError",
    "Spectrum",
    "__version__",
    "estimate_materials",
    "fingerprint_room",
    "gaussian_bands",
    "load_locator",
    "load_map",
    "read_fingerprints",
    "read_run_file",
    "read_scan",
    "relight_run",
    "run",
    "sensor_bands",
    "spectral_map",
    "trace",
    "train_locator",
    "write_scene",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'lidarspectra' has no attribute {name!r}")
    return getattr(import_module(f"lidarspectra.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
