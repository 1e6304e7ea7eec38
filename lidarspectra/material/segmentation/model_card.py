"""The card beside a segmentation model: how it is fed and what its numbers mean (docs/segmentation.md)."""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from lidarspectra.errors import MaterialError
from lidarspectra.io.toml_sections import Section, parse_sections

CARD_SUFFIX = ".toml"
SCALES = (2**-0.5, 1.0, 2**0.5)  # [1] Bell et al. 2015, Section 5
CARD_LIMIT_BYTES = 1_000_000  # a longer card is none
ClassName = Annotated[str, Field(min_length=1, max_length=80, pattern=r"^[^\s,;\"]+$")]


class ModelCard(Section):
    """How a model is fed. `[about]` is for people: data, accuracy, what it cannot tell."""

    classes: Annotated[tuple[ClassName, ...], Field(min_length=2, max_length=1000)]
    """In the order of the model's output."""
    leave_out: tuple[str, ...] = ()
    """Classes that are dropped; the others share their probability."""
    input_px: Annotated[int, Field(ge=8, le=2048)]
    """Edge of the square that one prediction sees. [px]"""
    stride_px: Annotated[int, Field(ge=1, le=512)]
    """From one prediction to the next. [px]"""
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Subtracted from values of 0 to 255, in the order of `channels`."""
    scale: Annotated[float, Field(gt=0)] | tuple[float, float, float] = 1.0
    """Multiplied with what is left; one number, or one a channel."""
    channels: Literal["RGB", "BGR"] = "RGB"
    output: Literal["logits", "probabilities"] = "logits"
    scales: Annotated[tuple[Annotated[float, Field(ge=0.1, le=10.0)], ...], Field(min_length=1, max_length=10)] = SCALES
    """At which the picture is shown to the model; what it says is averaged. [1]"""
    about: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if len(set(self.classes)) < len(self.classes):
            raise ValueError("each class may be named once")
        unknown = sorted(set(self.leave_out) - set(self.classes))
        if unknown:
            raise ValueError(f"leave_out names {unknown[0]!r}, which is none of the classes")
        if len(self.kept) < 2:
            raise ValueError("two or more classes must be left")
        if self.stride_px > self.input_px:
            raise ValueError("stride_px is larger than input_px: parts of the picture would not be seen")
        return self

    @property
    def kept(self) -> tuple[str, ...]:
        """Classes that are not left out, in order."""
        return tuple(name for name in self.classes if name not in self.leave_out)


def read_card(model: Path) -> ModelCard:
    """Read the card that lies beside a model, under the model's name with the ending .toml.

    Raises
    ------
    MaterialError
        If it is missing, no TOML, or says what cannot be.
    """
    path = model.with_suffix(CARD_SUFFIX)
    try:
        if path.stat().st_size > CARD_LIMIT_BYTES:
            raise ValueError(f"{path.stat().st_size} bytes")
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as cause:
        raise MaterialError(
            expected="a model card, a TOML text beside the model",
            found=str(cause),
            where=str(path),
            todo="docs/segmentation.md shows one.",
        ) from cause
    return parse_sections(
        ModelCard, text, kind="model card", where=str(path), error=MaterialError, page="docs/segmentation.md"
    )
