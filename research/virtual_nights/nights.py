"""Nights in a virtual office: what its sensors read of people at places, while lamps, dies and furniture change."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.sensor.as7265x import DIE_INDEX, REPEATABILITY
from lidarspectra.mapping.localization.fingerprint_files import EMPTY_LABEL, WideColumns, table_of_counts
from research.virtual_nights.office import (
    BODY_SHARE,
    DAYLIGHT,
    LED,
    OTHER_LED,
    SENSORS,
    SIZE_M,
    Office,
    Person,
    band_spectra,
    behind_box,
    behind_cylinder,
    draw_person,
)

BRIGHTEST_COUNTS = 150.0  # of the median sensor's brightest channel: what 27 sensors in a real office read
SWAY_M = 0.06  # [m] of a person who stands
STANCES = 3  # of a visit
NOBODY, TWO = "nobody", "two people"


@dataclass(frozen=True, kw_only=True)
class NightSettings:
    """What differs from the night before, all as standard deviations or shares.

    Parameters
    ----------
    die_jump : float
        Of a die of a sensor between nights. [1]
    die_drift : float
        Of a die within a night, as a walk over all of it. [1]
    age : float
        Largest loss of a lamp's flux. [1]
    replaced : int
        Lamps that are new, and of another spectrum.
    moved : int
        Pieces of furniture of eight that stand elsewhere.
    daylight : float
        Light through blinds over that of the lamps, of a sensor that sees the window well. [1]
    sway_m : float
        How far a person stands from the place, along each axis; drawn for each stance. [m]
    """

    die_jump: float = 0.2
    die_drift: float = 0.006
    age: float = 0.1
    replaced: int = 1
    moved: int = 2
    daylight: float = 0.0
    sway_m: float = SWAY_M


SAME_ROOM = NightSettings(replaced=0, moved=0, age=0.02)
KINDS = {
    "dies drift": SAME_ROOM,
    "lamps age, one replaced": NightSettings(moved=0),
    "furniture moved": NightSettings(replaced=0, age=0.02, moved=4),
    "daylight through blinds": NightSettings(replaced=0, moved=0, age=0.02, daylight=0.3),
    "all of it": NightSettings(moved=3, daylight=0.2),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Visit:
    """Somebody, or several, at places for some frames.

    Parameters
    ----------
    label : str
    places : tuple of (2,) float
        One for each person; none where nobody is there. [m]
    people : tuple of Person
    frames : int
    """

    label: str
    places: tuple[FloatArray, ...]
    people: tuple[Person, ...]
    frames: int


class Night:
    """A night in an office.

    Parameters
    ----------
    office : Office
    settings : NightSettings
    seed : int
        Of all that is drawn.
    furniture_seed : int
        Of the furniture before it was moved; that of the office.
    """

    def __init__(self, office: Office, settings: NightSettings, seed: int, furniture_seed: int) -> None:
        self._office = office
        self._settings = settings
        self._generator = np.random.default_rng(seed)
        spectra = band_spectra()
        lamps = np.repeat(spectra[LED][None], office.kind.max() + 1, axis=0)
        lamps = lamps * (1.0 - settings.age * self._generator.random((len(lamps), 1)))
        for lamp in self._generator.choice(len(lamps), settings.replaced, replace=False):
            lamps[lamp] = spectra[OTHER_LED] * self._generator.uniform(0.8, 1.3)
        self._ambient = lamps.mean(axis=0)
        self._day = spectra[DAYLIGHT]
        self._emitted = np.where((office.kind >= 0)[:, None], lamps[np.maximum(office.kind, 0)], self._ambient)
        self._blocked = self._furniture(furniture_seed)
        typical = np.median(office.geometry @ self._emitted, axis=0).max()
        fixed = np.random.default_rng(furniture_seed + 1)
        gain = np.exp(0.3 * fixed.standard_normal((SENSORS, 3)))  # of the devices, every night the same
        jump = np.exp(settings.die_jump * self._generator.standard_normal((SENSORS, 3)))
        self._gain = BRIGHTEST_COUNTS / typical * (gain * jump)[:, DIE_INDEX]

    def counts(self, visits: list[Visit]) -> tuple[FloatArray, list[str]]:
        """(frame, sensor, band) counts of visits one after the other, and the label of each frame."""
        total = sum(visit.frames for visit in visits)
        drift = self._walk(total, (SENSORS, 3), self._settings.die_drift)[:, :, DIE_INDEX]
        cloud = np.exp(self._walk(total, (1, 1), 0.5))
        frames: list[FloatArray] = []
        labels: list[str] = []
        for visit in visits:
            stances = [self._light(visit) for _ in range(STANCES if visit.people else 1)]
            chosen = np.repeat(np.arange(len(stances)), -(-visit.frames // len(stances)))[: visit.frames]
            start = len(labels)
            for frame, stance in enumerate(chosen.tolist()):
                lit, day = stances[stance]
                light = lit + day * cloud[start + frame]
                frames.append(light * self._gain * np.exp(drift[start + frame]))
                labels.append(visit.label)
        noisy = np.array(frames) * (1.0 + REPEATABILITY * self._generator.standard_normal((total, SENSORS, 18)))
        return np.rint(noisy), labels

    def _light(self, visit: Visit) -> tuple[FloatArray, FloatArray]:
        """(sensor, band) light of lamps, and of the window, with people in it."""
        office = self._office
        clear = ~self._blocked
        lit = (office.geometry * clear) @ self._emitted
        level = self._settings.daylight * office.geometry.sum(axis=1).mean() / max(office.from_window.mean(), 1e-6)
        window = office.from_window * clear * level / office.from_window.shape[1] * 0.2
        reflected = self._blocked * office.geometry * 0.3
        lit = lit + np.where((office.kind < 0)[None], reflected, 0.0) @ self._emitted
        taken = np.zeros(clear.shape, dtype=np.bool_)
        for place, person in zip(visit.places, visit.people, strict=True):
            stood = place + self._settings.sway_m * self._generator.standard_normal(2)
            new = behind_cylinder(office, stood, person) & clear & ~taken
            taken |= new
            lit = lit - (office.geometry * new) @ self._emitted
            seen = (office.kind < 0)[None] * new * office.geometry * BODY_SHARE
            lit = lit + seen @ self._emitted * person.reflectance
        day = (window * ~taken).sum(axis=1)[:, None] * self._day
        return lit, day

    def _furniture(self, seed: int) -> np.ndarray:
        fixed = np.random.default_rng(seed)
        spots = np.column_stack([fixed.uniform(0.2, SIZE_M[0] - 1.0, 8), fixed.uniform(0.2, SIZE_M[1] - 0.8, 8)])
        sizes = np.column_stack([fixed.uniform(0.4, 1.0, 8), fixed.uniform(0.3, 0.6, 8), fixed.uniform(0.9, 1.9, 8)])
        moved = self._generator.choice(8, self._settings.moved, replace=False)
        spots[moved] = spots[moved] + self._generator.uniform(-0.8, 0.8, (len(moved), 2))
        blocked = np.zeros(self._office.geometry.shape, dtype=np.bool_)
        for spot, size in zip(spots, sizes, strict=True):
            low = np.array([*spot, 0.0])
            blocked |= behind_box(self._office, low, low + size)
        return blocked

    def _walk(self, frames: int, shape: tuple[int, ...], spread: float) -> FloatArray:
        """(frame, ...) smooth random walk that has such a standard deviation at its end."""
        knots = max(2, frames // 120 + 2)
        steps = self._generator.standard_normal((knots, *shape)) * spread / np.sqrt(knots)
        path = np.cumsum(steps, axis=0)
        at = np.linspace(0.0, knots - 1.0, frames)
        first = np.minimum(at.astype(int), knots - 2)
        share = (at - first).reshape(-1, *([1] * len(shape)))
        return np.asarray(path[first] * (1.0 - share) + path[first + 1] * share, dtype=np.float64)


def visits_to(office: Office, generator: np.random.Generator, frames: int, *, order: str = "rows") -> list[Visit]:
    """One person's visits to all places, row by row as a survey goes, or by lot."""
    person = draw_person(generator)
    numbers = np.arange(len(office.places))
    if order == "lot":
        numbers = generator.permutation(numbers)
    return [
        Visit(label=str(number), places=(office.places[number],), people=(person,), frames=frames)
        for number in numbers.tolist()
    ]


def as_table(counts: FloatArray, labels: list[str], office: Office, source: str) -> xr.Dataset:
    """Counts in the form of fingerprints, with positions; label `EMPTY_LABEL` becomes the empty room."""
    sensors = tuple(f"s{number + 1}" for number in range(SENSORS))
    place = {(sensor, band): 0 for sensor in sensors for band in range(18)}
    columns = WideColumns(
        sensors=sensors, channels=tuple(range(18)), place=place, label=None, time=None, width=SENSORS * 18
    )
    table = table_of_counts(counts, columns, labels=labels, source=source)
    kept = [label for label in labels if label != EMPTY_LABEL]
    spots = [(*office.places[int(label)], 0.0) if label.isdigit() else (np.nan,) * 3 for label in kept]
    return table.assign_coords(position_m=(("fingerprint", "axis"), np.array(spots)))
