"""The light that rules ask for, at its points, in every state that a run's uncertainty allows."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.errors import MapError, WorkspaceError
from lidarspectra.lamps.lamps import is_daylight
from lidarspectra.mapping.calibration.model import LightModel
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
from lidarspectra.workflow.calibration_light import RunRoom, TracedLight, traced_light
from lidarspectra.workflow.light_of_run import scene_of_run
from lidarspectra.workflow.rule_points import RulePoints
from lidarspectra.workflow.workspace import require_stage

SEED = 20240601
BASE_SHARE = 0.3  # of the progress: the trace that the light is of; the rest are those of the derivatives
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
    slopes : TracedLight
        How each lamp's light changes with the room's reflectances.
    uncertainty : Uncertainty
    draws : Draws
    own_error, noise : (draw, point) float
        Factors; see `draw_own_error` and `draw_noise`. [1]
    """

    room: RunRoom
    points: RulePoints
    transport: xr.Dataset
    slopes: TracedLight
    uncertainty: Uncertainty
    draws: Draws
    own_error: FloatArray
    noise: FloatArray

    def model(self, quantity: str, points: IntArray) -> LightModel:
        """Light of every lamp at some points in a quantity, and its slopes."""
        response, centers = light_quantity(quantity).response, self.room.bands.centers_nm
        weights = np.stack([lamp_weights(centers, response, lamp.flux) for lamp in self.room.lamps])
        coefficient = self.transport["coefficient"].transpose("lamp", "point", "band").to_numpy()[:, points]
        light = np.einsum("lb,lpb->pl", weights, coefficient.astype(np.float64))
        every = np.broadcast_to(weights, (points.size, *weights.shape))
        return LightModel(light=light, slope=self.slopes.model(every, points).slope)

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
    slopes = traced_light(
        room, points.points, noise="draft", workers=workers, progress=part_of(progress, BASE_SHARE, 1.0)
    )
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
        slopes=slopes,
        uncertainty=uncertainty,
        draws=draw_states(uncertainty, len(room.lamps), generator),
        own_error=own_error,
        noise=draw_noise(error / np.maximum(value, 1e-300), generator),
    )


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
