"""The report's tables, with units in the headings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import ScanRecord
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.figures.channel_figures import ChosenPoint
from lidarspectra.mapping.figures.map_figures import relative_error
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.maps.assumptions import ASSUMED, Assumptions, assumptions_of
from lidarspectra.mapping.maps.map_files import map_table
from lidarspectra.mapping.maps.map_schema import kept_points
from lidarspectra.material.material_map import Material
from lidarspectra.spectra.colorimetry import hex_color

MAX_PERCENT = 1000.0  # [%] of an uncertainty: more says no more


@dataclass(frozen=True, kw_only=True)
class StageRow:
    """One stage of the run.

    Parameters
    ----------
    stage : str
        'scan' ... 'map'.
    summary : str
        One line on its result.
    seconds : float
        Wall time. [s]
    peak_memory_mib : float
        Highest memory of the process tree. [MiB]
    """

    stage: str
    summary: str
    seconds: float
    peak_memory_mib: float


def stages_table(stages: Sequence[StageRow]) -> Table:
    """Time and memory of every stage."""
    frame = pd.DataFrame(
        {
            "stage": [row.stage for row in stages],
            "result": [row.summary for row in stages],
            "time [s]": [float(row.seconds) for row in stages],
            "peak memory [MiB]": [float(row.peak_memory_mib) for row in stages],
        }
    )
    formats = {"time [s]": ".1f", "peak memory [MiB]": ".0f"}
    return Table(
        name="stages", caption="The result of each stage, with its time and memory.", frame=frame, formats=formats
    )


def scan_table(record: ScanRecord) -> Table:
    """What was found in the scan's file, and the count of every repair."""
    share = 100.0 * record.hole_area_m2 / record.area_m2 if record.area_m2 > 0 else 0.0
    rows = {
        "file": record.file,
        "unit of the file": f"{record.unit} (confidence {record.unit_confidence:.2f})",
        "upward axis of the file": f"{record.up_axis} (confidence {record.up_confidence:.2f})",
        "triangles read": f"{record.faces_read}",
        "triangles kept": f"{record.faces_kept}",
        "duplicate triangles removed": f"{record.duplicate_faces}",
        "degenerate triangles removed": f"{record.degenerate_faces}",
        "triangles turned towards the room": f"{record.flipped_faces}",
        "hidden layers left out": f"{record.hidden_faces} triangles, {record.hidden_area_m2:.1f} m²",
        "cut off at glass and mirrors": f"{record.cut_faces} triangles, {record.cut_area_m2:.1f} m²",
        "holes closed": f"{record.holes_closed}",
        "area of closed holes": f"{record.hole_area_m2:.2f} m² ({share:.1f} % of the surface)",
        "planes made flat": _flattened(record),
        "surface": f"{record.area_m2:.1f} m²",
        "triangles before decimation": f"{record.decimated_from}" if record.decimated_from else "not decimated",
    }
    frame = pd.DataFrame({"what": list(rows), "value": list(rows.values())})
    return Table(name="scan", caption="What the scan file contained, and every repair to it.", frame=frame)


def _flattened(record: ScanRecord) -> str:
    if not record.flat_planes:
        return "none"
    return (
        f"{record.flat_planes}, {100 * record.flat_area_share:.0f} % of the surface; "
        f"{100 * record.moved_vertex_share:.0f} % of the vertices moved, by {1e3 * record.moved_rms_m:.1f} mm (RMS)"
    )


def materials_table(materials: Sequence[Material], areas_m2: FloatArray, bands: FloatArray) -> Table:
    """Every material, the largest area first.

    Parameters
    ----------
    materials : sequence of Material
        By the numbers of their groups in materials.csv, which files of assignments name.
    areas_m2 : (material,) float
        [m²]
    bands : (band,) float
        Centres, over which the mean reflectance is taken. [nm]
    """
    order = np.argsort(-areas_m2, kind="stable")
    total = float(areas_m2.sum()) or 1.0
    chosen = [materials[index] for index in order]
    frame = pd.DataFrame(
        {
            "group": order,
            "material": [material.name for material in chosen],
            "colour": [hex_color(material.color) for material in chosen],
            "class": [material.category for material in chosen],
            "area [m²]": areas_m2[order],
            "share [%]": 100.0 * areas_m2[order] / total,
            "mean reflectance [1]": [float(m.reflectance.at(bands, outside="nearest").mean()) for m in chosen],
            "its deviation [1]": [_mean_deviation(material, bands) for material in chosen],
            "origin": [str(material.provenance) for material in chosen],
            "measured range [nm]": ["{:.0f} to {:.0f}".format(*material.measured_range_nm) for material in chosen],
            "confidence [1]": [float(material.confidence) for material in chosen],
            "source": [material.source for material in chosen],
        }
    )
    formats = {
        "area [m²]": ".2f",
        "share [%]": ".1f",
        "mean reflectance [1]": ".2f",
        "its deviation [1]": ".2f",
        "confidence [1]": ".2f",
    }
    return Table(
        name="materials",
        caption="Materials by area, with the colour that the scan shows, and their number in materials.csv (group). "
        "The standard deviation of a reflectance is common to its channels; none is stated of what was assigned, "
        "which the map counts as known to 3 %.",
        frame=frame,
        formats=formats,
    )


def _mean_deviation(material: Material, bands: FloatArray) -> float:
    """Standard deviation of the mean reflectance over bands, errors of which go together; NaN where none is stated."""
    if material.uncertainty is None:
        return float("nan")
    return float(material.uncertainty.at(bands, outside="nearest").mean())


def lamps_table(lamps: Sequence[Lamp], assumed: Assumptions) -> Table:
    """Every lamp: position, size, direction, flux, and what of its light is assumed."""
    frame = pd.DataFrame(
        {
            "lamp": [f"L{number}" for number in range(1, len(lamps) + 1)],
            "name": [lamp.name for lamp in lamps],
            "shape": [lamp.shape.word for lamp in lamps],
            "centre [m]": [", ".join(f"{value:.2f}" for value in lamp.center) for lamp in lamps],
            "size [m]": [" x ".join(f"{size:g}" for size in lamp.size) for lamp in lamps],
            "direction [1]": [_direction(lamp) for lamp in lamps],
            "spectrum": [lamp.flux.name for lamp in lamps],
            "radiant flux [W]": [lamp.flux.integral() for lamp in lamps],
            "luminous flux [lm]": [luminous_flux_lm(lamp.flux) for lamp in lamps],
            "assumed": [assumed.of_lamp(lamp.name) or "nothing" for lamp in lamps],
        }
    )
    formats = {"radiant flux [W]": ".3g", "luminous flux [lm]": ".0f"}
    return Table(
        name="lamps", caption="Lamps; the radiant flux is that of the whole spectrum.", frame=frame, formats=formats
    )


def bands_table(spectral_map: xr.Dataset) -> Table:
    """Irradiance and its standard error in every band, over all points that are not buried."""
    kept = kept_points(spectral_map)
    values = spectral_map["irradiance"].to_numpy()[kept]
    relative = 100.0 * relative_error(spectral_map)[kept]
    frame = pd.DataFrame(
        {
            "band [nm]": spectral_map["band"].to_numpy(),
            "width [nm]": spectral_map["band_width"].to_numpy(),
            "lowest [W/m²/nm]": values.min(axis=0),
            "median [W/m²/nm]": np.median(values, axis=0),
            "mean [W/m²/nm]": values.mean(axis=0),
            "highest [W/m²/nm]": values.max(axis=0),
            "median SE [%]": np.median(relative, axis=0),
        }
    )
    of_all_causes = ""
    if "irradiance_sd" in spectral_map:
        own = np.median(_own_uncertainty(spectral_map), axis=0)
        frame["median uncertainty [%]"] = np.where(own <= MAX_PERCENT, own, np.nan)
        of_all_causes = ", the uncertainty for all causes as a share of each point's own light"
        if (own > MAX_PERCENT).any():
            of_all_causes += f" (empty above {MAX_PERCENT:g} %: next to nothing is known there)"
    formats = {"band [nm]": "g", "width [nm]": "g", "median SE [%]": ".2f", "median uncertainty [%]": ".0f"}
    formats |= dict.fromkeys([name for name in map(str, frame.columns) if "W/m²/nm" in name], ".2e")
    caption = (
        f"Spectral irradiance by band; the standard error (SE) as a share of the band's mean{of_all_causes}."
        + _guesses(spectral_map)
    )
    return Table(name="bands", caption=caption, frame=frame, formats=formats)


def chosen_points_table(spectral_map: xr.Dataset, points: Sequence[ChosenPoint]) -> Table:
    """Spectra at the chosen points, one column per point, with their standard errors."""
    columns: dict[str, object] = {"band [nm]": spectral_map["band"].to_numpy()}
    formats = {"band [nm]": "g"}
    for point in points:
        for variable, unit in (("irradiance", "W/m²/nm"), ("irradiance_se", "SE, W/m²/nm")):
            heading = f"{point.reason} [{unit}]"
            columns[heading] = spectral_map[variable].to_numpy()[point.index]
            formats[heading] = ".3e" if variable == "irradiance" else ".1e"
    caption = "Spectral irradiance at the chosen points, and its standard error (SE)." + _guesses(spectral_map)
    return Table(name="chosen-points", caption=caption, frame=pd.DataFrame(columns), formats=formats)


def points_table(spectral_map: xr.Dataset) -> Table:
    """The whole map, one row per point (see `map_table`), without errors of the bands."""
    whole = map_table(spectral_map)
    errors = ("SE_", *(f"SD_{label}" for label in spectral_map["band_label"].to_numpy()), ASSUMED)  # the caption's
    frame = whole[[name for name in whole.columns if not name.startswith(errors)]]
    formats = dict.fromkeys(("x", "y", "z"), ".3f") | dict.fromkeys(("nx", "ny", "nz"), ".2f")
    formats |= dict.fromkeys([name for name in frame.columns if name.startswith("E_")], ".3e")
    caption = "All points: position [m], direction [1], spectral irradiance E by band [W/m²/nm]." + _guesses(
        spectral_map
    )
    return Table(name="points", caption=caption, frame=frame, formats=formats)


def _own_uncertainty(spectral_map: xr.Dataset) -> FloatArray:
    """(point, band) uncertainty over the light there, of points that are not buried [%]."""
    kept = kept_points(spectral_map)
    light, deviation = (spectral_map[name].to_numpy()[kept] for name in ("irradiance", "irradiance_sd"))
    return np.asarray(100.0 * np.divide(deviation, light, out=np.zeros(light.shape), where=light > 0), dtype=np.float64)


def _guesses(spectral_map: xr.Dataset) -> str:
    """A sentence on what of a map is assumed; empty if nothing is."""
    words = assumptions_of(spectral_map).in_words()
    return f" Assumed, and in no standard error: {words}." if words else ""


def pairs_table(name: str, caption: str, entries: Mapping[str, str]) -> Table:
    """Names and values."""
    frame = pd.DataFrame({"what": list(entries), "value": [str(value) for value in entries.values()]})
    return Table(name=name, caption=caption, frame=frame)


def _direction(lamp: Lamp) -> str:
    if not lamp.shape.has_axis:
        return "all around"
    return ", ".join(f"{value + 0.0:.2f}" for value in lamp.normal)  # + 0.0 removes a negative zero
