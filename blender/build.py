"""Build and check the extension's zip: `python blender/build.py [FOLDER]` writes FOLDER/lidarspectra-VERSION.zip.

Nothing but Python's standard library is needed. Checked are the manifest's keys, that all modules can be read, and that
they import one another and what Blender has (its own modules, NumPy, the standard library), neither the package
`lidarspectra` nor the network.
"""

import ast
import re
import sys
import tomllib
import zipfile
from pathlib import Path

EXTENSION = Path(__file__).resolve().parent / "extension"
BLENDER_HAS = {"bpy", "bpy_extras", "bmesh", "mathutils", "numpy"}
NETWORK = {"socket", "urllib", "http", "ftplib", "ssl", "smtplib", "requests", "asyncio", "xmlrpc"}
REQUIRED = {
    "schema_version": r"1\.0\.0", "id": r"[a-z][a-z0-9_]*", "version": r"\d+\.\d+\.\d+", "name": r".+",
    "type": r"add-on", "tagline": r".{1,63}[^.]", "maintainer": r".+", "blender_version_min": r"4\.2\.0",
}  # fmt: skip
MAX_LINES = 450  # of a module
SOME_DAY = (2026, 1, 1, 0, 0, 0)  # of all files in the zip, so that the same source makes the same bytes


def check(folder: Path) -> list[str]:
    """What is wrong with the source of an extension; nothing where all is well."""
    faults = [f"blender_manifest.toml: {fault}" for fault in _manifest_faults(folder)]
    modules = sorted(folder.glob("*.py"))
    names = {path.stem for path in modules}
    for path in modules:
        text = path.read_text(encoding="utf-8")
        if len(text.splitlines()) > MAX_LINES:
            faults.append(f"{path.name}: more than {MAX_LINES} lines")
        for node in ast.walk(ast.parse(text, path.name)):
            faults += [f"{path.name}: {fault}" for fault in _import_faults(node, names)]
    if not (folder / "LICENSE").is_file():
        faults.append("LICENSE: no such file")
    return faults


def _manifest_faults(folder: Path) -> list[str]:
    try:
        manifest = tomllib.loads((folder / "blender_manifest.toml").read_text(encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError) as cause:
        return [str(cause)]
    faults = [
        f"{key} = {manifest.get(key)!r}, expected {pattern}"
        for key, pattern in REQUIRED.items()
        if not re.fullmatch(pattern, str(manifest.get(key, "")))
    ]
    if manifest.get("license") != ["SPDX:GPL-3.0-or-later"]:
        faults.append("license: an extension that imports bpy is under the GPL")
    if "wheels" in manifest or "network" in manifest.get("permissions", {}):
        faults.append("neither wheels nor the network are wanted")
    return faults


def _import_faults(node: ast.AST, own: set[str]) -> list[str]:
    if isinstance(node, ast.ImportFrom) and node.level:
        wanted = [node.module] if node.module else [alias.name for alias in node.names]
        return [f"no module {name}" for name in wanted if node.level != 1 or name not in own]
    if isinstance(node, ast.ImportFrom):
        roots = [str(node.module).split(".")[0]]
    elif isinstance(node, ast.Import):
        roots = [alias.name.split(".")[0] for alias in node.names]
    else:
        return []
    known = BLENDER_HAS | set(sys.stdlib_module_names) - NETWORK
    return [
        f"imports {root}, which Blender's Python has not, or which is the network"
        for root in roots
        if root not in known
    ]


def build(folder: Path, out: Path) -> Path:
    """Zip an extension that was checked; the same source gives the same bytes."""
    manifest = tomllib.loads((folder / "blender_manifest.toml").read_text(encoding="utf-8"))
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{manifest['id']}-{manifest['version']}.zip"
    files = sorted([*folder.glob("*.py"), folder / "blender_manifest.toml", folder / "LICENSE"])
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            entry = zipfile.ZipInfo(file.name, SOME_DAY)
            entry.external_attr = 0o644 << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, file.read_bytes())
    return path


def main() -> None:
    """Check, build, and look into the zip once more."""
    faults = check(EXTENSION)
    if faults:
        sys.exit("\n".join(faults))
    path = build(EXTENSION, Path(sys.argv[1] if len(sys.argv) > 1 else "dist"))
    with zipfile.ZipFile(path) as archive:
        if archive.testzip() is not None or "__init__.py" not in archive.namelist():
            sys.exit(f"{path}: damaged")
        print(f"{path}: {len(archive.namelist())} files, {path.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
