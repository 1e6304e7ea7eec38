"""The tables of the air's scattering are kept when they are whole, and only then."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import pytest

from lidarspectra.errors import EngineError
from lidarspectra.radiance.engine.engine import Engine, EngineRun, find_engine
from lidarspectra.radiance.scene.sky import TABLES_FOLDER, Daylight, compute_sky

NOON = Daylight(latitude_deg=48.0, longitude_deg=11.0, time=datetime(2024, 6, 21, 11, tzinfo=UTC))


class Genssky:
    """Stands in for genssky: writes half a table and is cut, or the other half and gives no sky."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.cut = True
        self.seen: list[str] = []
        monkeypatch.setattr(Engine, "run", self.run)

    def run(self, program: str, arguments: Sequence[str], *, folder: Path, **_: object) -> EngineRun:
        tables = Path(arguments[arguments.index("-p") + 1]) / TABLES_FOLDER
        self.seen = sorted(path.name for path in tables.iterdir())
        table = tables / ("half.dat" if self.cut else "whole.dat")
        table.write_text(table.stem, encoding="utf-8")
        if self.cut:
            raise KeyboardInterrupt
        return EngineRun(argv=(program, *arguments), status=0, stderr="", seconds=0.0)


def names(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def test_a_table_that_was_cut_is_not_kept_and_a_whole_one_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    genssky, engine, atmosphere = Genssky(monkeypatch), find_engine(), tmp_path / "air"
    with pytest.raises(KeyboardInterrupt):
        compute_sky(NOON, tmp_path / "sky", engine, atmosphere=atmosphere)
    assert [path.name for path in atmosphere.iterdir()] == [TABLES_FOLDER]
    assert names(atmosphere) == []
    genssky.cut = False
    for seen in ([], ["whole.dat"]):  # the second time it finds what the first one made
        with pytest.raises(EngineError, match="a sky from genssky"):
            compute_sky(NOON, tmp_path / "sky", engine, atmosphere=atmosphere)
        assert genssky.seen == seen
        assert names(atmosphere) == [f"{TABLES_FOLDER}/whole.dat"]


def test_a_sky_is_asked_for_where_no_table_can_be_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    genssky = Genssky(monkeypatch)
    genssky.cut = False
    (tmp_path / "home").write_text("a file, where no folder can be made", encoding="utf-8")
    for _ in range(2):
        with pytest.raises(EngineError, match="a sky from genssky"):  # which was asked, and is the stand-in's fault
            compute_sky(NOON, tmp_path / "sky", find_engine(), atmosphere=tmp_path / "home" / "air")
        assert genssky.seen == []
