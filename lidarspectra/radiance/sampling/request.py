"""What a trace is asked for, and the record of what it did; common to all its blocks of points."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from lidarspectra.arrays import FloatArray
from lidarspectra.radiance.engine.engine import Engine
from lidarspectra.radiance.engine.options import NoiseOf, PassOptions, first_round_sizes
from lidarspectra.radiance.engine.seed_clock import Seconds
from lidarspectra.radiance.sampling.arrivals import Surfaces
from lidarspectra.radiance.sampling.receptors import Receptor
from lidarspectra.radiance.sampling.samplers import DIRECT, Sampler, samplers_of
from lidarspectra.radiance.scene.scene import RadianceScene, ScenePass

PATCHES_FIRST = (89, 987)  # as `first_round_sizes`, where light is binned by patches of the sky: the target is
# that of the whole sky's light, but the sun's comes from a few patches, whose noise this brings from 8 to 5 %


@dataclass(frozen=True, kw_only=True)
class Request:
    """Settings common to all blocks.

    Parameters
    ----------
    bounces : int
        Largest number of diffuse reflections.
    target : float
        Target of the standard error. [1]
    noise_of : str
        What that is relative to: the 'mean' irradiance, or the light of each 'point'.
    workers : int
        Processes.
    receptor : Receptor
    engine : Engine
    surfaces : dict of str to Surfaces
        Of each pass, by its name.
    direct_mean : (band,) float or None
        Mean irradiance straight from the lamps where it is known otherwise: it is not traced then, and errors are
        relative to the sum of both. [W/m²/nm]
    keeps_batches : bool
        Whether every lamp's independent estimates are kept, or only their mean and variance (`running_means`).
    """

    bounces: int
    target: float
    workers: int
    receptor: Receptor
    engine: Engine
    noise_of: NoiseOf = "mean"
    surfaces: Mapping[str, Surfaces] = field(default_factory=dict)
    direct_mean: FloatArray | None = None
    keeps_batches: bool = True

    def samplers(self, *, all_cast: bool) -> tuple[Sampler, ...]:
        """Those whose light is traced of a pass, all lamps of which can be cast, or not."""
        every = samplers_of(self.receptor, all_cast=all_cast)
        return every if self.direct_mean is None else tuple(each for each in every if each is not DIRECT)

    @property
    def first_sizes(self) -> tuple[int, int]:
        """Directions per point, and shared paths, in each batch of the first round."""
        return first_round_sizes(self.target) if self.direct_mean is None else PATCHES_FIRST


def pass_options(scene: RadianceScene, scene_pass: ScenePass, request: Request) -> PassOptions:
    """Options by which the engine is asked for the light of a pass."""
    return PassOptions(
        group=scene_pass.group,
        lamp_modifiers=tuple(dict.fromkeys(scene.lamp_modifiers[lamp] for lamp in scene_pass.lamps)),
        octree=scene_pass.octree,
        images=scene_pass.images_octree,
        glow=scene_pass.glow_octree,
        relays=scene.relays,
        bounces=request.bounces,
        lamp_count=len(scene.lamp_names),
        bins=len(scene_pass.lamps) if scene_pass.bins_file else 0,
        bins_file=scene_pass.bins_file,
    )


@dataclass(kw_only=True)
class Log:
    """Record of the engine's work, over all blocks.

    Parameters
    ----------
    commands : set of str
        Every different command line.
    rays : int
        Rays given to the engine.
    seeds : tuple of (int, int)
        Clock seconds that seeded shadow rays. [s]
    """

    commands: set[str] = field(default_factory=set)
    rays: int = 0
    seeds: tuple[Seconds, ...] = ()
