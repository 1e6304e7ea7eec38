"""Which material a picture shows, place by place: a classifier slid over it, and a CRF that follows its edges (MS).

The classifier is any fully convolutional ONNX model with a card (`model_card`). A prediction every 16 pixels is enough:
a model of coarser stride is run on copies of the picture shifted by parts of its stride, across and down, and the
answers interleave (four of them at a stride of 32). The picture is seen at the scales that the card names, three if it
names none, and the probabilities are averaged. `crf` then refines them.

References
----------
Bell, Upchurch, Snavely, Bala (2015) Material recognition in the wild with the Materials in Context Database, CVPR,
Section 5 (sliding CNN, three scales, dense CRF). Sermanet et al. (2014) OverFeat, ICLR (shifted pooling).
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.special import softmax

from lidarspectra.arrays import ByteArray, FloatArray
from lidarspectra.errors import MaterialError
from lidarspectra.io.onnx_errors import onnx_errors
from lidarspectra.material.segmentation.crf import CrfSettings, refine
from lidarspectra.material.segmentation.model_card import ModelCard, read_card

SHIPPED_MODEL = Path(__file__).parent / "models" / "materials.onnx"
MODEL_LIMIT_BYTES = 500_000_000  # far above any classifier of this use; a larger file is a mistake
FINEST_SPACING_PX = 16  # [px] of predictions; models of coarser stride are shifted by parts of it
CELL_PX = 4  # [px] of the view, to a pixel of the picture that the CRF works on
RANGE_TOLERANCE = 1e-3  # [1] by which probabilities may miss 0, 1 and their sum


@dataclass(frozen=True, kw_only=True, eq=False)
class CellGrid:
    """Predictions on a regular grid of a picture.

    Parameters
    ----------
    probabilities : (row, column, class) float
    first_px : (2,) float
        Row and column of the first prediction's middle, pixel edges counted from 0. [px]
    spacing_px : float
        [px]
    """

    probabilities: FloatArray
    first_px: tuple[float, float]
    spacing_px: float


class Classifier:
    """An ONNX model with its card, loaded.

    Parameters
    ----------
    model : Path
        ONNX file; its card lies beside it.
    threads : int, optional
        Of the processor; all if left out.

    Raises
    ------
    MaterialError
        If the file is no model, or the model is none of that card; both are tried before anything is asked of them.
    """

    def __init__(self, model: Path = SHIPPED_MODEL, *, threads: int | None = None) -> None:
        self.path = model
        self.card: ModelCard = read_card(model)
        self._session = load_model(model, threads)
        self._input = _input_name(self._session, model)
        self._try()

    @cached_property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes, in the order of the probabilities."""
        return self.card.kept

    @cached_property
    def _kept(self) -> list[int]:
        return [self.card.classes.index(name) for name in self.card.kept]

    def cells(self, image: ByteArray) -> CellGrid:
        """Probabilities on a grid over a picture, every `FINEST_SPACING_PX` pixels or closer.

        Parameters
        ----------
        image : (height, width, 3) uint8
            sRGB encoded.

        Returns
        -------
        grid : CellGrid
            Of what the model sees whole, up to half its input from the edges; what is smaller is mirrored beyond them.
        """
        stride, own = self.card.stride_px, self.card.input_px
        parts = -(-stride // FINEST_SPACING_PX)
        shift = stride / parts
        reach = int((parts - 1) * shift)  # of the copies that are shifted by parts of the stride
        missing = [max(own + reach - length, 0) for length in image.shape[:2]]
        rest = [(own + reach - length - more) % stride for length, more in zip(image.shape[:2], missing, strict=True)]
        before = [more // 2 for more in missing]
        after = [more - first + last for more, first, last in zip(missing, before, rest, strict=True)]
        sides = (before[0], after[0], before[1], after[1])
        padded = np.asarray(cv2.copyMakeBorder(image, *sides, cv2.BORDER_REFLECT_101), dtype=np.uint8)
        height, width = padded.shape[0] - reach, padded.shape[1] - reach
        answers = [
            [self._run(padded[_at(i * shift, height), _at(j * shift, width)]) for j in range(parts)]
            for i in range(parts)
        ]
        rows, columns, count = answers[0][0].shape
        merged = np.empty((parts * rows, parts * columns, count))
        for i in range(parts):
            for j in range(parts):
                merged[i::parts, j::parts] = answers[i][j]
        # Predictions stand symmetrically on what the model was given.
        sizes = ((height, rows, before[0]), (width, columns, before[1]))
        first = [0.5 * (length - (n - 1) * stride) - more for length, n, more in sizes]
        return CellGrid(probabilities=merged, first_px=(first[0], first[1]), spacing_px=shift)

    def _run(self, image: ByteArray) -> FloatArray:
        """(row, column, class) probabilities of one pass."""
        values = np.asarray(image[:, :, ::-1] if self.card.channels == "BGR" else image, dtype=np.float32)
        values = (values - np.array(self.card.mean, np.float32)) * np.array(self.card.scale, np.float32)
        try:
            outputs = self._session.run(None, {self._input: np.ascontiguousarray(values.transpose(2, 0, 1)[None])})
            answer = np.asarray(outputs[0])
        except onnx_errors() as cause:
            raise _unfit(
                self.path, f"it fails on a picture of {image.shape[1]} x {image.shape[0]} pixels: {cause}"
            ) from cause
        if answer.ndim != 4 or answer.shape[:2] != (1, len(self.card.classes)) or not answer.size:
            raise _unfit(self.path, f"an output of shape {answer.shape} for {len(self.card.classes)} classes")
        if answer.dtype.kind != "f":
            raise _unfit(self.path, f"an output of {answer.dtype}")
        numbers = answer[0].transpose(1, 2, 0).astype(np.float64)
        if not np.isfinite(numbers).all():
            raise _unfit(self.path, "an output that is not finite")
        if self.card.output == "logits":
            numbers = softmax(numbers, axis=2)
        elif numbers.min() < -RANGE_TOLERANCE or np.abs(numbers.sum(axis=2) - 1.0).max() > RANGE_TOLERANCE:
            raise _unfit(self.path, "probabilities that do not sum to 1; are they logits?")
        kept = np.clip(numbers[:, :, self._kept], 1e-9, None)
        return np.asarray(kept / kept.sum(axis=2, keepdims=True), dtype=np.float64)

    def _try(self) -> None:
        """Hold the model to its card: one stride more of picture gives one prediction more."""
        size, stride = self.card.input_px, self.card.stride_px
        grey = np.full((size + stride, size, 3), 128, np.uint8)
        small, large = self._run(grey[:size]), self._run(grey)
        if large.shape[0] - small.shape[0] != 1:
            raise _unfit(
                self.path,
                f"{small.shape[0]} rows of predictions for {size} pixels and {large.shape[0]} for {size + stride}, "
                f"which is no stride of {stride}",
            )


def segment(
    classifier: Classifier, image: ByteArray, *, crf: CrfSettings | None = None, cell_px: int = CELL_PX
) -> FloatArray:
    """Class probabilities over a picture: scales averaged, edges followed.

    Parameters
    ----------
    classifier : Classifier
    image : (height, width, 3) uint8
        sRGB encoded.
    crf : CrfSettings, optional
    cell_px : int
        Edge of the squares of pixels that share their probabilities. [px]

    Returns
    -------
    probabilities : (ceil(height / cell_px), ceil(width / cell_px), class) float
        Summing to 1.
    """
    height, width = image.shape[:2]
    rows, columns = -(-height // cell_px), -(-width // cell_px)
    own = np.zeros((rows, columns, len(classifier.classes)))
    scales = classifier.card.scales
    for scale in scales:
        size = (max(1, round(width * scale)), max(1, round(height * scale)))
        method = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        grid = classifier.cells(np.asarray(cv2.resize(image, size, interpolation=method), dtype=np.uint8))
        down = _interpolation(
            rows, cell_px * size[1] / height, grid.first_px[0], grid.spacing_px, grid.probabilities.shape[0]
        )
        across = _interpolation(
            columns, cell_px * size[0] / width, grid.first_px[1], grid.spacing_px, grid.probabilities.shape[1]
        )
        own += np.einsum("ir,rcl,jc->ijl", down, grid.probabilities, across, optimize=True) / len(scales)
    small = np.asarray(cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return refine(own, small, crf)


def _at(start: float, length: int) -> slice:
    return slice(int(start), int(start) + length)


def _interpolation(count: int, step_px: float, first_px: float, spacing_px: float, cells: int) -> FloatArray:
    """(count, cells) weights of linear interpolation from cells to places (n + 1/2) step; held beyond the ends."""
    place = np.clip(((np.arange(count) + 0.5) * step_px - first_px) / spacing_px, 0.0, cells - 1.0)
    low = np.minimum(place.astype(np.int64), max(0, cells - 2))
    weights = np.zeros((count, cells))
    weights[np.arange(count), low] = 1.0 - (place - low)
    if cells > 1:
        weights[np.arange(count), low + 1] = place - low
    return weights


def load_model(path: Path, threads: int | None = None) -> Any:
    """Load an ONNX model from its bytes, so that it can name no other file.

    Parameters
    ----------
    path : Path
    threads : int, optional
        Of the processor; all if left out.

    Returns
    -------
    session : onnxruntime.InferenceSession

    Raises
    ------
    MaterialError
        If there is no such file, or it is no model.
    """
    import onnxruntime  # heavy: only who segments pays for it

    try:
        if path.stat().st_size > MODEL_LIMIT_BYTES:
            raise _unfit(path, f"a file of {path.stat().st_size} bytes")
        content = path.read_bytes()
    except OSError as cause:
        raise MaterialError(
            expected="a segmentation model (ONNX)",
            found=str(cause),
            where=str(path),
            todo="Mend the key 'model' of [materials].",
        ) from cause
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4  # what it says is in the error
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")  # threads that wait take no processor time
    if threads is not None:
        options.intra_op_num_threads = threads
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except onnx_errors() as cause:
        raise _unfit(path, f"a file that cannot be loaded: {cause}") from cause


def _input_name(session: Any, path: Path) -> str:
    try:
        inputs = [(str(each.name), str(each.type), list(each.shape)) for each in session.get_inputs()]
    except UnicodeDecodeError as cause:  # onnxruntime takes any bytes for a name, and decodes it when asked
        raise _unfit(path, f"an input with a name that is no text: {cause}") from cause
    name, kind, shape = inputs[0] if len(inputs) == 1 else ("", "", [])
    if kind != "tensor(float)" or len(shape) != 4:
        found = ", ".join(f"'{name}' {kind} {shape}" for name, kind, shape in inputs) or "none"
        raise _unfit(path, f"inputs {found}")
    if any(isinstance(length, int) for length in shape[2:]):
        raise MaterialError(
            expected="a fully convolutional model: height and width of its input free",
            found=f"an input of shape {shape}",
            where=str(path),
            todo="docs/segmentation.md says how fully connected layers are made convolutions.",
        )
    return name


def _unfit(path: Path, found: str) -> MaterialError:
    return MaterialError(
        expected="an ONNX model that takes one float picture (1, 3, height, width) and gives (1, class, rows, columns)",
        found=found,
        where=str(path),
        todo="docs/segmentation.md says what a model and its card must be.",
    )
