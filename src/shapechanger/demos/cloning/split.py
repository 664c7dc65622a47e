"""Which steps are learned from, which judge the policy, and which choose when to stop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.errors import CloningError

__all__ = ["SplitBy", "judged_steps", "stretch"]

SplitBy = Literal["time", "episode"]
"""Hold out the last stretch of time, or whole episodes."""


def judged_steps(episodes: Sequence[int], by: SplitBy, share: float) -> NDArray[np.bool_]:
    """Which steps are not learned from but judge the policy: the last ones.

    They are the last and not any, because neighbours in time look alike.

    Args:
        episodes: Steps of each episode, in order.
        by: "time" takes the last share of all steps; "episode" as many whole episodes at the end
            as it takes to have that share, at least one, and leaves at least one.
        share: In [0, 1); 0 for none.

    Returns:
        A mask of shape (sum(episodes),).

    Raises:
        CloningError: If the share is none, or there is one episode only.
    """
    if not 0.0 <= share < 1.0:
        raise CloningError(f"The held-out share is in [0, 1), got {share}.")
    n = sum(episodes)
    mask = np.zeros(n, np.bool_)
    if not share:
        return mask
    if by == "time":
        mask[n - math.floor(share * n) :] = True
        return mask
    lengths = [length for length in episodes if length]
    if len(lengths) < 2:
        raise CloningError(
            "There is one episode only, so none can be held out: split by time in place of episode."
        )
    last = 0
    for length in reversed(lengths[1:]):
        if last and last >= share * n:
            break
        last += length
    mask[n - last :] = True
    return mask


def stretch(n: int, member: int, members: int, share: float) -> NDArray[np.bool_]:
    """Which of the learned steps choose when a member stops: a stretch of time of its own.

    Args:
        n: How many steps there are to learn from.
        member: Which one.
        members: How many there are; the stretch of the last one is the end.
        share: Length of the stretch, in [0, 1); of no more than n / (members + 1) steps.

    Returns:
        A mask of shape (n,).
    """
    length = min(math.floor(share * n), n // (members + 1))
    start = round((n - length) * (member + 1) / members)
    mask = np.zeros(n, np.bool_)
    mask[start : start + length] = True
    return mask
