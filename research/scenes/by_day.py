"""Make scans of the scenes as a phone takes them by day: with windows, lamps off, other cameras.

    python -m research.scenes.by_day FOLDER [--scene office ...] [--case day ...] [--seed 1 2 3]
    python -m research.scenes.by_day FOLDER --scene other --case night day     the rooms of research/scenes/rooms
    python -m research.scenes.by_day FOLDER --scene held-out --case night day  those of research/scenes/held_out

    FOLDER/office-day-1/plan.toml, room.toml, scan.glb, truth/   as in scenes/, the windows in the plan besides

Truth is the room's at night: plan.toml has the windows as panes of dark glass. The windows' light in the picture, and
all that is reflected, come from `virtual_rooms.day_light`, not from the product's trace. Each seed has its own
exposure, white balance and tone curve.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.spectra.databases import color_matching_functions, lamp_spectrum
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.spectrum_files import TableRow, read_table, write_table
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from research.scenes.build import (
    SCENES,
    VISIBLE_NM,
    WAVELENGTH_STEP_NM,
    Besides,
    Built,
    lamp_coefficients,
    phone_scan,
    spectral_flux,
    write_points,
    write_run_file,
    write_truth,
)
from research.virtual_rooms.camera import DirectLight, SurfaceLight
from research.virtual_rooms.day_light import (
    Opening,
    Sun,
    flux_per_zenith,
    opening_of,
    reflected_light,
    straight_light,
    sunlight,
)
from research.virtual_rooms.room_plan import BoxSection, CameraSection, Curve, RoomPlan, read_plan
from research.virtual_rooms.true_room import TrueRoom, true_room

WINDOW = "window"  # names of parts that are windows begin so
GLASS = "window glass"
# Boxes flush in an outer wall, low and high corners [m].
WINDOWS = {
    "office": (((3.09, 1.6, 0.95), (3.14, 2.8, 2.05)),),
    "apartment": (((3.2, -0.04, 0.9), (4.8, 0.01, 2.1)), ((0.8, 6.29, 0.9), (2.0, 6.34, 2.1))),
    "large-office": (((1.5, -0.04, 0.9), (4.5, 0.01, 2.2)), ((7.0, -0.04, 0.9), (10.0, 0.01, 2.2))),
}
OTHER_ROOMS = Path(__file__).parent / "rooms"
HELD_OUT_ROOMS = Path(__file__).parent / "held_out"
# Of the rooms in these two folders, which have these cases alone.
OTHER_WINDOWS = {
    "corridor": (((0.3, -0.04, 0.9), (1.2, 0.01, 2.1)), ((4.79, 2.5, 0.9), (4.84, 4.3, 2.1))),
    "kitchen": (((1.3, -0.04, 1.0), (2.7, 0.01, 2.1)),),
    "red-room": (((4.59, 1.5, 0.8), (4.64, 3.1, 2.2)),),
    "timber-study": (((4.19, 1.8, 0.9), (4.24, 3.0, 2.0)),),
}
HELD_OUT_WINDOWS = {
    "dark-room": (((4.19, 0.5, 1.0), (4.24, 1.5, 2.0)),),
    "l-shape": (((4.99, 0.5, 0.9), (5.04, 1.9, 2.1)), ((4.2, 4.99, 1.1), (4.8, 5.04, 2.0))),
    "red-wall": (((1.0, -0.04, 0.9), (2.0, 0.01, 2.1)),),
    "light-kitchen": (((3.39, 0.9, 1.0), (3.44, 2.1, 2.0)),),
}
GROUPS = {"other": OTHER_WINDOWS, "held-out": HELD_OUT_WINDOWS}
OTHER_CASES = ("night", "day")
CARDS = {"grey card": 0.18, "white paper": 0.85}  # [1] reflectance
CARD_M = (0.3, 0.21)
CARDS_AT = {  # middles on the floor [m]
    "office": ((1.1, 0.5), (1.5, 0.8)),
    "apartment": ((3.6, 1.0), (3.6, 0.5)),
    "large-office": ((4.1, 2.2), (4.1, 2.7)),
}
# [1] of all windows over all lamps, in lumens
FLUX_RATIO = {
    "office": 1.0, "apartment": 2.0, "large-office": 1.0,
    "corridor": 1.0, "kitchen": 1.5, "red-room": 2.0, "timber-study": 1.0,
    "dark-room": 0.5, "l-shape": 1.0, "red-wall": 1.5, "light-kitchen": 2.0,
}  # fmt: skip
SUN_AT = {"office": (30.0, 40.0), "apartment": (-70.0, 35.0), "large-office": (-110.0, 35.0)}  # [deg] azimuth, height
SHADE = "floor lamp"  # names of the parts that are its shade, stand and foot begin so
SHADE_M, SHADE_LOW_M, STAND_M = (0.3, 0.3, 0.3), 1.35, 0.03
SHADE_AT = {"office": (0.75, 0.5), "apartment": (2.2, 0.6), "large-office": (6.0, 4.4)}  # [m] middle
# Tone curve, exposure (share of white at which the brightest 3 % are), white balance; lifted, plain sRGB, lifted more.
CAMERAS: tuple[tuple[float | Curve, float, float], ...] = ((0.6, 0.8, 0.85), (0.0, 0.6, 0.6), (1.2, 0.4, 1.0))
HELD_OUT_CAMERAS: tuple[tuple[float | Curve, float, float], ...] = ((0.9, 0.7, 0.75), ("filmic", 0.55, 0.95))


@dataclass(frozen=True, kw_only=True)
class RoomByDay:
    """A room, its windows, and the camera that scans it.

    Parameters
    ----------
    name : str
        Of the room.
    plan : str
        Text of its plan, without windows; it names `reflectances.csv`.
    reflectances : Path
        That table.
    points : Path or None
        Sensor points, where the plan names a file of them.
    windows : sequence of (low corner, high corner)
        Boxes flush in a wall. [m]
    flux_ratio : float
        Luminous flux of all windows by day over that of all lamps. [1]
    tone : float or 'filmic' or 'lifted'
        Strength of the camera's tone curve, or its curve.
    bright_level, white_balance : float
        As in a plan's `[camera]`.
    """

    name: str
    plan: str
    reflectances: Path
    points: Path | None
    windows: Sequence[tuple[tuple[float, ...], tuple[float, ...]]]
    flux_ratio: float
    tone: float | Curve
    bright_level: float
    white_balance: float


@dataclass(frozen=True, kw_only=True)
class Case:
    """A light that a room is scanned in.

    Parameters
    ----------
    day : float
        Factor on the windows' light. [1]
    lamps : float
        Factor on the lamps' light. [1]
    open_share : float
        Share of a window that its blind leaves free, from below. [0-1]
    pane : bool
        Whether the scan has the glass as a surface; else there is a hole.
    cards : bool
        Whether a grey card and a sheet of white paper lie on the floor.
    sun : float
        Flux of the sun through the windows, over the sky's there. [1]
    shade : float
        Flux of a floor lamp that the run file does not have, over all lamps'. [1]
    """

    day: float = 1.0
    lamps: float = 1.0
    open_share: float = 1.0
    pane: bool = True
    cards: bool = False
    sun: float = 0.0
    shade: float = 0.0


CASES = {
    "night": Case(day=0.0),
    "day": Case(),
    "blinds": Case(open_share=0.5),
    "off": Case(lamps=0.0),
    "holes": Case(pane=False),
    "cards": Case(cards=True),
    "sun": Case(sun=2.0),
    "hazy": Case(sun=0.3),
    "floor-lamp": Case(day=0.0, shade=0.5),
}


def build_by_day(scene: str, case: Case, folder: Path, *, seed: int, besides: Besides | None = None) -> Built:
    """Make a scan of a scene, and its truth.

    Parameters
    ----------
    scene : str
        In `WINDOWS`, `OTHER_WINDOWS` or `HELD_OUT_WINDOWS`.
    case : Case
    folder : Path
        Made.
    seed : int
        Of the shape's noise; it chooses the camera too.
    besides : callable, optional
        What else is made of the same shape and light.

    Returns
    -------
    built : Built
    """
    return build_room(room_by_day(scene, seed), case, folder, seed=seed, besides=besides)


def build_room(room_plan: RoomByDay, case: Case, folder: Path, *, seed: int, besides: Besides | None = None) -> Built:
    """Make a scan of a room and its truth, as `build_by_day`; `seed` is of the shape's noise."""
    (folder / "truth").mkdir(parents=True, exist_ok=True)
    plan = plan_by_day(room_plan, case, folder)
    room = true_room(plan)
    wavelengths = np.arange(VISIBLE_NM[0], VISIBLE_NM[1] + WAVELENGTH_STEP_NM / 2, WAVELENGTH_STEP_NM)
    direct = _direct(room_plan, case, plan, room, folder, wavelengths)
    generator = np.random.default_rng(seed + 1000)
    positions, faces = room.sample(plan.file.camera.light_spacing_m, generator)
    normals = room.normals[faces]
    straight = direct(positions, normals)
    reflectance = np.stack([m.reflectance.at(wavelengths, outside="nearest") for m in room.materials])
    reflected = reflected_light(
        room, positions, normals, reflectance[room.face_material[faces]], straight, generator
    )  # fmt: skip
    light = SurfaceLight(
        positions=positions, normals=normals, wavelengths_nm=wavelengths, direct=straight, reflected=reflected
    )
    shining = np.array(
        [
            (surface.lamp is not None and case.lamps > 0)
            or (surface.part.startswith(WINDOW) and case.day > 0)
            or surface.part == SHADE
            for surface in room.surfaces
        ]
    )
    built = phone_scan(
        plan,
        room,
        folder,
        seed=seed,
        light=light,
        direct=direct,
        shining=shining,
        without=None if case.pane else WINDOW,
        besides=besides,
    )
    write_truth(folder / "truth", plan, room, built.true_face)
    write_run_file(folder / "room.toml", plan.file, built.file)
    if case.cards:
        with (folder / "room.toml").open("a", encoding="utf-8") as file:
            file.write(_told_cards(room_plan.name))
    if room_plan.points is not None:
        (folder / "points.csv").write_bytes(room_plan.points.read_bytes())
    write_points(folder)
    return built


def plan_folder(scene: str) -> Path:
    """Where the plan of a room is."""
    if scene in HELD_OUT_WINDOWS:
        return HELD_OUT_ROOMS / scene
    return OTHER_ROOMS / scene if scene in OTHER_WINDOWS else SCENES / scene


def room_by_day(scene: str, seed: int) -> RoomByDay:
    """A scene's plan, windows and daylight, with the camera that a seed chooses."""
    source = plan_folder(scene)
    points = source / "points.csv"
    cameras = HELD_OUT_CAMERAS if scene in HELD_OUT_WINDOWS else CAMERAS
    tone, level, balance = cameras[(seed - 1) % len(cameras)]
    return RoomByDay(
        name=scene,
        plan=(source / "plan.toml").read_text().replace('"../reflectances.csv"', '"reflectances.csv"'),
        reflectances=source.parent / "reflectances.csv",
        points=points if points.is_file() else None,
        windows=(WINDOWS | OTHER_WINDOWS | HELD_OUT_WINDOWS)[scene],
        flux_ratio=FLUX_RATIO[scene],
        tone=tone,
        bright_level=level,
        white_balance=balance,
    )


def plan_by_day(room_plan: RoomByDay, case: Case, folder: Path) -> RoomPlan:
    """The room's plan with windows and its camera, written to the folder and read again."""
    text = room_plan.plan
    (folder / "reflectances.csv").write_bytes(room_plan.reflectances.read_bytes())
    text += f'\n[[materials]]\nname = "{GLASS}"\nreflectance = "plastic-black"\n'
    for number, (low, high) in enumerate(room_plan.windows):
        top = low[2] + case.open_share * (high[2] - low[2])
        text += (
            f'\n[[parts]]\nname = "{WINDOW} {number + 1}"\nshape = "box"\nlow = {list(low)}\n'
            f'high = {[high[0], high[1], round(top, 3)]}\nmaterial = "{GLASS}"\n'
        )
    if case.cards:
        text += _cards(room_plan.name, folder / "reflectances.csv")
    if case.shade > 0:
        text += _floor_lamp(room_plan.name)
    (folder / "plan.toml").write_text(text)
    plan = read_plan(folder / "plan.toml")
    curve = {"curve": room_plan.tone} if isinstance(room_plan.tone, str) else {"tone": room_plan.tone}
    exposure = {"bright_level": room_plan.bright_level, "white_balance": room_plan.white_balance}
    camera = plan.file.camera.model_dump() | curve | exposure
    return replace(plan, file=plan.file.model_copy(update={"camera": CameraSection(**camera)}))


def _floor_lamp(scene: str) -> str:
    """Parts and material of a floor lamp, dark."""
    half, low, at = 0.5 * np.array(SHADE_M), SHADE_LOW_M, np.array(SHADE_AT[scene])
    boxes = {
        SHADE: ((*(at - half[:2]), low), (*(at + half[:2]), low + SHADE_M[2])),
        f"{SHADE} stand": ((*(at - STAND_M / 2), 0.02), (*(at + STAND_M / 2), low)),
        f"{SHADE} foot": ((*(at - half[:2]), 0.0), (*(at + half[:2]), 0.02)),
    }
    text = f'\n[[materials]]\nname = "{SHADE}"\nreflectance = "door-white"\n'
    for name, corners in boxes.items():
        low_corner, high_corner = ([round(float(value), 3) for value in corner] for corner in corners)
        text += f'\n[[parts]]\nname = "{name}"\nshape = "box"\nlow = {low_corner}\nhigh = {high_corner}\n'
        text += f'material = "{SHADE}"\n'
    return text


def _cards(scene: str, table: Path) -> str:
    """Parts and materials of the plan; their reflectances are added to the table."""
    rows = list(read_table(table))
    wavelengths = rows[0].spectrum.wavelengths_nm
    text = ""
    for (name, value), (x, y) in zip(CARDS.items(), CARDS_AT[scene], strict=True):
        key = name.replace(" ", "-")
        flat = Spectrum(wavelengths_nm=wavelengths, values=np.full(wavelengths.size, value))
        rows.append(TableRow(id=key, name=name, category="paper", spectrum=flat))
        low = [round(x - CARD_M[0] / 2, 3), round(y - CARD_M[1] / 2, 3), -0.01]
        high = [round(x + CARD_M[0] / 2, 3), round(y + CARD_M[1] / 2, 3), 0.004]
        text += f'\n[[materials]]\nname = "{name}"\nreflectance = "{key}"\n'
        text += f'\n[[parts]]\nname = "{name}"\nshape = "box"\nlow = {low}\nhigh = {high}\nmaterial = "{name}"\n'
    write_table(table, rows)
    return text


def _told_cards(scene: str) -> str:
    """The cards as a run file has them."""
    return "".join(
        f"\n[[materials.cards]]\ncenter = [{x}, {y}, 0.0]\nsize = {min(CARD_M)}\nreflectance = {value}\n"
        for value, (x, y) in zip(CARDS.values(), CARDS_AT[scene], strict=True)
    )


def _direct(
    room_plan: RoomByDay, case: Case, plan: RoomPlan, room: TrueRoom, folder: Path, wavelengths: FloatArray
) -> DirectLight:
    lamps = resolve_lamps(plan.file.lamps, folder)
    flux = spectral_flux(lamps, wavelengths)
    openings = openings_of(room_plan.flux_ratio, case, plan, folder, wavelengths)
    sun = _sun(room_plan.name, case, openings, wavelengths) if case.sun > 0 else None
    window = window_faces(room)
    shade = _sides_of_shade(room_plan.name, case, flux, wavelengths) if case.shade > 0 else []

    def light(positions: FloatArray, normals: FloatArray) -> FloatArray:
        total = np.zeros((len(positions), wavelengths.size))
        if case.lamps > 0:
            total += case.lamps * lamp_coefficients(room, lamps, positions, normals) @ flux
        if case.day > 0:
            total += straight_light(room, openings, positions, normals)
        if sun is not None:
            total += sunlight(room, sun, window, positions, normals)
        if shade:
            total += straight_light(room, shade, positions, normals)
        return total

    return light


def window_faces(room: TrueRoom) -> BoolArray:
    """(face,) of the room's scan that are windows."""
    windows = np.array([surface.part.startswith(WINDOW) for surface in room.surfaces])
    return np.asarray(windows[room.face_surface], dtype=np.bool_)


def _sun(scene: str, case: Case, openings: Sequence[Opening], wavelengths: FloatArray) -> Sun:
    azimuth, height = np.radians(SUN_AT[scene])
    toward = np.array([np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth), np.sin(height)])
    color = lamp_spectrum("D50").spectrum.at(wavelengths, outside="nearest")
    luminous = color_matching_functions(wavelengths)[:, 1]
    sky = sum(flux_per_zenith(each) * float(each.radiance @ luminous) for each in openings)
    facing = sum(each.area * max(0.0, float(-each.normal @ toward)) for each in openings)
    return Sun(toward=toward, irradiance=color * case.sun * sky / (facing * float(color @ luminous)))


def _sides_of_shade(scene: str, case: Case, lamp_flux: FloatArray, wavelengths: FloatArray) -> list[Opening]:
    """The upright sides of a floor lamp's shade, evenly bright."""
    x, y = SHADE_AT[scene]
    wide, deep, tall = SHADE_M
    color = lamp_spectrum("A").spectrum.at(wavelengths, outside="nearest")
    luminous = color_matching_functions(wavelengths)[:, 1]
    flux = case.shade * float((lamp_flux @ luminous).sum())
    radiance = color * flux / (np.pi * 2 * (wide + deep) * tall * float(color @ luminous))
    up = np.array([0.0, 0.0, tall])
    sides = []
    for normal in np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]]):
        along = np.array([-normal[1] * wide, normal[0] * deep, 0.0])
        middle = np.array([x, y, SHADE_LOW_M]) + 0.5 * normal * np.array([wide, deep, 0.0])
        sides.append(
            Opening(corner=middle - 0.5 * along, along=along, up=up, normal=normal, radiance=radiance, even=True)
        )
    return sides


def openings_of(flux_ratio: float, case: Case, plan: RoomPlan, folder: Path, wavelengths: FloatArray) -> list[Opening]:
    """The windows of a room, in the order of its parts, with the radiance that they have in a case.

    `flux_ratio` is the luminous flux of all windows over that of all lamps.
    """
    flux = spectral_flux(resolve_lamps(plan.file.lamps, folder), wavelengths)
    luminous = color_matching_functions(wavelengths)[:, 1]
    daylight = lamp_spectrum("D65").spectrum.at(wavelengths, outside="nearest")
    inside = np.mean([0.5 * (np.array(each.low) + np.array(each.high)) for each in plan.file.rooms], axis=0)
    boxes = [part for part in plan.file.parts if isinstance(part, BoxSection) and part.name.startswith(WINDOW)]
    openings: list[Opening] = [opening_of(box, inside, daylight) for box in boxes]
    per_zenith = sum(flux_per_zenith(opening) for opening in openings)
    zenith = flux_ratio * float((flux @ luminous).sum()) / (per_zenith * float(daylight @ luminous))
    return [replace(opening, radiance=case.day * zenith * daylight) for opening in openings]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    choices = (*sorted(WINDOWS), *(room for group in GROUPS.values() for room in sorted(group)), *GROUPS)
    parser.add_argument("--scene", nargs="+", choices=choices, default=sorted(WINDOWS))
    parser.add_argument("--case", nargs="+", choices=sorted(CASES), default=list(CASES))
    parser.add_argument("--seed", nargs="+", type=int, default=[1, 2, 3])
    given = parser.parse_args(arguments)
    scenes = [room for scene in given.scene for room in sorted(GROUPS.get(scene, [scene]))]
    if not set(scenes) <= set(WINDOWS) and not set(given.case) <= set(OTHER_CASES):
        folders = f"{OTHER_ROOMS.name} and {HELD_OUT_ROOMS.name}"
        parser.error(f"the rooms of {folders} have the cases {', '.join(OTHER_CASES)} alone: give --case")
    for scene in scenes:
        for name in given.case:
            for seed in given.seed:
                built = build_by_day(scene, CASES[name], given.folder / f"{scene}-{name}-{seed}", seed=seed)
                print(f"{built.file}: {built.words}", flush=True)


if __name__ == "__main__":
    main()
