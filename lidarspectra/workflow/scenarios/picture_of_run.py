"""Pictures of a run's room: from any place, under its lamps as they are or changed."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from lidarspectra.arguments import all_of, path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError, SceneError
from lidarspectra.io.files import writing
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.room_pictures import luminance_figure, tone_mapped
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.pictures.hdr_file import save_hdr
from lidarspectra.radiance.pictures.observer_channels import observer_channels, xyz_of_channels
from lidarspectra.radiance.pictures.render import Picture, render
from lidarspectra.radiance.pictures.view import Projection, View
from lidarspectra.radiance.scene.scene import RadianceScene, write_scene
from lidarspectra.room.room import Room, load_room
from lidarspectra.workflow.calibration.light import RunRoom, run_room
from lidarspectra.workflow.run_folder.workspace import made_folder, require_stage
from lidarspectra.workflow.scenarios.relighting import LampOrder, changed_lamps

STANDING_M = 1.6  # [m] height of the eye above the floor
LOOK_AT_M = 0.9  # [m] above the floor: what is looked at
TOWARDS_CORNER = 0.8  # [1] of the way from the middle of the plan to its farthest corner: the usual place of the eye
WRITING_SHARE = 0.1  # of the time: the scene
PICTURE, FALSE_COLOR, HDR = "picture.png", "luminance", "picture.hdr"  # files


@dataclass(frozen=True, kw_only=True, eq=False)
class RoomPicture:
    """A picture of a run's room.

    Parameters
    ----------
    picture : Picture
    lamps : tuple of Lamp
        As they were lit.
    """

    picture: Picture
    lamps: tuple[Lamp, ...]

    @property
    def white_xyz(self) -> FloatArray:
        """(3,) XYZ of all the lamps' light together."""
        return white_of(self.lamps)


def picture_run(
    run: str | PathLike[str],
    *,
    eye: ArrayLike | None = None,
    target: ArrayLike | None = None,
    orders: Sequence[LampOrder] = (),
    projection: Projection = "perspective",
    angle_deg: float | None = None,
    pixels: tuple[int, int] = (800, 600),
    smooth: bool = True,
    base: str | PathLike[str] = Path(),
    workers: int | None = None,
    progress: Progress = silent,
) -> RoomPicture:
    """Render the room of a finished run as it will look.

    Parameters
    ----------
    run : str or path
        Run folder with a finished trace.
    eye, target : (3,) float, optional
        Where the eye is and what it looks at, in the scan's axes. By default the eye stands towards the farthest
        corner of the room, 1.6 m high, and looks at the room's middle. [m]
    orders : sequence of LampOrder
        Changes of lamps, as of `relight_run`.
    projection : 'perspective' or 'fisheye'
        Radiance's -vtv or -vta.
    angle_deg : float, optional
        Seen from left to right; 75 in perspective and 180 in a fisheye by default. [deg]
    pixels : (int, int)
        Width and height.
    smooth : bool
        Four rays a pixel instead of one.
    base : str or path
        Where relative names of spectrum files start; the current folder by default.
    workers : int, optional
        Processes; one a core by default.
    progress : callable

    Returns
    -------
    picture : RoomPicture

    Raises
    ------
    WorkspaceError
        If the run has no finished trace.
    SceneError
        If the eye is outside the room, or there is no such view.
    LampError, DatabaseError
        If a lamp or spectrum is unknown.
    """
    run, base = path_of(run, name="run"), path_of(base, name="base")
    orders = all_of(orders, LampOrder, name="orders", todo="Write LampOrder(lamp='panel 1', dim=0.5).")
    room = run_room(run)
    lamps = changed_lamps(room.lamps, orders, base)
    view = view_of_room(room.room, eye, target, projection=projection, angle_deg=angle_deg, pixels=pixels)
    with tempfile.TemporaryDirectory(prefix="lidarspectra-") as name:
        scene = observer_scene(room, lamps, Path(name), progress=part_of(progress, 0.0, WRITING_SHARE))
        (picture,) = render(
            scene, [view], smooth=smooth, workers=workers, progress=part_of(progress, WRITING_SHARE, 1.0)
        )
    return RoomPicture(picture=picture, lamps=lamps)


def view_of_run(
    run: Path,
    eye: ArrayLike | None,
    target: ArrayLike | None,
    *,
    projection: Projection,
    angle_deg: float | None,
    pixels: tuple[int, int],
) -> View:
    """The view that `picture_run` renders.

    Parameters
    ----------
    run : Path
        Run folder with a scan stage.
    eye, target : (3,) float, optional
        As of `picture_run`. [m]
    projection : 'perspective' or 'fisheye'
    angle_deg : float, optional
        Seen from left to right; 75 in perspective and 180 in a fisheye by default. [deg]
    pixels : (int, int)
        Width and height.

    Returns
    -------
    view : View

    Raises
    ------
    WorkspaceError
        If the run has no scan.
    SceneError
        If the eye is outside the room, or there is no such view.
    """
    room = load_room(require_stage(run, "scan"))
    return view_of_room(room, eye, target, projection=projection, angle_deg=angle_deg, pixels=pixels)


def observer_scene(room: RunRoom, lamps: Sequence[Lamp], folder: Path, *, progress: Progress = silent) -> RadianceScene:
    """The room's scene in the channels of the observer, all lamps of a spectrum in one pass."""
    return write_scene(
        room.scan,
        room.materials,
        lamps,
        observer_channels(),
        folder,
        lamps_per_pass=max(len(lamps), 1),
        progress=progress,
    )


def white_of(lamps: Sequence[Lamp]) -> FloatArray:
    """(3,) XYZ of the light of lamps together, in lm and alike."""
    channels = observer_channels()
    return xyz_of_channels(np.sum([channels.band_values(lamp.flux, outside="zero") for lamp in lamps], axis=0))


def view_of_room(
    room: Room,
    eye: ArrayLike | None,
    target: ArrayLike | None,
    *,
    projection: Projection,
    angle_deg: float | None,
    pixels: tuple[int, int],
) -> View:
    """A view in a room; see `picture_run`.

    Raises
    ------
    SceneError
        If the eye is outside the room, or there is no such view.
    """
    middle = 0.5 * (room.outline.min(axis=0) + room.outline.max(axis=0))
    corner = room.outline[int(np.argmax(np.linalg.norm(room.outline - middle, axis=1)))]
    corner = middle + TOWARDS_CORNER * (corner - middle)
    place = np.array([*corner, room.floor_z + STANDING_M]) if eye is None else _place(eye, "eye")
    seen = np.array([*middle, room.floor_z + LOOK_AT_M]) if target is None else _place(target, "target")
    floor_z = float(room.floor_at(place[None])[0])
    if not (room.in_plan(place[None])[0] and floor_z < place[2] < room.ceiling_z):
        low, high = (each(np.vstack(room.outlines), axis=0) for each in (np.min, np.max))
        raise SceneError(
            expected=f"an eye in the room: x from {low[0]:.2f} to {high[0]:.2f}, y from {low[1]:.2f} to {high[1]:.2f}, "
            f"z from {floor_z:.2f} to {room.ceiling_z:.2f} m",
            found=", ".join(f"{value:g}" for value in place),
            where="picture",
            todo="Give another place of the eye, in metres and in the scan's axes.",
        )
    usual = 75.0 if projection == "perspective" else 180.0
    return View(
        eye=place,
        direction=seen - place,
        projection=projection,
        angle_deg=usual if angle_deg is None else angle_deg,
        pixels=pixels,
    )


def _place(given: ArrayLike, name: str) -> FloatArray:
    found = np.asarray(given, dtype=np.float64)
    if found.shape != (3,) or not np.all(np.isfinite(found)):
        raise SceneError(expected="three numbers x, y, z in metres", found=str(given), where=f"{name} of the picture")
    return found


def save_picture(picture: RoomPicture, folder: str | PathLike[str]) -> tuple[Path, ...]:
    """Write a picture for the eye (PNG), its luminance in false colour (PNG), and both as an HDR file.

    Parameters
    ----------
    picture : RoomPicture
    folder : str or path
        Made if absent; files of an earlier picture there are replaced.

    Returns
    -------
    paths : tuple of Path

    Raises
    ------
    MapError, SceneError
        If a file cannot be written.
    """
    folder = made_folder(path_of(folder, name="folder"))
    shown = picture.picture
    with writing(folder, error=MapError):
        Image.fromarray(tone_mapped(shown.xyz, picture.white_xyz)).save(folder / PICTURE)
    return (
        folder / PICTURE,
        *save_figure(luminance_figure(shown.luminance), folder, FALSE_COLOR, kinds=("png",)),
        save_hdr(shown.xyz, shown.view, folder / HDR),
    )
