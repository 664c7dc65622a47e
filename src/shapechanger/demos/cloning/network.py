"""The network that drives: a few convolutions, and two numbers at the end."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor, nn

from shapechanger.demos.cloning.pictures import CHANNELS, Framing

__all__ = ["ACTIONS", "CameraNetwork", "Eyes"]

ACTIONS: Final = 2
"""Steering and throttle."""

# Keeps an even picture, such as a covered lens, from being blown up into its own noise: about the
# noise of a camera, as a share of full brightness.
_EVEN: Final = 0.02


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
        found = self.filters((pictures - mean) / (spread + _EVEN))
        return torch.relu(self.boiled_down(found.flatten(1)))


class CameraNetwork(nn.Module):
    """From a picture to steering and throttle.

    Args:
        framing: Size of the pictures.
        channels: Filters of each layer.
        features: How many features lie between.
    """

    def __init__(self, framing: Framing, channels: tuple[int, ...], features: int) -> None:
        super().__init__()
        self.eyes = Eyes(framing, channels, features)
        self.hands = nn.Linear(features, ACTIONS)
        # With colours last in memory the convolutions of a single picture are a third faster.
        self.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]

    def forward(self, pictures: Tensor) -> Tensor:
        """Actions in [-1, 1], shape (n, 2), for pictures in [0, 1], shape (n, 3, height, width)."""
        return torch.tanh(self.hands(self.eyes(pictures)))
