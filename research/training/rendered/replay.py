"""Rendered pictures kept on the device, to be learned from more than once: rendering costs as much as fitting."""

import torch
from torch import Tensor

from research.training.rendered.phone_batch import develop
from research.training.rendered.surfaces import Wardrobe
from research.training.rendered.views import NO_CLASS, Batch, collages, room_views

COLLAGE_SHARE = 0.35  # [1] of the pictures
ROOM_SAMPLES = 2  # rays of each pixel


class Replay:
    """A store of rendered pictures, the oldest replaced by new ones.

    Parameters
    ----------
    wardrobe : Wardrobe
    capacity : int
        Pictures.
    size_px : int
        Edge of the pictures, a multiple of 32. [px]
    """

    def __init__(self, wardrobe: Wardrobe, capacity: int, size_px: int) -> None:
        self.wardrobe, self.size_px = wardrobe, size_px
        device = wardrobe.device
        self._light = torch.zeros((capacity, 3, size_px, size_px), dtype=torch.float16, device=device)
        self._label = torch.full((capacity, size_px, size_px), NO_CLASS, dtype=torch.int8, device=device)
        self.rendered = 0

    @property
    def held(self) -> int:
        """How many pictures there are."""
        return min(self.rendered, len(self._light))

    def render(self, count: int) -> None:
        """Add new pictures."""
        loose = round(COLLAGE_SHARE * count)
        for batch in (
            room_views(self.wardrobe, count - loose, self.size_px, samples=ROOM_SAMPLES),
            collages(self.wardrobe, loose, self.size_px),
        ):
            self._store(batch)

    def _store(self, batch: Batch) -> None:
        light = batch.light / batch.light.flatten(1).mean(dim=1).clamp_min(1e-6)[:, None, None, None]
        place = (self.rendered + torch.arange(len(light), device=light.device)) % len(self._light)
        self._light[place] = light.clamp(0, 1e4).to(torch.float16)
        self._label[place] = batch.label.to(torch.int8)
        self.rendered += len(light)

    def draw(self, count: int) -> tuple[Tensor, Tensor]:
        """Phone pictures of some of what there is, half of them mirrored.

        Returns
        -------
        pictures : (picture, 3, row, column) float
            Encoded. [0-1]
        label : (picture, row, column) int64
        """
        generator = self.wardrobe.generator
        chosen = torch.randint(self.held, (count,), generator=generator, device=self.wardrobe.device)
        light, label = self._light[chosen].float(), self._label[chosen].to(torch.int64)
        half = count // 2
        light = torch.cat([light[:half], light[half:].flip(3)])
        label = torch.cat([label[:half], label[half:].flip(2)])
        return develop(light, self.wardrobe), label
