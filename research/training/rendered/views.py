"""Views into rooms of boxes, as a phone holds them, with the class of every pixel.

    light = reflectance x irradiance x (1 - F) + F x what is mirrored + what a surface gives itself

Irradiance is that of the lamps and windows with shadows, the sun through a window, and light from everywhere, less
near corners. F is Fresnel's reflectance as Schlick has it. What is mirrored is blurred by as much as the surface is
rough, in the picture.

References
----------
Schlick (1994) An inexpensive BRDF model for physically-based rendering, Computer Graphics Forum 13(3), Eq. 15.
"""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d, interpolate

from research.training.pictures import CLASSES
from research.training.rendered.boxes import PANELS, SHELL, WINDOWS, Hits, Rooms, clear, make_rooms, nearest
from research.training.rendered.dressings import PLACES
from research.training.rendered.shading import albedo
from research.training.rendered.surfaces import Wardrobe

NO_CLASS = -1
LIFT_M = 2e-3  # [m] shadow and mirrored rays start just off the surface
MIN_LAMP_M = 0.3  # [m] nearer lamps light as from here
CORNER_M, CORNER = 0.35, 0.45  # [m], [1] reach and strength of the dimming in corners
SCAN_SHARE, SCAN_M = 0.4, (0.002, 0.025)  # [1], [m] share of views as of a scan's texture, and its texels
SUN_SHARE = 0.3  # [1] of rooms
BLURS_PX = (5, 17)  # [px] windows by which what is mirrored is blurred at half and full roughness
HOLES, HOLE_PARTS = 2.3, 14  # [1] threshold of a noise above which a scan has a hole, and its bumps along an edge
FLASH = 0.05  # [1] share of views with a lamp at the camera


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """Pictures and what they show.

    Parameters
    ----------
    light : (picture, 3, row, column) float
        Linear, in any unit.
    label : (picture, row, column) int64
        Of `pictures.CLASSES`, `NO_CLASS` where it does not count.
    """

    light: Tensor
    label: Tensor


def room_views(wardrobe: Wardrobe, count: int, size_px: int, *, samples: int = 2) -> Batch:
    """Render one view of each of `count` new rooms.

    Parameters
    ----------
    wardrobe : Wardrobe
    count : int
    size_px : int
        Edge of the pictures. [px]
    samples : int
        Rays of each pixel that texture is averaged over; light is found for the first.

    Returns
    -------
    batch : Batch
    """
    rooms = make_rooms(wardrobe, count)
    surfaces = wardrobe.surfaces(rooms.places.reshape(-1))
    number_of = torch.arange(rooms.places.numel(), device=wardrobe.device).reshape(rooms.places.shape)
    eye, turn, half = _cameras(wardrobe, rooms)
    scan = torch.where(
        wardrobe.random(count) < SCAN_SHARE, SCAN_M[0] + wardrobe.random(count) * (SCAN_M[1] - SCAN_M[0]), 0.0
    )
    color = torch.zeros((count, size_px**2, 3), device=wardrobe.device)
    for sample in range(samples):
        rays = _rays(wardrobe, turn, half, size_px)
        hits = nearest(rooms, eye[:, None], rays)
        number = number_of.gather(1, hits.surface)
        points = eye[:, None] + hits.distance[:, :, None] * rays
        seen, joint = _seen_color(wardrobe, surfaces, number, hits, points, rays, 2.0 * half / size_px, scan)
        color += seen / samples
        if not sample:
            first = (rays, hits, number, points, joint)
    rays, hits, number, points, joint = first
    normal = _normals(hits, rays)
    falling = _smooth(irradiance(wardrobe, rooms, points, normal, hits, eye), hits.surface, size_px)
    mirrored = _mirrored(rooms, surfaces, number_of, points, normal, rays)
    cosine = -(rays * normal).sum(dim=2) / rays.norm(dim=2)
    base = surfaces["mirroring"][number] * (1.0 - joint)
    share = torch.where(base > 0, base + (1.0 - base) * (1.0 - cosine).clamp(0, 1) ** 5, 0.0)
    share = share * (1.0 - 0.7 * surfaces["rough"][number] * (1.0 - base))
    sharp = _blurred(mirrored, surfaces["rough"][number], size_px)
    own = rooms.emission.gather(1, hits.surface[:, :, None].expand(-1, -1, 3))
    light = color * (falling + own) * (1.0 - share[:, :, None]) + share[:, :, None] * sharp
    label = surfaces["label"][number]
    for panel in PANELS:
        label = torch.where(hits.surface == SHELL + panel, NO_CLASS, label)
    for window in WINDOWS:
        label = torch.where(hits.surface == SHELL + window, CLASSES.index("glass"), label)
    holes = _holes(wardrobe, scan, size_px)
    label = torch.where(holes, NO_CLASS, label.reshape(count, size_px, size_px))
    return Batch(light=torch.where(holes[:, None], 0.0, _picture(light, size_px)), label=label)


def _holes(wardrobe: Wardrobe, scan: Tensor, size_px: int) -> Tensor:
    """(room, row, column) where a scan shows nothing: blots in half of the views of scans."""
    noise = wardrobe.normal(len(scan), 1, HOLE_PARTS, HOLE_PARTS)
    noise = interpolate(noise, size=size_px, mode="bilinear", align_corners=False)[:, 0]
    torn = (scan > 0) & (wardrobe.random(len(scan)) < 0.5)
    return (noise > HOLES) & torn[:, None, None]


def _cameras(wardrobe: Wardrobe, rooms: Rooms) -> tuple[Tensor, Tensor, Tensor]:
    """(room, 3) eyes, (room, 3, 3) right, down and forward, (room,) tangent of half the field of view."""
    count, device = len(rooms.size), wardrobe.device
    random = wardrobe.random
    way = torch.multinomial(
        torch.tensor([0.42, 0.38, 0.1, 0.1], device=device), count, replacement=True, generator=wardrobe.generator
    )  # about the room, at the floor, at the walls, at the ceiling

    def each(*bounds: tuple[float, float]) -> Tensor:
        low, high = torch.tensor(bounds, device=device)[way].unbind(dim=1)
        return low + random(count) * (high - low)

    eye = (0.06 + 0.88 * random(count, 3)) * rooms.size
    height = each((0.3, 2.2), (0.2, 1.7), (0.5, 2.0), (0.5, 2.0))
    eye[:, 2] = torch.minimum(height, 0.93 * rooms.size[:, 2])
    pitch = torch.deg2rad(each((-40.0, 20.0), (-85.0, -20.0), (-15.0, 15.0), (15.0, 75.0)))
    yaw, roll = 2.0 * torch.pi * random(count), 0.07 * wardrobe.normal(count)
    forward = torch.stack([pitch.cos() * yaw.cos(), pitch.cos() * yaw.sin(), pitch.sin()], dim=1)
    level = torch.stack([yaw.sin(), -yaw.cos(), torch.zeros_like(yaw)], dim=1)
    under = torch.linalg.cross(forward, level)
    right = roll.cos()[:, None] * level + roll.sin()[:, None] * under
    down = roll.cos()[:, None] * under - roll.sin()[:, None] * level
    half = torch.tan(torch.deg2rad(0.5 * each((50.0, 100.0), (40.0, 85.0), (40.0, 80.0), (45.0, 90.0))))
    return eye, torch.stack([right, down, forward], dim=1), half


def _rays(wardrobe: Wardrobe, turn: Tensor, half: Tensor, size_px: int) -> Tensor:
    """(room, pixel, 3) directions through random places of the pixels; 1 long along the view."""
    count = len(turn)
    step = torch.arange(size_px, device=turn.device)
    row, column = torch.meshgrid(step, step, indexing="ij")
    place = torch.stack([column, row], dim=2).reshape(1, -1, 2) + wardrobe.random(count, size_px**2, 2)
    across = (2.0 * place / size_px - 1.0) * half[:, None, None]
    return torch.cat([across, torch.ones_like(across[:, :, :1])], dim=2) @ turn


def _normals(hits: Hits, rays: Tensor) -> Tensor:
    """(room, ray, 3) of what is met, towards where the ray comes from."""
    sign = -torch.sign(rays.gather(2, hits.axis[:, :, None]))
    return torch.zeros_like(rays).scatter(2, hits.axis[:, :, None], sign)


def _seen_color(
    wardrobe: Wardrobe,
    surfaces: dict[str, Tensor],
    number: Tensor,
    hits: Hits,
    points: Tensor,
    rays: Tensor,
    pixel: Tensor,
    scan: Tensor,
) -> tuple[Tensor, Tensor]:
    """Reflectance and joints where rays meet surfaces; on upright ones the first axis of a texture is height."""
    x = torch.where(hits.axis == 2, points[:, :, 0], points[:, :, 2])
    y = torch.where(hits.axis == 0, points[:, :, 1], torch.where(hits.axis == 1, points[:, :, 0], points[:, :, 1]))
    along = rays.gather(2, hits.axis[:, :, None])[:, :, 0].abs() / rays.norm(dim=2)
    footprint = torch.maximum(pixel[:, None] * hits.distance / along.clamp_min(0.05).sqrt(), scan[:, None])
    flat = (each.reshape(-1) for each in (number, x, y, footprint))
    color, joint = albedo(wardrobe.textures, surfaces, *flat)
    return color.reshape(*number.shape, 3), joint.reshape(number.shape)


def irradiance(wardrobe: Wardrobe, rooms: Rooms, points: Tensor, normal: Tensor, hits: Hits, eye: Tensor) -> Tensor:
    """(room, point, 3) light that falls on surfaces; shadow rays end at random places of the lamps."""
    count = len(points)
    start = points + LIFT_M * normal
    walls = torch.stack([points, rooms.size[:, None] - points], dim=3).amin(dim=3)  # from the nearer of two
    corners = 1.0 - CORNER * torch.exp(-walls / CORNER_M)
    corners = torch.where(normal.abs() > 0.5, torch.ones_like(corners), corners).prod(dim=2)
    total = rooms.ambient[:, None] * corners[:, :, None]
    middle = 0.5 * (rooms.size[:, None] - 0.0)
    up = middle + (wardrobe.random(*points.shape) - 0.5) * rooms.size[:, None] * 0.9
    near = (up - start) / (up - start).norm(dim=2, keepdim=True).clamp_min(1e-3)
    total = total * (0.45 + 0.55 * clear(rooms, start, near, skip=PANELS)[:, :, None])
    lamps = [(rooms.lamps[:, k], rooms.power[:, k], rooms.radius_m[:, k]) for k in range(rooms.lamps.shape[1])]
    flash = (wardrobe.random(count, 1) < FLASH) * 0.7 * torch.ones_like(eye)
    lamps.append((eye, flash, torch.full_like(eye[:, 0], 0.01)))
    for place, power, radius in lamps:
        jitter = radius[:, None, None] * (2.0 * wardrobe.random(*points.shape) - 1.0)
        sight = place[:, None] + jitter - start
        square = (sight**2).sum(dim=2).clamp_min(MIN_LAMP_M**2)
        cosine = ((sight * normal).sum(dim=2) / square.sqrt()).clamp_min(0.0)
        share = cosine / square * clear(rooms, start, sight, skip=WINDOWS + PANELS)
        total = total + share[:, :, None] * power[:, None]
    return total + _sunlight(wardrobe, rooms, start, normal)


def _sunlight(wardrobe: Wardrobe, rooms: Rooms, start: Tensor, normal: Tensor) -> Tensor:
    """(room, point, 3) light of a sun that shines through the first window, as a patch with straight edges."""
    count = len(start)
    low, high = rooms.low[:, WINDOWS[0]], rooms.high[:, WINDOWS[0]]
    axis = (high - low)[:, :2].argmin(dim=1)
    outwards = torch.where(low.gather(1, axis[:, None]) < 0.1, -1.0, 1.0)
    sun = 0.6 * wardrobe.normal(count, 3)
    sun = sun.scatter(1, axis[:, None], outwards)
    sun[:, 2] = 0.3 + 0.9 * wardrobe.random(count)
    plane = low.gather(1, axis[:, None])
    reach = (plane - start.gather(2, axis[:, None, None].expand(-1, start.shape[1], 1))[:, :, 0]) / outwards
    through = start + reach[:, :, None] * sun[:, None]
    off = torch.maximum(low[:, None] - through, through - high[:, None])
    off = off.scatter(2, axis[:, None, None].expand(-1, start.shape[1], 1), -1.0).amax(dim=2)
    facing = ((normal * sun[:, None]).sum(dim=2) / sun.norm(dim=1)[:, None]).clamp_min(0.0)
    lit = (-off / 0.01).clamp(0, 1) * facing * clear(rooms, start, reach[:, :, None] * sun[:, None], skip=WINDOWS)
    shines = (wardrobe.random(count) < SUN_SHARE) * torch.exp(0.5 * wardrobe.normal(count)) * 2.5
    tint = torch.tensor([1.08, 1.0, 0.85], device=start.device)
    return (lit * shines[:, None])[:, :, None] * tint


def _mirrored(
    rooms: Rooms, surfaces: dict[str, Tensor], number_of: Tensor, points: Tensor, normal: Tensor, rays: Tensor
) -> Tensor:
    """(room, ray, 3) light that comes from where surfaces would mirror, of mean colours without shadows."""
    back = rays - 2.0 * (rays * normal).sum(dim=2, keepdim=True) * normal
    start = points + LIFT_M * normal
    hits = nearest(rooms, start, back)
    place = start + hits.distance[:, :, None] * back
    facing = _normals(hits, back)
    falling = rooms.ambient[:, None].expand_as(place).clone()
    for k in range(rooms.lamps.shape[1]):
        sight = rooms.lamps[:, k, None] - place
        square = (sight**2).sum(dim=2).clamp_min(MIN_LAMP_M**2)
        cosine = ((sight * facing).sum(dim=2) / square.sqrt()).clamp_min(0.0)
        falling += (cosine / square)[:, :, None] * rooms.power[:, k, None]
    falling += rooms.emission.gather(1, hits.surface[:, :, None].expand(-1, -1, 3))
    return surfaces["color"][number_of.gather(1, hits.surface)] * falling


def _picture(values: Tensor, size_px: int) -> Tensor:
    """(room, channel, row, column) of (room, pixel, channel)."""
    return values.permute(0, 2, 1).reshape(len(values), -1, size_px, size_px)


def _blurred(values: Tensor, rough: Tensor, size_px: int) -> Tensor:
    """(room, pixel, 3) blurred by roughness, twice as far down the picture as across."""
    sharp = _picture(values, size_px)
    levels = [sharp]
    for window in BLURS_PX:
        blurred = levels[-1]
        for _ in range(2):
            blurred = avg_pool2d(
                blurred, (window, window // 4 * 2 + 1), 1, (window // 2, window // 4), count_include_pad=False
            )
        levels.append(blurred)
    share = (2.0 * rough.reshape(len(values), 1, size_px, size_px)).clamp(0, 2)
    half, full = share.clamp_max(1.0), (share - 1.0).clamp_min(0.0)
    mixed = torch.lerp(torch.lerp(levels[0], levels[1], half), levels[2], full)
    return mixed.flatten(2).permute(0, 2, 1)


def _smooth(values: Tensor, surface: Tensor, size_px: int) -> Tensor:
    """(room, pixel, 3) means over the neighbours on the same surface, against the noise of random shadow rays."""
    picture = _picture(values, size_px)
    own = surface.reshape(len(values), 1, size_px, size_px)
    for step in (1, 2):
        total, weight = picture.clone(), torch.ones_like(picture[:, :1])
        for down in (-step, 0, step):
            for across in (-step, 0, step):
                if down or across:
                    alike = (torch.roll(own, (down, across), (2, 3)) == own).float()
                    total += alike * torch.roll(picture, (down, across), (2, 3))
                    weight += alike
        picture = total / weight
    return picture.flatten(2).permute(0, 2, 1)


COLLAGE_M = (0.0005, 0.004)  # [m] that a pixel of a collage covers, as a surface is seen from near
COLLAGE_REPEAT_PX, FITTING_SHARE = (40.0, 400.0), 0.75  # [px], [1] or how large the texture is in it, and how often
PIECES = (0.3, 0.25, 0.2, 0.15, 0.1)  # [1] how often a collage has 1, 2, ... pieces
LEAST_ASPECT = 0.5  # [1] foreshortening


def collages(wardrobe: Wardrobe, count: int, size_px: int) -> Batch:
    """Pictures put together of pieces of surfaces, each seen in its own scale, turn and slant; all classes evenly.

    Parameters
    ----------
    wardrobe : Wardrobe
    count : int
    size_px : int
        [px]

    Returns
    -------
    batch : Batch
    """
    device, most = wardrobe.device, len(PIECES)
    surfaces = wardrobe.surfaces(torch.full((count * most,), PLACES.index("collage"), device=device))
    step = torch.arange(size_px, device=device).float()
    y, x = (each.reshape(1, -1) for each in torch.meshgrid(step, step, indexing="ij"))
    seeds = size_px * wardrobe.random(count, most, 2)
    pieces = 1 + wardrobe.choose(torch.tensor(PIECES, device=device).repeat(count, 1))
    away = (x[:, None] - seeds[:, :, :1]).abs() ** 2 + (y[:, None] - seeds[:, :, 1:]).abs() ** 2
    away = torch.where(torch.arange(most, device=device)[None, :, None] < pieces[:, None, None], away, torch.inf)
    piece = away.argmin(dim=1)
    drawn = wardrobe.random(count, most)
    low, high = torch.log(torch.tensor(COLLAGE_M)).tolist()
    scale = torch.exp(low + drawn * (high - low))
    low, high = torch.log(torch.tensor(COLLAGE_REPEAT_PX)).tolist()
    fitting = surfaces["repeat_m"].reshape(count, most) / torch.exp(low + drawn * (high - low))
    scale = torch.where(wardrobe.random(count, most) < FITTING_SHARE, fitting, scale)
    turn, lean = (2.0 * torch.pi * wardrobe.random(count, most) for _ in range(2))
    aspect = LEAST_ASPECT + (1.0 - LEAST_ASPECT) * wardrobe.random(count, most)
    slope = 0.4 * wardrobe.normal(count, most) / size_px

    def of(values: Tensor) -> Tensor:
        return values.gather(1, piece)

    x, y = x - 0.5 * size_px, y - 0.5 * size_px
    leaning = of(lean).cos() * x + of(lean).sin() * y
    across = -of(lean).sin() * x + of(lean).cos() * y
    depth = 1.0 / (1.0 - of(slope) * leaning).clamp(0.4, 2.5)
    metres = of(scale) * depth
    u, v = metres * leaning / of(aspect), metres * across
    u, v = of(turn).cos() * u - of(turn).sin() * v, of(turn).sin() * u + of(turn).cos() * v
    number = most * torch.arange(count, device=device)[:, None] + piece
    flat = (each.reshape(-1) for each in (number, u, v, metres / of(aspect).sqrt()))
    color, _ = albedo(wardrobe.textures, surfaces, *flat)
    level = torch.exp(of(0.5 * wardrobe.normal(count, most)) * leaning / size_px)
    edge = (leaning - size_px * (of(wardrobe.random(count, most)) - 0.5)) / (
        size_px * of(0.01 + 0.2 * wardrobe.random(count, most))
    )
    shade = of((wardrobe.random(count, most) < 0.15) * (0.1 + 0.5 * wardrobe.random(count, most)))
    level = level * (1.0 - shade * torch.sigmoid(edge)) * torch.exp(of(0.3 * wardrobe.normal(count, most)))
    light = color.reshape(count, -1, 3) * level[:, :, None]
    label = surfaces["label"][number].reshape(count, size_px, size_px)
    return Batch(light=_picture(light, size_px), label=label)


def coarser(batch: Batch, factor: float) -> Batch:
    """The same at fewer pixels and back, as a picture of poor resolution."""
    size = batch.light.shape[-1]
    small = interpolate(batch.light, size=round(size * factor), mode="bilinear", antialias=True, align_corners=False)
    return Batch(light=interpolate(small, size=size, mode="bilinear", align_corners=False), label=batch.label)
