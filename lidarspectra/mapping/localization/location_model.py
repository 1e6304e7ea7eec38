"""A trained locator: its features, its places, the methods that map one to the other, and how many people there are.

model = train_locator(fingerprints)          in memory; `location_model_files` keeps it in a folder
located = model.locate(readings)             probabilities of the places and of how many people, and positions
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Literal

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray, IntArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import SensorSettings
from lidarspectra.mapping.localization.augmentation import Augmentation, augmented_counts, unsettled_references
from lidarspectra.mapping.localization.discriminant import DiscriminantPlaces, fit_discriminant, sensor_blur
from lidarspectra.mapping.localization.feature_choice import chosen_features
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
from lidarspectra.mapping.localization.light_trend import follow_trend
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
from lidarspectra.mapping.localization.memory import Memory, remember
from lidarspectra.mapping.localization.network_graph import network_graph
from lidarspectra.mapping.localization.places import Located, Places, places_of_table
from lidarspectra.mapping.localization.presence import NOBODY, TWO_PEOPLE, Presence, fit_presence, log_changes
from lidarspectra.mapping.localization.running_reference import LightTrend, references_and_trends
from lidarspectra.progress import Progress, silent

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
        Without `per`, it is chosen; see `chosen_features`.
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
    presence : Presence
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
    presence: Presence
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
                return self.features_against(readings, reference_of(fitted), quantity)
            case "running":
                reference, trend = references_and_trends(readings)
                return self.features_against(readings, reference, quantity, trend=trend)
            case "trained":
                return self.features_against(readings, self.reference, quantity)

    def features_against(
        self, readings: FloatArray, reference: FloatArray, quantity: Quantity, *, trend: LightTrend | None = None
    ) -> FloatArray:
        """(reading, feature) features of readings against a reference, NaN where missing.

        Parameters
        ----------
        readings : (reading, sensor, band) float
            Of the model's sensors and bands; NaN where missing.
        reference : (sensor, band) or (reading, sensor, band) float
            [unit of the readings]
        quantity : 'irradiance' or 'counts'
            Of both. Channels whose reference is a few counts are left out.
        trend : LightTrend, optional
            Of all readings or at each, along which the reference goes on; see `follow_trend`.
        """
        usable = reference >= self.space.settings.min_count if quantity == "counts" else None
        if trend is not None:
            reference = follow_trend(self.space, readings, reference, trend, usable=usable)
        return self.space.features(readings, reference, usable=usable)

    def locate(self, table: xr.Dataset, method: Method = "together", *, against: Against = "own") -> Located:
        """Locate readings by one method; parameters as in `features`."""
        return self.locate_features(self.features(table, against=against), method)

    def locate_features(self, features: FloatArray, method: Method = "together") -> Located:
        """Locate features by one method."""
        return Located(
            scores=self.locators[method].scores(features),
            places=self.places,
            people=self.people(features),
        )

    def memory(self) -> Memory:
        """An empty memory of what readings told, for those of one recording in order of time."""
        return Memory(self.places.positions_m, self.space.difference_noise)

    def locate_in_order(self, features: FloatArray, times_s: FloatArray, method: Method = "together") -> Located:
        """Locate the features of readings in turn, each with what those before it told; see `memory`.

        Parameters
        ----------
        features : (reading, feature) float
            NaN where missing.
        times_s : (reading,) float
            From any origin. [s]
        method : Method
        """
        return self.remembered(self.locate_features(features, method), features, times_s)

    def remembered(self, alone: Located, features: FloatArray, times_s: FloatArray) -> Located:
        """What is known after each of recorded readings, of what each told alone; parameters as `locate_in_order`."""
        scores, people = remember(self.memory(), times_s, features, alone.scores, alone.people)
        return Located(scores=scores, places=self.places, people=people)

    def people(self, features: FloatArray) -> FloatArray:
        """(reading, 3) probability of nobody, one person and two [0-1]."""
        return self.presence.probabilities(self.space.sensor_features(features))


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

    Notes
    -----
    Readings labelled 'nobody' and 'two people' are no places, and left out.
    """
    settings = settings or TrainingSettings()
    several = [of_one_person(table) for table in ([tables] if isinstance(tables, xr.Dataset) else tables)]
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
    space = chosen_features(space, fitted, places, device, drift=settings.augmentation.drift)
    generator = np.random.default_rng(seed)
    clean, drawn, unsettled, place, drawn_place, changes = [], [], [], [], [], []
    for number, table in enumerate(fitted):
        progress(0.3 * number / len(fitted), "drawing readings")
        own = places.index(table["label"].to_numpy())
        values, reference = table[quantity_of(table)].to_numpy(), reference_of(table)
        clean.append(space.features(values, reference))
        place.append(own)
        changes.append(log_changes(values, reference))
        copies, rows = _draw(table, settings.augmentation, device, generator)
        settled = reference_counts(table, device)
        drawn.append(space.features(copies, settled))
        share = settings.augmentation.unsettled
        counts = values * _counts_per_unit(table, device)
        unsettled.append(space.features(copies, unsettled_references(counts, settled, len(copies), share, generator)))
        drawn_place.append(own[rows])
    all_drawn, all_place = np.vstack(drawn), np.concatenate(drawn_place)
    all_clean, clean_place = np.vstack(clean), np.concatenate(place)
    progress(0.3, "fitting the discriminant")
    blur = sensor_blur(space, fitted[0], device, drift=settings.augmentation.drift)
    discriminant = fit_discriminant(all_clean, clean_place, len(places), blur, mismatch=space.settings.mismatch)
    progress(0.35, "fitting the ridge")
    ridge = fit_ridge(all_drawn, all_place, len(places))
    progress(0.4, "training the network")
    weights = fit_network(np.vstack(unsettled), all_place, len(places), settings.network)
    progress(0.95, "learning to count people")
    presence = fit_presence(
        np.concatenate(changes),
        reference_counts(fitted[0], device),
        clean_place,
        places.positions_m,
        space,
        np.random.default_rng(seed),
    )
    progress(1.0, "trained")
    return LocationModel(
        space=space,
        places=places,
        neighbours=_neighbours(all_clean, clean_place, len(places)),
        ridge=ridge,
        discriminant=discriminant,
        network=NetworkPlaces(network_graph(weights, places, space), where="the trained network"),
        presence=presence,
        reference=reference_of(fitted[0]),
        quantity=quantity_of(first),
        source=", ".join(str(table.attrs.get("source", "fingerprints")) for table in several),
    )


def of_one_person(table: xr.Dataset) -> xr.Dataset:
    """The readings of a table that are of one person."""
    labels = table["label"].to_numpy().astype(str)
    others = np.isin(labels, (NOBODY, TWO_PEOPLE))
    return table.isel(fingerprint=np.flatnonzero(~others)) if others.any() and not others.all() else table


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
    drawn = augmented_counts(
        values[rows] * _counts_per_unit(table, device),
        reference_counts(table, device),
        augmentation,
        generator,
        are_whole=quantity == "counts",
    )
    return drawn, np.repeat(rows, augmentation.copies)


def _counts_per_unit(table: xr.Dataset, device: SensorSettings | None) -> float:
    """Counts per unit of a table's readings."""
    return 1.0 if quantity_of(table) == "counts" or device is None else counts_per_irradiance(device)


def _neighbours(features: FloatArray, place: IntArray, place_count: int) -> NearestFingerprints:
    step = -(-len(features) // MAX_NEIGHBOURS)
    return NearestFingerprints(features=features[::step], place=place[::step], place_count=place_count)


__all__ = ["METHODS", "LocationModel", "TrainingSettings", "train_locator"]
