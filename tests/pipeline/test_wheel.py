"""The built wheel holds all that the program needs: databases, scenes, the report's page parts."""

import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest


def output_of(*argv: str, folder: Path) -> str:
    """What a program prints; fails with its complaint if it ends with another status than 0."""
    run = subprocess.run(argv, cwd=folder, capture_output=True, text=True, encoding="utf-8", check=False)
    assert run.returncode == 0, run.stderr[-2000:]
    return run.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory, project: Path) -> Path:
    """The Python of an empty environment with our wheel in it, which takes its libraries from this one."""
    folder = tmp_path_factory.mktemp("wheel")
    output_of(
        sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(project), folder=folder
    )
    venv.create(folder / "empty", with_pip=False)
    binaries = folder / "empty" / ("Scripts" if sys.platform == "win32" else "bin")
    python = binaries / ("python.exe" if sys.platform == "win32" else "python")
    (wheel,) = folder.glob("lidarspectra-*.whl")
    site = output_of(str(python), "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", folder=folder).strip()
    output_of(
        sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", site, str(wheel), folder=folder
    )
    # Libraries only: a .pth named in a .pth is not followed, so this checkout's own install stays out of sight.
    (Path(site) / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return python


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
