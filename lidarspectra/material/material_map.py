"""The material map: which reflectance spectrum every face of the scan has, and how we know."""

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast, get_args

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray, float_array, int_array
from lidarspectra.errors import ArrayError, DatabaseError, MaterialError, WorkspaceError
from lidarspectra.io.array_files import read_arrays
from lidarspectra.io.files import write_whole
from lidarspectra.spectra.colorimetry import hex_color
from lidarspectra.spectra.reflectance_library import MAX_REFLECTANCE as MAX_REFLECTANCE
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.spectrum_files import TableRow, read_table, read_text, write_table
from lidarspectra.words import counted

SurfaceKind = Literal["plastic", "metal", "glass", "trans", "mirror"]
Provenance = Literal["measured", "recovered", "modelled", "default", "assigned"]
MATERIALS_FILE, SPECTRA_FILE, UNCERTAINTY_FILE = "materials.csv", "spectra.csv", "uncertainty.csv"
FACES_FILE = "faces.npz"
PAPER_BANDS_NM = (410.0, 760.0)  # [nm] first and last channel of the paper's 14
UNSEEN_WARNING = 0.02  # [1] of the area
COLUMNS = (
    "group", "name", "category", "reflectance", "provenance", "confidence", "kind", "specularity", "roughness",
    "transmittance", "measured_from_nm", "measured_to_nm", "color", "faces", "area_m2",
)  # fmt: skip  # of materials.csv


@dataclass(frozen=True, kw_only=True, eq=False)
class Material:
    """A surface: its reflectance spectrum and how it scatters.

    Parameters
    ----------
    name : str
        The user's or the database's words; never written into a Radiance file.
    category : str
        Material class ('wood', 'painted', ... ; 'unknown' where none was estimated).
    reflectance : Spectrum
        Total hemispherical reflectance, 0 to `MAX_REFLECTANCE`. [1]
    kind : str
        How it scatters, in Radiance's terms.
    specularity : float
        Fraction of the light reflected at the surface, without its colour for plastic. [0-1]
    roughness : float
        Radiance's rms facet slope. [0-1]
    transmittance : float
        Fraction passed through, for glass and trans. [0-1]
    source : str
        Database and ID ("builtin:cc-orange"), or 'default'.
    provenance : str
        Whether the spectrum was measured on a surface of this name, recovered from a colour, modelled, a default,
        or assigned by the user.
    confidence : float
        [0-1]
    measured_range_nm : (float, float)
        Beyond it the reflectance is extrapolated. [nm]
    color : (3,) float
        Linear sRGB that the scan showed. [0-1]
    uncertainty : Spectrum or None
        Standard deviation of the reflectance, as its estimate sees it; None where nothing is known of it. [1]
    """

    name: str
    category: str
    reflectance: Spectrum
    kind: SurfaceKind = "plastic"
    specularity: float = 0.0
    roughness: float = 0.0
    transmittance: float = 0.0
    source: str
    provenance: Provenance
    confidence: float
    measured_range_nm: tuple[float, float]
    color: tuple[float, float, float]
    uncertainty: Spectrum | None = None

    def __post_init__(self) -> None:
        values = self.reflectance.values
        if values.min() < 0 or values.max() > MAX_REFLECTANCE:
            raise ArrayError(
                expected=f"a reflectance between 0 and {MAX_REFLECTANCE}",
                found=f"{values.min():.3f} to {values.max():.3f}",
                where=f"material '{self.name}'",
                todo="A surface that returns more light than it gets has no steady state.",
            )
        for name in ("specularity", "roughness", "transmittance", "confidence"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ArrayError(
                    expected=f"{name} between 0 and 1",
                    found=f"{getattr(self, name)}",
                    where=f"material '{self.name}'",
                )

    def __repr__(self) -> str:
        value = _at_555(self.reflectance)
        return f"<Material '{self.name}': reflectance {value:.2f} at 555 nm, {self.kind}, {self.provenance}>"


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialMap:
    """The material of every face.

    Parameters
    ----------
    materials : tuple of Material
        Tens, not thousands.
    face_material : (face,) int
        Which material each face has.
    face_color : (face, 3) float
        Mean linear sRGB of each face in the scan. [0-1]
    face_seen : (face,) float
        Fraction of the face's area that some view saw. [0-1]
    """

    materials: tuple[Material, ...]
    face_material: IntArray
    face_color: FloatArray
    face_seen: FloatArray

    def __post_init__(self) -> None:
        face_material = int_array(self.face_material, name="MaterialMap.face_material", shape=(None,))
        count = face_material.size
        if count and (face_material.min() < 0 or face_material.max() >= len(self.materials)):
            raise ArrayError(
                expected=f"material numbers from 0 to {len(self.materials) - 1}",
                found=f"{face_material.min()} to {face_material.max()}",
                where="MaterialMap.face_material",
            )
        object.__setattr__(self, "face_material", face_material)
        object.__setattr__(
            self, "face_color", float_array(self.face_color, name="MaterialMap.face_color", shape=(count, 3))
        )
        object.__setattr__(self, "face_seen", float_array(self.face_seen, name="MaterialMap.face_seen", shape=(count,)))

    def __repr__(self) -> str:
        names = ", ".join(material.name for material in self.materials[:5])
        more = f" and {len(self.materials) - 5} more" if len(self.materials) > 5 else ""
        return f"<MaterialMap: {self.face_material.size} faces, {len(self.materials)} materials: {names}{more}>"

    def areas(self, face_areas: FloatArray) -> FloatArray:
        """(material,) area of each material [m²], from the (face,) areas [m²]."""
        return np.bincount(self.face_material, weights=face_areas, minlength=len(self.materials)).astype(np.float64)

    def mean_reflectance(self, face_areas: FloatArray, wavelength_nm: float = 555.0) -> float:
        """Area-weighted mean reflectance at a wavelength [1]."""
        values = [float(material.reflectance.at([wavelength_nm], outside="nearest")[0]) for material in self.materials]
        return float(np.average(values, weights=self.areas(face_areas)))

    def in_words(self, face_areas: FloatArray) -> str:
        """One line for the run's summary, from the (face,) areas [m²]."""
        areas = self.areas(face_areas)
        main = [f"{self.materials[n].name} {areas[n]:.1f} m²" for n in np.argsort(-areas, kind="stable")[:3]]
        return (
            f"{counted(len(self.materials), 'material')}, mean reflectance {self.mean_reflectance(face_areas):.2f} "
            f"at 555 nm; most: {', '.join(main)}"
        )

    def warnings(self, face_areas: FloatArray, *, light_left_in: bool = True) -> tuple[str, ...]:
        """Caveats on how the materials were found, as full sentences, from the (face,) areas [m²]."""
        areas, total = self.areas(face_areas), float(face_areas.sum())
        words = []
        estimated = [material.provenance in ("measured", "recovered") for material in self.materials]
        if any(estimated) and light_left_in:
            words.append(
                "Reflectances are taken from the scan's colours without de-lighting: the light in the room at the time "
                "of the scan is still in them, so that most surfaces come out too dark and some too bright, of a scan "
                "by day, or of a room lit by way of its ceiling or a wall, by more than the uncertainties that are "
                "stated for it. Give the lamps that were lit, and set delight = true under [materials]."
            )
        by_name = [(area, m) for area, m in zip(areas, self.materials, strict=True) if m.source.startswith("typical:")]
        typical = float(sum(area for area, _ in by_name))
        if by_name:
            kinds = ", ".join(
                f"{m.name.removeprefix('typical ')} {_at_555(m.reflectance):.2f} ± {_at_555(m.uncertainty):.2f}"
                for _, m in by_name
            )
            words.append(
                f"{100 * typical / total:.0f} % of the area has no photographed colour and gets the typical "
                f"reflectance of what it is by name, which may well be wrong ({kinds}). Assign materials there "
                '(method = "file" under [materials]) where you know better.'
            )
        default = float(sum(area for area, m in zip(areas, self.materials, strict=True) if m.provenance == "default"))
        default -= typical
        if any(estimated) and default > 0:
            words.append(
                f"{100 * default / total:.1f} % of the area is cut at white in the scan, as lamps are, or has no "
                "colour there, and gets the default material. "
                'Assign other materials there (method = "file" under [materials]) if it is near the sensors.'
            )
        of_picture = np.array(estimated, dtype=np.bool_)[self.face_material]  # others have a material without one
        unseen = float((face_areas * (1.0 - self.face_seen))[of_picture].sum())
        if any(estimated) and unseen > UNSEEN_WARNING * total:
            words.append(
                f"{100 * unseen / total:.1f} % of the area was seen by no view and takes the material of its "
                "neighbours. Scan those places again if they matter."
            )
        short = [
            area
            for area, m in zip(areas, self.materials, strict=True)
            if m.measured_range_nm[0] > PAPER_BANDS_NM[0] or m.measured_range_nm[1] < PAPER_BANDS_NM[1]
        ]
        if short:
            words.append(
                f"{100 * sum(short) / total:.0f} % of the area has reflectances that were measured only in a part of "
                f"{PAPER_BANDS_NM[0]:.0f} to {PAPER_BANDS_NM[1]:.0f} nm and are extrapolated outside it: the outer "
                "channels are less certain. Reflectance databases with a wider range can be imported."
            )
        return tuple(words)


def _at_555(spectrum: Spectrum | None) -> float:
    """Value at the peak of V(λ); 0 where there is no spectrum."""
    return 0.0 if spectrum is None else float(spectrum.at([555.0], outside="nearest")[0])


def save_materials(materials: MaterialMap, folder: Path, *, face_areas: FloatArray | None = None) -> None:
    """Write a material map into a folder that exists: materials.csv and spectra for people, faces.npz for the faces.

    `materials.csv` can be edited and given back as the file of `[materials] method = "file"` (see `assignments`).

    Parameters
    ----------
    materials : MaterialMap
    folder : Path
    face_areas : (face,) float, optional
        For the column area_m2. [m²]
    """
    areas = None if face_areas is None else materials.areas(face_areas)
    faces = np.bincount(materials.face_material, minlength=len(materials.materials))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for group, material in enumerate(materials.materials):
        area = "" if areas is None else f"{areas[group]:.3f}"
        low, high = material.measured_range_nm
        writer.writerow(
            [
                group, material.name, material.category, material.source, material.provenance,
                f"{material.confidence:.3f}", material.kind, f"{material.specularity:.6g}", f"{material.roughness:.6g}",
                f"{material.transmittance:.6g}", f"{low:g}", f"{high:g}", hex_color(material.color), faces[group], area,
            ]
        )  # fmt: skip
    write_whole(folder / MATERIALS_FILE, text.getvalue())
    write_table(folder / SPECTRA_FILE, [_spectrum_row(n, m, m.reflectance) for n, m in enumerate(materials.materials)])
    known = [(n, m, m.uncertainty) for n, m in enumerate(materials.materials) if m.uncertainty is not None]
    (folder / UNCERTAINTY_FILE).unlink(missing_ok=True)
    if known:
        write_table(folder / UNCERTAINTY_FILE, [_spectrum_row(n, m, spectrum) for n, m, spectrum in known])
    np.savez_compressed(
        folder / FACES_FILE,
        face_material=materials.face_material,
        face_color=materials.face_color,
        face_seen=materials.face_seen,
        color=np.array([material.color for material in materials.materials]),
    )


def load_materials(folder: Path) -> MaterialMap:
    """Read what `save_materials` wrote.

    Raises
    ------
    MaterialError
        If a file is missing or malformed.
    """
    try:
        spectra = {row.id: row.spectrum for row in read_table(folder / SPECTRA_FILE)}
        known = folder / UNCERTAINTY_FILE
        uncertainty = {row.id: row.spectrum for row in read_table(known)} if known.is_file() else {}
        rows = list(csv.DictReader(io.StringIO(read_text(folder / MATERIALS_FILE), newline="")))
        arrays = read_arrays(folder / FACES_FILE)
        colors = float_array(arrays["color"], name="color", shape=(len(rows), 3))
        return MaterialMap(
            materials=tuple(
                _material(row, spectra[str(n)], uncertainty.get(str(n)), colors[n]) for n, row in enumerate(rows)
            ),
            face_material=int_array(arrays["face_material"], name="face_material", shape=(None,)),
            face_color=float_array(arrays["face_color"], name="face_color", shape=(None, 3)),
            face_seen=float_array(arrays["face_seen"], name="face_seen", shape=(None,)),
        )
    except (OSError, ValueError, TypeError, KeyError, ArrayError, DatabaseError, WorkspaceError) as cause:
        raise MaterialError(
            expected="the materials that an earlier stage wrote",
            found=f"{type(cause).__name__}: {cause}",
            where=str(folder),
            todo="Run the materials stage again.",
        ) from cause


def _spectrum_row(group: int, material: Material, spectrum: Spectrum) -> TableRow:
    return TableRow(id=str(group), name=material.name, category=material.category, spectrum=spectrum)


def _material(row: dict[str, str], spectrum: Spectrum, uncertainty: Spectrum | None, color: FloatArray) -> Material:
    if row["kind"] not in get_args(SurfaceKind) or row["provenance"] not in get_args(Provenance):
        raise ValueError(f"kind '{row['kind']}' or provenance '{row['provenance']}' is unknown")
    return Material(
        name=row["name"],
        category=row["category"],
        reflectance=Spectrum(wavelengths_nm=spectrum.wavelengths_nm, values=spectrum.values, name=row["name"]),
        kind=cast(SurfaceKind, row["kind"]),
        specularity=float(row["specularity"]),
        roughness=float(row["roughness"]),
        transmittance=float(row["transmittance"]),
        source=row["reflectance"],
        provenance=cast(Provenance, row["provenance"]),
        confidence=float(row["confidence"]),
        measured_range_nm=(float(row["measured_from_nm"]), float(row["measured_to_nm"])),
        color=(float(color[0]), float(color[1]), float(color[2])),
        uncertainty=uncertainty,
    )
