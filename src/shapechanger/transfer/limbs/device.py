"""Observations and actions of many worlds on a device as rows of limbs, without leaving it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np

from shapechanger.errors import MissingExtra
from shapechanger.transfer.limbs.rows import LimbRows

try:
    import torch
    from torch import Tensor
except ImportError as error:
    raise MissingExtra("torch", "gpu") from error


class DeviceRows:
    """Map between the numbers of worlds of `shapechanger.make_vec(backend="warp")` and rows.

    Where a body has fewer limbs than others its last rows are empty, so that all worlds share one
    tensor.

    Args:
        envs: The worlds.
        each: The rows of each world's body, all with the same room.

    Attributes:
        room: Limbs that there are rows for.
    """

    def __init__(self, envs: Any, each: Sequence[LimbRows]) -> None:
        self.room = each[0].room
        # Each batch has spaces of its own, and so tensors of its own.
        self._apart = isinstance(envs.single_action_space, gym.spaces.Tuple)
        self._batches = [
            _Batch(batch.numbers, [each[int(i)] for i in batch.numbers.tolist()])
            for batch in envs.batches
        ]

    def of(self, observations: Any) -> Tensor:
        """Return the rows of all worlds, flattened, shape (n, (room + 1) * width).

        Args:
            observations: Those of the vector env: one tensor, or one per batch.
        """
        parts = [
            batch.rows(observations[i] if self._apart else observations[batch.numbers])
            for i, batch in enumerate(self._batches)
        ]
        return self._gathered(parts)

    def actions(self, limbs: Tensor) -> Tensor | list[Tensor]:
        """Return the actions of all worlds as the vector env takes them.

        Args:
            limbs: A number from -1 to 1 for each limb, shape (n, room).
        """
        parts = [batch.actions(limbs[batch.numbers]) for batch in self._batches]
        return parts if self._apart else self._gathered(parts)

    def _gathered(self, parts: list[Tensor]) -> Tensor:
        """Return rows of all batches in the order of the worlds."""
        count = sum(len(part) for part in parts)
        whole = parts[0].new_empty((count, parts[0].shape[1]))
        for batch, part in zip(self._batches, parts, strict=True):
            whole[batch.numbers] = part
        return whole


class _Batch:
    """Rows of worlds whose bodies have arrays of the same shapes, and so numbers in the same order.

    Args:
        numbers: The number of each world, shape (k,).
        each: The rows of each world's body.
    """

    def __init__(self, numbers: Tensor, each: Sequence[LimbRows]) -> None:
        def stacked(name: str) -> Tensor:
            values = np.stack([getattr(rows, name) for rows in each])
            return torch.as_tensor(values, dtype=torch.float32, device=numbers.device)

        first = each[0]
        self.numbers = numbers
        self._scale, self._offset = stacked("scale"), stacked("offset")
        self._low, self._high = stacked("low"), stacked("high")
        self._constant = stacked("constant")
        self._selection = torch.as_tensor(
            first.selection, dtype=torch.float32, device=numbers.device
        )
        self._actuators = torch.as_tensor(first.actuators, device=numbers.device)

    def rows(self, observations: Tensor) -> Tensor:
        """Return the rows; observations have the shape (k, observations)."""
        scaled = observations * self._scale + self._offset
        return scaled @ self._selection + self._constant

    def actions(self, limbs: Tensor) -> Tensor:
        """Return the worlds' own actions; `limbs` has the shape (k, room)."""
        share = 0.5 * (limbs[:, self._actuators] + 1.0)
        return self._low + share * (self._high - self._low)
