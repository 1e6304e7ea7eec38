"""A trained locator: its features, its places, and the four methods that map one to the other.

    model = train_locator(fingerprints)          in memory
    save_locator(model, folder); load_locator(folder)
    located = model.locate(readings)             probabilities of the places, and positions

A folder holds `model.nc` (features, places, the nearest fingerprints, the ridge and the discriminant), `network.onnx`,
and `discriminant.onnx`, which is for devices alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np
import xarray as xr

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray, IntArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import SensorSettings
from lidarspectra.io.files import writing
from lidarspectra.io.netcdf import read_netcdf, write_netcdf
from lidarspectra.mapping.localization.augmentation import Augmentation, augmented_counts
from lidarspectra.mapping.localization.discriminant import DiscriminantPlaces, fit_discriminant, sensor_blur
from lidarspectra.mapping.localization.features import (
    FeatureSettings,
    FeatureSpace,
    counts_per_irradiance,
    device_settings,
    feature_space,
    reference_counts,
    reference_of,
    require_same_sensors,
)
from lidarspectra.mapping.localization.fingerprint_table import Quantity, quantity_of
from lidarspectra.mapping.localization.locators import (
    METHODS,
    Locator,
    Method,
    NearestFingerprints,
    NetworkPlaces,
    NetworkSettings,
    RidgePlaces,
    TogetherPlaces,
    fit_network,
    fit_ridge,
)
from lidarspectra.mapping.localization.network_graph import discriminant_graph, network_graph
from lidarspectra.mapping.localization.places import Located, Places, places_of_table
from lidarspectra.mapping.localization.running_reference import running_references
from lidarspectra.progress import Progress, silent

MODEL_FILE, NETWORK_FILE, DISCRIMINANT_FILE = "model.nc", "network.onnx", "discriminant.onnx"
SCHEMA = "lidarspectra location model 2"
MAX_NEIGHBOURS = 20_000  # fingerprints that are kept to compare with; longer tables are thinned evenly
MAX_TRAINED = 6_000  # readings drawn for training the network; more take longer and do not improve it

Against = Literal["own", "running", "trained"]
"""Reference of the readings: their own, the running median up to each, or that of the training."""


@dataclass(frozen=True, kw_only=True)
class TrainingSettings:
    """How a locator is trained.

    Parameters
    ----------
    features : FeatureSettings
    augmentation : Augmentation
        Its drift is also that of the discriminant's covariance.
    network : NetworkSettings
    device : SensorSettings, optional
        Gain and time of the sensors that will read, where the fingerprints are traced; see `device_settings`.
    """

    features: FeatureSettings = field(default_factory=FeatureSettings)
    augmentation: Augmentation = field(default_factory=Augmentation)
    network: NetworkSettings = field(default_factory=NetworkSettings)
    device: SensorSettings | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class LocationModel:
    """A trained locator.

    Parameters
    ----------
    space : FeatureSpace
    places : Places
    neighbours : NearestFingerprints
    ridge : RidgePlaces
    discriminant : DiscriminantPlaces
    network : NetworkPlaces
    reference : (sensor, band) float
        That of the fingerprints. [W/m²/nm] or counts
    quantity : 'irradiance' or 'counts'
        Of the fingerprints.
    source : str
        Files that it was trained on.
    """

    space: FeatureSpace
    places: Places
    neighbours: NearestFingerprints
    ridge: RidgePlaces
    discriminant: DiscriminantPlaces
    network: NetworkPlaces
    reference: FloatArray
    quantity: Quantity
    source: str

    def __post_init__(self) -> None:
        shape = self.space.usable.shape
        object.__setattr__(self, "reference", float_array(self.reference, name="LocationModel.reference", shape=shape))
        linear = (self.ridge.weights.shape, self.discriminant.weights.shape)
        shapes = {*linear, (self.neighbours.features.shape[1], self.neighbours.place_count)}
        if shapes != {(self.space.count, len(self.places))} or self.network.feature_count != self.space.count:
            raise MapError(
                expected=f"locators of {self.space.count} features and {len(self.places)} places",
                found=f"of {sorted(shapes)}, and a network of {self.network.feature_count} features",
                where="location model",
            )

    @property
    def locators(self) -> Mapping[Method, Locator]:
        """All of them by name."""
        return {
            "together": TogetherPlaces(locators=(self.network, self.neighbours, self.ridge)),
            "network": self.network,
            "discriminant": self.discriminant,
            "neighbours": self.neighbours,
            "ridge": self.ridge,
        }

    def features(self, table: xr.Dataset, *, against: Against = "own") -> FloatArray:
        """(reading, feature) features of readings, NaN where missing.

        Parameters
        ----------
        table : xarray.Dataset
            Readings in the form of fingerprints, of the model's sensors and bands.
        against : 'own', 'running' or 'trained'
            'own': the table's own empty room, or its median; 'running': the median over the latest frames, as live
            localization takes it, for a table in order of time; 'trained': that of the training fingerprints, if
            nothing has changed since, in the same unit.

        Raises
        ------
        MapError
            If sensors or bands are missing, or the units differ.
        """
        where = str(table.attrs.get("source", "readings"))
        fitted = require_same_sensors(table, self.space, where=where)
        quantity = quantity_of(fitted)
        if against == "trained" and quantity != self.quantity:
            raise MapError(
                expected=f"{self.quantity}, as the model was trained with",
                found=quantity,
                where=where,
                todo="Compare with the readings' own reference.",
            )
        readings = fitted[quantity].to_numpy()
        match against:
            case "own":
                reference = reference_of(fitted)
            case "running":
                reference = running_references(readings)
            case "trained":
                reference = self.reference
        usable = None
        if quantity == "counts":
            usable = reference >= self.space.settings.min_count
        return self.space.features(readings, reference, usable=usable)

    def locate(self, table: xr.Dataset, method: Method = "together", *, against: Against = "own") -> Located:
        """Locate readings by one method; parameters as in `features`."""
        return self.locate_features(self.features(table, against=against), method)

    def locate_features(self, features: FloatArray, method: Method = "together") -> Located:
        """Locate features by one method."""
        return Located(scores=self.locators[method].scores(features), places=self.places)


def train_locator(
    tables: xr.Dataset | Sequence[xr.Dataset],
    settings: TrainingSettings | None = None,
    *,
    seed: int = 0,
    progress: Progress = silent,
) -> LocationModel:
    """Train a locator on fingerprints.

    Parameters
    ----------
    tables : xarray.Dataset, or several
        Fingerprints of the same sensors, all traced or all measured; each is compared with its own reference. The first
        one's counts say which channels are bright enough.
    settings : TrainingSettings, optional
    seed : int
        Of the augmentation; the network has its own.
    progress : Progress, optional

    Returns
    -------
    model : LocationModel

    Raises
    ------
    MapError
        If the tables do not fit together, or labels or light are lacking.
    """
    settings = settings or TrainingSettings()
    several = [tables] if isinstance(tables, xr.Dataset) else list(tables)
    first = several[0]
    device = settings.device
    if device is None and quantity_of(first) == "irradiance":
        device = device_settings(first)
    space = feature_space(first, settings.features, device)
    fitted = [
        require_same_sensors(table, space, where=str(table.attrs.get("source", "fingerprints"))) for table in several
    ]
    if len({quantity_of(table) for table in fitted}) > 1:
        raise MapError(expected="fingerprints that are all traced or all measured", found="both", where="training")
    places = _joined_places(fitted)
    generator = np.random.default_rng(seed)
    clean, drawn, place, drawn_place = [], [], [], []
    for number, table in enumerate(fitted):
        progress(0.3 * number / len(fitted), "drawing readings")
        own = places.index(table["label"].to_numpy())
        values, reference = table[quantity_of(table)].to_numpy(), reference_of(table)
        clean.append(space.features(values, reference))
        place.append(own)
        copies, rows = _draw(table, settings.augmentation, device, generator)
        drawn.append(space.features(copies, reference_counts(table, device)))
        drawn_place.append(own[rows])
    all_drawn, all_place = np.vstack(drawn), np.concatenate(drawn_place)
    all_clean, clean_place = np.vstack(clean), np.concatenate(place)
    progress(0.3, "fitting the discriminant")
    blur = sensor_blur(space, fitted[0], device, drift=settings.augmentation.drift)
    discriminant = fit_discriminant(all_clean, clean_place, len(places), blur, mismatch=space.settings.mismatch)
    progress(0.35, "fitting the ridge")
    ridge = fit_ridge(all_drawn, all_place, len(places))
    progress(0.4, "training the network")
    weights = fit_network(all_drawn, all_place, len(places), settings.network)
    progress(1.0, "trained")
    return LocationModel(
        space=space,
        places=places,
        neighbours=_neighbours(all_clean, clean_place, len(places)),
        ridge=ridge,
        discriminant=discriminant,
        network=NetworkPlaces(network_graph(weights, places, space), where="the trained network"),
        reference=reference_of(fitted[0]),
        quantity=quantity_of(first),
        source=", ".join(str(table.attrs.get("source", "fingerprints")) for table in several),
    )


def save_locator(model: LocationModel, folder: Path) -> Path:
    """Write a model into a folder, which is made where it is not there.

    Raises
    ------
    WorkspaceError
        If it cannot be written.
    """
    settings = {
        name: int(value) if isinstance(value, bool) else value for name, value in asdict(model.space.settings).items()
    }
    dataset = xr.Dataset(
        {
            "usable": (("sensor", "band"), model.space.usable.astype(np.int8)),
            "noise": (("sensor", "band"), model.space.noise),
            "reference": (("sensor", "band"), model.reference),
            "position_m": (("place", "axis"), model.places.positions_m),
            "neighbour_features": (("neighbour", "feature"), model.neighbours.features),
            "neighbour_place": (("neighbour",), model.neighbours.place),
            "ridge_weights": (("feature", "place"), model.ridge.weights),
            "ridge_offset": (("place",), model.ridge.offset),
            "discriminant_weights": (("feature", "place"), model.discriminant.weights),
            "discriminant_offset": (("place",), model.discriminant.offset),
        },
        coords={
            "sensor": list(model.space.sensors),
            "band": ("band", model.space.bands_nm, {"units": "nm"}),
            "place": list(model.places.labels),
        },
        attrs={"schema": SCHEMA, "quantity": model.quantity, "source": model.source, **settings},
    )
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        # The graphs first: a folder from an interrupted run has no model.nc, and is recognised as incomplete.
        (folder / MODEL_FILE).unlink(missing_ok=True)
        (folder / NETWORK_FILE).write_bytes(model.network.model)
        (folder / DISCRIMINANT_FILE).write_bytes(discriminant_graph(model.discriminant, model.places, model.space))
        write_netcdf(dataset, folder / MODEL_FILE, encoding={})
    return folder


def load_locator(folder: str | PathLike[str]) -> LocationModel:
    """Read a model that `save_locator` wrote.

    Parameters
    ----------
    folder : str or path
        It holds `model.nc` and `network.onnx`.

    Returns
    -------
    model : LocationModel

    Raises
    ------
    MapError
        If the folder lacks a file, or they are no model.
    """
    folder = path_of(folder, name="folder", meaning="the name of a model's folder, as a str or a Path")
    path = folder / MODEL_FILE
    try:
        kept = read_netcdf(path)
        network = (folder / NETWORK_FILE).read_bytes()
        if kept.attrs.get("schema") != SCHEMA:
            raise ValueError(f"schema {kept.attrs.get('schema')!r}")
        quantity: Quantity = "counts" if kept.attrs["quantity"] == "counts" else "irradiance"
        space = FeatureSpace(
            sensors=tuple(kept["sensor"].to_numpy().astype(str).tolist()),
            bands_nm=kept["band"].to_numpy(),
            usable=kept["usable"].to_numpy().astype(np.bool_),
            noise=kept["noise"].to_numpy(),
            settings=FeatureSettings(
                min_count=float(kept.attrs["min_count"]),
                mismatch=float(kept.attrs["mismatch"]),
                remove_level=bool(kept.attrs["remove_level"]),
            ),
        )
        places = Places(
            labels=tuple(kept["place"].to_numpy().astype(str).tolist()), positions_m=kept["position_m"].to_numpy()
        )
        neighbours = NearestFingerprints(
            features=kept["neighbour_features"].to_numpy(),
            place=kept["neighbour_place"].to_numpy().astype(np.int64),
            place_count=len(places),
        )
        ridge = RidgePlaces(weights=kept["ridge_weights"].to_numpy(), offset=kept["ridge_offset"].to_numpy())
        discriminant = DiscriminantPlaces(
            weights=kept["discriminant_weights"].to_numpy(), offset=kept["discriminant_offset"].to_numpy()
        )
        reference, source = kept["reference"].to_numpy(), str(kept.attrs["source"])
    except (OSError, ValueError, KeyError) as cause:
        raise MapError(
            expected=f"a folder that 'localize train' wrote, with {MODEL_FILE} and {NETWORK_FILE}",
            found=str(cause),
            where=str(path),
            todo="Train it again.",
        ) from cause
    return LocationModel(
        space=space,
        places=places,
        neighbours=neighbours,
        ridge=ridge,
        discriminant=discriminant,
        network=NetworkPlaces(network, where=str(folder / NETWORK_FILE)),
        reference=reference,
        quantity=quantity,
        source=source,
    )


def _joined_places(tables: Sequence[xr.Dataset]) -> Places:
    """The places of all tables; one that is in several stands where the first has it."""
    found: dict[str, FloatArray] = {}
    for table in tables:
        places = places_of_table(table)
        for label, position in zip(places.labels, places.positions_m, strict=True):
            found.setdefault(label, position)
    return Places(labels=tuple(found), positions_m=np.array(list(found.values())))


def _draw(
    table: xr.Dataset, augmentation: Augmentation, device: SensorSettings | None, generator: np.random.Generator
) -> tuple[FloatArray, IntArray]:
    """Counts drawn from a table, and the fingerprint that each comes from."""
    quantity = quantity_of(table)
    values = table[quantity].to_numpy()
    rows = np.arange(len(values))
    if len(rows) * augmentation.copies > MAX_TRAINED:
        augmentation = Augmentation(**{**asdict(augmentation), "copies": max(1, MAX_TRAINED // len(rows))})
        rows = rows[:: -(-len(rows) // MAX_TRAINED)]
    scale = 1.0 if quantity == "counts" or device is None else counts_per_irradiance(device)
    drawn = augmented_counts(
        values[rows] * scale,
        reference_counts(table, device),
        augmentation,
        generator,
        are_whole=quantity == "counts",
    )
    return drawn, np.repeat(rows, augmentation.copies)


def _neighbours(features: FloatArray, place: IntArray, place_count: int) -> NearestFingerprints:
    step = -(-len(features) // MAX_NEIGHBOURS)
    return NearestFingerprints(features=features[::step], place=place[::step], place_count=place_count)


__all__ = ["METHODS", "LocationModel", "TrainingSettings", "load_locator", "save_locator", "train_locator"]
