"""Training of networks, and cloning of steering and throttle from pictures."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Protocol, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.demonstrations import Examples, held_out, steering_examples
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.errors import MissingExtra

try:
    import torch
    from torch import Tensor
    from torch.nn import functional

    from shapechanger.demos.cloning.batches import Batch, Batches
    from shapechanger.demos.cloning.network import CameraNetwork
except ImportError as error:
    raise MissingExtra("torch", "learn") from error

__all__ = ["HUBER_BETA", "History", "Judged", "ValidationScore", "clone", "fit"]

# Error at which the loss changes from quadratic to linear. An error of a tenth of the steering's
# range is a mistake, and one mistake of the driver should not outweigh ten small errors.
HUBER_BETA: Final = 0.1
_MAX_INITIAL: Final = 0.95  # Keeps the initial output in the range where tanh can still learn.
_MAX_GRADIENT: Final = 1.0
# The average of early steps forgets faster: step / (step + 10).
_AVERAGE_FROM: Final = 10.0


class ValidationScore(msgspec.Struct, frozen=True):
    """Result of a validation.

    Attributes:
        step: Number of training steps so far.
        loss: Mean loss of the batches since the last validation.
        steering: Mean absolute error of the steering on the held-out pictures; NaN without any.
        throttle: Mean absolute error of the throttle; NaN without held-out pictures.
    """

    step: int
    loss: float
    steering: float
    throttle: float

    @property
    def error(self) -> float:
        """Sum of both errors; smaller is better."""
        return self.steering + self.throttle


@dataclass(frozen=True, slots=True)
class History:
    """Course of a training.

    Attributes:
        checks: Validations in order; the first one is from before training.
        best: Validation of the policy that was kept.
        steps: Number of training steps.
        learned: Number of pictures learned from.
        held_out: Number of pictures used for early stopping.
        guess: Mean absolute errors of steering and throttle on the held-out pictures for a constant
            action, the median of the training actions; NaN without held-out pictures.
        seconds: Duration, s.
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
    """Learn the steering and throttle of a driver from pictures.

    Equal arguments give an equal policy on the same machine with the same number of threads.

    Args:
        pictures: Shape (n, H, W, 3), raw or prepared.
        actions: Steering and throttle in [-1, 1], shape (n, 2).
        settings: Hyperparameters; None for the defaults.
        seed: Seed of all randomness.
        episodes: Number of pictures of each episode, in order; () for a single episode. The end of
            each one is used for early stopping.
        start: Policy to train further, which is not changed; None to start from scratch.
        rehearsal: Pictures and actions that `start` was trained on, mixed in so that they are not
            forgotten.
        on_check: Called after each validation.

    Returns:
        The policy that was best on the held-out pictures, or the last one without them, and the
        course of the training.

    Raises:
        CloningError: If there are no examples, or an array is invalid.
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
    """Initialise the output of an untrained policy to the mean action."""
    initial = torch.as_tensor(mean).clamp(-_MAX_INITIAL, _MAX_INITIAL)
    with torch.no_grad():
        policy.network.hands.bias.copy_(torch.atanh(initial))


def _check(policy: CameraPolicy, exam: Examples, step: int, loss: float) -> ValidationScore:
    return ValidationScore(step, loss, *_errors(policy.predict_many(exam.pictures), exam.targets))


def _errors(done: NDArray[np.floating], wanted: NDArray[np.float32]) -> tuple[float, float]:
    """Return the mean absolute errors of steering and throttle; NaN without examples."""
    if not len(wanted):
        return math.nan, math.nan
    steering, throttle = np.abs(done - wanted).mean(axis=0).tolist()
    return steering, throttle


class Judged(Protocol):
    """Result of a validation of any kind."""

    @property
    def error(self) -> float:
        """Validation error; smaller is better, NaN if unknown."""
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
    """Train a network in place, and restore its best weights at the end.

    Args:
        network: The network.
        batches: The training data.
        loss: Returns the loss of a batch.
        judge: Validates a network, given the step and the mean loss since the last validation.
        settings: Number of steps, validations, and patience.
        rate: Maximum learning rate.
        on_check: Called after each validation.

    Returns:
        The validations in order, the index of the best one, and the number of steps.
    """
    optimizer = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=settings.weight_decay)
    total = settings.steps(batches.size)
    every = max(total // settings.checks, 1)
    # Validated and kept: the network itself, or the average of its weights.
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
        torch.nn.utils.clip_grad_norm_(network.parameters(), _MAX_GRADIENT)
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
        if not check.error >= checks[best].error:  # NaN without held-out data: keep the last.
            best, worse, best_state = len(checks) - 1, 0, _copied(kept)
    network.load_state_dict(best_state)
    network.eval()
    return checks, best, step


def _average(average: CameraNetwork, network: CameraNetwork, share: float) -> None:
    """Update a moving average of the weights."""
    with torch.no_grad():
        for old, new in zip(average.parameters(), network.parameters(), strict=True):
            old.lerp_(new, 1.0 - share)


def _share_of_rate(step: int, total: int, warm_up: int) -> float:
    """Return the learning rate schedule: a linear warm-up, and half a cosine down to 0."""
    rising = min((step + 1) / warm_up, 1.0) if warm_up else 1.0
    return rising * 0.5 * (1.0 + math.cos(math.pi * step / total))


def _copied(network: CameraNetwork) -> dict[str, Tensor]:
    return {name: value.clone() for name, value in network.state_dict().items()}
