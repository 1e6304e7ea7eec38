"""Gloss of a run's materials, from what its frames showed and the light that de-lighting found."""

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import MaterialError
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.io.files import write_whole, writing
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.patterns import Lambertian
from lidarspectra.material.delighting.albedo import LightFit
from lidarspectra.material.delighting.sharpened_cones import srgb_of_cones
from lidarspectra.material.frames.gloss import AT_LAMP_M, GlossOfPart, Mirrored, ShownLamps, gloss_of_parts
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.material.material_map import MAX_REFLECTANCE, Material, MaterialMap
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.workflow.materials.delighting import Delighting

GLOSS_FILE = "gloss.json"
LOOK_M = 0.05  # [m] before and behind a place, in which its face lies: rooms are closed after frames were read
MAX_CUT = 0.2  # [1] of a face that is cut at white in all frames
OF_EXPOSURE = slice(2, 5)  # of a fit's parameters: log k
SEED = 20240911  # of places that are chosen


def gloss_of_materials(
    records: FrameRecords | None, scan: Scan, materials: MaterialMap, delighting: Delighting | None
) -> tuple[GlossOfPart, ...]:
    """What the frames tell of each material's gloss; nothing without frames, lamps or a light that was found.

    Parameters
    ----------
    records : FrameRecords or None
        Of the scan.
    scan : Scan
    materials : MaterialMap
    delighting : Delighting or None

    Returns
    -------
    gloss : tuple of GlossOfPart
        In the order of the materials; empty if nothing is told.
    """
    if records is None or delighting is None or delighting.fit is None or delighting.face_color is None:
        return ()
    return gloss_of_faces(
        records, scan, materials.face_material, len(materials.materials), delighting.fit, delighting.lit
    )


def gloss_of_faces(
    records: FrameRecords, scan: Scan, face_part: IntArray, parts: int, fit: LightFit, lit: Sequence[Lamp]
) -> tuple[GlossOfPart, ...]:
    """The same for any parts of the faces (face,), in the light of a fit with its lamps."""
    matt = [number for number, lamp in enumerate(lit) if isinstance(lamp.shape.pattern, Lambertian) and lamp.is_in_room]
    if not matt or not len(fit.lamp_radiosity):
        return ()
    shown = ShownLamps(
        lamps=tuple(lit[number] for number in matt),
        radiosity=srgb_of_cones(fit.lamp_radiosity[matt]).mean(axis=1),
        log_deviation=float(fit.deviations[OF_EXPOSURE].mean()),
    )
    caster = caster_of(scan)
    hits = caster.nearest(records.points + LOOK_M * records.normals, -records.normals, max_distance=2.0 * LOOK_M)
    part = np.where(hits.met, face_part[hits.face], -1)
    generator = np.random.default_rng(SEED)
    return gloss_of_parts(records, part, parts, shown, caster, mirrored_in(scan, caster, lit), generator)


def mirrored_in(scan: Scan, caster: RayCaster, lamps: Sequence[Lamp]) -> Mirrored:
    """What a scan shows in a direction; 0 of lamps, NaN where it has no picture or was cut at white in all frames."""
    level = scan.face_colors().mean(axis=1)
    unknown = ~scan.appearance.photographed
    if scan.appearance.linear is not None:
        unknown |= scan.appearance.linear.face_cut > MAX_CUT

    def light(origins: FloatArray, directions: FloatArray) -> FloatArray:
        hits = caster.nearest(origins, directions)
        shown = np.where(hits.met & ~unknown[hits.face], level[hits.face], np.nan)
        met = origins + np.where(hits.met, hits.distance, 0.0)[:, None] * directions
        for lamp in lamps:
            shown[hits.met & (lamp.distance(met) < AT_LAMP_M)] = 0.0
        return np.asarray(shown, dtype=np.float64)

    return light


def with_gloss(materials: MaterialMap, gloss: Sequence[GlossOfPart]) -> MaterialMap:
    """Materials with the gloss that frames tell; what is assigned by hand, glass and mirrors keep their own.

    The colour of a surface is what it scatters: what it throws back as a mirror is added to its reflectance.
    """
    if not gloss:
        return materials
    pairs = zip(materials.materials, gloss, strict=True)
    return replace(materials, materials=tuple(_glossy(material, found) for material, found in pairs))


def _glossy(material: Material, found: GlossOfPart) -> Material:
    if found.matt or material.kind != "plastic" or material.provenance == "assigned":
        return material
    whole = np.minimum(material.reflectance.values + found.specularity, MAX_REFLECTANCE)
    return replace(
        material,
        specularity=found.specularity,
        roughness=found.roughness,
        reflectance=Spectrum(wavelengths_nm=material.reflectance.wavelengths_nm, values=whole),
    )


def gloss_in_words(gloss: Sequence[GlossOfPart]) -> str:
    """How many materials are glossy by the frames, as an end of the stage's line; empty for none."""
    count = sum(not found.matt for found in gloss)
    return f"; gloss of {count} of {len(gloss)} materials from the frames" if count else ""


def save_gloss(materials: MaterialMap, gloss: Sequence[GlossOfPart], folder: Path) -> None:
    """Write what frames tell of each material's gloss as JSON; nothing if they tell of none.

    Raises
    ------
    MaterialError
        If it cannot be written.
    """
    if not gloss:
        return
    rows = [
        {"material": material.name, **asdict(found)} for material, found in zip(materials.materials, gloss, strict=True)
    ]
    with writing(folder, error=MaterialError):
        write_whole(folder / GLOSS_FILE, json.dumps(rows, indent=1) + "\n")
