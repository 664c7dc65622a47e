"""The one loop in which networks learn, whatever comes in and whatever is to come out."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from typing import Final, Protocol, TypeVar

import torch
from torch import Tensor

from shapechanger.demos.cloning.batches import Batch, Batches
from shapechanger.demos.cloning.network import CameraNetwork
from shapechanger.demos.cloning.settings import CloneSettings

__all__ = ["Judged", "fit"]

_LARGEST_GRADIENT: Final = 1.0
# Early steps are averaged over fewer of them: this many more at least than there have been.
_AVERAGE_FROM: Final = 10.0


class Judged(Protocol):
    """How good a network is at some step."""

    @property
    def error(self) -> float:
        """The smaller the better; NaN where nothing can be said."""
        ...


_Check = TypeVar("_Check", bound=Judged)


def fit(
    network: CameraNetwork,
    batches: Batches,
    loss: Callable[[CameraNetwork, Batch], Tensor],
    judge: Callable[[CameraNetwork, int, float], _Check],
    settings: CloneSettings,
    rate: float,
    on_check: Callable[[_Check], None],
) -> tuple[list[_Check], int, int]:
    """Train a network in place, and leave it as it was at its best.

    Args:
        network: What learns.
        batches: What it learns from.
        loss: What is made small.
        judge: Says how good a network is, given the step and the mean loss since the last time.
        settings: How many steps, how often to judge, when to give up.
        rate: Largest learning rate.
        on_check: Called with each judgement as soon as it is there.

    Returns:
        The judgements in order, the place of the best one, and the steps that were taken.
    """
    optimizer = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=settings.weight_decay)
    total = settings.steps(batches.size)
    every = max(total // settings.checks, 1)
    # What is judged and kept: the network itself, or the average of what it was.
    kept = copy.deepcopy(network) if settings.averaging else network

    checks = [judge(kept.eval(), 0, math.nan)]
    on_check(checks[0])
    best, best_state = 0, _copied(kept)
    losses: list[float] = []
    step = worse = 0
    while step < total and worse < settings.patience:
        for group in optimizer.param_groups:
            group["lr"] = rate * _share_of_rate(step, total, settings.warm_up)
        network.train()
        now = loss(network, batches.draw())
        optimizer.zero_grad()
        now.backward()  # pyright: ignore[reportUnknownMemberType]
        torch.nn.utils.clip_grad_norm_(network.parameters(), _LARGEST_GRADIENT)
        optimizer.step()  # pyright: ignore[reportUnknownMemberType]
        losses.append(now.item())
        step += 1
        if settings.averaging:
            _average(kept, network, min(settings.averaging, step / (step + _AVERAGE_FROM)))
        if step % every and step < total:
            continue
        check = judge(kept.eval(), step, sum(losses) / len(losses))
        on_check(check)
        checks.append(check)
        losses.clear()
        worse += 1
        if not check.error >= checks[best].error:  # Without held-out data the last is the best.
            best, worse, best_state = len(checks) - 1, 0, _copied(kept)
    network.load_state_dict(best_state)
    network.eval()
    return checks, best, step


def _average(average: CameraNetwork, network: CameraNetwork, share: float) -> None:
    """Take in the newest weights, and keep a share of what was there."""
    with torch.no_grad():
        for old, new in zip(average.parameters(), network.parameters(), strict=True):
            old.lerp_(new, 1.0 - share)


def _share_of_rate(step: int, total: int, warm_up: int) -> float:
    """Up along a line, down along half a cosine."""
    rising = min((step + 1) / warm_up, 1.0) if warm_up else 1.0
    return rising * 0.5 * (1.0 + math.cos(math.pi * step / total))


def _copied(network: CameraNetwork) -> dict[str, Tensor]:
    return {name: value.clone() for name, value in network.state_dict().items()}
