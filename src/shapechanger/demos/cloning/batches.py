"""Which pictures are learned from together."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from shapechanger.demos.cloning.augment import augmented
from shapechanger.demos.cloning.demonstrations import Demonstrations
from shapechanger.demos.cloning.settings import CloneSettings

__all__ = ["Batches"]


class Batches:
    """Endless batches of augmented pictures: every picture once before any comes again.

    Args:
        shown: What to learn from.
        learned: Which of it, shape (n,).
        rehearsal: What to mix in; None for nothing.
        settings: Size of a batch, share of the rehearsal, augmentation.
        seed: Seed of the order and of the augmentation.
    """

    def __init__(
        self,
        shown: Demonstrations,
        learned: NDArray[np.bool_],
        rehearsal: Demonstrations | None,
        settings: CloneSettings,
        seed: int,
    ) -> None:
        self._generator = torch.Generator().manual_seed(seed)
        self._augmentation = settings.augmentation
        again = 0 if rehearsal is None else round(settings.rehearsal * settings.batch)
        self._sources = [_Source(shown, np.flatnonzero(learned), settings.batch - again)]
        if rehearsal is not None and again:
            everything = np.arange(len(rehearsal.actions))
            self._sources.append(_Source(rehearsal, everything, again))

    @property
    def size(self) -> int:
        """How many different pictures are learned from, without the rehearsed ones."""
        return self._sources[0].size

    def draw(self) -> tuple[Tensor, Tensor]:
        """Pictures in [0, 1], shape (batch, 3, height, width), and actions, shape (batch, 2)."""
        parts = [
            augmented(
                source.pictures,
                source.actions,
                source.next(self._generator),
                self._augmentation,
                self._generator,
            )
            for source in self._sources
        ]
        if len(parts) == 1:
            return parts[0]
        seen, wanted = zip(*parts, strict=True)
        return torch.cat(seen), torch.cat(wanted)


class _Source:
    """Pictures in an order that is shuffled whenever it ends."""

    def __init__(self, shown: Demonstrations, index: NDArray[np.intp], at_a_time: int) -> None:
        # Torch does not take arrays that may not be written to, such as parts of a file.
        self.pictures = torch.as_tensor(np.require(shown.pictures, requirements=["C", "W"]))
        self.actions = torch.as_tensor(shown.actions)
        self.size = len(index)
        self._index = torch.as_tensor(index)
        self._at_a_time = at_a_time
        self._waiting = self._index[:0]

    def next(self, generator: torch.Generator) -> Tensor:
        """The next few; where there are fewer pictures than that, some come more than once."""
        while len(self._waiting) < self._at_a_time:
            order = torch.randperm(self.size, generator=generator)
            self._waiting = torch.cat((self._waiting, self._index[order]))
        few = self._waiting[: self._at_a_time]
        self._waiting = self._waiting[self._at_a_time :]
        return few
