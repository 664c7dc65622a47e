"""Random numbers of many worlds: functions of each world's seed and episode alone.

A world's numbers depend on neither its place in a batch nor the number of worlds, and a GPU draws
the numbers of the CPU, up to the rounding of its logarithm and cosine. They come from SplitMix64 as
a function of a counter (Steele, Lea and Flood, OOPSLA 2014), with 53 bits each.
"""

# Warp reads the annotations, so they must not become strings.
# pyright: basic, reportInvalidTypeForm=false

import math
from typing import Any

import torch
from torch import Tensor

from shapechanger.envs.warp.devices import as_warp, on, wp

_STEP: Any = wp.constant(wp.uint64(0x9E3779B97F4A7C15))
_FIRST: Any = wp.constant(wp.uint64(0xBF58476D1CE4E5B9))
_SECOND: Any = wp.constant(wp.uint64(0x94D049BB133111EB))
_UNIT: Any = wp.constant(wp.float64(2.0**-53))
_TURN: Any = wp.constant(wp.float64(2.0 * math.pi))


@wp.func
def _mixed(bits: wp.uint64):
    """Return the bits of a counter, mixed by SplitMix64."""
    bits = (bits ^ (bits >> wp.uint64(30))) * _FIRST
    bits = (bits ^ (bits >> wp.uint64(27))) * _SECOND
    return bits ^ (bits >> wp.uint64(31))


@wp.func
def _uniform(key: wp.uint64, place: int):
    """Return number `place` of a key, in [0, 1)."""
    bits = _mixed(key + wp.uint64(place + 1) * _STEP)
    return wp.float64(bits >> wp.uint64(11)) * _UNIT


@wp.kernel
def _draw(
    seeds: wp.array[wp.int64],
    episodes: wp.array[wp.int64],
    streams: wp.array[wp.int64],
    normal: bool,
    numbers: wp.array2d[wp.float64],
):
    """Write one number of one world; normal ones by Box and Muller."""
    world, place = wp.tid()
    stream = wp.uint64(streams[world % streams.shape[0]])
    key = _mixed(_mixed(wp.uint64(seeds[world])) + wp.uint64(episodes[world]) * _STEP)
    key = _mixed(key + stream * _STEP)
    number = _uniform(key, place)
    if normal:
        radius = wp.sqrt(wp.float64(-2.0) * wp.log(wp.float64(1.0) - number))
        number = radius * wp.cos(_TURN * _uniform(key, numbers.shape[1] + place))
    numbers[world, place] = number


def _drawn(
    seeds: Tensor, episodes: Tensor, stream: int | Tensor, count: int, normal: bool
) -> Tensor:
    numbers = torch.empty((len(seeds), count), dtype=torch.float64, device=seeds.device)
    if isinstance(stream, int):
        # Filled on the device, so that no number is copied there.
        stream = torch.full((1,), stream, dtype=torch.int64, device=seeds.device)
    with on(str(seeds.device)):
        wp.launch(
            _draw,
            dim=(len(seeds), count),
            inputs=[*(as_warp(each, wp.int64) for each in (seeds, episodes, stream)), normal],
            outputs=[as_warp(numbers, wp.float64)],
        )
    return numbers


def uniforms(seeds: Tensor, episodes: Tensor, stream: int | Tensor, count: int) -> Tensor:
    """Return numbers in [0, 1), shape (n, count), float64.

    Args:
        seeds: The seed of each world, shape (n,), int64.
        episodes: How many episodes each world has begun, shape (n,), int64.
        stream: Which numbers of the episode, also one per world, shape (n,), int64; other streams
            are independent.
        count: How many numbers a world gets.
    """
    return _drawn(seeds, episodes, stream, count, normal=False)


def normals(seeds: Tensor, episodes: Tensor, stream: int | Tensor, count: int) -> Tensor:
    """Return normally distributed numbers (Box and Muller), shape (n, count), float64.

    Args:
        seeds: The seed of each world, shape (n,), int64.
        episodes: How many episodes each world has begun, shape (n,), int64.
        stream: Which numbers of the episode, also one per world, shape (n,), int64.
        count: How many numbers a world gets.
    """
    return _drawn(seeds, episodes, stream, count, normal=True)
