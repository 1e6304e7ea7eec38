"""The light that rules ask for, at its points, in every state that a run's uncertainty allows."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.errors import MapError, WorkspaceError
from lidarspectra.lamps.lamps import is_daylight
from lidarspectra.mapping.calibration.model import STEEPEST, LightModel
from lidarspectra.mapping.maps.assumptions import assumptions_of
from lidarspectra.mapping.maps.light_unknowns import load_unknowns
from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map
from lidarspectra.mapping.maps.response_weights import lamp_weights
from lidarspectra.mapping.maps.visible_bands import uncovered
from lidarspectra.mapping.photometry.point_light import light_of_lamps
from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.mapping.rules.chances import DrawnLight, Draws, Uncertainty, draw_noise, draw_own_error, draw_states
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.workflow.calibration.light import RunRoom
from lidarspectra.workflow.calibration.unknowns_of_run import reflected_effects
from lidarspectra.workflow.rules.points import RulePoints
from lidarspectra.workflow.run_folder.light_of_run import scene_of_run
from lidarspectra.workflow.run_folder.workspace import require_stage

SEED = 20240601
BASE_SHARE = 0.8  # of the progress: the trace; the rest are the derivatives
GUESSED_SPECTRUM_SD = 0.2  # [1] of the melanopic over the visual effect: .45 to .9 for white light of 2700 to 6500 K
LUX, EDI, PPFD = "illuminance_lx", "melanopic_edi_lx", "ppfd_umol_m2_s"


@dataclass(frozen=True, kw_only=True, eq=False)
class RuleLight:
    """Light at all points, and what is not known of it.

    Parameters
    ----------
    room : RunRoom
    points : RulePoints
    transport : xarray.Dataset
        Of the run's lamps to the points.
    effects : dict of str to (point, lamp, part) float
        By quantity: derivative of each lamp's light by the logarithm of each part's reflectance. [its unit]
    uncertainty : Uncertainty
    draws : Draws
    own_error, noise : (draw, point) float
        Factors; see `draw_own_error` and `draw_noise`. [1]
    """

    room: RunRoom
    points: RulePoints
    transport: xr.Dataset
    effects: dict[str, FloatArray]
    uncertainty: Uncertainty
    draws: Draws
    own_error: FloatArray
    noise: FloatArray

    def model(self, quantity: str, points: IntArray) -> LightModel:
        """Light of every lamp at some points in a quantity, and its slopes."""
        weights = _weights(self.room, quantity)
        coefficient = self.transport["coefficient"].transpose("lamp", "point", "band").to_numpy()[:, points]
        light = np.einsum("lb,lpb->pl", weights, coefficient.astype(np.float64))
        slope = np.divide(
            self.effects[quantity][points],
            light[:, :, None],
            out=np.zeros_like(self.effects[quantity][points]),
            where=light[:, :, None] > 0,
        )
        return LightModel(light=light, slope=np.clip(slope, 0.0, STEEPEST))

    @property
    def electric(self) -> BoolArray:
        """(lamp,) whether each is a lamp, not a window or the sun."""
        return np.array([not is_daylight(lamp) for lamp in self.room.lamps], dtype=np.bool_)

    def drawn(self, quantity: str, points: IntArray, *, lamps: BoolArray | None = None) -> DrawnLight:
        """Light at some points, of all or of some (lamp,) lamps."""
        model = self.model(quantity, points)
        if lamps is not None:
            model = replace(model, light=model.light * lamps)
        states = self.draws.light(model) * self.own_error[:, points]
        if quantity == EDI:
            states = states * self.draws.spectrum[:, None]
        return DrawnLight(traced=model.light.sum(axis=1), states=states, noise=self.noise[:, points])


def rule_light(
    run: Path, room: RunRoom, points: RulePoints, *, workers: int | None = None, progress: Progress = silent
) -> RuleLight:
    """Trace the run's lamps to the points of the rules, and draw states of the room.

    Raises
    ------
    MapError
        If the run's channels do not cover V(λ).
    WorkspaceError
        If a stage is not finished.
    """
    fault = uncovered(room.bands.centers_nm)
    if fault is not None:
        raise MapError(
            expected="channels that cover V(λ), for illuminance",
            found=fault,
            where="rules",
            todo="Run it with [sensors] device = 'as7265x-14' or 'full-spectrum'.",
        )
    section = room.run_file.trace
    transport = trace(
        scene_of_run(run),
        points.points,
        accuracy=section.accuracy,
        noise=section.noise,
        seed=SEED,
        workers=workers,
        progress=part_of(progress, 0.0, BASE_SHARE),
    )
    progress(BASE_SHARE, "how light changes with the reflectances")
    effects = effects_at(room, points.points, workers=workers)
    uncertainty = uncertainty_of_run(run)
    generator = np.random.default_rng(SEED)
    value, error = light_of_lamps(transport, {lamp.name: lamp.flux for lamp in room.lamps}).weigh(
        light_quantity(LUX).response
    )
    places = points.points
    own_error = draw_own_error(uncertainty, places.positions, places.normals, value, generator)
    return RuleLight(
        room=room,
        points=points,
        transport=transport,
        effects=effects,
        uncertainty=uncertainty,
        draws=draw_states(uncertainty, len(room.lamps), generator),
        own_error=own_error,
        noise=draw_noise(error / np.maximum(value, 1e-300), generator),
    )


def effects_at(room: RunRoom, points: SensorPoints, *, workers: int | None = None) -> dict[str, FloatArray]:
    """By quantity, (point, lamp, part) derivatives of the lamps' light by the logarithms of the parts' reflectances.

    By radiosity (`mapping.maps.reflected_change`), which tells one quantity of one lamp from another as it tells
    channels: by the reflectance that each material has for it.
    """
    count, quantities = len(room.lamps), (LUX, EDI, PPFD)
    spectra = np.stack(
        [room.bands.band_values(each.reflectance, outside="nearest") for each in room.materials.materials]
    )
    flux = np.zeros((count, len(quantities) * count))
    reflectance = np.zeros((len(spectra), len(quantities) * count))
    for number, quantity in enumerate(quantities):
        columns = slice(number * count, (number + 1) * count)
        weights = np.maximum(_weights(room, quantity), 0.0)
        total = weights.sum(axis=1)
        flux[:, columns] = np.diag(total)
        reflectance[:, columns] = spectra @ (weights / np.maximum(total, 1e-300)[:, None]).T
    found = reflected_effects(
        room.scan, room.part, room.materials, room.lamps, flux, reflectance, points.positions, points.normals,
        workers=workers,
    )  # fmt: skip
    by_lamp = found.reshape(*found.shape[:2], len(quantities), count)
    return {quantity: by_lamp[:, :, number].transpose(1, 2, 0) for number, quantity in enumerate(quantities)}


def _weights(room: RunRoom, quantity: str) -> FloatArray:
    """(lamp, band) weights of the coefficients in a quantity."""
    response, centers = light_quantity(quantity).response, room.bands.centers_nm
    return np.stack([lamp_weights(centers, response, lamp.flux) for lamp in room.lamps])


def uncertainty_of_run(run: Path) -> Uncertainty:
    """What a finished run does not know: fluxes and reflectances, what lies beyond the scan, its last reflections.

    Raises
    ------
    WorkspaceError
        If its map was made by a version that kept no covariance.
    """
    folder = require_stage(run, "map")
    light_map, unknowns = load_map(folder / MAP_FILE), load_unknowns(folder)
    if unknowns is None:
        raise WorkspaceError(
            expected="a map with the covariance of what is not known of it",
            found="one of an earlier version",
            where=str(folder),
            todo="Make the map again: 'lidarspectra run ROOM.toml --from map'.",
        )
    opening = float(light_map.attrs.get("opening_share", 0.0))
    assumed = assumptions_of(light_map)
    return Uncertainty(
        covariance=unknowns.covariance,
        local_sd=unknowns.local_sd,
        opening_share=-opening if light_map.attrs.get("opening_closed") else opening,
        truncated_share=float(light_map.attrs.get("truncated_share", 0.0)),
        spectrum_sd=GUESSED_SPECTRUM_SD if assumed.lamps or assumed.spectra else 0.0,
    )
