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
    from lidarspectra.fingerprints import FingerprintOrder, fingerprint_room
    from lidarspectra.hardware.phone.readers import read_scan
    from lidarspectra.mapping.localization.fingerprint_files import read_fingerprints
    from lidarspectra.mapping.localization.location_model import load_locator, train_locator
    from lidarspectra.mapping.spectral_map import load_map, spectral_map
    from lidarspectra.material.estimate import estimate_materials
    from lidarspectra.pipeline import run
    from lidarspectra.radiance.scene import write_scene
    from lidarspectra.radiance.trace import trace
    from lidarspectra.relighting import LampOrder, relight_run
    from lidarspectra.spectra import BandSet, Spectrum, gaussian_bands, sensor_bands

_HOMES = {
    "BandSet": "spectra",
    "FingerprintOrder": "fingerprints",
    "LampOrder": "relighting",
    "LidarSpectraError": "errors",
    "Spectrum": "spectra",
    "estimate_materials": "material.estimate",
    "fingerprint_room": "fingerprints",
    "gaussian_bands": "spectra",
    "load_locator": "mapping.localization.location_model",
    "load_map": "mapping.spectral_map",
    "read_fingerprints": "mapping.localization.fingerprint_files",
    "read_run_file": "config",
    "read_scan": "hardware.phone.readers",
    "relight_run": "relighting",
    "run": "pipeline",
    "sensor_bands": "spectra",
    "spectral_map": "mapping.spectral_map",
    "trace": "radiance.trace",
    "train_locator": "mapping.localization.location_model",
    "write_scene": "radiance.scene",
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
