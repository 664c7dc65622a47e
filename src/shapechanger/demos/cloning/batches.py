"""Batches of augmented training examples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from shapechanger.demos.cloning.demonstrations import Examples
from shapechanger.demos.cloning.settings import Augmentation, CloneSettings

_BRIGHTEST: Final = 255.0


def plain(pictures: Tensor, index: Tensor) -> Tensor:
    """Return pictures without augmentation.

    Args:
        pictures: uint8, shape (n, height, width, 3).
        index: Indices of the pictures, shape (batch,).

    Returns:
        Pictures in [0, 1], shape (batch, 3, height, width).
    """
    return scaled(pictures[index])


def scaled(pictures: Tensor) -> Tensor:
    """Return pictures in [0, 1], shape (n, 3, height, width), of uint8 as in `plain`."""
    return pictures.permute(0, 3, 1, 2).float() / _BRIGHTEST


def augmented(
    pictures: Tensor, index: Tensor, augmentation: Augmentation, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Return pictures with random changes of light, colour, noise and position.

    Args:
        pictures: uint8, shape (n, height, width, 3).
        index: Indices of the pictures, shape (batch,).
        augmentation: Kind and extent of the changes.
        generator: Source of randomness.

    Returns:
        Pictures in [0, 1], shape (batch, 3, height, width), and a mask of the mirrored ones, whose
        actions must be mirrored too, shape (batch,).
    """
    mirrored = torch.rand(len(index), generator=generator) < augmentation.mirror
    seen = _moved(pictures, index, mirrored, augmentation.shift, generator)
    _change_light(seen, augmentation, generator)
    _blur(seen, augmentation.blurred, generator)
    _add_noise(seen, augmentation, generator)
    return seen.clamp_(0.0, 1.0), mirrored


def _moved(
    pictures: Tensor, index: Tensor, mirrored: Tensor, shift: int, generator: torch.Generator
) -> Tensor:
    """Mirror and shift while fetching, with one look-up per pixel; edge pixels are repeated."""
    height, width = pictures.shape[1], pictures.shape[2]
    moves = torch.randint(-shift, shift + 1, (2, len(index), 1), generator=generator)
    rows = (torch.arange(height) + moves[0]).clamp_(0, height - 1)
    columns = (torch.arange(width) + moves[1]).clamp_(0, width - 1)
    columns = torch.where(mirrored[:, None], width - 1 - columns, columns)
    places = (index[:, None, None] * height + rows[:, :, None]) * width + columns[:, None, :]
    pixels = pictures.reshape(-1, pictures.shape[3]).index_select(0, places.reshape(-1))
    # Colours stay last in memory, which is fastest for the network.
    return pixels.reshape(*places.shape, -1).permute(0, 3, 1, 2).float().div_(_BRIGHTEST)


def _change_light(seen: Tensor, augmentation: Augmentation, generator: torch.Generator) -> None:
    """Change brightness and colour."""
    n, colours = seen.shape[0], seen.shape[1]
    gain = _factors((n, 1, 1, 1), augmentation.gain, generator)
    colour = _factors((n, colours, 1, 1), augmentation.colour, generator)
    offset = augmentation.offset * (2.0 * torch.rand((n, 1, 1, 1), generator=generator) - 1.0)
    seen.mul_(gain * colour).add_(offset)


def _factors(shape: tuple[int, ...], largest: float, generator: torch.Generator) -> Tensor:
    """Return factors between 1 / largest and largest, uniform in their logarithm."""
    spread = 2.0 * torch.rand(shape, generator=generator) - 1.0
    return torch.exp(math.log(largest) * spread)


def _blur(seen: Tensor, share: float, generator: torch.Generator) -> None:
    """Blur the first few pictures; a batch is in random order."""
    if count := _random_count(len(seen), share, generator):
        seen[:count] = functional.avg_pool2d(seen[:count], 3, 1, 1, count_include_pad=False)


def _add_noise(seen: Tensor, augmentation: Augmentation, generator: torch.Generator) -> None:
    """Add noise as of a camera in the dark to the last few pictures; some are blurred and noisy."""
    if count := _random_count(len(seen), augmentation.noisy, generator):
        strength = augmentation.noise * torch.rand((count, 1, 1, 1), generator=generator)
        last = seen[-count:]
        last.add_(strength * torch.randn(last.shape, generator=generator))


def _random_count(n: int, share: float, generator: torch.Generator) -> int:
    """Return a number of pictures that is right on average even for small batches."""
    return math.floor(n * share + float(torch.rand((), generator=generator)) * (share > 0.0))


class Batch(NamedTuple):
    """Examples of one training step.

    Attributes:
        pictures: In [0, 1], shape (batch, 3, height, width); None for none.
        states: Shape (batch, k); None for none.
        targets: Shape (batch, m), or (batch,) for classes.
    """

    pictures: Tensor | None
    states: Tensor | None
    targets: Tensor


class Batches:
    """Infinite batches of augmented examples, each drawn once before any repeats.

    Args:
        shown: The examples.
        learned: Mask of those to learn from, shape (n,).
        rehearsal: Examples to mix in; None for none.
        settings: Batch size, share of the rehearsal, and augmentation.
        seed: Seed of order and augmentation.
    """

    def __init__(
        self,
        shown: Examples,
        learned: NDArray[np.bool_],
        rehearsal: Examples | None,
        settings: CloneSettings,
        seed: int,
    ) -> None:
        self._generator = torch.Generator().manual_seed(seed)
        self._settings = settings
        again = 0 if rehearsal is None else round(settings.rehearsal * settings.batch)
        self._sources = [_Source(shown, np.flatnonzero(learned), settings.batch - again)]
        if rehearsal is not None and again:
            self._sources.append(_Source(rehearsal, np.arange(len(rehearsal)), again))

    @property
    def size(self) -> int:
        """Number of different examples to learn from, without the rehearsal."""
        return self._sources[0].size

    def draw(self) -> Batch:
        """Return the next batch."""
        parts = [source.draw(self._settings, self._generator) for source in self._sources]
        pictures, states, targets = (_joined(few) for few in zip(*parts, strict=True))
        return Batch(pictures, states, cast("Tensor", targets))


class _Source:
    """Examples in an order that is shuffled again whenever it ends."""

    def __init__(self, shown: Examples, index: NDArray[np.intp], at_a_time: int) -> None:
        self._pictures, self._states = _tensor(shown.pictures), _tensor(shown.states)
        self._mirrored_states = _tensor(shown.mirrored_states)
        self._targets = torch.as_tensor(shown.targets)
        self._mirrored_targets = torch.as_tensor(shown.mirrored_targets)
        self.size = len(index)
        self._index = torch.as_tensor(index)
        self._at_a_time = at_a_time
        self._waiting = self._index[:0]

    def draw(self, settings: CloneSettings, generator: torch.Generator) -> Batch:
        """Return the next examples, augmented."""
        few = self._next(generator)
        if self._pictures is None:
            share = settings.augmentation.mirror
            seen, turned = None, torch.rand(len(few), generator=generator) < share
        else:
            seen, turned = augmented(self._pictures, few, settings.augmentation, generator)
        states = None
        if self._states is not None and self._mirrored_states is not None:
            states = _select(turned, self._mirrored_states[few], self._states[few])
        return Batch(seen, states, _select(turned, self._mirrored_targets[few], self._targets[few]))

    def _next(self, generator: torch.Generator) -> Tensor:
        """Return the next indices; with too few examples, some repeat within a batch."""
        while len(self._waiting) < self._at_a_time:
            order = torch.randperm(self.size, generator=generator)
            self._waiting = torch.cat((self._waiting, self._index[order]))
        few, self._waiting = self._waiting.tensor_split([self._at_a_time])
        return few


def _select(turned: Tensor, mirrored: Tensor, plain: Tensor) -> Tensor:
    """Select the mirrored or the plain value of each row."""
    return torch.where(turned if plain.ndim == 1 else turned[:, None], mirrored, plain)


def _joined(parts: Sequence[Tensor | None]) -> Tensor | None:
    there = [part for part in parts if part is not None]
    return torch.cat(there) if len(there) > 1 else there[0] if there else None


def _tensor(values: NDArray[Any] | None) -> Tensor | None:
    # PyTorch does not accept read-only arrays, such as memory-mapped files.
    return None if values is None else torch.as_tensor(np.require(values, requirements=["C", "W"]))
