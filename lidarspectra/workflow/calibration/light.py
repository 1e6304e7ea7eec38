"""The light model of a calibration: every lamp's light at places, traced at the room's reflectances and near them.

The derivative by the reflectance of a part is a difference of two traces with the same directions, so that most of
their noise cancels.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.config import RunFile, parse_run_file, require_no_run_file
from lidarspectra.errors import WorkspaceError
from lidarspectra.geometry.scan import Scan, load_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.patterns import SkyLight
from lidarspectra.mapping.calibration.model import STEEPEST, LightModel
from lidarspectra.mapping.maps.response_weights import lamp_weights
from lidarspectra.mapping.maps.visible_bands import luminosity
from lidarspectra.mapping.photovoltaics.cells import Cell
from lidarspectra.material.material_map import MaterialMap, load_materials
from lidarspectra.material.scaled import scaled_materials
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.engine.options import Accuracy, Noise
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.clearance import clear_lamps
from lidarspectra.radiance.scene.scene import load_scene, write_scene
from lidarspectra.room.room import Room, load_room
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.room.surface_parts import PARTS, surface_parts
from lidarspectra.spectra.spectrum import BandSet
from lidarspectra.workflow.calibration.readings import LUX, Quantity
from lidarspectra.workflow.run_folder.calibration_of_run import calibrated_materials
from lidarspectra.workflow.run_folder.declared import changed_keys
from lidarspectra.workflow.run_folder.lamps_of_run import LAMP_KEYS, ScannedRoom
from lidarspectra.workflow.run_folder.light_of_run import present_lamps_of_run
from lidarspectra.workflow.run_folder.workspace import (
    StageName,
    parse_record,
    read_request,
    require_stage,
    stage_folder,
)

STEP = 0.2  # [1] of the logarithm of a reflectance, between the traces of a derivative; downwards, as white is near 1
SEED = 20240513


@dataclass(frozen=True, kw_only=True, eq=False)
class RunRoom:
    """What a finished run knows of its room.

    Parameters
    ----------
    run_file : RunFile
        As it was run.
    base : Path
        Its folder.
    name : str
        Its name without ending.
    scan, room, materials, lamps, bands
        Of its stages.
    part : (face,) int
        Part of the room that each face belongs to.
    """

    run_file: RunFile
    base: Path
    name: str
    scan: Scan
    room: Room
    materials: MaterialMap
    lamps: tuple[Lamp, ...]
    bands: BandSet
    part: IntArray

    def reflectances(self) -> FloatArray:
        """(part,) mean reflectance of each part at 555 nm, by area [1]."""
        values = np.array(
            [float(each.reflectance.at([555.0], outside="nearest")[0]) for each in self.materials.materials]
        )
        weights, face = self.scan.areas, values[self.materials.face_material]
        total = np.bincount(self.part, weights=weights, minlength=len(PARTS))
        return np.bincount(self.part, weights=weights * face, minlength=len(PARTS)) / np.maximum(total, 1e-12)


def run_room(run: Path) -> RunRoom:
    """Read a finished run.

    Raises
    ------
    WorkspaceError
        If a stage up to the trace is not finished, or made for another run file than the folder keeps, or the folder
        is of a version that keeps none.
    """
    folders = {stage: require_stage(run, stage) for stage in ("scan", "materials", "scene", "trace")}
    request = read_request(run)
    if request is None:
        raise WorkspaceError(
            expected="a run folder that keeps its run file",
            found="one of an older version",
            where=str(run),
            todo="Give 'lidarspectra run ROOM.toml' once more, then this command.",
        )
    run_file = parse_run_file(request.text, where=request.name)
    _require_made_for(run_file, run, name=request.name)
    scan, room = load_scan(folders["scan"]), load_room(folders["scan"])
    part = surface_parts(scan, room)
    lamps = present_lamps_of_run(run)
    _require_skies(lamps, run_file, run)
    clear = clear_lamps(lamps, scan)  # as the scene stage did
    return RunRoom(
        run_file=run_file,
        base=(run / request.folder).resolve(),
        name=Path(request.name).stem,
        scan=clear.scan,
        room=room,
        materials=calibrated_materials(
            load_materials(folders["materials"]), ScannedRoom(scan=scan, room=room), run_file.calibration
        ),
        lamps=clear.lamps,
        bands=load_scene(folders["scene"]).bands,
        part=part,
    )


def _require_skies(lamps: Sequence[Lamp], run_file: RunFile, run: Path) -> None:
    """Raise a WorkspaceError where a run of an earlier version does not keep what its windows let in from where.

    Traced anew, they would send the same light in all directions, and stand in the sun's way.
    """
    windows = set() if run_file.daylight is None else {window.name for window in run_file.daylight.windows}
    without = [each.name for each in lamps if each.name in windows and not isinstance(each.shape.pattern, SkyLight)]
    if without:
        raise WorkspaceError(
            expected="a scene that keeps the sky behind its windows",
            found=f"one of an earlier version, without that of '{without[0]}'",
            where=str(run),
            todo="Make the scene again: lidarspectra run ROOM.toml --from scene.",
        )


def _require_made_for(run_file: RunFile, run: Path, *, name: str) -> None:
    """Raise a WorkspaceError where the run file asks for other light than the run has: it ended before that was made.

    The map knows the lamps as they are; its scene may stand in for other fluxes and spectra (`kept_light`).
    """
    of_lamps = (*LAMP_KEYS, "calibration") if parse_record(stage_folder(run, "map")) else ()
    compared: tuple[tuple[StageName, tuple[str, ...]], ...] = (("scene", of_lamps), ("trace", ()), ("map", ()))
    for stage, but in compared:
        record = parse_record(stage_folder(run, stage))
        changed = () if record is None else changed_keys(run_file, record, but=but)
        if changed:
            raise WorkspaceError(
                expected=f"a run that is finished for its run file, {name}",
                found=f"a {stage} of other {' and '.join(changed)} than it has now",
                where=str(run),
                todo="Finish it first: give 'lidarspectra run' with its run file, which makes what is missing.",
            )


def require_no_run_file_beside(run: Path, suffix: str) -> None:
    """Raise a RunFileError if the run file that is to be made of a run's, NAME + suffix, is there already.

    It is for commands that compute for long before they write it.
    """
    request = read_request(run)
    if request is not None:
        require_no_run_file((run / request.folder).resolve() / f"{Path(request.name).stem}{suffix}.toml")


@dataclass(frozen=True, kw_only=True, eq=False)
class TracedLight:
    """Coefficients of a room at its reflectances, and at those of each part lowered by `STEP`.

    Parameters
    ----------
    base : (lamp, point, band) float
        [m⁻²]
    lowered : (part, lamp, point, band) float
        [m⁻²]
    step : float
        By which the logarithm of the part's reflectance is lower. [1]
    """

    base: FloatArray
    lowered: FloatArray
    step: float = STEP

    def base_light(self, weights: FloatArray, points: IntArray) -> FloatArray:
        """(point,) one quantity by all lamps at (number,) points, for (lamp, band) weights of the coefficients."""
        return np.asarray(np.einsum("lb,lnb->n", weights, self.base[:, points]), dtype=np.float64)

    def model(self, weights: FloatArray, points: IntArray) -> LightModel:
        """Light of a number each: (number, lamp, band) weights of the coefficients at (number,) points."""
        light = np.einsum("nlb,lnb->nl", weights, self.base[:, points])
        lowered = np.einsum("nlb,klnb->nlk", weights, self.lowered[:, :, points])
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.log(light[:, :, None] / lowered) / self.step
        return LightModel(light=light, slope=np.clip(np.nan_to_num(slope, posinf=STEEPEST), 0.0, STEEPEST))


def traced_light(
    room: RunRoom,
    points: SensorPoints,
    *,
    factors: FloatArray | None = None,
    accuracy: Accuracy | None = None,
    noise: Noise = "standard",
    workers: int | None = None,
    progress: Progress = silent,
) -> TracedLight:
    """Trace the room's lamps at points, at its reflectances and with each part's lowered.

    Parameters
    ----------
    room : RunRoom
    points : SensorPoints
    factors : (part,) float, optional
        On the reflectances that the traces start from. [1]
    accuracy : str, optional
        The run's by default.
    noise : str
        See `trace`; most of it cancels in the derivatives.
    workers : int, optional
    progress : callable

    Returns
    -------
    light : TracedLight
    """
    start = np.ones(len(PARTS)) if factors is None else factors
    steps = 1.0 + (np.exp(-STEP) - 1.0) * np.eye(len(PARTS))
    found = [
        coefficients(
            room,
            points,
            start * step,
            accuracy=accuracy,
            noise=noise,
            workers=workers,
            progress=part_of(progress, number / (len(PARTS) + 1), (number + 1) / (len(PARTS) + 1)),
        )
        for number, step in enumerate([np.ones(len(PARTS)), *steps])
    ]
    return TracedLight(base=found[0], lowered=np.stack(found[1:]))


def coefficients(
    room: RunRoom,
    points: SensorPoints,
    factors: FloatArray,
    *,
    accuracy: Accuracy | None = None,
    noise: Noise = "standard",
    workers: int | None = None,
    progress: Progress = silent,
) -> FloatArray:
    """(lamp, point, band) coefficients of the room with its parts' reflectances multiplied [m⁻²]."""
    with tempfile.TemporaryDirectory(prefix="lidarspectra-") as name:
        scene = write_scene(
            room.scan, scaled_materials(room.materials, room.part, factors), room.lamps, room.bands, Path(name)
        )
        transport = trace(
            scene,
            points,
            accuracy=accuracy or room.run_file.trace.accuracy,
            noise=noise,
            seed=SEED,
            workers=workers,
            progress=progress,
        )
    return transport["coefficient"].transpose("lamp", "point", "band").to_numpy().astype(np.float64)


def weights_of(
    quantities: Sequence[Quantity], room: RunRoom, *, cell: Cell | None = None, area_m2: float = 0.0
) -> FloatArray:
    """(number, lamp, band) weights with quantity = Σ_lamp Σ_band weight x coefficient.

    Parameters
    ----------
    quantities : sequence of int or str
        A channel [W/m²/nm], 'illuminance' [lx] or 'current' [A].
    room : RunRoom
    cell : Cell or None
    area_m2 : float
        Of the cell.
    """
    centers = room.bands.centers_nm
    known: dict[Quantity, FloatArray] = {}
    for quantity in set(quantities):
        if isinstance(quantity, int):
            flux = np.stack([room.bands.band_values(lamp.flux, outside="zero") for lamp in room.lamps])
            known[quantity] = flux * (np.arange(centers.size) == quantity)
        elif quantity == LUX:
            known[quantity] = np.stack([lamp_weights(centers, luminosity(), lamp.flux) for lamp in room.lamps])
        else:
            assert cell is not None  # since the readings were read
            weights = [lamp_weights(centers, cell.responsivity, lamp.flux) for lamp in room.lamps]
            known[quantity] = area_m2 * np.stack(weights)
    return np.stack([known[quantity] for quantity in quantities])
