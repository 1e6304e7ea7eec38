"""Evidence for the light in a picture: what points of the surfaces show, and what may light them."""

from dataclasses import dataclass

from scipy.sparse import csr_array

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.material.delighting.tone_curve import USUAL_TONE, ToneCurve, TonePrior


@dataclass(frozen=True, kw_only=True, eq=False)
class SourceSightings:
    """What frames show of unknown sources.

    Parameters
    ----------
    source : (sighting,) int
    lobes : (sighting, lobe) float
        Radiance of each lobe towards where it was seen, mean of the views, over that of its strength. [1]
    light : (sighting, 3) float
        Linear sRGB of what was seen. [1]
    log_deviation : (sighting,) float
        Standard deviation of the logarithm of the source's light about that. [1]
    """

    source: IntArray
    lobes: FloatArray
    light: FloatArray
    log_deviation: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class LightEvidence:
    """Data of the fit: the light at points of the surfaces.

    Parameters
    ----------
    shown : (sample, 3) float
        Linear sRGB that the picture shows there. [0-1]
    direct : (lamp, sample, 3) float
        Direct light, in cones, in any one unit.
    emission : (lamp, sample) float
        Cosine between a lamp's axis and the way to the sample; 1 for lamps whose beam is known. [0-1]
    exchange : (sample, face + 1) sparse float
        See `light_exchange.exchange_matrix`.
    face_shown : (face, 3) float
        Linear sRGB of the faces. [0-1]
    face_area : (face,) float
        [m²]
    face_lamp : (face,) bool
        Faces that show a known lamp: their light is in `direct`.
    group : (sample,) int
        Points of one surface; -1 for those that are not used.
    cell : (sample,) int
        Cluster of neighbouring points, whose errors are correlated.
    ceiling : (sample,) bool
        Points of a ceiling that may be taken for white.
    ceiling_weight : float, optional
        How far it may: 1 for a neutral one. [0-1]
    white : (sample,) bool
        Points so light that their surface is most likely a white one.
    unsure : (sample, 3) float
        Relative standard deviation of the light there in each cone, by shadows' edges of uncertain place, and by stray
        light in the picture of a dark place. [1]
    tint : (sample, 3) float, optional
        Ratio of apparent reflectance to that in daylight (see `colored_light`); 1 if left out. [1]
    face_excess : (face, 3) float, optional
        Light that a face sends in each channel of linear sRGB over what the picture shows, which is cut at white; 1 if
        left out. [1]
    other : (source, lobe, sample) float, optional
        Patterns of the light of unknown sources (see `unknown_light`). [any one unit]
    other_upright : (source,) bool, optional
        Which of them may be windows.
    other_window : (source,) bool, optional
        Which of them surely have a window's pattern; none if left out.
    card : (sample,) int, optional
        Which card of known reflectance each is a point of; -1 for none.
    card_log : (card, 3) float, optional
        Log reflectance of these cards, in cones.
    card_beside : (card, sample) sparse bool, optional
        Points beside each card, of the plane that it lies in.
    other_seen : SourceSightings, optional
        What frames show of them.
    lamp_shown : (lamp, 3) float, optional
        Linear sRGB that frames tell of the lamps' own surfaces; NaN where they are cut at white in all. [1]
    lamp_sent : (lamp, 3) float, optional
        Radiosity of these surfaces in cones, in the unit of `direct`.
    tone_prior : TonePrior, optional
        What is known of the camera's curve; a usual phone's if left out.
    """

    shown: FloatArray
    direct: FloatArray
    emission: FloatArray
    exchange: csr_array
    face_shown: FloatArray
    face_area: FloatArray
    face_lamp: BoolArray
    group: IntArray
    cell: IntArray
    ceiling: BoolArray
    white: BoolArray
    unsure: FloatArray
    ceiling_weight: float = 1.0
    tint: FloatArray | None = None
    face_excess: FloatArray | None = None
    other: FloatArray | None = None
    other_upright: BoolArray | None = None
    other_window: BoolArray | None = None
    card: IntArray | None = None
    card_log: FloatArray | None = None
    card_beside: csr_array | None = None
    other_seen: SourceSightings | None = None
    lamp_shown: FloatArray | None = None
    lamp_sent: FloatArray | None = None
    tone_prior: TonePrior = USUAL_TONE

    @property
    def sources(self) -> int:
        """Number of unknown sources."""
        return 0 if self.other is None else len(self.other)

    def face_light(self, tone: ToneCurve, faces: IntArray | slice = slice(None)) -> FloatArray:
        """(face, 3) linear sRGB that all or some faces send through a tone curve."""
        light = tone.light(self.face_shown[faces])
        return light if self.face_excess is None else light * self.face_excess[faces]
