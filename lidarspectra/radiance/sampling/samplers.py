"""The trace's samplers: each knows one part of a sensor's light, and how the engine is asked for it.

A cosine receptor's light is the sum of three (see `options`): `DIRECT`, reflected `ONCE`, and reflected more `OFTEN`,
whose paths all sensors share. Any other receptor takes what is reflected by `REFLECTED_VIEW`, and the light straight
from lamps that can be cast by `DIRECT`: a small lamp that rays at random do not meet would be missing, and no spread
would say so. Lamps that cannot be cast (windows, all lamps where there are panes) are met by the rays of `VIEW`. The
first two are spared the engine where `cast_light` can do without it.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.radiance.engine.options import Glass, PassOptions
from lidarspectra.radiance.sampling.receptors import FIBONACCI, Receptor
from lidarspectra.radiance.sampling.sensor_rays import Sensors

Kind = Literal["direct", "once", "often", "view"]
_REPEATS = tuple(4**power for power in range(7))  # shadow-ray repeats a batch; each number is a job of its own
_DIRECTIONS = FIBONACCI[::2]  # directions a batch; the same
_FEW_DIRECTIONS = (1, 2, *_DIRECTIONS)  # where at least so many passes share a band's light as make up the fewest


@dataclass(frozen=True)
class Sampler:
    """A part of the light, by directions that each sensor draws for itself.

    Parameters
    ----------
    kind : str
        Its name.
    is_shared : bool
        Whether all points share its samples.
    lamps_visible : bool
        Whether its rays see lamps.
    glass : str
        How panes of glass reflect lamps for it (`scene.pane_text`).
    """

    kind: Kind
    is_shared: bool = False
    lamps_visible: bool = False
    glass: Glass = "plain"

    def sizes(self, sharers: int) -> tuple[int, ...]:
        """Numbers of samples that one set may have, where so many passes add up to the light of a band."""
        return _FEW_DIRECTIONS if sharers >= FIBONACCI[0] else _DIRECTIONS

    def first_samples(self, paths: int, pooled: int) -> int:
        """Samples of the first round: of the paths a point, and those that all points share."""
        return pooled if self.is_shared else paths

    def bounces(self, options: PassOptions) -> int:
        """Largest number of reflections of its light."""
        return options.bounces

    def rays(
        self, sensors: Sensors, points: IntArray, *, sets: int, size: int, generator: np.random.Generator
    ) -> FloatArray:
        """(ray, 6) what the engine is given: of each point in turn, each set of `size` rays in turn."""
        return sensors.draw_rays(points, sets=sets, count=size, generator=generator).reshape(-1, 6)

    def arguments(self, options: PassOptions, size: int) -> tuple[str, ...]:
        """Of rcontrib, which averages each set of `size` rays."""
        return options.gather_arguments(
            size, bounces=self.bounces(options), lamps_visible=self.lamps_visible, glass=self.glass
        )

    def order(self, points: IntArray, generator: np.random.Generator) -> IntArray:
        """The order in which points are given to the engine."""
        return points

    def measure_sr(self, receptor: Receptor) -> float:
        """Solid angle that the engine's answers are multiplied by [sr]."""
        return receptor.measure_sr


class _Direct(Sampler):
    """Light straight from the lamps: the sensors themselves are given, the engine draws the shadow rays."""

    def sizes(self, sharers: int) -> tuple[int, ...]:
        return _REPEATS

    def first_samples(self, paths: int, pooled: int) -> int:
        return 1

    def rays(
        self, sensors: Sensors, points: IntArray, *, sets: int, size: int, generator: np.random.Generator
    ) -> FloatArray:
        rays = np.concatenate([sensors.positions[points], sensors.normals[points]], axis=1)
        return np.repeat(rays, sets * size, axis=0)

    def arguments(self, options: PassOptions, size: int) -> tuple[str, ...]:
        return options.direct_arguments(size)

    def order(self, points: IntArray, generator: np.random.Generator) -> IntArray:
        return generator.permutation(points)  # jobs of one second start on the same numbers

    def measure_sr(self, receptor: Receptor) -> float:
        return 1.0


class _Once(Sampler):
    """Light reflected once."""

    def bounces(self, options: PassOptions) -> int:
        return 1


class _Often(Sampler):
    """Light reflected more than once; its rays and arguments are those of the legs of the drawn paths (`pooling`)."""

    def sizes(self, sharers: int) -> tuple[int, ...]:
        return FIBONACCI


DIRECT = _Direct("direct")
ONCE = _Once("once", glass="images")
OFTEN = _Often("often", is_shared=True)
VIEW = Sampler("view", lamps_visible=True)
REFLECTED_VIEW = Sampler("view")


def samplers_of(receptor: Receptor, *, all_cast: bool) -> tuple[Sampler, ...]:
    """Those whose light adds up to a receptor's, where all lamps of a pass can be cast, or not."""
    if receptor.is_cosine:
        return (DIRECT, ONCE, OFTEN)
    return (DIRECT, REFLECTED_VIEW) if all_cast else (VIEW,)
