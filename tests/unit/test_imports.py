"""The building has one way through: hardware, material, radiance, mapping."""

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

ROOMS = ("hardware", "material", "radiance", "mapping")
SHARED = (
    "arrays", "colorimetry", "config", "database_files", "database_import", "databases", "errors", "file_lock", "files",
    "hdf5_heaps", "netcdf_files", "onnx_errors", "peak_memory", "progress", "reflectance_library", "sensor_files",
    "spectra", "spectrum_files", "toml_text", "workspace",
)  # fmt: skip  # root modules that the rooms use; all others at the root use the rooms


def imported(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    return {name for name in names if name.startswith("lidarspectra.")}


def test_a_room_imports_only_rooms_before_it_and_the_shared_modules(project: Path) -> None:
    package = project / "lidarspectra"
    for room in ROOMS:
        allowed = {*SHARED, *ROOMS[: ROOMS.index(room) + 1]}
        for path in sorted((package / room).rglob("*.py")):
            for name in imported(path):
                assert name.split(".")[1] in allowed, f"{room}/{path.name} imports {name}"


def test_shared_modules_import_no_room(project: Path) -> None:
    for stem in SHARED:
        for name in imported(project / "lidarspectra" / f"{stem}.py"):
            assert name.split(".")[1] in SHARED, f"{stem}.py imports {name}"


def test_no_modules_import_one_another_in_a_circle(project: Path) -> None:
    paths = {
        ".".join(path.relative_to(project).with_suffix("").parts).removesuffix(".__init__"): path
        for path in (project / "lidarspectra").rglob("*.py")
    }
    order = TopologicalSorter({name: (imported(path) & paths.keys()) - {name} for name, path in paths.items()})
    assert set(order.static_order()) == paths.keys()  # raises CycleError with the circle


def test_nothing_rests_on_the_second_opinion(project: Path) -> None:
    for path in sorted((project / "lidarspectra").rglob("*.py")):
        if path.parent.name != "second_opinion":
            borrowed = {name for name in imported(path) if name.startswith("lidarspectra.second_opinion")}
            assert not borrowed, f"{path} imports {borrowed}"


def test_only_the_engine_starts_programs(project: Path) -> None:
    for path in sorted((project / "lidarspectra").rglob("*.py")):
        if path.name == "engine.py" and path.parent.name == "radiance":
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        modules = {
            alias.name.split(".")[0] for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names
        } | {(node.module or "").split(".")[0] for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        assert "subprocess" not in modules, f"{path} imports subprocess"


def test_importing_the_package_loads_no_heavy_library() -> None:
    code = (
        "import sys, lidarspectra, lidarspectra.cli;"
        "heavy = {'trimesh', 'pymeshlab', 'cv2', 'matplotlib', 'colour', 'xarray', 'pandas', 'onnxruntime', 'scipy'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
