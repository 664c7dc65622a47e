"""Which examples are learned from together."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from shapechanger.demos.cloning.demonstrations import Examples
from shapechanger.demos.cloning.settings import Augmentation, CloneSettings

__all__ = ["Batch", "Batches", "augmented", "plain"]

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


class Batch(NamedTuple):
    """Examples that are learned from together.

    Attributes:
        pictures: In [0, 1], shape (batch, 3, height, width); None for none.
        states: Shape (batch, k); None for none.
        targets: Shape (batch, m), or (batch,) for classes.
    """

    pictures: Tensor | None
    states: Tensor | None
    targets: Tensor


class Batches:
    """Endless batches of augmented examples: every one once before any comes again.

    Args:
        shown: What to learn from.
        learned: Which of it, shape (n,).
        rehearsal: What to mix in; None for nothing.
        settings: Size of a batch, share of the rehearsal, augmentation.
        seed: Seed of the order and of the augmentation.
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
        """How many different examples are learned from, without the rehearsed ones."""
        return self._sources[0].size

    def draw(self) -> Batch:
        """The next batch."""
        parts = [source.draw(self._settings, self._generator) for source in self._sources]
        if len(parts) == 1:
            return parts[0]
        return Batch(
            _joined([part.pictures for part in parts]),
            _joined([part.states for part in parts]),
            torch.cat([part.targets for part in parts]),
        )


class _Source:
    """Examples in an order that is shuffled whenever it ends."""

    def __init__(self, shown: Examples, index: NDArray[np.intp], at_a_time: int) -> None:
        # Torch does not take arrays that may not be written to, such as parts of a file.
        self.pictures = (
            None
            if shown.pictures is None
            else torch.as_tensor(np.require(shown.pictures, requirements=["C", "W"]))
        )
        self.states = _tensor(shown.states)
        self.turned_states = _tensor(shown.turned_states)
        self.targets = torch.as_tensor(shown.targets)
        self.turned_targets = torch.as_tensor(shown.turned_targets)
        self.size = len(index)
        self._index = torch.as_tensor(index)
        self._at_a_time = at_a_time
        self._waiting = self._index[:0]

    def draw(self, settings: CloneSettings, generator: torch.Generator) -> Batch:
        """The next few, each a little different from how it was."""
        few = self._next(generator)
        if self.pictures is None:
            share = settings.augmentation.mirror
            seen, turned = None, torch.rand(len(few), generator=generator) < share
        else:
            seen, turned = augmented(self.pictures, few, settings.augmentation, generator)
        targets = _either(turned, self.turned_targets[few], self.targets[few])
        states = None
        if self.states is not None:
            mirrored = self.states if self.turned_states is None else self.turned_states
            states = _either(turned, mirrored[few], self.states[few])
        return Batch(seen, states, targets)

    def _next(self, generator: torch.Generator) -> Tensor:
        """The next few; where there are fewer examples than that, some come more than once."""
        while len(self._waiting) < self._at_a_time:
            order = torch.randperm(self.size, generator=generator)
            self._waiting = torch.cat((self._waiting, self._index[order]))
        few = self._waiting[: self._at_a_time]
        self._waiting = self._waiting[self._at_a_time :]
        return few


def _either(turned: Tensor, mirrored: Tensor, plain: Tensor) -> Tensor:
    """Of each row the one or the other."""
    return torch.where(turned if plain.ndim == 1 else turned[:, None], mirrored, plain)


def _joined(parts: list[Tensor | None]) -> Tensor | None:
    there = [part for part in parts if part is not None]
    return torch.cat(there) if there else None


def _tensor(values: NDArray[np.float32] | None) -> Tensor | None:
    return None if values is None else torch.as_tensor(values)
