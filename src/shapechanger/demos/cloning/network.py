"""Cloned policies of PyTorch: encoders for images and states, and a linear output layer.

The attributes `eyes`, `nerves` and `hands` name the weights in the file of a policy.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.clone import Clone, CloneSettings, prepared
from shapechanger.errors import MissingExtra, translate_errors
from shapechanger.layout import Layout
from shapechanger.policy import STEERING, CloneNetwork, PolicyCard, export_network

with translate_errors(ImportError, to=lambda _: MissingExtra("torch", "learn")):
    import torch
    from torch import Tensor, nn
    from torch.nn import functional

DIRECTIONS: Final = 6  # Of edges, over half a turn: 30 degrees each.
BRIGHTEST: Final = 255.0  # Largest value of a pixel.
_CHUNK: Final = 256  # Examples at a time, to bound the memory.
_CELL: Final = 4  # Side of a cell, pixels.
# Added before the logarithm, as a share of full brightness: about a camera's noise in the dark.
_DARK: Final = 8.0 / 255.0
# Mean strength of an edge that is only noise; keeps uniform images from being amplified.
_MIN_EDGE: Final = 1e-4
# About a camera's noise, as a share of full brightness; keeps uniform images from being amplified.
_MIN_SPREAD: Final = 0.02
_MAX_DEVIATIONS: Final = 5.0  # Larger deviations of a state value carry no more information.


def edges(pictures: Tensor, cells: tuple[int, int]) -> Tensor:
    """Return the square root of the strength of edges of each direction in each cell.

    Images are in [0, 1], shape (n, 3, height, width); strengths are relative to their mean, shape
    (n, DIRECTIONS, rows, columns) for the given rows and columns of cells.
    """
    light = torch.log(pictures.mean(dim=1, keepdim=True) + _DARK)
    across = functional.pad(light[..., 2:] - light[..., :-2], (1, 1, 0, 0))
    down = functional.pad(light[..., 2:, :] - light[..., :-2, :], (0, 0, 1, 1))
    strength = torch.hypot(across, down)
    # Opposite directions belong to the same edge.
    turn = torch.remainder(torch.atan2(down, across), math.pi) * (DIRECTIONS / math.pi)
    apart = (turn - torch.arange(DIRECTIONS, device=turn.device).view(1, -1, 1, 1)).abs()
    share = (1.0 - torch.minimum(apart, DIRECTIONS - apart)).clamp(min=0.0)
    pooled = functional.adaptive_avg_pool2d(strength * share, cells)
    return torch.sqrt(pooled / (pooled.mean(dim=(1, 2, 3), keepdim=True) + _MIN_EDGE))


class Eyes(nn.Module):
    """Encoder of an image by its colours or edges.

    Colours are normalised by the mean and standard deviation of their image, so that neither
    daylight nor exposure matters.
    """

    def __init__(self, net: CloneNetwork) -> None:
        super().__init__()
        framing, by_edges = net.framing, net.eyes == "edges"
        self._cells: tuple[int, int] | None = None
        height, width, before = framing.shape
        if by_edges:
            height, width = max(height // _CELL, 1), max(width // _CELL, 1)
            self._cells, before = (height, width), DIRECTIONS
        layers: list[nn.Module] = []
        for i, after in enumerate(net.channels):
            # The first filters of colours are wider, to find edges.
            side = 3 if i or by_edges else 5
            layers += [nn.Conv2d(before, after, side, stride=2, padding=side // 2), nn.ReLU()]
            height, width, before = (height + 1) // 2, (width + 1) // 2, after
        self.filters = nn.Sequential(*layers)
        self.boiled_down = nn.Linear(before * height * width, net.features)

    def forward(self, pictures: Tensor) -> Tensor:
        """Return the features, shape (n, features), of images in [0, 1], (n, 3, height, width)."""
        if self._cells is not None:
            seen = edges(pictures, self._cells) - 1.0
        else:
            # The statistics of flat rows are several times faster than over three dimensions.
            rows = pictures.permute(0, 2, 3, 1).flatten(1)
            spread, mean = (x[:, None, None, None] for x in torch.std_mean(rows, dim=1))
            seen = (pictures - mean) / (spread + _MIN_SPREAD)
        return torch.relu(self.boiled_down(self.filters(seen).flatten(1)))


class Nerves(nn.Module):
    """Encoder of a state, with layers of these widths; the last one is the number of features.

    Each value is normalised by the mean and standard deviation in the demonstrations. A missing
    value (NaN) is replaced by the mean and flagged in a second input; outliers are clipped at five
    standard deviations.
    """

    def __init__(self, size: int, widths: tuple[int, ...]) -> None:
        super().__init__()
        self.register_buffer("middle", torch.zeros(size))
        self.register_buffer("spread", torch.ones(size))
        layers: list[nn.Module] = []
        for before, after in pairwise((2 * size, *widths)):
            layers += [nn.Linear(before, after), nn.ReLU()]
        self.layers = nn.Sequential(*layers)

    def forward(self, states: Tensor) -> Tensor:
        """Return the features, shape (n, widths[-1]), of states, shape (n, size)."""
        missing = states.isnan()
        known = (states - cast("Tensor", self.middle)) / cast("Tensor", self.spread)
        known = torch.where(missing, 0.0, known.clamp(-_MAX_DEVIATIONS, _MAX_DEVIATIONS))
        return self.layers(torch.cat((known, missing.float()), dim=1))


class _Several(nn.ModuleList):
    """Modules with concatenated outputs."""

    def forward(self, x: Tensor) -> Tensor:
        return torch.cat([one(x) for one in self], dim=1)


class CameraNetwork(nn.Module):
    """Network of a clone: encoders and output layer, as the card describes them."""

    def __init__(self, card: PolicyCard) -> None:
        super().__init__()
        self.card, net, feels = card, card.network, card.observation
        self.seen = 0 if net.eyes == "none" else net.members * net.features
        self.felt = 0 if feels is None else net.members * net.nerves[-1]
        eyes = [Eyes(net) for _ in range(net.members) if self.seen]
        nerves = [Nerves(feels.size, net.nerves) for _ in range(net.members) if feels is not None]
        self.eyes, self.nerves = (
            _Several(parts) if len(parts) > 1 else next(iter(parts), None)
            for parts in (eyes, nerves)
        )
        self.hands = nn.Linear(self.seen + self.felt, len(net.classes) or card.action_size)
        self.activation = nn.Softmax(dim=1) if net.classes else nn.Tanh()
        # Colours last in memory: convolutions of a single image are a third faster.
        self.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]

    def perceive(self, pictures: Tensor | None, states: Tensor | None = None) -> Tensor:
        """Return the features, shape (n, features), of inputs of the encoders."""
        given = ((self.eyes, pictures), (self.nerves, states))
        found = [encoder(part) for encoder, part in given if encoder is not None]
        return found[0] if len(found) == 1 else torch.cat(found, dim=1)

    @torch.no_grad()
    def features(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None
    ) -> Tensor:
        """Return the features, as `perceive` does, of raw images and states."""
        small, known = prepared(self.card, pictures, states)
        n = len(small) if small is not None else len(known) if known is not None else 0
        found = next(self.parameters()).new_empty(n, self.seen + self.felt)
        for start in range(0, n, _CHUNK):
            some = slice(start, start + _CHUNK)
            parts = (None if x is None else torch.tensor(x[some]) for x in (small, known))
            seen, felt = (None if x is None else x.to(found.device) for x in parts)
            found[some] = self.perceive(None if seen is None else scaled(seen), felt)
        return found

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return the outputs, as `Clone.outputs` does, for prepared images, a state, or both."""
        seen = None if self.eyes is None else scaled(inputs[0])
        return self.activation(self.hands(self.perceive(seen, inputs[-1])))


class CameraPolicy(Clone):
    """A clone whose network runs in PyTorch, and which can be trained further and saved."""

    def __init__(self, network: CameraNetwork, card: PolicyCard) -> None:
        self.network = network.eval()
        self.card = card

    @classmethod
    def fresh(
        cls, settings: CloneSettings, seed: int, actions: Layout | None = None
    ) -> CameraPolicy:
        """Return an untrained policy of images, whose actions are in [-1, 1].

        Without `actions`, it steers any vehicle by steering and throttle.
        """
        if actions is not None and actions.names == STEERING:
            actions = None
        same = ("framing", "channels", "features", "eyes")
        clone = CloneNetwork(**{name: getattr(settings, name) for name in same})
        return cls.blank(PolicyCard(learner="cloning", action=actions, clone=clone), seed)

    @classmethod
    def blank(cls, card: PolicyCard, seed: int) -> CameraPolicy:
        """Return an untrained policy with the architecture of a card and weights of a seed."""
        with seeded(seed):
            return cls(CameraNetwork(card), card)

    @classmethod
    def of_file(cls, card: PolicyCard, weights: Mapping[str, NDArray[Any]]) -> CameraPolicy:
        """Return the policy of a file, see `shapechanger.load_policy`."""
        for name, value in weights.items():
            if value.dtype != np.float32 or not np.isfinite(value).all():
                raise ValueError(f"its weights {name} must be finite and in single precision")
        # On the meta device a forged card cannot allocate memory before the sizes are compared.
        with torch.device("meta"):
            network = CameraNetwork(card)
        state = {name: torch.from_numpy(value.copy()) for name, value in weights.items()}  # pyright: ignore[reportUnknownMemberType]
        network.load_state_dict(state, assign=True)
        # Assigned weights keep the memory layout of the file, so that sums have the same order.
        network.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]
        settings = msgspec.convert(card.settings, CloneSettings | None)
        return cls(network, msgspec.structs.replace(card, settings=settings))

    def tensors(self) -> dict[str, NDArray[Any]]:
        """Return its weights, keyed by name."""
        return {name: value.numpy() for name, value in self.network.state_dict().items()}

    def outputs(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return the outputs of the network, as `Clone` describes them."""
        with torch.no_grad():
            features = self.network.features(pictures, states)
            return self.network.activation(self.network.hands(features)).numpy()

    def export(self, path: Path) -> None:
        """Write the policy as ONNX, which a robot runs without PyTorch.

        Its inputs, if the policy uses them, are `picture`, uint8 of the shape (n, height, width, 3)
        that the card's framing gives, and `state`, float32 of shape (n, values); its output is
        `output`, float32: actions scaled to [-1, 1], or probabilities of the card's classes.
        """
        kinds = {"picture": torch.uint8, "state": torch.float32}
        shapes = self.card.shapes
        inputs = {n: torch.zeros((2, *shapes[n]), dtype=kinds[n]) for n in kinds if n in shapes}
        export_network(self.network, inputs, self.card, path)


def scaled(pictures: Tensor) -> Tensor:
    """Return images in [0, 1], shape (n, 3, height, width), of uint8 (n, height, width, 3)."""
    return pictures.permute(0, 3, 1, 2).float() / BRIGHTEST


@contextmanager
def seeded(seed: int) -> Generator[None]:
    """Seed the global generator, and restore it at the end."""
    with cast("Any", torch.random).fork_rng(devices=[]):
        torch.manual_seed(seed)  # pyright: ignore[reportUnknownMemberType]
        yield


def joined(card: PolicyCard, members: Sequence[CameraNetwork]) -> CameraNetwork:
    """Return one network, as a card describes it, which averages its members before activation."""
    network = CameraNetwork(card)
    for name in ("eyes", "nerves"):
        for one, member in zip(getattr(network, name) or (), members, strict=False):
            one.load_state_dict(getattr(member, name).state_dict())
    seen = members[0].seen
    weights = [member.hands.weight for member in members]
    parts = [weight[:, :seen] for weight in weights] + [weight[:, seen:] for weight in weights]
    with torch.no_grad():
        network.hands.weight.copy_(torch.cat(parts, dim=1) / len(members))
        network.hands.bias.copy_(torch.stack([member.hands.bias for member in members]).mean(dim=0))
    return network
