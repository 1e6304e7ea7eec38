"""Pictures are written as PNG in the colours they have."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lidarspectra.io.png_files import write_png


@pytest.mark.parametrize("shape", [(1, 1, 3), (37, 53, 3)])
def test_a_picture_comes_back_pixel_for_pixel(tmp_path: Path, shape: tuple[int, int, int]) -> None:
    image = np.random.default_rng(3).integers(0, 256, shape).astype(np.uint8)
    image.flags.writeable = False  # as textures are
    path = tmp_path / "picture.png"
    write_png(path, image)
    with Image.open(path) as picture:
        assert picture.mode == "RGB"
        assert np.array_equal(np.asarray(picture), image)


def test_a_part_of_a_picture_is_written_as_it_is_seen(tmp_path: Path) -> None:
    image = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)[::2, ::-1]
    path = tmp_path / "part.png"
    write_png(path, image)
    with Image.open(path) as picture:
        assert np.array_equal(np.asarray(picture), image)


def test_a_folder_that_is_not_there_is_an_error_of_the_system_with_its_name(tmp_path: Path) -> None:
    path = tmp_path / "none" / "picture.png"
    with pytest.raises(FileNotFoundError) as refused:
        write_png(path, np.zeros((2, 2, 3), np.uint8))
    assert refused.value.filename == str(path)


def test_a_picture_that_cannot_be_encoded_leaves_no_empty_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cv2.imencode", lambda *_: (False, np.empty(0, np.uint8)))
    path = tmp_path / "picture.png"
    with pytest.raises(OSError, match="cannot be encoded"):
        write_png(path, np.zeros((2, 2, 3), np.uint8))
    assert not path.exists()
