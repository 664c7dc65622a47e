"""Learning from any demonstrations: pictures, states or both; keys or numbers."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, cast

import msgspec
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from shapechanger.demos.cloning.card import CloneCard
from shapechanger.demos.cloning.demonstrations import Examples, Mirror, mirror_of, stretch
from shapechanger.demos.cloning.judge import AskedHead, Goal, goal_of
from shapechanger.demos.cloning.pictures import CloningError, Framing, prepare
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.settings import Augmentation, CloneSettings
from shapechanger.errors import MissingExtra

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

try:
    import torch
    from torch import Tensor
    from torch.nn import functional

    from shapechanger.demos.cloning.batches import Batch, Batches
    from shapechanger.demos.cloning.network import CameraNetwork, joined
    from shapechanger.demos.cloning.train import HUBER_BETA, fit
except ImportError as error:
    raise MissingExtra("torch", "learn") from error


Inputs = Literal["auto", "picture", "state", "both"]
"""What a policy perceives: "auto" takes pictures where there are any, and states elsewhere."""

# Chosen on the first 430 frames of a real drive by the accuracy on five later stretches; what was
# tried is told in benchmarks/cloning_real.py.
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
"""How a policy is cloned from few demonstrations."""

MANY: Final = 3000
"""From so many steps on, two and a half minutes at 20 Hz, demonstrations are many: one network
that sees colours and finer pictures learns from them. Few teach it the lamps of one corridor."""

_MOST_CERTAIN: Final = 0.95
# What the robot did a moment ago nearly always tells what it does next: a clone that sees it learns
# to repeat itself in place of looking.
_APPLIED: Final = "/applied"
_LEAST_SPREAD: Final = 1e-6


def settings_for(steps: int) -> CloneSettings:
    """How a policy is cloned from so many steps.

    Where they are many nothing is held out, and the last network is kept: by a tenth of twenty
    minutes the one after 140 of 1,400 steps was the best, by 0.3 %, and it drove badly; see
    docs/cloning.md.
    """
    return DEMOS if steps < MANY else CloneSettings(held_out=0.0)


class MemberCheck(msgspec.Struct, frozen=True):
    """How good one member was at some step.

    Attributes:
        member: Which one.
        step: Steps of its training before it.
        loss: Mean loss of the batches since the check before; NaN at the start.
        error: The loss on the stretch of time that chooses when it stops; NaN without one.
    """

    member: int
    step: int
    loss: float
    error: float


@dataclass(frozen=True, slots=True)
class Training:
    """How a training went.

    Attributes:
        checks: Of all members, in order.
        steps: For each member the step at which it was best, which was kept.
        learned: Steps of the demonstrations that were learned from.
        mirrored: Share of pictures that were mirrored.
        mirror_note: Why it is that share, in a sentence.
        seconds: How long it took.
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
    """Learn to do what a driver did.

    Several networks learn, each but for a stretch of time of its own, which says when it was best;
    the policy is their mean. The same arguments give the same policy on the same machine with as
    many threads.

    Args:
        data: What the driver perceived and did.
        learned: Which of its steps to learn from, in the order of time, shape (n,); None for all.
        settings: How; None for what `settings_for` says.
        head: What comes out.
        inputs: What goes in.
        seed: Seed of everything random in it.
        on_check: Called with each check as soon as it is there.

    Raises:
        CloningError: If nothing can be learned from the data.
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
        raise CloningError(f"Action {first} is {data.actions[first].tolist()}, which is no action.")
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
    sure: list[tuple[Tensor, Tensor]] = []
    for member in range(settings.members):
        network, told, at, left_out = _one(shown, card, goal, settings, seed, member, on_check)
        members.append(network)
        checks += told
        steps.append(at)
        sure.append(left_out)
    whole = joined(msgspec.structs.replace(card, members=len(members)), members)
    if goal.head == "class":
        _calibrate(whole, sure)
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
    """Whether it sees, and whether it feels."""
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
    """The mirror of actions and states, the share that is mirrored, and why it is that."""
    try:
        mirror = mirror_of(data.action_layout)
        layout = data.state_layout
        felt = mirror_of(layout) if feels and layout is not None else None
    except CloningError as reason:
        return None, None, 0.0, f"Nothing is mirrored: {reason}."
    even = mirror.even(actions)
    share = 0.5 * even
    note = (
        f"{share:.1%} of the pictures are mirrored, because the driver went to one side "
        f"{even:.1%} as much as to the other: in the mirror, a drive to one side would teach the "
        "wrong one."
    )
    return mirror, felt, share, note


def _unseen(data: Dataset) -> tuple[str, ...]:
    """The numbers of the state that are not looked at."""
    layout = data.state_layout
    names = () if layout is None else layout.names
    unseen = tuple(name for name in names if name.endswith(_APPLIED))
    if len(unseen) == len(names):
        raise CloningError(
            "The state tells only what the robot did the moment before, from which nobody can "
            "learn what to do."
        )
    return unseen


def _felt(
    states: NDArray[np.float32] | None, data: Dataset, unseen: tuple[str, ...]
) -> NDArray[np.float32] | None:
    """The states without what is not looked at."""
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
    """The card of one member."""
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
        The network, its checks, the step at which it was best, and what it gave and should have
        given on the stretch that it did not learn from.
    """
    seed = seed * settings.members + member
    kept_back = stretch(len(shown), member, settings.members, settings.held_out)
    exam = shown.part(kept_back)
    policy = CameraPolicy.blank(card, seed)
    _begin_with(policy.network, shown.part(~kept_back), goal)
    batches = Batches(shown, ~kept_back, None, settings, seed)
    wanted = torch.as_tensor(exam.targets)
    # Dropout draws from the global generator; what was drawn from it before must not matter.
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
    """What comes out of a network, shape (n, outputs)."""
    policy = CameraPolicy(network, card)
    found = torch.as_tensor(policy.features(exam.pictures, exam.states))
    with torch.inference_mode():
        return network.hands(found)


def _loss(out: Tensor, wanted: Tensor, goal: Goal, smoothing: float) -> Tensor:
    if goal.head == "class":
        return functional.cross_entropy(out, wanted, label_smoothing=smoothing)
    return functional.smooth_l1_loss(torch.tanh(out), wanted, beta=HUBER_BETA)


def _begin_with(network: CameraNetwork, shown: Examples, goal: Goal) -> None:
    """Let an untrained network do what the driver does on average, and know usual states."""
    with torch.no_grad():
        if goal.head == "class":
            counts = np.bincount(shown.targets, minlength=len(goal.classes)) + 1.0
            network.hands.weight.zero_()
            network.hands.bias.copy_(torch.as_tensor(np.log(counts / counts.sum())))
        else:
            mean = torch.as_tensor(shown.targets.mean(axis=0))
            network.hands.bias.copy_(torch.atanh(mean.clamp(-_MOST_CERTAIN, _MOST_CERTAIN)))
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
                    found = np.where(found > _LEAST_SPREAD, found, 1.0)
                values[there] = found
                getattr(network.nerves, name).copy_(torch.as_tensor(values))


def _calibrate(network: CameraNetwork, sure: list[tuple[Tensor, Tensor]]) -> None:
    """Let the policy be as sure as it is right, by what its members did not learn from."""
    temperature = best_temperature(
        torch.cat([out for out, _ in sure]), torch.cat([wanted for _, wanted in sure])
    )
    with torch.no_grad():
        network.hands.weight.div_(temperature)
        network.hands.bias.div_(temperature)


# From twice as sure as the network was to a fifth.
_TEMPERATURES: Final = torch.logspace(-0.3, 0.7, 101)
_FEWEST: Final = 20


def best_temperature(logits: Tensor, wanted: Tensor) -> float:
    """The temperature at which what was not learned from is the least surprise.

    Args:
        logits: Shape (n, classes).
        wanted: Numbers of the classes, shape (n,).

    Returns:
        1 where fewer than 20 steps say anything.
    """
    if len(wanted) < _FEWEST:
        return 1.0
    losses = [float(functional.cross_entropy(logits / t, wanted)) for t in _TEMPERATURES]
    return float(_TEMPERATURES[int(torch.tensor(losses).argmin())])
