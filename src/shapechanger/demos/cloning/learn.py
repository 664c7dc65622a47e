"""Behaviour cloning: steering from images, or any actions from any demonstrations."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import CloneCard
from shapechanger.demos.cloning.evaluation import AskedHead, output_fields
from shapechanger.demos.cloning.examples import (
    Examples,
    Mirror,
    held_out,
    mirror_of,
    steering_examples,
    stretch,
)
from shapechanger.demos.cloning.pictures import CloningError, prepare
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.settings import CloneSettings, settings_for
from shapechanger.errors import MissingExtra, check_seed

try:
    import torch
    from torch import Tensor
    from torch.nn import functional

    from shapechanger.demos.cloning.examples import Batches
    from shapechanger.demos.cloning.network import CameraNetwork, joined
except ImportError as error:
    raise MissingExtra("torch", "learn") from error

if TYPE_CHECKING:
    from shapechanger.demos.dataset import Dataset

Inputs = Literal["auto", "picture", "state", "both"]
"""Inputs of a policy; "auto" takes images if there are any, and states otherwise."""

# Error at which the loss changes from quadratic to linear. An error of a tenth of the steering's
# range is a mistake, and one mistake of the driver should not outweigh ten small errors.
_HUBER_BETA: Final = 0.1
_MAX_INITIAL: Final = 0.95  # Keeps the initial output in the range where tanh can still learn.
_MAX_GRADIENT: Final = 1.0
# The average of early steps forgets faster: step / (step + 10).
_AVERAGE_FROM: Final = 10.0
# The previous action nearly always predicts the next one: a clone that sees it learns to repeat
# itself instead of looking.
_APPLIED: Final = "/applied"
_MIN_SPREAD: Final = 1e-6
# From twice as confident to a fifth as confident.
_TEMPERATURES: Final = torch.logspace(-0.3, 0.7, 101)
_MIN_CALIBRATION_STEPS: Final = 20


class MemberCheck(msgspec.Struct, frozen=True):
    """Validation of one member.

    Attributes:
        member: Index of the member.
        step: Number of its training steps so far.
        loss: Mean loss of the batches since the last validation; NaN at the start.
        error: Error on the steps held out for early stopping, smaller is better; NaN without any.
    """

    member: int
    step: int
    loss: float
    error: float


@dataclass(frozen=True, slots=True)
class Training:
    """Course of a training.

    Attributes:
        checks: Validations of all members, in order; the first of each is from before training.
        best_steps: Step of each member at which it was best, which was kept.
        learned: Number of demonstrated steps learned from.
        mirrored: Share of examples that were mirrored.
        mirror_note: Reason for that share, in a sentence; "" for a share that the settings state.
        seconds: Duration, s.
    """

    checks: tuple[MemberCheck, ...]
    best_steps: tuple[int, ...]
    learned: int
    mirrored: float
    mirror_note: str
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
    on_check: Callable[[MemberCheck], None] = lambda check: None,
) -> tuple[CameraPolicy, Training]:
    """Learn the steering and throttle of a driver from images, with one network.

    Equal arguments give an equal policy on the same machine with the same number of threads.

    Args:
        pictures: Shape (n, H, W, 3), raw or prepared.
        actions: Steering and throttle in [-1, 1], shape (n, 2).
        settings: Hyperparameters; None for the defaults. `members`, `dropout` and `smoothing` are
            ignored.
        seed: Seed of all randomness.
        episodes: Number of images of each episode, in order; () for a single episode. The end of
            each one is used for early stopping, by the sum of the mean absolute errors.
        start: Policy to train further, which is not changed; None to start from scratch.
        rehearsal: Images and actions that `start` was trained on, mixed in so that they are not
            forgotten.
        on_check: Called after each validation.

    Returns:
        The policy that was best on the held-out images, or the last one without them, and the
        course of the training.

    Raises:
        CloningError: If there are no examples, or an array is invalid.
    """
    began = time.monotonic()
    given = CloneSettings() if settings is None else settings
    settings = msgspec.structs.replace(given, members=1, dropout=0.0, smoothing=0.0)
    framing = settings.framing if start is None else start.card.framing
    shown = steering_examples(pictures, actions, framing)
    kept_back = held_out(len(shown), episodes, settings.held_out)
    policy = CameraPolicy.fresh(settings, seed) if start is None else start.copy()
    lesson = _Lesson(
        shown,
        settings,
        settings.learning_rate if start is None else settings.further_rate,
        torch.tensor([1.0, settings.throttle_weight]),
        None if rehearsal is None else steering_examples(*rehearsal, framing),
        on_check,
    )
    if start is None:
        lesson.begin(policy, ~kept_back)

    def error(network: CameraNetwork, validation: Examples) -> float:
        done = CameraPolicy(network, policy.card).predict_many(validation.pictures)
        return sum(np.abs(done - validation.targets).mean(axis=0).tolist())

    with _seeded(seed):
        checks, best = lesson.fit(policy, kept_back, seed, 0, error)
    card = msgspec.structs.replace(
        policy.card, seeds=(*policy.card.seeds, seed), steps=best, settings=given
    )
    learned, seconds = int((~kept_back).sum()), time.monotonic() - began
    mirrored = settings.augmentation.mirror
    training = Training(tuple(checks), (best,), learned, mirrored, "", seconds)
    return CameraPolicy(policy.network, card), training


def learn(
    data: Dataset,
    learned: NDArray[np.bool_] | None = None,
    *,
    settings: CloneSettings | None = None,
    head: AskedHead = "auto",
    inputs: Inputs = "auto",
    seed: int = 0,
    on_check: Callable[[MemberCheck], None] = lambda check: None,
) -> tuple[CameraPolicy, Training]:
    """Learn the actions of a driver.

    The policy is the mean of several networks, each of which uses another stretch of time for early
    stopping. Equal arguments give an equal policy on the same machine with the same number of
    threads.

    Args:
        data: The demonstrations.
        learned: Mask of the steps to learn from, shape (n,); None for all.
        settings: Hyperparameters; None for those of `settings_for`. `throttle_weight` is ignored.
        head: Kind of output.
        inputs: Inputs of the policy.
        seed: Seed of all randomness.
        on_check: Called after each validation.

    Returns:
        The policy, and the course of the training.

    Raises:
        CloningError: If the data are unsuitable, or the seed is not a whole number from 0 to
            2^32 - 1.
    """
    seed = check_seed(seed, CloningError)
    began = time.monotonic()
    which = np.ones(len(data.actions), np.bool_) if learned is None else learned
    if not which.any():
        raise CloningError("There is no step to learn from.")
    settings = settings_for(int(which.sum())) if settings is None else settings
    actions = data.actions[which]
    if not np.isfinite(actions).all():
        first = int(np.flatnonzero(~np.isfinite(data.actions).all(axis=1) & which)[0])
        raise CloningError(f"Action {first} must be finite, got {data.actions[first].tolist()}.")
    with_pictures, with_states = _inputs_of(data, inputs)
    mirror, state_mirror, share, note = _mirrors(data, actions, with_states)
    settings = msgspec.structs.replace(
        settings, augmentation=msgspec.structs.replace(settings.augmentation, mirror=share)
    )
    mirrored = mirror(actions) if mirror and share else None
    unseen = _unseen(data) if with_states else ()
    states = None
    if with_states and data.states is not None and data.state_layout is not None:
        states = data.states[which].astype(np.float32)
        for name in unseen:
            states[:, data.state_layout.slices[name]] = np.nan
    card = CloneCard(
        framing=settings.framing,
        channels=settings.channels,
        features=settings.features,
        eyes=settings.eyes if with_pictures else "none",
        nerves=settings.nerves if with_states else (),
        action_layout=data.action_layout,
        state_layout=data.state_layout if with_states else None,
        unseen=unseen,
        **output_fields(actions, data.action_layout, head, mirrored),
    )
    shown = Examples(
        prepare(data.pictures[which], settings.framing)
        if with_pictures and data.pictures is not None
        else None,
        states,
        card.targets(actions),
        states if states is None or state_mirror is None else state_mirror(states),
        card.targets(actions if mirrored is None else mirrored),
    )
    lesson = _Lesson(shown, settings, settings.learning_rate, None, None, on_check)
    members = [
        lesson.member(card, stretch(len(shown), n, settings.members, settings.held_out), seed, n)
        for n in range(settings.members)
    ]
    networks, checks, steps, logits, wanted = (list(each) for each in zip(*members, strict=True))
    card = msgspec.structs.replace(
        card, members=len(members), seeds=(seed,), steps=max(steps), settings=settings
    )
    whole = joined(card, networks)
    if card.classes:
        # Scale the logits so that confidence matches accuracy on held-out steps.
        temperature = best_temperature(torch.cat(logits), torch.cat(wanted))
        with torch.no_grad():
            whole.hands.weight.div_(temperature)
            whole.hands.bias.div_(temperature)
    training = Training(
        tuple(check for own in checks for check in own),
        tuple(steps),
        len(actions),
        share,
        note,
        time.monotonic() - began,
    )
    return CameraPolicy(whole, card), training


def _inputs_of(data: Dataset, inputs: Inputs) -> tuple[bool, bool]:
    """Return whether the policy uses images, and whether it uses states."""
    if inputs == "auto":
        inputs = "picture" if data.pictures is not None else "state"
    with_pictures, with_states = inputs in {"picture", "both"}, inputs in {"state", "both"}
    if with_pictures and data.pictures is None:
        raise CloningError("These demonstrations have no images to learn from.")
    if with_states and (data.states is None or not data.states.shape[1]):
        raise CloningError("These demonstrations have no state to learn from.")
    return with_pictures, with_states


def _mirrors(
    data: Dataset, actions: NDArray[np.float32], with_states: bool
) -> tuple[Mirror | None, Mirror | None, float, str]:
    """Return the mirrors of actions and states, the share to mirror, and the reason for it."""
    try:
        mirror = mirror_of(data.action_layout)
        layout = data.state_layout
        of_states = mirror_of(layout) if with_states and layout is not None else None
    except CloningError as reason:
        return None, None, 0.0, f"No image is mirrored, because {reason}."
    balance = mirror.balance(actions)
    share = 0.5 * balance
    note = (
        f"{share:.1%} of the images are mirrored, because the driver steered to one side "
        f"{balance:.1%} as much as to the other: the mirror image of a one-sided drive would teach "
        "the wrong side."
    )
    return mirror, of_states, share, note


def _unseen(data: Dataset) -> tuple[str, ...]:
    """Return the names of the state values to ignore."""
    names = () if data.state_layout is None else data.state_layout.names
    unseen = tuple(name for name in names if name.endswith(_APPLIED))
    if len(unseen) == len(names):
        raise CloningError(
            "The state contains only the previous action, from which nothing can be learned."
        )
    return unseen


@dataclass(frozen=True, slots=True)
class _Lesson:
    """Training of networks on examples.

    Attributes:
        shown: The examples.
        settings: Number of steps, validations, and patience.
        rate: Maximum learning rate.
        weights: Weight of each value's error, shape (m,); None for equal ones, or classes.
        rehearsal: Examples to mix in; None for none.
        on_check: Called after each validation.
    """

    shown: Examples
    settings: CloneSettings
    rate: float
    weights: Tensor | None
    rehearsal: Examples | None
    on_check: Callable[[MemberCheck], None]

    def member(
        self, card: CloneCard, kept_back: NDArray[np.bool_], seed: int, member: int
    ) -> tuple[CameraNetwork, list[MemberCheck], int, Tensor, Tensor]:
        """Train one member of several."""
        seed = seed * self.settings.members + member
        policy = CameraPolicy.blank(card, seed)
        self.begin(policy, ~kept_back)
        wanted = torch.as_tensor(self.shown.targets[kept_back])

        def logits(network: CameraNetwork, validation: Examples) -> Tensor:
            return CameraPolicy(network, card).logits(validation.pictures, validation.states)

        def error(network: CameraNetwork, validation: Examples) -> float:
            return float(self.loss(card, logits(network, validation), wanted, smoothing=0.0))

        with _seeded(seed):
            checks, best = self.fit(policy, kept_back, seed, member, error)
        outputs = logits(policy.network, self.shown.part(kept_back))
        return policy.network, checks, best, outputs, wanted

    def begin(self, policy: CameraPolicy, learned: NDArray[np.bool_]) -> None:
        """Initialise the output to the mean action or the frequencies, and normalise the states."""
        shown, network = self.shown.part(learned), policy.network
        with torch.no_grad():
            if policy.card.classes:
                counts = np.bincount(shown.targets, minlength=len(policy.card.classes)) + 1.0
                network.hands.weight.zero_()
                network.hands.bias.copy_(torch.as_tensor(np.log(counts / counts.sum())))
            else:
                mean = torch.as_tensor(shown.targets.mean(axis=0))
                network.hands.bias.copy_(torch.atanh(mean.clamp(-_MAX_INITIAL, _MAX_INITIAL)))
        if shown.states is not None:
            _normalise(network, shown.states)

    def loss(self, card: CloneCard, out: Tensor, wanted: Tensor, smoothing: float) -> Tensor:
        """Return the mean loss of outputs."""
        if card.classes:
            return functional.cross_entropy(out, wanted, label_smoothing=smoothing)
        out = torch.tanh(out)
        if self.weights is None:
            return functional.smooth_l1_loss(out, wanted, beta=_HUBER_BETA)
        each = functional.smooth_l1_loss(out, wanted, reduction="none", beta=_HUBER_BETA)
        return (each * self.weights).mean()

    def fit(
        self,
        policy: CameraPolicy,
        kept_back: NDArray[np.bool_],
        seed: int,
        member: int,
        error: Callable[[CameraNetwork, Examples], float],
    ) -> tuple[list[MemberCheck], int]:
        """Train the network of a policy in place, and restore its best weights at the end."""
        network, settings = policy.network, self.settings
        batches = Batches(self.shown, ~kept_back, self.rehearsal, settings, seed)
        validation = self.shown.part(kept_back)
        optimizer = torch.optim.AdamW(
            network.parameters(), lr=self.rate, weight_decay=settings.weight_decay
        )
        total = settings.steps(batches.size)
        every = max(total // settings.checks, 1)
        # Validated and kept: the network itself, or the average of its weights.
        kept = copy.deepcopy(network) if settings.averaging else network
        checks: list[MemberCheck] = []
        losses: list[float] = []
        best, best_weights = -1, dict[str, Tensor]()
        step = worse = 0
        while True:
            if step % every == 0 or step == total:
                mean_loss = sum(losses) / len(losses) if losses else math.nan
                now = error(kept.eval(), validation) if len(validation) else math.nan
                checks.append(MemberCheck(member, step, mean_loss, now))
                self.on_check(checks[-1])
                losses.clear()
                worse += 1
                # NaN without held-out data: keep the last.
                if best < 0 or not now >= checks[best].error:
                    best, worse = len(checks) - 1, 0
                    best_weights = {name: w.clone() for name, w in kept.state_dict().items()}
                if step == total or worse >= settings.patience:
                    break
            for group in optimizer.param_groups:
                group["lr"] = self.rate * _share_of_rate(step, total, settings.warm_up)
            network.train()
            batch = batches.draw()
            found = network.perceive(batch.pictures, batch.states)
            out = network.hands(functional.dropout(found, settings.dropout))
            batch_loss = self.loss(policy.card, out, batch.targets, settings.smoothing)
            optimizer.zero_grad()
            batch_loss.backward()  # pyright: ignore[reportUnknownMemberType]
            torch.nn.utils.clip_grad_norm_(network.parameters(), _MAX_GRADIENT)
            optimizer.step()  # pyright: ignore[reportUnknownMemberType]
            losses.append(batch_loss.item())
            step += 1
            if settings.averaging:
                share = min(settings.averaging, step / (step + _AVERAGE_FROM))
                with torch.no_grad():
                    for old, new in zip(kept.parameters(), network.parameters(), strict=True):
                        old.lerp_(new, 1.0 - share)
        network.load_state_dict(best_weights)
        network.eval()
        return checks, checks[best].step


@contextmanager
def _seeded(seed: int) -> Generator[None]:
    """Seed the global generator, which dropout draws from; earlier draws must not matter."""
    fork = cast(
        "AbstractContextManager[None]",
        torch.random.fork_rng(devices=[]),  # pyright: ignore[reportUnknownMemberType]
    )
    with fork:
        torch.manual_seed(seed)  # pyright: ignore[reportUnknownMemberType]
        yield


def _normalise(network: CameraNetwork, states: NDArray[np.float32]) -> None:
    """Initialise the normalisation of states to the mean and spread of their finite values."""
    known = np.where(np.isfinite(states), states, np.nan)
    there: NDArray[np.bool_] = np.isfinite(known).sum(axis=0) > 0
    middle, spread = np.zeros(known.shape[1]), np.ones(known.shape[1])
    middle[there] = np.nanmean(known[:, there], axis=0)
    found = np.nanstd(known[:, there], axis=0)
    spread[there] = np.where(found > _MIN_SPREAD, found, 1.0)
    with torch.no_grad():
        for name, values in (("middle", middle), ("spread", spread)):
            getattr(network.nerves, name).copy_(torch.as_tensor(values))


def _share_of_rate(step: int, total: int, warm_up: int) -> float:
    """Return the learning rate schedule: a linear warm-up, and half a cosine down to 0."""
    rising = min((step + 1) / warm_up, 1.0) if warm_up else 1.0
    return rising * 0.5 * (1.0 + math.cos(math.pi * step / total))


def best_temperature(logits: Tensor, wanted: Tensor) -> float:
    """Return the softmax temperature with the smallest cross-entropy on held-out steps.

    Args:
        logits: Shape (n, classes).
        wanted: Class indices, shape (n,).
    """
    if len(wanted) < _MIN_CALIBRATION_STEPS:
        return 1.0
    losses = [float(functional.cross_entropy(logits / t, wanted)) for t in _TEMPERATURES]
    return float(_TEMPERATURES[int(torch.tensor(losses).argmin())])
