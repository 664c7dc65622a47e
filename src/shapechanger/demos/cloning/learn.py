"""Behaviour cloning from any demonstrations: pictures or states, keys or continuous actions."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import CloneCard
from shapechanger.demos.cloning.demonstrations import Examples, Mirror, mirror_of, stretch
from shapechanger.demos.cloning.judge import AskedHead, Goal, goal_of
from shapechanger.demos.cloning.pictures import CloningError, Framing, prepare
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.settings import Augmentation, CloneSettings
from shapechanger.errors import MissingExtra

try:
    import torch
    from torch import Tensor
    from torch.nn import functional

    from shapechanger.demos.cloning.batches import Batch, Batches
    from shapechanger.demos.cloning.network import CameraNetwork, joined
    from shapechanger.demos.cloning.train import HUBER_BETA, fit
except ImportError as error:
    raise MissingExtra("torch", "learn") from error

if TYPE_CHECKING:
    from shapechanger.demos.dataset import Dataset

__all__ = [
    "DEMOS",
    "MANY",
    "Inputs",
    "MemberCheck",
    "Training",
    "best_temperature",
    "learn",
    "settings_for",
]

Inputs = Literal["auto", "picture", "state", "both"]
"""Inputs of a policy; "auto" takes pictures if there are any, and states otherwise."""

# Chosen on the first 430 frames of a real drive by the accuracy on five later stretches;
# benchmarks/cloning_real.py lists the alternatives.
DEMOS: Final = CloneSettings(
    framing=Framing(height=48, width=64, top=0.0),
    channels=(24, 48),
    features=64,
    batch=32,
    passes=25.0,
    fewest_steps=300,
    most_steps=3000,
    learning_rate=2e-3,
    weight_decay=0.1,
    held_out=0.15,
    checks=12,
    patience=12,
    augmentation=Augmentation(shift=3),
    eyes="edges",
    members=4,
    dropout=0.5,
    smoothing=0.1,
    averaging=0.98,
)
"""Settings for few demonstrations."""

MANY: Final = 3000
"""Number of steps, two and a half minutes at 20 Hz, from which demonstrations are many. One network
on colours and finer pictures learns from them; with fewer it would learn irrelevant details.
"""

_MAX_INITIAL: Final = 0.95  # Keeps the initial output in the range where tanh can still learn.
# The previous action nearly always predicts the next one: a clone that sees it learns to repeat
# itself instead of looking.
_APPLIED: Final = "/applied"
_MIN_SPREAD: Final = 1e-6
# From twice as confident to a fifth as confident.
_TEMPERATURES: Final = torch.logspace(-0.3, 0.7, 101)
_MIN_CALIBRATION_STEPS: Final = 20


def settings_for(steps: int) -> CloneSettings:
    """Return the settings for this many steps.

    With many steps nothing is held out, and the last network is kept. When a tenth of twenty
    minutes was held out, the network after 140 of 1,400 steps was best by 0.3 %, and drove badly;
    see docs/cloning.md.
    """
    return DEMOS if steps < MANY else CloneSettings(held_out=0.0)


class MemberCheck(msgspec.Struct, frozen=True):
    """Validation of one member.

    Attributes:
        member: Index of the member.
        step: Number of its training steps so far.
        loss: Mean loss of the batches since the last validation; NaN at the start.
        error: Loss on the stretch of time held out for early stopping; NaN without one.
    """

    member: int
    step: int
    loss: float
    error: float


@dataclass(frozen=True, slots=True)
class Training:
    """Course of a training.

    Attributes:
        checks: Validations of all members, in order.
        steps: Step of each member at which it was best, which was kept.
        learned: Number of demonstrated steps learned from.
        mirrored: Share of examples that were mirrored.
        mirror_note: Reason for that share, in a sentence.
        seconds: Duration, s.
    """

    checks: tuple[MemberCheck, ...]
    steps: tuple[int, ...]
    learned: int
    mirrored: float
    mirror_note: str
    seconds: float


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
        settings: Hyperparameters; None for those of `settings_for`.
        head: Kind of output.
        inputs: Inputs of the policy.
        seed: Seed of all randomness.
        on_check: Called after each validation.

    Returns:
        The policy, and the course of the training.

    Raises:
        CloningError: If the data are unsuitable.
    """
    began = time.monotonic()
    which = np.ones(len(data.actions), np.bool_) if learned is None else learned
    if not which.any():
        raise CloningError("There is no step to learn from.")
    settings = settings_for(int(which.sum())) if settings is None else settings
    pictures = None if data.pictures is None else data.pictures[which]
    states = None if data.states is None else data.states[which]
    actions = data.actions[which]
    if not np.isfinite(actions).all():
        first = int(np.flatnonzero(~np.isfinite(data.actions).all(axis=1) & which)[0])
        raise CloningError(f"Action {first} must be finite, got {data.actions[first].tolist()}.")
    sees, feels = _senses(pictures, states, inputs)
    mirror, felt_mirror, share, note = _mirrors(data, actions, feels)
    settings = msgspec.structs.replace(
        settings, augmentation=msgspec.structs.replace(settings.augmentation, mirror=share)
    )
    goal = goal_of(actions, data.action_layout, head, mirror(actions) if mirror and share else None)
    unseen = _unseen(data) if feels else ()
    card = _card(data, goal, settings, sees, feels, unseen)
    felt = _felt(states, data, unseen) if feels else None
    shown = Examples(
        prepare(pictures, settings.framing) if sees and pictures is not None else None,
        felt,
        goal.targets(actions),
        None if felt is None else (felt_mirror(felt) if felt_mirror else felt),
        goal.targets(mirror(actions) if mirror and share else actions),
    )
    members: list[CameraNetwork] = []
    checks: list[MemberCheck] = []
    steps: list[int] = []
    held_out: list[tuple[Tensor, Tensor]] = []
    for member in range(settings.members):
        network, own, best, left_out = _one(shown, card, goal, settings, seed, member, on_check)
        members.append(network)
        checks += own
        steps.append(best)
        held_out.append(left_out)
    whole = joined(msgspec.structs.replace(card, members=len(members)), members)
    if goal.head == "class":
        _calibrate(whole, held_out)
    card = msgspec.structs.replace(
        card, members=len(members), seeds=(seed,), steps=max(steps), settings=settings
    )
    training = Training(
        tuple(checks), tuple(steps), len(actions), share, note, time.monotonic() - began
    )
    return CameraPolicy(whole, card), training


def _senses(
    pictures: NDArray[np.uint8] | None, states: NDArray[np.float32] | None, inputs: Inputs
) -> tuple[bool, bool]:
    """Return whether the policy uses pictures, and whether it uses states."""
    if inputs == "auto":
        inputs = "picture" if pictures is not None else "state"
    sees, feels = inputs in {"picture", "both"}, inputs in {"state", "both"}
    if sees and pictures is None:
        raise CloningError("These demonstrations have no pictures to learn from.")
    if feels and (states is None or not states.shape[1]):
        raise CloningError("These demonstrations have no state to learn from.")
    return sees, feels


def _mirrors(
    data: Dataset, actions: NDArray[np.float32], feels: bool
) -> tuple[Mirror | None, Mirror | None, float, str]:
    """Return the mirrors of actions and states, the share to mirror, and the reason for it."""
    try:
        mirror = mirror_of(data.action_layout)
        layout = data.state_layout
        felt = mirror_of(layout) if feels and layout is not None else None
    except CloningError as reason:
        return None, None, 0.0, f"No picture is mirrored, because {reason}."
    even = mirror.even(actions)
    share = 0.5 * even
    note = (
        f"{share:.1%} of the pictures are mirrored, because the driver steered to one side "
        f"{even:.1%} as much as to the other: the mirror image of a one-sided drive would teach "
        "the wrong side."
    )
    return mirror, felt, share, note


def _unseen(data: Dataset) -> tuple[str, ...]:
    """Return the names of the state values to ignore."""
    layout = data.state_layout
    names = () if layout is None else layout.names
    unseen = tuple(name for name in names if name.endswith(_APPLIED))
    if len(unseen) == len(names):
        raise CloningError(
            "The state contains only the previous action, from which nothing can be learned."
        )
    return unseen


def _felt(
    states: NDArray[np.float32] | None, data: Dataset, unseen: tuple[str, ...]
) -> NDArray[np.float32] | None:
    """Return the states, with NaN for ignored values."""
    if states is None or data.state_layout is None:
        return None
    felt = states.astype(np.float32)
    for name in unseen:
        felt[:, data.state_layout.slices[name]] = np.nan
    return felt


def _card(
    data: Dataset,
    goal: Goal,
    settings: CloneSettings,
    sees: bool,
    feels: bool,
    unseen: tuple[str, ...],
) -> CloneCard:
    """Return the card of one member."""
    return CloneCard(
        framing=settings.framing,
        channels=settings.channels,
        features=settings.features,
        format=2,
        eyes=settings.eyes if sees else "none",
        nerves=settings.nerves if feels else (),
        head=goal.head,
        classes=goal.classes,
        class_names=goal.names,
        action_layout=data.action_layout,
        state_layout=data.state_layout if feels else None,
        unseen=unseen,
        low=goal.low,
        high=goal.high,
    )


def _one(
    shown: Examples,
    card: CloneCard,
    goal: Goal,
    settings: CloneSettings,
    seed: int,
    member: int,
    on_check: Callable[[MemberCheck], None],
) -> tuple[CameraNetwork, list[MemberCheck], int, tuple[Tensor, Tensor]]:
    """Train one member.

    Returns:
        The network, its validations, the step at which it was best, and its outputs and targets on
        the stretch that it did not learn from.
    """
    seed = seed * settings.members + member
    kept_back = stretch(len(shown), member, settings.members, settings.held_out)
    exam = shown.part(kept_back)
    policy = CameraPolicy.blank(card, seed)
    _begin_with(policy.network, shown.part(~kept_back), goal)
    batches = Batches(shown, ~kept_back, None, settings, seed)
    wanted = torch.as_tensor(exam.targets)
    # Dropout draws from the global generator; earlier draws must not matter.
    fork = cast(
        "AbstractContextManager[None]",
        torch.random.fork_rng(devices=[]),  # pyright: ignore[reportUnknownMemberType]
    )

    def loss(network: CameraNetwork, batch: Batch) -> Tensor:
        found = network.perceive(batch.pictures, batch.states)
        out = network.hands(functional.dropout(found, settings.dropout))
        return _loss(out, batch.targets, goal, settings.smoothing)

    def judge(network: CameraNetwork, step: int, loss: float) -> MemberCheck:
        error = float("nan")
        if len(exam):
            error = float(_loss(_outputs(network, card, exam), wanted, goal, 0.0))
        return MemberCheck(member, step, loss, error)

    with fork:
        torch.manual_seed(seed)  # pyright: ignore[reportUnknownMemberType]
        checks, best, _ = fit(
            policy.network, batches, loss, judge, settings, settings.learning_rate, on_check
        )
    left_out = _outputs(policy.network, card, exam), wanted
    return policy.network, checks, checks[best].step, left_out


def _outputs(network: CameraNetwork, card: CloneCard, exam: Examples) -> Tensor:
    """Return the outputs of a network, shape (n, outputs)."""
    policy = CameraPolicy(network, card)
    found = torch.as_tensor(policy.features(exam.pictures, exam.states))
    with torch.inference_mode():
        return network.hands(found)


def _loss(out: Tensor, wanted: Tensor, goal: Goal, smoothing: float) -> Tensor:
    if goal.head == "class":
        return functional.cross_entropy(out, wanted, label_smoothing=smoothing)
    return functional.smooth_l1_loss(torch.tanh(out), wanted, beta=HUBER_BETA)


def _begin_with(network: CameraNetwork, shown: Examples, goal: Goal) -> None:
    """Initialise the output to the average action, and the normalisation of states."""
    with torch.no_grad():
        if goal.head == "class":
            counts = np.bincount(shown.targets, minlength=len(goal.classes)) + 1.0
            network.hands.weight.zero_()
            network.hands.bias.copy_(torch.as_tensor(np.log(counts / counts.sum())))
        else:
            mean = torch.as_tensor(shown.targets.mean(axis=0))
            network.hands.bias.copy_(torch.atanh(mean.clamp(-_MAX_INITIAL, _MAX_INITIAL)))
        if network.nerves is not None and shown.states is not None:
            known = np.where(np.isfinite(shown.states), shown.states, np.nan)
            there: NDArray[np.bool_] = np.isfinite(known).sum(axis=0) > 0
            for name, values in (
                ("middle", np.zeros(known.shape[1])),
                ("spread", np.ones(known.shape[1])),
            ):
                found = np.nanmean(known[:, there], axis=0)
                if name == "spread":
                    found = np.nanstd(known[:, there], axis=0)
                    found = np.where(found > _MIN_SPREAD, found, 1.0)
                values[there] = found
                getattr(network.nerves, name).copy_(torch.as_tensor(values))


def _calibrate(network: CameraNetwork, held_out: list[tuple[Tensor, Tensor]]) -> None:
    """Scale the logits so that confidence matches accuracy on held-out steps."""
    temperature = best_temperature(
        torch.cat([out for out, _ in held_out]), torch.cat([wanted for _, wanted in held_out])
    )
    with torch.no_grad():
        network.hands.weight.div_(temperature)
        network.hands.bias.div_(temperature)


def best_temperature(logits: Tensor, wanted: Tensor) -> float:
    """Return the softmax temperature with the smallest cross-entropy on held-out steps.

    Args:
        logits: Shape (n, classes).
        wanted: Class indices, shape (n,).

    Returns:
        1 with fewer than 20 steps.
    """
    if len(wanted) < _MIN_CALIBRATION_STEPS:
        return 1.0
    losses = [float(functional.cross_entropy(logits / t, wanted)) for t in _TEMPERATURES]
    return float(_TEMPERATURES[int(torch.tensor(losses).argmin())])
