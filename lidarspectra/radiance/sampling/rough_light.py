"""Rough light on the room's surfaces: shared paths need only find by how much it is wrong.

Sensors that share the paths of a cell are given its mean. Left at that, a sensor in a corner would have the light of
the cell's middle, the same in every batch, so that no spread tells it (measured in docs/performance.md). So the paths
estimate the difference from a known function r(y), which every sensor adds again along its own rays (a control
variate):

    m(cell) = r(y) + mean of m(y') - r(y') over its drawn arrivals y'

That is unbiased for any r. It is the radiosity solution of the patches (`patches`), made even by a linear fit to
each place and those beside it that it sees.

References
----------
Lavenberg S S, Welch P D (1981), A perspective on the use of control variables to increase the efficiency of Monte
Carlo simulations, Management Science 27(3), 322-335.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lidarspectra.arrays import FloatArray, IntArray

TERMS = 4  # of the linear function at a place: its level, and its change along the axes
RIDGE = 0.1  # [1] of a slope over the fit's length: places that lie in a plane, or alone, leave slopes undetermined


@dataclass(frozen=True, kw_only=True, eq=False)
class RoughLight:
    """Light that surfaces send on, a linear function around each place.

    Parameters
    ----------
    places : (place, 3) float
        [m]
    functions : (4 place, value) float32
        Level at each place, and its change along x, y and z over `length_m`; a value is a lamp's in a slot. [any unit]
    length_m : float
        [m]
    """

    places: FloatArray
    functions: NDArray[np.float32] = field(repr=False)
    length_m: float

    def terms(
        self, place: IntArray, positions: FloatArray, *, row: IntArray, rows: int, weight: float = 1.0
    ) -> csr_array:
        """Sums of the rough light at positions, as a matrix that is to be multiplied by `functions`.

        Parameters
        ----------
        place : (position,) int
            Whose function holds there; -1 where none is, and the rough light is 0.
        positions : (position, 3) float
            [m]
        row : (position,) int
            Which sum each belongs to.
        weight : float
            Of each.
        rows : int
            Number of sums.

        Returns
        -------
        terms : (row, 4 place) sparse, float32
        """
        known = np.flatnonzero(place >= 0)
        at = place[known]
        values = np.empty((known.size, TERMS), dtype=np.float32)
        values[:, 0] = weight
        values[:, 1:] = weight * (positions[known] - self.places[at]) / self.length_m
        columns = TERMS * at[:, None] + np.arange(TERMS)
        where = np.repeat(row[known], TERMS), columns.ravel()
        return csr_array((values.ravel(), where), shape=(rows, TERMS * len(self.places)))


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearFit:
    """How light at places becomes a linear function around each, by least squares over the place and its neighbours.

    Parameters
    ----------
    places : (place, 3) float
        [m]
    matrix : (4 place, place) sparse
        The functions' coefficients, of values at the places.
    length_m : float
        Over which slopes are held down by a `RIDGE`. [m]
    """

    places: FloatArray
    matrix: csr_array = field(repr=False)
    length_m: float

    def of(self, light: FloatArray) -> RoughLight:
        """The functions of (place, value) light; zero where a place and all its neighbours have none."""
        functions = (self.matrix @ light).astype(np.float32)
        return RoughLight(places=self.places, functions=functions, length_m=self.length_m)

    def at(self, light: FloatArray, place: IntArray, positions: FloatArray) -> FloatArray:
        """(position, value) of (place, value) light by the functions of some places, at a position (3,) [m] each."""
        row = np.arange(len(place))
        known = self.of(light)
        found: FloatArray = known.terms(place, positions, row=row, rows=len(row)) @ known.functions
        return found


def linear_fit(places: FloatArray, neighbours: IntArray, *, length_m: float) -> LinearFit:
    """Prepare the fit of a linear function to each place and its neighbours.

    Parameters
    ----------
    places : (place, 3) float
        [m]
    neighbours : (pair, 2) int
        Places that see one another.
    length_m : float
        [m]

    Returns
    -------
    fit : LinearFit
    """
    count = len(places)
    itself = np.arange(count)
    here = np.concatenate([neighbours[:, 0], neighbours[:, 1], itself])
    there = np.concatenate([neighbours[:, 1], neighbours[:, 0], itself])
    design = np.ones((len(here), TERMS))
    design[:, 1:] = (places[there] - places[here]) / length_m
    squares = np.zeros((count, TERMS, TERMS))
    np.add.at(squares, here, design[:, :, None] * design[:, None, :])
    squares[:, range(1, TERMS), range(1, TERMS)] += RIDGE
    solved = np.linalg.solve(squares[here], design[:, :, None])[..., 0]  # (pair, term): what each adds to the function
    rows = (TERMS * here[:, None] + np.arange(TERMS)).ravel()
    matrix = csr_array((solved.ravel(), (rows, np.repeat(there, TERMS))), shape=(TERMS * count, count))
    return LinearFit(places=places, matrix=matrix, length_m=length_m)
