"""The options that rtrace and rcontrib are run with: accuracy and noise turned into argument lists.

The irradiance at a sensor is split in three, each part by the estimator that suits it:

    E = D + S + M,   D    straight from the lamps: shadow rays to points of them
                     S    reflected once: rays in all directions, blind to lamps (`-dv-`), shadow rays where they arrive
                     M    reflected more than once: paths with shadow rays at every corner, from the second on;
                          few serve all sensors (`pooling`)

D and S are had by ray casting where lamps and surfaces allow it (`sampling.cast_light`), M always by Radiance.

Each path is unbiased: every shadow ray aims at a point drawn evenly from its part of the lamp (`-dj 1`), none is left
out (`-dt 0`), paths end by Russian roulette (negative `-lr`), nothing is cached or interpolated (`-aa 0`), and
sampling is uncorrelated: `-u-`, whose stratified numbers are correlated along a path, came out 0.9 % low in a closed
cube of reflectance 0.8, where `-u+` was right within its noise of 0.06 %.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from lidarspectra.arguments import one_of
from lidarspectra.radiance.engine.bands import BandGroup

Glass = Literal["plain", "images", "glow"]
Accuracy = Literal["low", "medium", "high", "ultra", "all"]
Noise = Literal["draft", "standard", "fine"]
NoiseOf = Literal["mean", "point"]
TraceMethod = Literal["adaptive", "rtrace"]

NOISES_OF: tuple[NoiseOf, ...] = ("mean", "point")
BOUNCES: dict[Accuracy, int] = {"low": 2, "medium": 8, "high": 14, "ultra": 20}  # [1] paper, Section 4.1
ALL_BOUNCES = 2_000  # of 'all', where paths end by Russian roulette alone: .99 to this power is 2e-9
PATH_WEIGHT = 0.4  # [1] -lw: Russian roulette below this weight; .3 to .5 gave the least variance for equal time
REFLECTED_LAMP_PART = 0.3  # [1] -ds for lamps as seen from reflecting surfaces: subdivided only if close
SPECULAR_REFLECTIONS = 20  # mirror-like reflections that a path may have besides the diffuse ones
SPECULAR_THRESHOLD = 0.01  # [1] -st: a gloss weaker than this is added to the diffuse part
RELAYS = 2  # -dr, where a scene does not ask for more: images of lamps in panes, and images of those
LAMP_PARTS = (
    (4, 0.05),
    (16, 0.1),
    (64, 0.2),
)  # (largest number of lamps, -ds); with many lamps the noise of each averages out
BIN = "litbin"  # variable of a function file: part of the light that a ray belongs to; none below 0
COARSEST_LAMP_PART = 0.4  # [1] -ds beyond the last


@dataclass(frozen=True, kw_only=True)
class NoiseLevel:
    """Sampling parameters of a noise setting.

    Parameters
    ----------
    relative_se : float
        Target of the standard error, relative to the mean irradiance. [1]
    first_from : float
        Smallest target whose first round has these sizes. [1]
    first_paths : int
        Directions per point and batch in the first round.
    first_pooled : int
        Shared paths per batch in the first round.
    plain_divisions : int
        First rays of a sensor (`-ad`) in one plain run of the engine.
    exported_repeats : int
        Times that the exported model traces each sensor with the divisions of 'draft'; the mean's noise comes near
        the run's.
    """

    relative_se: float
    first_from: float
    first_paths: int
    first_pooled: int
    plain_divisions: int
    exported_repeats: int


NOISE_LEVELS: dict[Noise, NoiseLevel] = {
    "draft": NoiseLevel(
        relative_se=0.03, first_from=0.02, first_paths=13, first_pooled=89, plain_divisions=256, exported_repeats=2
    ),
    "standard": NoiseLevel(
        relative_se=0.01, first_from=0.0075, first_paths=34, first_pooled=233, plain_divisions=1024, exported_repeats=8
    ),
    "fine": NoiseLevel(
        relative_se=0.005, first_from=0.0, first_paths=34, first_pooled=233, plain_divisions=4096, exported_repeats=32
    ),
}
QUICK_TARGET = 0.05  # coarser than 'draft', as textures are baked with: from here on the first round is smaller still
QUICK_FIRST = (5, 34)  # first_paths and first_pooled of it


def bounces_of(accuracy: Accuracy) -> int:
    """Largest number of reflections of an accuracy [1]; raises ArgumentError for an unknown one."""
    return ALL_BOUNCES if one_of(accuracy, (*BOUNCES, "all"), name="accuracy") == "all" else BOUNCES[accuracy]


def reflections_in_words(accuracy: Accuracy) -> str:
    """The number of reflections traced, in words for the user."""
    return "all reflections" if accuracy == "all" else f"at most {bounces_of(accuracy)} reflections"


def noise_level(noise: Noise) -> NoiseLevel:
    """Sampling parameters of a noise setting; raises ArgumentError for an unknown one."""
    return NOISE_LEVELS[one_of(noise, tuple(NOISE_LEVELS), name="noise")]


def first_round_sizes(target: float) -> tuple[int, int]:
    """Directions per point, and shared paths, in each batch of the first round for a target [1]."""
    if target >= QUICK_TARGET:
        return QUICK_FIRST
    level = next(level for level in NOISE_LEVELS.values() if target >= level.first_from)
    return level.first_paths, level.first_pooled


@dataclass(frozen=True, kw_only=True)
class PassOptions:
    """Options of rcontrib and rtrace for one pass.

    Parameters
    ----------
    group : BandGroup
        Bands and slots.
    lamp_modifiers : tuple of str
        Lamps with separate results, in the order of the results.
    octree : str
        File name in the scene folder.
    images, glow : str or None
        Octrees in which panes of glass reflect the lamps: as images, and spread over all directions
        (`scene.pane_text`); the octree itself if None.
    relays : int
        Reflections of lamps' light from pane to pane that are followed (-dr).
    bounces : int
        Largest number of diffuse reflections, 1 or more.
    lamp_count : int
        Lamps in the whole scene.
    bins : int
        Parts by which light of each modifier is binned; 0 where it is not.
    bins_file : str
        Function file with `BIN`, the number of a ray's part.
    """

    group: BandGroup
    lamp_modifiers: tuple[str, ...]
    octree: str
    bounces: int
    lamp_count: int
    images: str | None = None
    glow: str | None = None
    bins: int = 0
    bins_file: str = ""
    relays: int = RELAYS

    def octree_of(self, glass: Glass) -> str:
        """The octree in which panes of glass are so."""
        named = {"plain": None, "images": self.images, "glow": self.glow}[glass]
        return self.octree if named is None else named

    def direct_arguments(self, repeats: int) -> tuple[str, ...]:
        """Arguments for D: sensors in, each given `repeats` times in a row and averaged (`-c`)."""
        options = ("-I+", "-ab", "0", "-dj", "1", "-ds", f"{lamp_part(self.lamp_count):g}", "-dv+")
        return (*self._common(repeats), *options, *self._ending("images"))

    def survey_arguments(self) -> tuple[str, ...]:
        """Arguments for a rough D: sensors in, one shadow ray per lamp part, lamps subdivided only if close."""
        options = ("-I+", "-ab", "0", "-dj", "1", "-ds", f"{REFLECTED_LAMP_PART:g}", "-dv+")
        return (*self._common(1), *options, *self._ending("images"))

    def gather_arguments(
        self,
        paths: int,
        *,
        bounces: int,
        lamps_visible: bool,
        path_weight: float = PATH_WEIGHT,
        glass: Glass = "plain",
    ) -> tuple[str, ...]:
        """Arguments for S and M: directions in, each set of `paths` averaged, reflected up to `bounces` times.

        A narrow receptor takes all its light this way, with lamps in view.
        """
        options = (
            *("-I-", "-dv+" if lamps_visible else "-dv-", "-dj", "1", "-ds", f"{REFLECTED_LAMP_PART:g}"),
            *("-ab", str(bounces - 1), "-ad", "1", "-lw", f"{path_weight:g}"),
            *("-lr", str(-(bounces + SPECULAR_REFLECTIONS))),
        )
        return (*self._common(paths), *options, *self._ending(glass))

    def tree_arguments(self, fields: str, *, lamps_visible: bool) -> tuple[str, ...]:
        """Arguments for rtrace: directions in, all rays of their paths out, each vertex with one look at each lamp."""
        return self._path_arguments(self.bounces, lamps_visible=lamps_visible, lamp_part=0.0, output=f"T{fields}")

    def direct_tree_arguments(self, fields: str) -> tuple[str, ...]:
        """Arguments for rtrace: sensors in, all their shadow rays out, each sensor's own record closing its list."""
        options = ("-I+", "-ab", "0", "-dj", "1", "-ds", f"{lamp_part(self.lamp_count):g}", "-dv+")
        return (*self._rtrace(f"{fields}T{fields}"), *options, self.octree)

    def radiance_arguments(self, octree: str, *, bounces: int) -> tuple[str, ...]:
        """Arguments for rtrace: radiance along rays that end on a surface, reflected up to `bounces` times."""
        return self._path_arguments(
            bounces, lamps_visible=False, lamp_part=REFLECTED_LAMP_PART, output="v", octree=octree
        )

    def _path_arguments(
        self, bounces: int, *, lamps_visible: bool, lamp_part: float, output: str, octree: str | None = None
    ) -> tuple[str, ...]:
        return (
            *self._rtrace(output),
            *("-I-", "-dv+" if lamps_visible else "-dv-", "-dj", "1", "-ds", f"{lamp_part:g}"),
            *("-ab", str(bounces - 1), "-ad", "1", "-lw", f"{PATH_WEIGHT:g}"),
            *("-lr", str(-(bounces + SPECULAR_REFLECTIONS)), octree or self.octree),
        )

    def _rtrace(self, output: str) -> tuple[str, ...]:
        spectral = () if self.group.mode == "rgb" else ("-co+",)
        return ("-h-", "-fdf", f"-o{output}", *SHARED_OPTIONS, *relayed(self.relays), *self.group.options, *spectral)

    def _common(self, averaged: int) -> tuple[str, ...]:
        return ("-h-", "-fdf", "-V+", "-c", str(averaged), *SHARED_OPTIONS, *relayed(self.relays))

    def _ending(self, glass: Glass) -> tuple[str, ...]:
        parts = ("-f", self.bins_file, "-bn", str(self.bins), "-b", BIN) if self.bins else ()
        modifiers = [word for name in self.lamp_modifiers for word in ("-m", name)]
        return (*self.group.options, *parts, *modifiers, self.octree_of(glass))


SHARED_OPTIONS: tuple[str, ...] = (
    *(
        "-u+",
        "-bv+",
        "-dt",
        "0",
        "-dc",
        "1",
        "-dr",
        f"{RELAYS}",
        "-dp",
        "0",
        "-ss",
        "1",
        "-st",
        f"{SPECULAR_THRESHOLD:g}",
    ),
    *("-aa", "0", "-as", "0", "-av", "0", "0", "0"),
)
"""Options of every run; written out, since the programs' defaults differ."""


def relayed(relays: int) -> tuple[str, ...]:
    """Options that follow so many reflections of lamps' light from pane to pane, after the shared ones."""
    return () if relays == RELAYS else ("-dr", str(relays))


def lamp_part(lamp_count: int) -> float:
    """`-ds` for D: largest ratio of a lamp's part to its distance.

    Parameters
    ----------
    lamp_count : int

    Returns
    -------
    ratio : float
        0.05 cuts a 0.6 m panel at 2.3 m into 64 parts; coarser with more lamps, which bounds the cost. [1]
    """
    return next((ratio for most, ratio in LAMP_PARTS if lamp_count <= most), COARSEST_LAMP_PART)


def plain_arguments(
    accuracy: Accuracy,
    noise: Noise,
    *,
    lamp_count: int,
    lamp_modifiers: Sequence[str] = (),
    relays: int = RELAYS,
    bounces: int | None = None,
) -> list[str]:
    """Options of one plain run of rtrace (or of rcontrib, with modifiers) that gives D + S + M in a single pass.

    For the models that are handed to stock Radiance: the same answer as the split, within noise, from sensors given
    once. It takes about twice as long for the same noise, and knows no standard error.

    Parameters
    ----------
    accuracy, noise : str
        As in the run file.
    lamp_count : int
        Lamps in the pass.
    lamp_modifiers : sequence of str
        For rcontrib.
    relays : int
        As of the scene.
    bounces : int, optional
        Diffuse reflections; by default those of the accuracy.

    Returns
    -------
    arguments : list of str
        Without files, formats and slots.
    """
    divisions = NOISE_LEVELS[noise].plain_divisions
    modifiers = [word for name in lamp_modifiers for word in ("-m", name)]
    bounces = bounces_of(accuracy) if bounces is None else bounces
    return [
        *("-I+", *SHARED_OPTIONS, *relayed(relays), "-dj", "1", "-ds", f"{lamp_part(lamp_count):g}"),
        *("-ab", str(bounces), "-ad", str(divisions), "-lw", f"{PATH_WEIGHT / divisions:g}"),
        *("-lr", str(-(bounces + SPECULAR_REFLECTIONS)), *modifiers),
    ]
