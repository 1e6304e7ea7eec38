"""Fusion of many views' classes on the mesh: pixel votes, a prior by place, and smoothing over neighbours.

A pixel votes with its class probabilities, weighted by their confidence and by the cosine under which it sees the face.
The votes' mean enters as a likelihood that is uninformative for a given share of surfaces (`WRONG`); times the prior of
the face's place (`place_priors`) it gives the face's posterior. Mean field on the mesh then smooths it where colour and
normal of neighbours agree (`face_groups.agreement`).
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import FloatArray, IntArray, float_array
from lidarspectra.errors import MaterialError
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.segmentation.crf import MIN_PROBABILITY
from lidarspectra.material.segmentation.face_groups import ROUNDS, probabilities_of
from lidarspectra.material.segmentation.segmentation import CELL_PX, Classifier, segment
from lidarspectra.material.views.projection import ray_directions
from lidarspectra.material.views.views import View, ViewSet
from lidarspectra.progress import Progress, silent

MIN_CONFIDENCE = 0.05  # [1] weight of a pixel with uniform probabilities, relative to a certain one
NEIGHBOR_WEIGHT = 4.0  # [1] of all neighbours together in the mean field, as `crf`'s two kernels together
ENOUGH_PIXELS = 30.0  # [1] sure, square pixels at which a face's own votes count as they are
WRONG = 0.8  # [1] share of surfaces for which the pictures' classes are uninformative (docs/segmentation.md)
CLASS_PARTS = 0.15  # [1] share of a colour group from which a second class makes a group of its own
CLASS_PART_M2 = 0.25  # [m²] and its least area


@dataclass(frozen=True, kw_only=True, eq=False)
class FaceClasses:
    """Material class of every face.

    Parameters
    ----------
    classes : tuple of str
    belief : (face, class) float
        Summing to 1 over the classes.
    votes : (face,) float
        Pixels that showed the face, each weighted by how sure and how square it was. [pixel]
    """

    classes: tuple[str, ...]
    belief: FloatArray
    votes: FloatArray

    def __post_init__(self) -> None:
        belief = float_array(self.belief, name="FaceClasses.belief", shape=(None, len(self.classes)))
        object.__setattr__(self, "belief", belief)
        object.__setattr__(self, "votes", float_array(self.votes, name="FaceClasses.votes", shape=(len(belief),)))

    @property
    def best(self) -> IntArray:
        """(face,) number of the likeliest class."""
        return np.asarray(self.belief.argmax(axis=1), dtype=np.int64)


def view_votes(classifier: Classifier, scan: Scan, views: ViewSet, progress: Progress = silent) -> FaceClasses:
    """Mean of all pixels' class probabilities on every face; faces that no view shows know nothing.

    Parameters
    ----------
    classifier : Classifier
    scan : Scan
    views : ViewSet
        Of it.
    progress : callable

    Returns
    -------
    votes : FaceClasses

    Raises
    ------
    MaterialError
        If a view shows faces that the scan does not have, or the model fails.
    """
    count = len(classifier.classes)
    total = np.zeros((len(scan.faces), count))
    for number, view in enumerate(views.views):
        progress(number / len(views.views), f"material classes, view {number + 1} of {len(views.views)}")
        if view.face.max(initial=-1) >= len(scan.faces):
            raise MaterialError(
                expected=f"views of this scan ({len(scan.faces)} faces)",
                found=f"face {view.face.max()} in view '{view.name}'",
                where="views",
                todo="Run the views stage again.",
            )
        probabilities = segment(classifier, view.image)
        total += _votes(view, scan, probabilities)
    weight = total.sum(axis=1)
    known = weight > 0
    belief = np.full_like(total, 1.0 / count)
    belief[known] = total[known] / weight[known, None]
    return FaceClasses(classes=classifier.classes, belief=belief, votes=weight)


def fuse(
    votes: FaceClasses, neighbors: csr_array, prior: FloatArray | None = None, *, wrong: float = WRONG
) -> FaceClasses:
    """Votes, prior and neighbours together.

    Parameters
    ----------
    votes : FaceClasses
        See `view_votes`.
    neighbors : (face, face) sparse float
        See `face_groups.agreement`.
    prior : (face, class) float, optional
        See `place_priors.class_prior`; even where it is left out. [0-1]
    wrong : float
        Share of surfaces of which pictures say something that means nothing. [0-1]

    Returns
    -------
    fused : FaceClasses
    """
    trust = np.minimum(votes.votes / ENOUGH_PIXELS, 1.0)[:, None]
    likelihood = (1.0 - wrong) * votes.belief + wrong / len(votes.classes)
    own = trust * np.log(likelihood)
    if prior is not None:
        own = own + np.log(np.maximum(prior, MIN_PROBABILITY))
    belief = probabilities_of(own)
    for _ in range(ROUNDS):
        belief = probabilities_of(own + NEIGHBOR_WEIGHT * (neighbors @ belief))
    return FaceClasses(classes=votes.classes, belief=belief, votes=votes.votes)


def split_by_class(
    label: IntArray, classes: FaceClasses, areas: FloatArray, *, most: int
) -> tuple[IntArray, int, tuple[str, ...]]:
    """Segments of one colour and one class, from segments of one colour.

    A colour group becomes more than one segment where further classes hold enough of it (`CLASS_PARTS`,
    `CLASS_PART_M2`), the largest first until there are `most`; its other faces take the likeliest of the classes that
    stay.

    Parameters
    ----------
    label : (face,) int
        Colour group, -1 for none; 0 to n - 1 all occur.
    classes : FaceClasses
    areas : (face,) float
        [m²]
    most : int
        Largest number of segments, unless there are more colours.

    Returns
    -------
    label : (face,) int
        Segments by descending area.
    count : int
    names : (segment,) str
        Class of each.
    """
    groups = int(label.max(initial=-1)) + 1
    cell = np.maximum(label, 0) * len(classes.classes) + classes.best
    area = np.bincount(cell[label >= 0], weights=areas[label >= 0], minlength=groups * len(classes.classes))
    area = area.reshape(groups, len(classes.classes))
    kept = np.zeros(area.shape, dtype=np.bool_)
    kept[np.arange(groups), area.argmax(axis=1)] = True
    further = np.where(~kept & (area >= CLASS_PARTS * area.sum(axis=1, keepdims=True)), area, 0.0)
    further[further < CLASS_PART_M2] = 0.0
    for place in np.argsort(-further, axis=None, kind="stable")[: max(0, most - groups)]:
        kept.flat[place] |= further.flat[place] > 0
    segments: list[tuple[IntArray, str]] = []
    for group in range(groups):
        member, names = np.flatnonzero(label == group), np.flatnonzero(kept[group])
        own = names[classes.belief[member][:, names].argmax(axis=1)]
        segments += [(member[own == k], classes.classes[k]) for k in names if (own == k).any()]
    segments.sort(key=lambda segment: -float(areas[segment[0]].sum()))
    renamed = np.full(len(label), -1, dtype=np.int64)
    for number, (member, _) in enumerate(segments):
        renamed[member] = number
    return renamed, len(segments), tuple(name for _, name in segments)


def _votes(view: View, scan: Scan, probabilities: FloatArray) -> FloatArray:
    """(face, class) weighted sum of a view's pixels."""
    rows, columns, count = probabilities.shape
    flat = probabilities.reshape(-1, count)
    entropy = -(flat * np.log(np.maximum(flat, 1e-12))).sum(axis=1) / np.log(count)
    sure = MIN_CONFIDENCE + (1.0 - MIN_CONFIDENCE) * np.clip(1.0 - entropy, 0.0, 1.0)
    y, x = np.nonzero(view.face >= 0)
    face = view.face[y, x]
    cell = (y // CELL_PX) * columns + x // CELL_PX
    rays = ray_directions(view.camera, np.stack([x + 0.5, y + 0.5], axis=1))
    square = np.abs(np.einsum("nc,nc->n", rays, scan.normals[face])) / np.sqrt(np.einsum("nc,nc->n", rays, rays))
    mixed = csr_array((square * sure[cell], (face, cell)), shape=(len(scan.faces), rows * columns))
    return np.asarray(mixed @ flat, dtype=np.float64)
