"""Learning to drive as somebody else drove."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.batches import Batches
from shapechanger.demos.cloning.demonstrations import Demonstrations, held_out
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.errors import MissingExtra

try:
    import torch
    from torch import Tensor
    from torch.nn import functional
except ImportError as error:
    raise MissingExtra("torch", "learn") from error

__all__ = ["Check", "History", "clone"]

# Where the loss turns from a square into a straight line: an error of a tenth of the steering's
# range is a mistake, and one mistake of the driver should not count as much as ten small ones.
_HUBER_BETA: Final = 0.1
_LARGEST_GRADIENT: Final = 1.0
_MOST_CERTAIN: Final = 0.95


class Check(msgspec.Struct, frozen=True):
    """How good the policy was at some step.

    Attributes:
        step: Steps of training before it.
        loss: Mean loss of the batches since the check before.
        steering: Mean absolute error of the steering on the held-out pictures; NaN without any.
        throttle: The same of the throttle.
    """

    step: int
    loss: float
    steering: float
    throttle: float

    @property
    def error(self) -> float:
        """Both errors together; the smaller the better."""
        return self.steering + self.throttle


@dataclass(frozen=True, slots=True)
class History:
    """How a training went.

    Attributes:
        checks: In order; the first is from before training.
        best: The check of the policy that was kept.
        steps: Steps that were taken.
        learned: Pictures that were learned from.
        held_out: Pictures that chose when to stop.
        guess: Mean absolute errors, on the held-out pictures, of steering and throttle when always
            the median of the learned actions is guessed; NaN without any.
        seconds: How long it took.
    """

    checks: tuple[Check, ...]
    best: Check
    steps: int
    learned: int
    held_out: int
    guess: tuple[float, float]
    seconds: float


def clone(
    pictures: NDArray[np.uint8],
    actions: NDArray[np.floating],
    *,
    settings: CloneSettings | None = None,
    seed: int,
    episodes: Sequence[int] = (),
    start: CameraPolicy | None = None,
    rehearsal: tuple[NDArray[np.uint8], NDArray[np.floating]] | None = None,
    on_check: Callable[[Check], None] = lambda check: None,
) -> tuple[CameraPolicy, History]:
    """Learn to do on seeing a picture what a driver did.

    The same arguments give the same policy on the same machine with as many threads.

    Args:
        pictures: What the camera saw, shape (n, H, W, 3), as recorded or prepared.
        actions: What the driver did, shape (n, 2): steering and throttle in [-1, 1].
        settings: How to learn; None for the defaults.
        seed: Seed of everything random in it.
        episodes: How many pictures each episode has, in order; none for a single episode. The end
            of each chooses when to stop.
        start: A policy to go on from, which stays as it is; None to begin with nothing.
        rehearsal: Pictures and actions that `start` was learned from, which are mixed in so that
            it does not forget them.
        on_check: Called with each check as soon as it is there.

    Returns:
        The policy that did best on the held-out pictures, or the last one without such pictures,
        and how the training went.

    Raises:
        CloningError: If there is nothing to learn from, or it does not fit together.
    """
    began = time.monotonic()
    settings = CloneSettings() if settings is None else settings
    framing = settings.framing if start is None else start.card.framing
    shown = Demonstrations.checked(pictures, actions, framing)
    kept_back = held_out(len(shown.actions), episodes, settings.held_out)
    again = None if rehearsal is None else Demonstrations.checked(*rehearsal, framing)

    policy = CameraPolicy.fresh(settings, seed) if start is None else start.copy()
    if start is None:
        _begin_with(policy, shown.actions[~kept_back].mean(axis=0))
    batches = Batches(shown, ~kept_back, again, settings, seed)
    exam = Demonstrations(shown.pictures[kept_back], shown.actions[kept_back])
    rate = settings.learning_rate if start is None else settings.further_rate
    checks, best, taken = _learn(policy, batches, exam, settings, rate, on_check)

    card = msgspec.structs.replace(
        policy.card, seeds=(*policy.card.seeds, seed), steps=best.step, settings=settings
    )
    guess = _errors(np.median(shown.actions[~kept_back], axis=0), exam.actions)
    history = History(
        checks=tuple(checks),
        best=best,
        steps=taken,
        learned=int((~kept_back).sum()),
        held_out=int(kept_back.sum()),
        guess=guess,
        seconds=time.monotonic() - began,
    )
    return CameraPolicy(policy.network, card), history


def _begin_with(policy: CameraPolicy, mean: NDArray[np.float32]) -> None:
    """Let an untrained policy do what the driver does on average."""
    certain = torch.as_tensor(mean).clamp(-_MOST_CERTAIN, _MOST_CERTAIN)
    with torch.no_grad():
        policy.network.hands.bias.copy_(torch.atanh(certain))


def _learn(
    policy: CameraPolicy,
    batches: Batches,
    exam: Demonstrations,
    settings: CloneSettings,
    rate: float,
    on_check: Callable[[Check], None],
) -> tuple[list[Check], Check, int]:
    """Train a policy's network in place, and leave it as it was at its best."""
    network = policy.network
    optimizer = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=settings.weight_decay)
    total = settings.steps(batches.size)
    every = max(total // settings.checks, 1)
    weights = torch.tensor([1.0, settings.throttle_weight])

    best = _check(policy, exam, 0, math.nan)
    on_check(best)
    checks = [best]
    best_state = _copied(network.state_dict())
    losses: list[float] = []
    step = worse = 0
    while step < total and worse < settings.patience:
        for group in optimizer.param_groups:
            group["lr"] = rate * _share_of_rate(step, total, settings.warm_up)
        network.train()
        seen, wanted = batches.draw()
        loss = _loss(network(seen), wanted, weights)
        optimizer.zero_grad()
        loss.backward()  # pyright: ignore[reportUnknownMemberType]
        torch.nn.utils.clip_grad_norm_(network.parameters(), _LARGEST_GRADIENT)
        optimizer.step()  # pyright: ignore[reportUnknownMemberType]
        losses.append(loss.item())
        step += 1
        if step % every and step < total:
            continue
        check = _check(policy, exam, step, float(np.mean(losses)))
        on_check(check)
        checks.append(check)
        losses.clear()
        worse += 1
        if not check.error >= best.error:  # Without held-out pictures the last is the best.
            best, worse, best_state = check, 0, _copied(network.state_dict())
    network.load_state_dict(best_state)
    network.eval()
    return checks, best, step


def _loss(done: Tensor, wanted: Tensor, weights: Tensor) -> Tensor:
    errors = functional.smooth_l1_loss(done, wanted, reduction="none", beta=_HUBER_BETA)
    return (errors * weights).mean()


def _share_of_rate(step: int, total: int, warm_up: int) -> float:
    """Up along a line, down along half a cosine."""
    rising = min((step + 1) / warm_up, 1.0) if warm_up else 1.0
    return rising * 0.5 * (1.0 + math.cos(math.pi * step / total))


def _check(policy: CameraPolicy, exam: Demonstrations, step: int, loss: float) -> Check:
    policy.network.eval()
    return Check(step, loss, *_errors(policy.predict_many(exam.pictures), exam.actions))


def _errors(done: NDArray[np.floating], wanted: NDArray[np.float32]) -> tuple[float, float]:
    """Mean absolute errors of steering and throttle; NaN where nothing was wanted."""
    if not len(wanted):
        return math.nan, math.nan
    steering, throttle = np.abs(done - wanted).mean(axis=0).tolist()
    return steering, throttle


def _copied(state: dict[str, Tensor]) -> dict[str, Tensor]:
    return {name: value.clone() for name, value in state.items()}
