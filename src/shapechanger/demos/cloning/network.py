"""The network that drives: a few convolutions, a few layers for a state, and what comes out."""

from __future__ import annotations

import math
from typing import Final, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from shapechanger.demos.cloning.card import CloneCard
from shapechanger.demos.cloning.pictures import CHANNELS, Framing

__all__ = [
    "ACTIONS",
    "DIRECTIONS",
    "CameraNetwork",
    "EdgeEyes",
    "Eyes",
    "Nerves",
    "edges",
    "joined",
]

DIRECTIONS: Final = 6
"""Directions of edges that are told apart, over half a turn: 30 degrees each."""

# Pixels of a cell, along each side.
_CELL: Final = 4
# Added before the logarithm, as a share of full brightness: about a camera's noise in the dark.
_DARK: Final = 8.0 / 255.0
# Keeps an even picture from being blown up: the mean strength of an edge that is noise.
_EVEN: Final = 1e-4


class EdgeEyes(nn.Module):
    """From a picture to features, by way of its edges.

    Args:
        framing: Size of the pictures.
        channels: Filters of each layer that follows the edges; each halves rows and columns.
        features: How many features.
    """

    def __init__(self, framing: Framing, channels: tuple[int, ...], features: int) -> None:
        super().__init__()
        height, width = max(framing.height // _CELL, 1), max(framing.width // _CELL, 1)
        self._cells = height, width
        layers: list[nn.Module] = []
        before = DIRECTIONS
        for after in channels:
            layers += [nn.Conv2d(before, after, 3, stride=2, padding=1), nn.ReLU()]
            height, width, before = (height + 1) // 2, (width + 1) // 2, after
        self.filters = nn.Sequential(*layers)
        self.boiled_down = nn.Linear(before * height * width, features)

    def forward(self, pictures: Tensor) -> Tensor:
        """Features, shape (n, features), of pictures in [0, 1], shape (n, 3, height, width)."""
        found = self.filters(edges(pictures, self._cells) - 1.0)
        return torch.relu(self.boiled_down(found.flatten(1)))


def edges(pictures: Tensor, cells: tuple[int, int]) -> Tensor:
    """How strong the edges of each direction are in each cell, 1 where they are as in the mean.

    Args:
        pictures: In [0, 1], shape (n, 3, height, width).
        cells: Rows and columns of cells.

    Returns:
        At least 0, shape (n, DIRECTIONS, rows, columns).
    """
    light = torch.log(pictures.mean(dim=1, keepdim=True) + _DARK)
    across = functional.pad(light[..., 2:] - light[..., :-2], (1, 1, 0, 0))
    down = functional.pad(light[..., 2:, :] - light[..., :-2, :], (0, 0, 1, 1))
    strength = torch.hypot(across, down)
    # A direction and its opposite are the same edge, seen from the other side.
    turn = torch.remainder(torch.atan2(down, across), math.pi) * (DIRECTIONS / math.pi)
    apart = (turn - torch.arange(DIRECTIONS, device=turn.device).view(1, -1, 1, 1)).abs()
    share = (1.0 - torch.minimum(apart, DIRECTIONS - apart)).clamp(min=0.0)
    pooled = functional.adaptive_avg_pool2d(strength * share, cells)
    return torch.sqrt(pooled / (pooled.mean(dim=(1, 2, 3), keepdim=True) + _EVEN))


ACTIONS: Final = 2
"""Steering and throttle."""

# Keeps an even picture, such as a covered lens, from being blown up into its own noise: about the
# noise of a camera, as a share of full brightness.
_NETWORK_EVEN: Final = 0.02
# A number of a state that lies farther out, in standard deviations, says no more than this.
_FARTHEST: Final = 5.0


class Eyes(nn.Module):
    """From a picture to features.

    Each picture is first freed of its own mean and spread, so that neither the time of day nor the
    exposure reaches the filters. Each layer halves rows and columns.

    Args:
        framing: Size of the pictures.
        channels: Filters of each layer.
        features: How many features.
    """

    def __init__(self, framing: Framing, channels: tuple[int, ...], features: int) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        height, width = framing.height, framing.width
        before = CHANNELS
        for i, after in enumerate(channels):
            # The first filters are wider: they look for edges and not yet for shapes.
            size = 3 if i else 5
            layers += [nn.Conv2d(before, after, size, stride=2, padding=size // 2), nn.ReLU()]
            height, width, before = (height + 1) // 2, (width + 1) // 2, after
        self.filters = nn.Sequential(*layers)
        self.boiled_down = nn.Linear(before * height * width, features)

    def forward(self, pictures: Tensor) -> Tensor:
        """Features, shape (n, features), of pictures in [0, 1], shape (n, 3, height, width)."""
        # Colours are last in memory, so each picture is one row: several times faster than over
        # three dimensions.
        rows = pictures.permute(0, 2, 3, 1).flatten(1)
        spread, mean = (x[:, None, None, None] for x in torch.std_mean(rows, dim=1))
        found = self.filters((pictures - mean) / (spread + _NETWORK_EVEN))
        return torch.relu(self.boiled_down(found.flatten(1)))


class Nerves(nn.Module):
    """From a state to features.

    Each number is freed of the mean and spread that it had in the demonstrations. One that is
    missing (NaN) counts as its mean, and a flag beside it says so; one that is far out counts as
    five standard deviations.

    Args:
        size: Numbers of the state.
        widths: Of the layers; the last one's are the features.
    """

    def __init__(self, size: int, widths: tuple[int, ...]) -> None:
        super().__init__()
        self.register_buffer("middle", torch.zeros(size))
        self.register_buffer("spread", torch.ones(size))
        layers: list[nn.Module] = []
        before = 2 * size
        for after in widths:
            layers += [nn.Linear(before, after), nn.ReLU()]
            before = after
        self.layers = nn.Sequential(*layers)

    def forward(self, states: Tensor) -> Tensor:
        """Features, shape (n, widths[-1]), of states, shape (n, size)."""
        missing = states.isnan()
        known = (states - cast("Tensor", self.middle)) / cast("Tensor", self.spread)
        known = torch.where(missing, 0.0, known.clamp(-_FARTHEST, _FARTHEST))
        return self.layers(torch.cat((known, missing.float()), dim=1))


class _Several(nn.ModuleList):
    """Several of the same, side by side."""

    def forward(self, x: Tensor) -> Tensor:
        return torch.cat([one(x) for one in self], dim=1)


class CameraNetwork(nn.Module):
    """From a picture, a state or both to what a policy decides by.

    Args:
        card: What the policy is like.
    """

    def __init__(self, card: CloneCard) -> None:
        super().__init__()
        eyes = [_eyes(card) for _ in range(card.members if card.eyes != "none" else 0)]
        nerves = [
            Nerves(card.state_size, card.nerves) for _ in range(card.members if card.nerves else 0)
        ]
        self.eyes: nn.Module | None = _one_or_several(eyes)
        self.nerves: nn.Module | None = _one_or_several(nerves)
        features = len(eyes) * card.features + (len(nerves) * card.nerves[-1] if nerves else 0)
        self.hands = nn.Linear(features, card.outputs)
        # With colours last in memory the convolutions of a single picture are a third faster.
        self.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]

    def perceive(self, pictures: Tensor | None, states: Tensor | None = None) -> Tensor:
        """Features of what is seen and felt, shape (n, features).

        Args:
            pictures: In [0, 1], shape (n, 3, height, width); None without eyes.
            states: Shape (n, state size); None without nerves.
        """
        found: list[Tensor] = []
        if self.eyes is not None:
            found.append(self.eyes(pictures))
        if self.nerves is not None:
            found.append(self.nerves(states))
        return found[0] if len(found) == 1 else torch.cat(found, dim=1)

    def forward(self, pictures: Tensor | None, states: Tensor | None = None) -> Tensor:
        """What comes out, shape (n, outputs): before the tanh, or logits of the classes."""
        return self.hands(self.perceive(pictures, states))


def joined(card: CloneCard, members: list[CameraNetwork]) -> CameraNetwork:
    """One network whose output is the mean of the outputs of several.

    Args:
        card: What the policy of all is like.
        members: Networks of the same shape, each of a policy with one member.
    """
    network = CameraNetwork(card)
    if len(members) == 1:
        network.load_state_dict(members[0].state_dict())
        return network
    for name in ("eyes", "nerves"):
        several = getattr(network, name)
        if several is not None:
            for one, member in zip(several, members, strict=True):
                one.load_state_dict(getattr(member, name).state_dict())
    seen = card.features if card.eyes != "none" else 0
    weights = [member.hands.weight for member in members]
    parts = [weight[:, :seen] for weight in weights] + [weight[:, seen:] for weight in weights]
    with torch.no_grad():
        network.hands.weight.copy_(torch.cat(parts, dim=1) / len(members))
        network.hands.bias.copy_(torch.stack([member.hands.bias for member in members]).mean(dim=0))
    return network


def _eyes(card: CloneCard) -> nn.Module:
    if card.eyes == "edges":
        return EdgeEyes(card.framing, card.channels, card.features)
    return Eyes(card.framing, card.channels, card.features)


def _one_or_several(parts: list[nn.Module] | list[Nerves]) -> nn.Module | None:
    if len(parts) < 2:
        return parts[0] if parts else None
    return _Several(parts)
