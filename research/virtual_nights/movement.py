"""People who move in a virtual office: walks, steps to the next place, jumps, long stays, nobody, and two people.

A frame is a second. Which movement comes, how long a stay takes and where it goes are drawn, so that no order of the
places and no length of a stay can be learned from these nights.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from research.virtual_nights.nights import NOBODY, TWO, Visit
from research.virtual_nights.office import Office, Person, draw_person

Movement = Literal["walk", "steps", "jumps", "stay", "nobody", "two people"]
MOVEMENTS: tuple[Movement, ...] = get_args(Movement)
WALKED_FRAMES = (1, 4)  # at a place that a walk passes: from the first up to below the second
STEP_FRAMES = (5, 16)
JUMP_FRAMES = (5, 41)
STAY_FRAMES = (80, 201)
AWAY_FRAMES = (3, 61)
PLACES = {"walk": (6, 16), "steps": (4, 7), "jumps": (3, 6), "stay": (1, 2)}  # that one movement goes to
NEXT_M = 1.4  # [m] a step goes no farther; places are 0.9 m apart
APART_M = 0.7  # [m] two people stand at least so far from each other


@dataclass(frozen=True, kw_only=True, eq=False)
class Moves:
    """A night's visits, in order.

    Parameters
    ----------
    visits : list of Visit
    movements : list of Movement
        Which one each visit belongs to.
    """

    visits: list[Visit]
    movements: list[Movement]

    @property
    def of_frame(self) -> IntArray:
        """(frame,) number of the visit."""
        return np.repeat(np.arange(len(self.visits)), [visit.frames for visit in self.visits])


def moves_of_a_night(office: Office, generator: np.random.Generator, frames: int) -> Moves:
    """Movements by lot, each as likely, of three people one after the other, for so many frames or a little longer.

    Parameters
    ----------
    office : Office
    generator : Generator
    frames : int
        Of the whole night.
    """
    people = [draw_person(generator) for _ in range(3)]
    visits: list[Visit] = []
    movements: list[Movement] = []
    at, person, total = int(generator.integers(len(office.places))), people[0], 0
    while total < frames:
        movement = MOVEMENTS[generator.integers(len(MOVEMENTS))]
        if movement in ("nobody", "two people"):
            new = [_without_one(movement, office, people, generator)]
            person, at = people[generator.integers(3)], int(generator.integers(len(office.places)))
        else:
            new = []
            for _ in range(generator.integers(*PLACES[movement])):
                at = _next_place(movement, at, office.places, generator)
                new.append(_visit(movement, at, office, person, generator))
        visits += new
        movements += [movement] * len(new)
        total += sum(visit.frames for visit in new)
    return Moves(visits=visits, movements=movements)


def _visit(movement: Movement, at: int, office: Office, person: Person, generator: np.random.Generator) -> Visit:
    frames = {"walk": WALKED_FRAMES, "steps": STEP_FRAMES, "jumps": JUMP_FRAMES, "stay": STAY_FRAMES}[movement]
    length = int(generator.integers(*frames))
    return Visit(label=str(at), places=(office.places[at],), people=(person,), frames=length)


def _next_place(movement: Movement, at: int, places: FloatArray, generator: np.random.Generator) -> int:
    away = np.linalg.norm(places - places[at], axis=1)
    farthest_m = NEXT_M if movement in ("walk", "steps") else np.inf
    return int(generator.choice(np.flatnonzero((away > 0) & (away <= farthest_m))))


def _without_one(movement: Movement, office: Office, people: list[Person], generator: np.random.Generator) -> Visit:
    frames = int(generator.integers(*AWAY_FRAMES))
    if movement == "nobody":
        return Visit(label=NOBODY, places=(), people=(), frames=frames)
    places = office.places
    first = int(generator.integers(len(places)))
    second = int(generator.choice(np.flatnonzero(np.linalg.norm(places - places[first], axis=1) >= APART_M)))
    pair = generator.choice(3, 2, replace=False)
    both = (people[pair[0]], people[pair[1]])
    return Visit(label=TWO, places=(places[first], places[second]), people=both, frames=frames)
