"""Batches of pictures, each time a little different, so that few demonstrations go a long way."""

from __future__ import annotations

import math
from typing import Final

import torch
from torch import Tensor
from torch.nn import functional

from shapechanger.demos.cloning.settings import Augmentation

__all__ = ["augmented", "plain"]

_BRIGHTEST: Final = 255.0


def plain(pictures: Tensor, index: Tensor) -> Tensor:
    """Pictures as they are.

    Args:
        pictures: uint8, shape (n, height, width, 3).
        index: Which of them, shape (batch,).

    Returns:
        In [0, 1], shape (batch, 3, height, width).
    """
    return pictures[index].permute(0, 3, 1, 2).float() / _BRIGHTEST


def augmented(
    pictures: Tensor, index: Tensor, augmentation: Augmentation, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Pictures as another day, another camera or the mirror would show them.

    Args:
        pictures: uint8, shape (n, height, width, 3).
        index: Which of them, shape (batch,).
        augmentation: What to change, and how far.
        generator: The source of chance.

    Returns:
        Pictures in [0, 1], shape (batch, 3, height, width), and which of them are mirrored, so that
        their actions have to be mirrored, too, shape (batch,).
    """
    mirrored = torch.rand(len(index), generator=generator) < augmentation.mirror
    seen = _moved(pictures, index, mirrored, augmentation.shift, generator)
    _relight(seen, augmentation, generator)
    _blur(seen, augmentation.blurred, generator)
    _sprinkle(seen, augmentation, generator)
    return seen.clamp_(0.0, 1.0), mirrored


def _moved(
    pictures: Tensor, index: Tensor, mirrored: Tensor, shift: int, generator: torch.Generator
) -> Tensor:
    """Mirror and shift while fetching: one look-up a pixel. Edges are repeated."""
    height, width = pictures.shape[1], pictures.shape[2]
    moves = torch.randint(-shift, shift + 1, (2, len(index), 1), generator=generator)
    rows = (torch.arange(height) + moves[0]).clamp_(0, height - 1)
    columns = (torch.arange(width) + moves[1]).clamp_(0, width - 1)
    columns = torch.where(mirrored[:, None], width - 1 - columns, columns)
    places = (index[:, None, None] * height + rows[:, :, None]) * width + columns[:, None, :]
    pixels = pictures.reshape(-1, pictures.shape[3]).index_select(0, places.reshape(-1))
    # So permuted, the tensor has its colours last in memory, as the network likes it.
    return pixels.reshape(*places.shape, -1).permute(0, 3, 1, 2).float().div_(_BRIGHTEST)


def _relight(seen: Tensor, augmentation: Augmentation, generator: torch.Generator) -> None:
    """More or less light, of another colour."""
    n, colours = seen.shape[0], seen.shape[1]
    gain = _factors((n, 1, 1, 1), augmentation.gain, generator)
    colour = _factors((n, colours, 1, 1), augmentation.colour, generator)
    offset = augmentation.offset * (2.0 * torch.rand((n, 1, 1, 1), generator=generator) - 1.0)
    seen.mul_(gain * colour).add_(offset)


def _factors(shape: tuple[int, ...], largest: float, generator: torch.Generator) -> Tensor:
    """Factors between the inverse of the largest and the largest, even in their logarithm."""
    spread = 2.0 * torch.rand(shape, generator=generator) - 1.0
    return torch.exp(math.log(largest) * spread)


def _blur(seen: Tensor, share: float, generator: torch.Generator) -> None:
    """Blur the first few: a batch is in no order, so they are any few."""
    count = _first_few(len(seen), share, generator)
    if count:
        seen[:count] = functional.avg_pool2d(seen[:count], 3, 1, 1, count_include_pad=False)


def _sprinkle(seen: Tensor, augmentation: Augmentation, generator: torch.Generator) -> None:
    """Add the noise of a camera in the dark to the last few, so that some are blurred and noisy."""
    count = _first_few(len(seen), augmentation.noisy, generator)
    if count:
        strength = augmentation.noise * torch.rand((count, 1, 1, 1), generator=generator)
        last = seen[-count:]
        last.add_(strength * torch.randn(last.shape, generator=generator))


def _first_few(n: int, share: float, generator: torch.Generator) -> int:
    """How many of n, so that the share is right on average for the smallest batch, too."""
    return math.floor(n * share + float(torch.rand((), generator=generator)) * (share > 0.0))
