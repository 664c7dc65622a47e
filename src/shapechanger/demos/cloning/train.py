"""Learning to drive as somebody else drove."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Protocol, TypeVar

import msgspec
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from shapechanger.demos.cloning.batches import Batch, Batches
from shapechanger.demos.cloning.demonstrations import Examples, held_out, steering_examples
from shapechanger.demos.cloning.network import CameraNetwork
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.errors import MissingExtra

__all__ = ["HUBER_BETA", "History", "Judged", "ValidationScore", "clone", "fit"]

try:
    import torch
    from torch import Tensor
    from torch.nn import functional

    from shapechanger.demos.cloning.batches import Batch, Batches
    from shapechanger.demos.cloning.network import CameraNetwork
except ImportError as error:
    raise MissingExtra("torch", "learn") from error


# Where the loss turns from a square into a straight line: an error of a tenth of the steering's
# range is a mistake, and one mistake of the driver should not count as much as ten small ones.
HUBER_BETA: Final = 0.1
_MOST_CERTAIN: Final = 0.95


class ValidationScore(msgspec.Struct, frozen=True):
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

    checks: tuple[ValidationScore, ...]
    best: ValidationScore
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
    on_check: Callable[[ValidationScore], None] = lambda check: None,
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
    shown = steering_examples(pictures, actions, framing)
    kept_back = held_out(len(shown), episodes, settings.held_out)
    again = None if rehearsal is None else steering_examples(*rehearsal, framing)

    policy = CameraPolicy.fresh(settings, seed) if start is None else start.copy()
    if start is None:
        _begin_with(policy, shown.targets[~kept_back].mean(axis=0))
    batches = Batches(shown, ~kept_back, again, settings, seed)
    exam = shown.part(kept_back)
    rate = settings.learning_rate if start is None else settings.further_rate
    weights = torch.tensor([1.0, settings.throttle_weight])

    def loss(network: CameraNetwork, batch: Batch) -> Tensor:
        done = torch.tanh(network(batch.pictures))
        errors = functional.smooth_l1_loss(done, batch.targets, reduction="none", beta=HUBER_BETA)
        return (errors * weights).mean()

    def judge(network: CameraNetwork, step: int, loss: float) -> ValidationScore:
        return _check(CameraPolicy(network, policy.card), exam, step, loss)

    checks, place, taken = fit(policy.network, batches, loss, judge, settings, rate, on_check)
    best = checks[place]

    card = msgspec.structs.replace(
        policy.card, seeds=(*policy.card.seeds, seed), steps=best.step, settings=settings
    )
    guess = _errors(np.median(shown.targets[~kept_back], axis=0), exam.targets)
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


def _check(policy: CameraPolicy, exam: Examples, step: int, loss: float) -> ValidationScore:
    return ValidationScore(step, loss, *_errors(policy.predict_many(exam.pictures), exam.targets))


def _errors(done: NDArray[np.floating], wanted: NDArray[np.float32]) -> tuple[float, float]:
    """Mean absolute errors of steering and throttle; NaN where nothing was wanted."""
    if not len(wanted):
        return math.nan, math.nan
    steering, throttle = np.abs(done - wanted).mean(axis=0).tolist()
    return steering, throttle


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
