"""Networks of cloned policies: encoders for images and states, and a linear output layer.

The names of the attributes (`eyes`, `nerves`, `hands`, ...) name the weights in the file of
a policy, and must not change.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from shapechanger.demos.cloning.card import CloneCard
from shapechanger.demos.cloning.pictures import Framing

DIRECTIONS: Final = 6
"""Number of edge directions over half a turn: 30 degrees each."""

_CELL: Final = 4  # Side of a cell, pixels.
# Added before the logarithm, as a share of full brightness: about a camera's noise in the dark.
_DARK: Final = 8.0 / 255.0
# Mean strength of an edge that is only noise; keeps uniform images from being amplified.
_MIN_EDGE: Final = 1e-4
# About the noise of a camera, as a share of full brightness; keeps a uniform image, such as that
# of a covered lens, from being amplified into noise.
_MIN_SPREAD: Final = 0.02
_MAX_DEVIATIONS: Final = 5.0  # Larger deviations of a state value carry no more information.


def edges(pictures: Tensor, cells: tuple[int, int]) -> Tensor:
    """Return the strength of the edges of each direction in each cell, relative to their mean.

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

    Args:
        framing: Size of the images.
        channels: Filters of each convolution, which halves rows and columns.
        features: Number of features.
        by_edges: Whether the first layer sees edges instead of colours.
    """

    def __init__(
        self, framing: Framing, channels: tuple[int, ...], features: int, by_edges: bool
    ) -> None:
        super().__init__()
        self._cells: tuple[int, int] | None = None
        height, width, before = framing.shape
        if by_edges:
            height, width = max(height // _CELL, 1), max(width // _CELL, 1)
            self._cells, before = (height, width), DIRECTIONS
        layers: list[nn.Module] = []
        for i, after in enumerate(channels):
            # The first filters of colours are wider, to find edges.
            side = 3 if i or by_edges else 5
            layers += [nn.Conv2d(before, after, side, stride=2, padding=side // 2), nn.ReLU()]
            height, width, before = (height + 1) // 2, (width + 1) // 2, after
        self.filters = nn.Sequential(*layers)
        self.boiled_down = nn.Linear(before * height * width, features)

    def forward(self, pictures: Tensor) -> Tensor:
        """Return the features, shape (n, features).

        Args:
            pictures: In [0, 1], shape (n, 3, height, width).
        """
        if self._cells is not None:
            seen = edges(pictures, self._cells) - 1.0
        else:
            # Colours are last in memory, so that each image is one row: several times faster than
            # over three dimensions.
            rows = pictures.permute(0, 2, 3, 1).flatten(1)
            spread, mean = (x[:, None, None, None] for x in torch.std_mean(rows, dim=1))
            seen = (pictures - mean) / (spread + _MIN_SPREAD)
        return torch.relu(self.boiled_down(self.filters(seen).flatten(1)))


class Nerves(nn.Module):
    """Encoder of a state.

    Each value is normalised by the mean and standard deviation in the demonstrations. A missing
    value (NaN) is replaced by the mean and flagged in a second input; outliers are clipped at five
    standard deviations.

    Args:
        size: Number of values in a state.
        widths: Widths of the layers; the last one is the number of features.
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
        """Return the features, shape (n, widths[-1]), of states, shape (n, size)."""
        missing = states.isnan()
        known = (states - cast("Tensor", self.middle)) / cast("Tensor", self.spread)
        known = torch.where(missing, 0.0, known.clamp(-_MAX_DEVIATIONS, _MAX_DEVIATIONS))
        return self.layers(torch.cat((known, missing.float()), dim=1))


class _Several(nn.ModuleList):
    """Modules side by side, with concatenated outputs."""

    def forward(self, x: Tensor) -> Tensor:
        return torch.cat([one(x) for one in self], dim=1)


class CameraNetwork(nn.Module):
    """Network of a policy: encoders and output layer.

    Args:
        card: Architecture.
    """

    def __init__(self, card: CloneCard) -> None:
        super().__init__()
        eyes = [
            Eyes(card.framing, card.channels, card.features, card.eyes == "edges")
            for _ in range(card.members if card.eyes != "none" else 0)
        ]
        nerves = [
            Nerves(card.state_size, card.nerves) for _ in range(card.members if card.nerves else 0)
        ]
        self.eyes: nn.Module | None = _one_or_several(eyes)
        self.nerves: nn.Module | None = _one_or_several(nerves)
        features = len(eyes) * card.features + (len(nerves) * card.nerves[-1] if nerves else 0)
        self.hands = nn.Linear(features, card.outputs)
        # With colours last in memory, convolutions of a single image are a third faster.
        self.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]

    def perceive(self, pictures: Tensor | None, states: Tensor | None = None) -> Tensor:
        """Return the features of images and states, shape (n, features).

        Args:
            pictures: In [0, 1], shape (n, 3, height, width); None for a policy without images.
            states: Shape (n, state size); None for a policy without a state.
        """
        found: list[Tensor] = []
        if self.eyes is not None:
            found.append(self.eyes(pictures))
        if self.nerves is not None:
            found.append(self.nerves(states))
        return found[0] if len(found) == 1 else torch.cat(found, dim=1)


def joined(card: CloneCard, members: list[CameraNetwork]) -> CameraNetwork:
    """Return one network whose output is the mean of the outputs of several networks.

    Args:
        card: Architecture of the joint network.
        members: Networks of the same architecture, each with one member.
    """
    network = CameraNetwork(card)
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


def _one_or_several(parts: Sequence[nn.Module]) -> nn.Module | None:
    if len(parts) < 2:
        return parts[0] if parts else None
    return _Several(parts)
