"""How well the light on the walls determines the lamps' relative fluxes: scenes whose lamps are known.

    python -m research.benchmarks.lamp_fluxes [office ... or folders made by research.scenes.build, or scans]

A scene's lamps keep their places, but all start with equal fluxes; the estimates are printed beside the truth. A scan
has no truth: its lit lamps are found, and start with fluxes in proportion to their areas.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarspectra.config import read_run_file
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.lamps.lamp_spectra import cct_spectrum
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.make_lamp import lamps_from_lit
from lidarspectra.material.lit_lamps.fluxes import LampFlux
from lidarspectra.material.lit_lamps.lit_lamps import find_lit_lamps
from lidarspectra.room.room import find_room
from lidarspectra.spectra.databases import scenes_folder
from lidarspectra.workflow.materials.delighting import take_light_out
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps

WHITE_K = 4000.0  # [K] of lamps that are found in a scan


def estimated_by(path: Path, lamps: Sequence[Lamp] | None) -> tuple[LampFlux, ...]:
    """Estimated fluxes of given lamps, or of those that are lit in the scan."""
    scan = repair_scan(read_scan(path), flatten=True)
    room = find_room(scan)
    if lamps is None:
        lamps = lamps_from_lit(find_lit_lamps(scan, room), cct_spectrum(WHITE_K))
    found = take_light_out(scan, room, lamps, fluxes_stated=False)
    print(f"\n{path}: {len(lamps)} lamps\n  {found.words}", *found.warnings, sep="\n  ")
    return found.lamp_fluxes


def run_scene(folder: Path) -> None:
    """Compare with a scene's truth."""
    lamps = resolve_lamps(read_run_file(folder / "room.toml").lamps, folder)
    powers = np.array([lamp.flux.integral() for lamp in lamps])
    mean = float(np.exp(np.log(powers).mean()))
    equal = [replace(lamp, flux=lamp.flux.scaled(mean / power)) for lamp, power in zip(lamps, powers, strict=True)]
    fluxes = estimated_by(folder / "scan.glb", equal)
    for flux, power in zip(fluxes, powers, strict=True):
        print(f"  {flux.lamp:16s} true {power / mean:5.2f}  {_in_words(flux)}")
    errors = np.array([np.log(flux.factor * mean / power) for flux, power in zip(fluxes, powers, strict=True)])
    print(
        f"  root mean square error {100 * np.sqrt((errors**2).mean()):.1f} %, largest {100 * abs(errors).max():.1f} %"
    )


def _in_words(flux: LampFlux) -> str:
    sure = "identifiable" if flux.identifiable else "not identifiable"
    return f"found {flux.factor:5.2f} ± {100 * flux.log_deviation:2.0f} %, {sure}"


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("places", nargs="*", default=["office", "apartment"])
    for name in parser.parse_args().places:
        path = scenes_folder() / name if (scenes_folder() / name).is_dir() else Path(name)
        if path.is_dir():
            run_scene(path)
        else:
            for flux in estimated_by(path, None):
                print(f"  {flux.lamp:16s} {_in_words(flux)}")


if __name__ == "__main__":
    main()
