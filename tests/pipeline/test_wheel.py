"""The built wheel holds all that the program needs: databases, scenes, the report's page parts."""

import re
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest


def output_of(*argv: str, folder: Path) -> str:
    """What a program prints; fails with its complaint if it ends with another status than 0."""
    run = subprocess.run(argv, cwd=folder, capture_output=True, text=True, encoding="utf-8", check=False)
    assert run.returncode == 0, run.stderr[-2000:]
    return run.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory, project: Path) -> Path:
    """The wheel of this checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    output_of(
        sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(project), folder=folder
    )
    (built,) = folder.glob("lidarspectra-*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel: Path) -> Path:
    """The Python of an empty environment with our wheel in it, which takes its libraries from this one."""
    folder = wheel.parent
    venv.create(folder / "empty", with_pip=False)
    binaries = folder / "empty" / ("Scripts" if sys.platform == "win32" else "bin")
    python = binaries / ("python.exe" if sys.platform == "win32" else "python")
    site = output_of(str(python), "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", folder=folder).strip()
    output_of(
        sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", site, str(wheel), folder=folder
    )
    # Libraries only: a .pth named in a .pth is not followed, so this checkout's own install stays out of sight.
    (Path(site) / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return python


@pytest.mark.slow
def test_the_wheel_holds_the_package_its_databases_and_the_office_and_nothing_else(wheel: Path, project: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    scenes = {name for name in names if name.startswith("lidarspectra/_data/scenes/")}
    assert scenes == {f"lidarspectra/_data/scenes/office/{name}" for name in ("room.toml", "scan.glb")}
    ours = [path for folder in ("lidarspectra", "databases") for path in (project / folder).rglob("*")]
    kept = [path.relative_to(project).as_posix() for path in ours if path.is_file() and path.suffix != ".pyc"]
    expected = {re.sub("^databases/", "lidarspectra/_data/databases/", name) for name in kept}
    assert names - scenes == expected  # no research, no test, no script; and none of ours is left out


@pytest.mark.slow
def test_a_room_that_the_wheel_does_not_hold_is_refused_and_the_checkout_named(installed: Path, tmp_path: Path) -> None:
    code = (
        "from pathlib import Path; from lidarspectra.errors import WorkspaceError;"
        "from lidarspectra.workflow.run_folder.inputs import copy_scene\n"
        "try: copy_scene('box', Path('here'))\n"
        "except WorkspaceError as error: print(error)"
    )
    said = output_of(str(installed), "-c", code, folder=tmp_path)
    assert "a room that comes with the package (office), found 'box'" in said
    assert "checkout" in said


@pytest.mark.slow
def test_an_installed_wheel_finds_its_databases_and_scenes(installed: Path, tmp_path: Path) -> None:
    code = (
        "import lidarspectra; from lidarspectra.spectra.databases import data_folder, scenes_folder, load_reflectances;"
        "print(lidarspectra.__file__, data_folder(), scenes_folder() / 'office' / 'scan.glb', sep='\\n');"
        "print((scenes_folder() / 'office' / 'scan.glb').is_file(), len(load_reflectances()) > 100)"
    )
    lines = output_of(str(installed), "-c", code, folder=tmp_path).splitlines()
    home = str(installed.parent.parent)
    assert all(line.startswith(home) for line in lines[:3]), lines
    assert lines[3] == "True True"


@pytest.mark.slow
def test_an_installed_wheel_runs(installed: Path, tmp_path: Path) -> None:
    run = "from lidarspectra.cli.app import main; main()"
    assert "LED-B3" in output_of(str(installed), "-c", run, "databases", "show", "LED-B3", folder=tmp_path)
    assert "24 a pass" in output_of(str(installed), "-c", run, "doctor", folder=tmp_path)
