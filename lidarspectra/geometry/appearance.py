"""What a scan's file says of every face: its colour, where that is from, and what the face is part of."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, float_array, int_array
from lidarspectra.errors import ArrayError
from lidarspectra.geometry.textures import SAMPLES_AT_ONCE, TextureArray, mean_texture_colors, sample_image
from lidarspectra.spectra.colorimetry import decode_srgb, encode_srgb

NEUTRAL_COLOR = 0.735  # sRGB-encoded; linear 0.5, of faces without colour
PHOTOGRAPHED, DRAWN, NO_COLOR = 0, 1, 2  # where a face's colour is from: see `Appearance.color_source`
MAX_PHOTOGRAPHED = 0.2  # share of the faces of a model of a room whose colour is a photograph's
CLOSED_KINDS = ("closed ceiling", "closed floor", "closed side")  # kinds of parts that close a room; no file has them
CLOSED_CEILING_SHARE = 0.8  # [1] of the plan: what is open of a ceiling of which less was scanned is closed


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearLight:
    """How well colours are known that were put together from frames: radiance over one white, no picture of it.

    Parameters
    ----------
    power_deviation, shoulder_deviation : float
        Standard deviations of the logs of the tone curve that was taken out, log g and log(1 + s). [1]
    face_deviation : (face,) float
        Relative standard deviation of each face's colour, from the spread between views. [1]
    face_cut : (face,) float
        Share of each face that every frame shows cut at white: its radiance is a lower bound. [0-1]
    """

    power_deviation: float
    shoulder_deviation: float
    face_deviation: FloatArray
    face_cut: FloatArray

    def select(self, faces: IntArray) -> "LinearLight":
        """Of some faces, (n,) int."""
        return replace(self, face_deviation=self.face_deviation[faces], face_cut=self.face_cut[faces])

    def with_more(self, count: int) -> "LinearLight":
        """The same followed by faces that no frame saw."""
        more = np.zeros(count)
        return replace(
            self,
            face_deviation=np.concatenate([self.face_deviation, more]),
            face_cut=np.concatenate([self.face_cut, more]),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Appearance:
    """The colour of every face: a texture image with coordinates, or colours at its corners.

    Parameters
    ----------
    images : tuple of (height, width, 3) uint8 or float32
        Texture images, first row at the top: bytes are sRGB encoded, floats linear and not cut at 1.
    face_image : (face,) int
        Which image a face takes its colour from; -1 where it has corner colours instead.
    corner_uv : (face, 3, 2) float
        Texture coordinates of each corner, v up (0, 0 is the lower left). [1]
    corner_color : (face, 3, 3) float
        sRGB-encoded colour of each corner, used where `face_image` is -1. [0-1]
    known : bool
        False where the file held no colour at all (an STL); the corner colours are then a neutral gray.
    color_source : (face,) int, optional
        PHOTOGRAPHED, DRAWN (the one flat colour or the repeated pattern that a program gave a named part, as room
        models have them) or NO_COLOR (the corner colours are then a neutral gray). By default all are photographed, or
        none has colour.
    kinds : tuple of str
        Kinds of parts that the file names ('wall', 'door', ...), and that `face_kind` counts.
    face_kind : (face,) int, optional
        What each face is part of; -1, the default, where the file does not say.
    linear : LinearLight, optional
        Where the colours are the frames' radiance.
    """

    images: tuple[TextureArray, ...]
    face_image: IntArray
    corner_uv: FloatArray
    corner_color: FloatArray
    known: bool = True
    color_source: IntArray | None = None
    kinds: tuple[str, ...] = ()
    face_kind: IntArray | None = None
    linear: LinearLight | None = None

    def __post_init__(self) -> None:
        face_image = int_array(self.face_image, name="Appearance.face_image", shape=(None,))
        count = face_image.size
        uv = float_array(self.corner_uv, name="Appearance.corner_uv", shape=(count, 3, 2))
        color = float_array(self.corner_color, name="Appearance.corner_color", shape=(count, 3, 3))
        if count and (face_image.min() < -1 or face_image.max() >= len(self.images)):
            raise ArrayError(
                expected=f"image numbers from -1 to {len(self.images) - 1}",
                found=f"{face_image.min()} to {face_image.max()}",
                where="Appearance.face_image",
            )
        for image in self.images:
            if image.ndim != 3 or image.shape[2] != 3 or image.dtype not in (np.uint8, np.float32):
                raise ArrayError(
                    expected="(height, width, 3) images of uint8 or float32",
                    found=f"{image.shape} {image.dtype}",
                    where="Appearance.images",
                )
        if self.color_source is None:
            source = np.full(count, PHOTOGRAPHED if self.known else NO_COLOR)
        else:
            source = int_array(self.color_source, name="Appearance.color_source", shape=(count,))
        given = np.full(count, -1) if self.face_kind is None else self.face_kind
        kind = int_array(given, name="Appearance.face_kind", shape=(count,))
        if count and (kind.min() < -1 or kind.max() >= len(self.kinds)):
            raise ArrayError(
                expected=f"kinds of parts from -1 to {len(self.kinds) - 1}",
                found=f"{kind.min()} to {kind.max()}",
                where="Appearance.face_kind",
            )
        if self.linear is not None:
            float_array(self.linear.face_deviation, name="LinearLight.face_deviation", shape=(count,))
            float_array(self.linear.face_cut, name="LinearLight.face_cut", shape=(count,))
        object.__setattr__(self, "color_source", source)
        object.__setattr__(self, "face_kind", kind)
        object.__setattr__(self, "images", tuple(_read_only(image) for image in self.images))
        object.__setattr__(self, "face_image", face_image)
        object.__setattr__(self, "corner_uv", uv)
        object.__setattr__(self, "corner_color", color)

    @property
    def pixels(self) -> int:
        """Number of pixels of all images together."""
        return sum(image.shape[0] * image.shape[1] for image in self.images)

    def sample(self, faces: IntArray, barycentric: FloatArray) -> FloatArray:
        """Colour at points on faces: bilinear in the texture, linear between corner colours, both in linear light.

        Parameters
        ----------
        faces : (n,) int
            On which face each point lies.
        barycentric : (n, 3) float
            Weights of the face's corners. [1]

        Returns
        -------
        color : (n, 3) float
            Linear sRGB. [0-1]
        """
        color = np.empty((faces.size, 3))
        for first in range(0, faces.size, SAMPLES_AT_ONCE):
            some = slice(first, first + SAMPLES_AT_ONCE)
            color[some] = self._of_some(faces[some], barycentric[some])
        return color

    def _of_some(self, faces: IntArray, barycentric: FloatArray) -> FloatArray:
        """(n, 3) colour at few points on faces [0-1]."""
        image_numbers = self.face_image[faces]
        if image_numbers.size and (image_numbers == image_numbers[0]).all():  # mostly there is one image
            return self._sampled(int(image_numbers[0]), faces, barycentric)
        color = np.empty((faces.size, 3))
        for number in range(-1, len(self.images)):
            chosen = np.flatnonzero(image_numbers == number)
            if chosen.size:
                color[chosen] = self._sampled(number, faces[chosen], barycentric[chosen])
        return color

    def _sampled(self, number: int, faces: IntArray, barycentric: FloatArray) -> FloatArray:
        """(n, 3) colour at points of faces that all have it from one image, or from their corners [0-1]."""
        if number >= 0:
            return sample_image(self.images[number], np.einsum("nk,nkc->nc", barycentric, self.corner_uv[faces]))
        return np.asarray(np.einsum("nk,nkc->nc", barycentric, decode_srgb(self.corner_color[faces])))

    def face_colors(self) -> FloatArray:
        """(face, 3) mean linear sRGB [0-1] of each face: the texture averaged over the face's area."""
        return self._face_colors

    @cached_property
    def _face_colors(self) -> FloatArray:
        colors = np.empty((self.face_image.size, 3))
        for number in np.unique(self.face_image):
            chosen = np.flatnonzero(self.face_image == number)
            if number >= 0:
                colors[chosen] = mean_texture_colors(self.images[number], self.corner_uv[chosen])
            else:
                colors[chosen] = decode_srgb(self.corner_color[chosen]).mean(axis=1)
        colors.flags.writeable = False
        return colors

    def colors_of(self, faces: IntArray) -> FloatArray:
        """(n, 3) mean linear sRGB [0-1] of some faces, (n,) int; the texture is read for no others."""
        if self._has_face_colors:
            return np.asarray(self._face_colors[faces], dtype=np.float64)
        distinct, number = np.unique(faces, return_inverse=True)
        return np.asarray(self.select(distinct).face_colors()[number], dtype=np.float64)

    @property
    def _has_face_colors(self) -> bool:
        return "_face_colors" in self.__dict__

    def _keep_face_colors(self, colors: FloatArray) -> None:
        """Take over the faces' mean colours, which need not be read from the texture again."""
        colors.flags.writeable = False
        self.__dict__["_face_colors"] = colors  # where `cached_property` keeps them

    def select(self, faces: IntArray) -> "Appearance":
        """The appearance of some faces, (n,) int, in that order; images are shared."""
        some = Appearance(
            images=self.images,
            face_image=self.face_image[faces],
            corner_uv=self.corner_uv[faces],
            corner_color=self.corner_color[faces],
            known=self.known,
            color_source=self.sources[faces],
            kinds=self.kinds,
            face_kind=self.face_kinds[faces],
            linear=None if self.linear is None else self.linear.select(faces),
        )
        if self._has_face_colors:
            some._keep_face_colors(self._face_colors[faces])
        return some

    def split(self, parent: IntArray, weights: FloatArray) -> "Appearance":
        """The appearance of faces that are parts of these; a face that stays whole keeps its mean colour, if known.

        Parameters
        ----------
        parent : (part,) int
            Of which face each is a part.
        weights : (part, 3, 3) float
            Barycentric weights of that face's corners that make up each corner of the part. [1]
        """
        of_parent = self.select(parent)
        parts = replace(
            of_parent,
            corner_uv=np.einsum("fkp,fpc->fkc", weights, of_parent.corner_uv),
            corner_color=encode_srgb(np.einsum("fkp,fpc->fkc", weights, decode_srgb(of_parent.corner_color))),
        )
        if self._has_face_colors:
            cut = np.flatnonzero(np.bincount(parent)[parent] > 1)
            colors = self._face_colors[parent]
            colors[cut] = parts.select(cut).face_colors()
            parts._keep_face_colors(colors)
        return parts

    @property
    def sources(self) -> IntArray:
        """(face,) where each face's colour is from: PHOTOGRAPHED, DRAWN or NO_COLOR."""
        assert self.color_source is not None  # set where it is made
        return self.color_source

    @property
    def face_kinds(self) -> IntArray:
        """(face,) what each face is part of, a place in `kinds`; -1 where the file does not say."""
        assert self.face_kind is not None  # set where it is made
        return self.face_kind

    @property
    def photographed(self) -> BoolArray:
        """(face,) whether a face's colour shows light on a real surface."""
        return np.asarray((self.sources == PHOTOGRAPHED) & ~self.unpictured, dtype=np.bool_)

    @property
    def unpictured(self) -> BoolArray:
        """(face,) which faces of a picture are black all over, to the last level of 8 bits.

        Apps fill so what no picture shows; black paint that is lit at all shows some levels, and noise.
        """
        pictured = self.sources == PHOTOGRAPHED
        if self.linear is not None or not pictured.any():
            return np.zeros(pictured.size, dtype=np.bool_)
        return np.asarray(pictured & (self.face_colors() == 0.0).all(axis=1), dtype=np.bool_)

    @property
    def is_drawn(self) -> bool:
        """Whether this is a model of a room, with named walls and hardly a photographed colour, rather than a mesh."""
        return "wall" in self.kinds and float(self.photographed.mean()) < MAX_PHOTOGRAPHED

    def of_kind(self, *kinds: str) -> BoolArray:
        """(face,) whether the file says that a face is part of one of these kinds of things."""
        wanted = [place for place, name in enumerate(self.kinds) if name in kinds]
        return np.isin(self.face_kinds, wanted)

    def without_names(self) -> "Appearance":
        """The same as if the file named no parts: drawn colours count as colours of surfaces."""
        return replace(
            self,
            color_source=np.where(self.sources == DRAWN, PHOTOGRAPHED, self.sources),
            face_kind=np.where(self.of_kind(*CLOSED_KINDS), self.face_kinds, -1),
        )

    def darkened(self, faces: BoolArray) -> "Appearance":
        """The same with (face,) faces black."""
        return replace(
            self,
            face_image=np.where(faces, -1, self.face_image),
            corner_color=np.where(faces[:, None, None], 0.0, self.corner_color),
        )

    def with_more(self, other: "Appearance") -> "Appearance":
        """The same followed by the faces of another that has no images of its own."""
        kinds = (*self.kinds, *(name for name in other.kinds if name not in self.kinds))
        place = np.array([kinds.index(name) for name in other.kinds] + [-1])  # the last is what -1 finds
        both = Appearance(
            images=self.images,
            face_image=np.concatenate([self.face_image, other.face_image]),
            corner_uv=np.concatenate([self.corner_uv, other.corner_uv]),
            corner_color=np.concatenate([self.corner_color, other.corner_color]),
            known=self.known,
            color_source=np.concatenate([self.sources, other.sources]),
            kinds=kinds,
            face_kind=np.concatenate([self.face_kinds, place[other.face_kinds]]),
            linear=None if self.linear is None else self.linear.with_more(other.face_image.size),
        )
        if self._has_face_colors:
            both._keep_face_colors(np.concatenate([self._face_colors, other.face_colors()]))
        return both


def _read_only(image: TextureArray) -> TextureArray:
    view = image.view()
    view.flags.writeable = False
    return view
