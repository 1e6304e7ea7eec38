"""A changed run file says what was changed, and nothing else."""

from pathlib import Path

import pytest

from lidarspectra.config import read_run_file
from lidarspectra.errors import RunFileError
from research.experiments.variants import changed, fixed_points, with_flux, with_lamps, write_run_file


@pytest.mark.parametrize("scene", ["office", "apartment", "box", "large-office"])
def test_a_run_file_comes_back_as_it_was_written(project: Path, tmp_path: Path, scene: str) -> None:
    run_file = read_run_file(project / "scenes" / scene / "room.toml")
    again = read_run_file(write_run_file(run_file, tmp_path / "room.toml"))
    assert again.model_dump() == run_file.model_dump()  # text and place differ


def test_changes_change_their_key_alone(project: Path, tmp_path: Path) -> None:
    run_file = read_run_file(project / "scenes" / "office" / "room.toml")
    other = changed(with_flux(with_lamps(run_file, spectrum="LED-B1"), 0.5), "trace", accuracy="low")
    assert [lamp.spectrum for lamp in other.lamps] == ["LED-B1", "LED-B1"]
    assert [lamp.luminous_flux_lm for lamp in other.lamps] == [1700.0, 1700.0]
    assert (other.trace.accuracy, other.trace.noise) == ("low", run_file.trace.noise)
    assert other.scan == run_file.scan
    assert fixed_points(run_file, tmp_path / "p.csv").sensors.points == str((tmp_path / "p.csv").resolve())


def test_words_with_quotes_survive_and_a_contradiction_is_refused(project: Path, tmp_path: Path) -> None:
    run_file = read_run_file(project / "scenes" / "office" / "room.toml")
    quoted = changed(run_file, "scan", file='a "b" \\ c.glb')
    assert read_run_file(write_run_file(quoted, tmp_path / "room.toml")).scan.file == 'a "b" \\ c.glb'
    with pytest.raises(RunFileError):
        write_run_file(run_file.model_copy(update={"lamps": ()}), tmp_path / "dark.toml")
