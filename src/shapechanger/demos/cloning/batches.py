"""Which examples are learned from together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from shapechanger.demos.cloning.augment import augmented
from shapechanger.demos.cloning.demonstrations import Examples
from shapechanger.demos.cloning.settings import CloneSettings

__all__ = ["Batch", "Batches"]


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
