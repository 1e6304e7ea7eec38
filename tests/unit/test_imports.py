"""The building has one way through, read from its tree: no folder imports one that stands above it."""

import ast
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

FLOORS = (
    ("io",),
    ("spectra",),
    ("geometry",),
    ("room", "lamps"),
    ("hardware",),
    ("material",),
    ("radiance",),
    ("mapping",),
    ("workflow",),
    ("cli",),
)
"""Folders from the ground up; each imports from floors below its own and from the root's ground modules alone."""
GROUND = {"arguments", "arrays", "beside", "errors", "garbage", "progress", "threads", "words"}
"""Root modules below all folders."""
READ_THE_RUN_FILE = {"workflow", "cli"}  # and nobody else: all others take plain values and records
MAX_ROOT_MODULES = 11


@cache
def imported(path: Path) -> frozenset[str]:
    """All that a module imports, at its top or late: modules, and names in them."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}, line {node.lineno}: a relative import, which these tests do not follow"
            names.add(str(node.module))
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    return frozenset(names)


@pytest.fixture(scope="module")
def modules(project: Path) -> dict[str, set[str]]:
    """What each module of the package imports of the package, by dotted names."""
    paths = {
        ".".join(path.relative_to(project).with_suffix("").parts).removesuffix(".__init__"): path
        for path in (project / "lidarspectra").rglob("*.py")
    }
    return {name: set(imported(path) & paths.keys()) - {name} for name, path in paths.items()}


def test_every_folder_has_its_floor(project: Path) -> None:
    folders = {path.parent.name for path in (project / "lidarspectra").glob("*/__init__.py")}
    assert folders == {name for floor in FLOORS for name in floor}


def test_the_root_is_small(project: Path) -> None:
    assert len(list((project / "lidarspectra").glob("*.py"))) <= MAX_ROOT_MODULES


def test_a_folder_imports_only_from_floors_below(modules: dict[str, set[str]]) -> None:
    level = {name: number for number, floor in enumerate(FLOORS) for name in floor}
    for module, names in modules.items():
        parts = module.split(".")
        if len(parts) < 2 or parts[1] not in level:
            continue
        below = {name for name, number in level.items() if number < level[parts[1]]} | {parts[1]} | GROUND
        if parts[1] in READ_THE_RUN_FILE:
            below |= {"config"}
        for name in names - {"lidarspectra"}:
            assert name.split(".")[1] in below, f"{module} imports {name}"


def test_the_run_file_rests_on_the_ground_and_on_files(modules: dict[str, set[str]]) -> None:
    names = modules["lidarspectra.config"] - {"lidarspectra", "lidarspectra.io"}
    low = ("io.file_names", "io.files", "io.toml_sections", "io.toml_text")
    assert names <= {f"lidarspectra.{stem}" for stem in (*GROUND, *low)}


def test_ground_modules_import_no_folder(modules: dict[str, set[str]]) -> None:
    for stem in GROUND:
        for name in modules[f"lidarspectra.{stem}"]:
            assert name.split(".")[1] in GROUND, f"{stem} imports {name}"


def test_no_modules_import_one_another_in_a_circle(modules: dict[str, set[str]]) -> None:
    assert set(TopologicalSorter(modules).static_order()) == modules.keys()  # raises CycleError with the circle


def test_no_two_folders_import_one_another(modules: dict[str, set[str]], project: Path) -> None:
    packages = {name for name in modules if (project / name.replace(".", "/")).is_dir()}
    # A folder whose own file is a docstring is only a way to its modules; one that names things stands for all of them.
    silent = {
        name
        for name in packages
        if len(ast.parse((project / name.replace(".", "/") / "__init__.py").read_text(encoding="utf-8")).body) == 1
    }

    def folder(module: str) -> str:
        return module if module in packages else module.rpartition(".")[0]

    folders: dict[str, set[str]] = {}
    for module, names in modules.items():
        mine = folder(module)
        others = {folder(name) for name in names if name not in silent}
        # A folder may build on its own sub-folders; what counts is two that stand side by side, or one in another.
        folders.setdefault(mine, set()).update(others - {mine, "lidarspectra"})
    folders.pop("lidarspectra")  # its __init__ names what users need, from all over the house
    assert set(TopologicalSorter(folders).static_order()) >= folders.keys()  # raises CycleError with the circle


@pytest.mark.parametrize("outside", ["research", "tests", "tools"])
def test_the_package_rests_on_nothing_that_the_wheel_has_not(outside: str, project: Path) -> None:
    for path in sorted((project / "lidarspectra").rglob("*.py")):
        borrowed = {name for name in imported(path) if name.split(".")[0] == outside}
        assert not borrowed, f"{path} imports {borrowed}"


def test_benchmarks_build_on_the_rest_of_research_and_nothing_of_it_on_them(project: Path) -> None:
    for path in sorted((project / "research").rglob("*.py")):
        if path.relative_to(project).parts[1] not in ("benchmarks", "tests"):
            borrowed = {name for name in imported(path) if name.startswith("research.benchmarks")}
            assert not borrowed, f"{path} imports {borrowed}"


def test_only_the_engine_starts_programs(project: Path) -> None:
    for path in sorted((project / "lidarspectra").rglob("*.py")):
        if path.name != "engine.py" or path.parent.name != "engine":
            starters = {name for name in imported(path) if name.split(".")[0] == "subprocess"}
            assert not starters, f"{path} imports {starters}"


def loaded(code: str, libraries: set[str]) -> list[str]:
    """Which of some libraries a program loads."""
    code += f"; import sys; print(*sorted({libraries!r} & set(sys.modules)))"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()


def test_importing_the_package_loads_no_heavy_library() -> None:
    heavy = {"trimesh", "pymeshlab", "cv2", "matplotlib", "colour", "xarray", "pandas", "onnxruntime", "scipy"}
    assert not loaded("import lidarspectra, lidarspectra.cli.app", heavy)


def test_relighting_loads_nothing_that_draws_or_reads_meshes() -> None:
    heavy = {"trimesh", "pymeshlab", "matplotlib", "colour", "onnxruntime", "sklearn", "scipy.special", "scipy.stats"}
    assert not loaded("import lidarspectra.cli.relight, lidarspectra.workflow.scenarios.relighting", heavy)


def test_a_run_that_groups_no_colours_loads_no_statistics() -> None:
    assert not loaded("import lidarspectra.workflow.pipeline", {"scipy.signal", "scipy.stats", "sklearn", "matplotlib"})


def test_what_init_asks_for_and_draws_loads_no_maps_and_no_tables() -> None:
    heavy = {"xarray", "pandas", "h5py", "dask", "scipy.optimize", "sklearn", "colour", "onnxruntime"}
    drawn = "lidarspectra.mapping.figures.places_figure, lidarspectra.mapping.figures.floor_plan"
    assert not loaded(f"import lidarspectra.workflow.init.init_file, {drawn}", heavy)
