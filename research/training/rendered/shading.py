"""Light that places of dressed surfaces throw back: texture, fine structure, joints, wear."""

import torch
from torch import Tensor

from research.training.rendered.dressings import PATTERNS
from research.training.rendered.patterns import hashed, lay
from research.training.rendered.structures import UNIT
from research.training.rendered.surfaces import Textures
from research.training.rendered.texture_bank import sample_bank

EVEN_DEVIATION = 12.0**0.5  # [1] makes numbers spread evenly over 1 such of deviation 1
ALBEDO = (0.01, 0.97)  # [1]


def albedo(
    textures: Textures, surfaces: dict[str, Tensor], number: Tensor, x: Tensor, y: Tensor, footprint: Tensor
) -> tuple[Tensor, Tensor]:
    """Reflectance of places on surfaces, and how much of each is a joint.

    Parameters
    ----------
    textures : Textures
    surfaces : dict of str to (surface,) tensor
        See `Wardrobe.surfaces`.
    number : (place,) int64
        Surface of each place.
    x, y : (place,) float
        On the surface. [m]
    footprint : (place,) float
        Edge of what a pixel covers. [m]

    Returns
    -------
    reflectance : (place, 3) float
        [0-1]
    joint : (place,) float
        [0-1]
    """

    def of(name: str) -> Tensor:
        return surfaces[name][number]

    cosine, sine = torch.cos(of("angle")), torch.sin(of("angle"))
    shift = of("shift")
    x, y = cosine * x - sine * y + shift[:, 0], sine * x + cosine * y + shift[:, 1]
    pattern, seed = of("pattern"), of("seed")
    cells = lay(pattern, x, y, of("cell_m"), of("aspect"), seed)
    laid = pattern != PATTERNS.index("none")
    first, second, third = (torch.where(laid, hashed(cells.column, cells.row, seed, k), 0.0) for k in (1, 2, 3))
    flip = torch.where(third > 0.5, 1.0, -1.0)
    repeat = of("repeat_m")
    seen = sample_bank(
        textures.materials, of("texture"), cells.across / repeat + 17.0 * first,
        flip * cells.down / (repeat * of("stretch")) + 13.0 * second, footprint / repeat,
    )  # fmt: skip
    structure = seen / textures.materials.mean[of("texture")]
    other = (pattern == PATTERNS.index("checker")) & cells.odd
    color = torch.where(other[:, None], of("second"), of("color"))
    color = color * (1.0 + of("contrast")[:, None] * (structure - 1.0))
    color = color * torch.exp(of("uneven") * EVEN_DEVIATION * (third - 0.5) * laid)[:, None]
    for part, across, down in (
        ("fine", cells.across + 7.0 * first, flip * cells.down + 5.0 * second), ("coarse", x, y)
    ):  # fmt: skip
        edge = of(f"{part}_repeat_m")
        factor = sample_bank(textures.structures, of(part), across / edge, down / edge, footprint / edge) / UNIT
        color = color * (1.0 + of(f"{part}_strength")[:, None] * (factor - 1.0)).clamp_min(0.05)
    width = of("joint_m")
    joint = ((0.5 * width - cells.edge) / footprint + 0.5).clamp(0.0, 1.0) * (width / footprint).clamp_max(1.0)
    color = torch.lerp(color, of("joint_color"), joint[:, None])
    return color.clamp(*ALBEDO), joint
