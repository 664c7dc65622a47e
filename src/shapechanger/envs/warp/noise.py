"""Random numbers of many worlds: functions of each world's seed and episode alone.

A world's numbers depend on neither its place in a batch nor the number of worlds, and a GPU draws
what the CPU draws. They come from SplitMix64 as a function of a counter (Steele, Lea and Flood,
OOPSLA 2014), in torch's int64, whose products wrap around.
"""

from __future__ import annotations

import math
from typing import Final

import torch
from torch import Tensor


def _signed(bits: int) -> int:
    """Return an unsigned number of 64 bits as the signed one with the same bits."""
    return bits - (1 << 64) if bits >> 63 else bits


_STEP: Final = _signed(0x9E3779B97F4A7C15)
_FIRST: Final = _signed(0xBF58476D1CE4E5B9)
_SECOND: Final = _signed(0x94D049BB133111EB)
_MANTISSA: Final = 53


def _shifted(numbers: Tensor, places: int) -> Tensor:
    """Shift to the right and fill with zeros; torch fills with the sign."""
    return (numbers >> places) & ((1 << (64 - places)) - 1)


def _mixed(numbers: Tensor) -> Tensor:
    numbers = (numbers ^ _shifted(numbers, 30)) * _FIRST
    numbers = (numbers ^ _shifted(numbers, 27)) * _SECOND
    return numbers ^ _shifted(numbers, 31)


def uniforms(seeds: Tensor, episodes: Tensor, stream: int | Tensor, count: int) -> Tensor:
    """Return numbers in [0, 1), shape (n, count), float64.

    Args:
        seeds: The seed of each world, shape (n,), int64.
        episodes: How many episodes each world has begun, shape (n,), int64.
        stream: Which numbers of the episode, also one per world, shape (n,); other streams are
            independent.
        count: How many numbers a world gets.
    """
    streams = torch.as_tensor(stream, device=seeds.device)
    key = _mixed(_mixed(_mixed(seeds) + episodes * _STEP) + streams * _STEP)
    places = torch.arange(1, count + 1, device=seeds.device) * _STEP
    bits = _shifted(_mixed(key[:, None] + places), 64 - _MANTISSA)
    return bits.to(torch.float64) * 2.0**-_MANTISSA


def normals(seeds: Tensor, episodes: Tensor, stream: int | Tensor, count: int) -> Tensor:
    """Return normally distributed numbers (Box and Muller), shape (n, count), float64.

    Args:
        seeds: The seed of each world, shape (n,), int64.
        episodes: How many episodes each world has begun, shape (n,), int64.
        stream: Which numbers of the episode, also one per world, shape (n,).
        count: How many numbers a world gets.
    """
    drawn = uniforms(seeds, episodes, stream, 2 * count)
    radius = torch.sqrt(-2.0 * torch.log1p(-drawn[:, :count]))
    return radius * torch.cos(2.0 * math.pi * drawn[:, count:])
