"""A room in closed form: a person takes light from the sensors near by, more of some colours than of others."""

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.localization.augmentation import Augmentation
from lidarspectra.mapping.localization.fingerprint_table import make_fingerprints
from lidarspectra.mapping.localization.location_model import LocationModel, TrainingSettings, train_locator
from lidarspectra.mapping.localization.locators import NetworkSettings
from lidarspectra.spectra.spectrum import gaussian_bands

SENSORS = np.array([(x, y) for x in (1.0, 3.0, 5.0) for y in (1.0, 3.0)])  # [m]
PLACES = np.array([(x, y) for x in (0.5, 2.0, 3.5, 5.0) for y in (0.7, 2.0, 3.3)])  # [m]
CENTERS_NM = np.array([460.0, 560.0, 645.0])
EMPTY = 0.004 * np.array([1.0, 1.6, 1.1])  # [W/m²/nm]
DEPTH, REACH_M = 0.08, 1.2  # [1], [m] as a person near a ceiling sensor takes
Maker = Callable[..., xr.Dataset]


def changes(positions: FloatArray, tint: FloatArray) -> FloatArray:
    """(fingerprint, sensor, band) relative change by persons of some tint (fingerprint, band)."""
    away = np.linalg.norm(SENSORS[None] - positions[:, None], axis=2)
    return np.asarray(-DEPTH * np.exp(-0.5 * (away / REACH_M) ** 2)[:, :, None] * tint[:, None, :])


@pytest.fixture(scope="session")
def make_table() -> Maker:
    """Fingerprints at all places, in W/m²/nm or in the counts of sensors with gains of their own."""

    def make(
        seed: int = 0,
        *,
        draws: int = 3,
        gains: FloatArray | None = None,
        dim: float = 1.0,
        with_empty: bool = True,
        with_positions: bool = True,
        source: str = "made up",
    ) -> xr.Dataset:
        generator = np.random.default_rng(seed)
        positions = np.repeat(PLACES, draws, axis=0)
        tint = 1.0 + 0.2 * generator.standard_normal((len(positions), len(CENTERS_NM)))
        light = EMPTY * (1.0 + changes(positions, tint))
        scale = np.ones((len(SENSORS), 1)) if gains is None else gains[:, None]
        values, empty = dim * light * scale, np.broadcast_to(EMPTY * scale, light.shape[1:])
        if gains is not None:
            values = np.rint(values)
        se = {} if gains is not None else {"readings_se": 1e-6 * light, "empty_se": 1e-6 * empty}
        nowhere = np.full((len(positions), 3), np.nan)
        return make_fingerprints(
            values,
            quantity="irradiance" if gains is None else "counts",
            labels=[f"p{number // draws}" for number in range(len(positions))],
            positions_m=np.column_stack([positions, np.zeros(len(positions))]) if with_positions else nowhere,
            sensors=[f"s{number + 1}" for number in range(len(SENSORS))],
            bands=gaussian_bands("three", CENTERS_NM, 20.0),
            empty=empty if with_empty else None,
            attributes={"source": source},
            **se,
        )

    return make


@pytest.fixture(scope="session")
def quick_settings() -> TrainingSettings:
    """Small enough for tests."""
    return TrainingSettings(
        augmentation=Augmentation(copies=8), network=NetworkSettings(hidden=32, updates=600, seed=0)
    )


@pytest.fixture(scope="session")
def model(make_table: Maker, quick_settings: TrainingSettings) -> LocationModel:
    """Trained on light, as on traced fingerprints."""
    return train_locator(make_table(), quick_settings)
