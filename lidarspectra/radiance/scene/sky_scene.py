"""A room lit by the patches of the sky: one pass in which every patch is a lamp.

The windows send the same radiance from all directions, and rcontrib tells their light apart by the patch that a ray
through the window points to (`-b`). So one trace gives every patch's coefficient, E = Σ_patch C_p Φ_p, for whatever sky
stands outside later on; Φ_p = L_p G_p, see `sky_patches`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import LampError
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.progress import Progress, silent
from lidarspectra.radiance.engine.bands import WRITTEN_PER_WATT
from lidarspectra.radiance.engine.engine import Engine, find_engine
from lidarspectra.radiance.scene.daylight import Window, daylight_lamps
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.radiance.scene.scene_record import RadianceScene
from lidarspectra.radiance.scene.sky import ALTITUDES_DEG, AZIMUTHS_DEG, SKY_WAVELENGTHS_NM, Sky, sky_spectrum
from lidarspectra.radiance.scene.sky_patches import GROUND, SkyPatches, patch_geometry
from lidarspectra.spectra.spectrum import BandSet

BINS_FILE = "sky_bins.cal"
MODIFIER = "skylight"
GROUND_NAME = "ground"
TREGENZA = SkyPatches()  # the sky unless another is asked for
DIM_PATCH = 1e-6  # [1] of the brightest patch's flux: patches that send less graze a window's plane


@dataclass(frozen=True, kw_only=True, eq=False)
class SkyScene:
    """A scene whose lamps are the patches of the sky that windows see.

    Parameters
    ----------
    scene : RadianceScene
        Its flux is that of the radiance it was made with.
    patches : SkyPatches
    lit : (lamp,) int
        Patch that each lamp is.
    geometry : (lamp,) float
        Its flux through the windows per unit of radiance, G_p. [m² sr]
    windows : tuple of Window
    north_deg : float
        Turn of north from the scan's y axis. [deg]
    """

    scene: RadianceScene
    patches: SkyPatches
    lit: IntArray
    geometry: FloatArray
    windows: tuple[Window, ...]
    north_deg: float

    @property
    def centers(self) -> FloatArray:
        """(lamp, 3) unit vectors to the patches' middles, x east, y north, z up."""
        return self.patches.centers[self.lit]


def write_sky_scene(
    scan: Scan,
    materials: MaterialMap,
    windows: Sequence[Window],
    bands: BandSet,
    folder: Path,
    *,
    radiance: FloatArray,
    lamps: Sequence[Lamp] = (),
    north_deg: float = 0.0,
    patches: SkyPatches = TREGENZA,
    engine: Engine | None = None,
    progress: Progress = silent,
) -> SkyScene:
    """Write a room in which every patch of the sky is a lamp.

    Parameters
    ----------
    scan, materials, bands, folder, engine, progress
        As `scene.write_scene`.
    windows : sequence of Window
        One or more.
    radiance : (patch, wavelength) float
        Of every patch, in `sky.SKY_WAVELENGTHS_NM`: the light by which reflectances are weighed within a channel and
        which errors are relative to, the mean of a year for instance. [W/m²/sr/nm]
    lamps : sequence of Lamp
        Electric lamps, which stand in the way and are dark.
    north_deg : float
        Turn of north from the scan's y axis, counter-clockwise seen from above. [deg]
    patches : SkyPatches

    Returns
    -------
    sky_scene : SkyScene

    Raises
    ------
    LampError
        If no window lets any light in.
    SceneError
        As `write_scene`.
    """
    geometry = patch_geometry(patches, windows, north_deg)
    lit = np.flatnonzero(geometry > DIM_PATCH * geometry.max(initial=0.0))
    shape = geometry[lit] @ radiance[lit] / max(float(geometry[lit].sum()), 1e-300)
    panes = daylight_lamps(_even_sky(shape), windows)
    if not panes or not lit.size or shape.max() <= 0:
        raise LampError(
            expected="a window that lets daylight in",
            found="none",
            where="[daylight]",
            todo="Give it a transmittance above 0, and a weather with some light in it.",
        )
    scene = write_scene(
        scan,
        materials,
        [*panes, *lamps],
        bands,
        folder,
        engine=find_engine() if engine is None else engine,
        fine_slots=False,  # daylight changes little within a channel
        lamps_per_pass=len(panes),
        window_modifier=MODIFIER,
        progress=progress,
    )
    (folder / BINS_FILE).write_text(patches.function_text(north_deg, lit), encoding="utf-8", newline="\n")
    return SkyScene(
        scene=_of_patches(scene, panes, lit, geometry[lit], radiance[lit], shape),
        patches=patches,
        lit=lit,
        geometry=geometry[lit],
        windows=tuple(windows),
        north_deg=north_deg,
    )


def lamp_name(patch: int) -> str:
    """What a patch is called where lamps have names."""
    return GROUND_NAME if patch == GROUND else f"sky {patch}"


def _even_sky(spectrum: FloatArray) -> Sky:
    """The same radiance (wavelength,) from all directions, the ground's too."""
    shape = (AZIMUTHS_DEG.size, ALTITUDES_DEG.size, SKY_WAVELENGTHS_NM.size)
    radiance = np.broadcast_to(spectrum, shape)
    return Sky(radiance=radiance, sun_direction=None, sun_irradiance=np.zeros(shape[2]))


def _of_patches(
    scene: RadianceScene,
    panes: Sequence[Lamp],
    lit: IntArray,
    geometry: FloatArray,
    radiance: FloatArray,
    even: FloatArray,
) -> RadianceScene:
    """The scene with patches for lamps: what the windows' passes light, binned by direction."""
    slots = scene.slots.bands
    of_windows = set(range(len(panes)))
    passes = tuple(
        replace(each, lamps=tuple(range(lit.size)), bins_file=BINS_FILE)
        for each in scene.passes
        if set(each.lamps) == of_windows
    )
    sent = slots.band_values(sky_spectrum(even, "even sky"), outside="zero")
    dim = scene.written_flux[0] / (np.pi * panes[0].size[0] * panes[0].size[1])  # of slots without daylight
    written = np.where(sent > 0, WRITTEN_PER_WATT * sent, dim)
    by_patch = np.array([slots.band_values(sky_spectrum(each, "sky"), outside="zero") for each in radiance])
    return replace(
        scene,
        lamp_names=tuple(lamp_name(int(patch)) for patch in lit),
        lamp_modifiers=(MODIFIER,) * lit.size,
        slot_flux=geometry[:, None] * by_patch,
        written_flux=geometry[:, None] * written,
        slot_reflectance=np.repeat(scene.slot_reflectance[:1], lit.size, axis=0),
        passes=passes,
    )
