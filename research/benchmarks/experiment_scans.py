"""Scans of a scene by worse phones, for the sensitivity experiment."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from lidarspectra.spectra.databases import scenes_folder
from research.scenes.build import phone_scan, surface_light_of
from research.virtual_rooms.room_plan import PhoneSection, read_plan
from research.virtual_rooms.true_room import true_room

SEED = 1  # of the shipped scans, so that only what is changed differs
NOISE_FACTOR = 4.0  # [1] on the phone's noise and drift
HOLE_SHARE = 0.05  # [1] of the area, six times the usual


def scan_changes(scene: str, work: Path) -> Iterator[tuple[str, str, None, Path]]:
    """Scan a scene again by other phones; the light in the room is traced once.

    Parameters
    ----------
    scene : str
        In scenes/.
    work : Path
        Where the scans go; those that are there already are kept.

    Yields
    ------
    scan : (str, str, None, Path)
        The input, the change, and the scan that has it, made when it is asked for.
    """
    usual = read_plan(scenes_folder() / scene / "plan.toml").file.phone
    rough = usual.model_copy(update={"noise_m": NOISE_FACTOR * usual.noise_m, "drift_m": NOISE_FACTOR * usual.drift_m})
    wanted: dict[str, dict[str, PhoneSection]] = {
        "scan noise and drift": {f"{1000 * rough.noise_m:g} mm and {1000 * rough.drift_m:g} mm": rough},
        "holes, share of the area": {f"{HOLE_SHARE:.0%}": usual.model_copy(update={"hole_share": HOLE_SHARE})},
    }
    for words, phones in wanted.items():
        for change, file in _scans(scene, work, phones).items():
            yield words, change, None, file


def _scans(scene: str, work: Path, phones: dict[str, PhoneSection]) -> dict[str, Path]:
    plan = read_plan(scenes_folder() / scene / "plan.toml")
    room = true_room(plan)
    files = {}
    for name, phone in phones.items():
        file = plan.file.model_copy(update={"phone": phone})
        words = f"{phone.noise_m:g}-{phone.drift_m:g}-{phone.hole_share:g}"
        files[name] = work / "scans" / f"{scene}-{words}" / "scan.glb"
        if not files[name].is_file():
            files[name].parent.mkdir(parents=True, exist_ok=True)
            light = surface_light_of(plan, room, scenes_folder() / scene, seed=SEED, keep=work / f"{scene}-light.npz")
            phone_scan(replace(plan, file=file), room, files[name].parent, seed=SEED, light=light)
    return files
