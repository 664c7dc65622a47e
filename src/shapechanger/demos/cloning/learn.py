"""Behaviour cloning: learn the actions of demonstrations from their images, states or both."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import msgspec
import numpy as np

from shapechanger.demos.cloning.clone import CloneSettings, settings_for
from shapechanger.demos.cloning.evaluation import AskedHead, output_fields
from shapechanger.errors import DemosError, MissingExtra, check_seed, translate_errors
from shapechanger.policy import CloneNetwork, PolicyCard

with translate_errors(ImportError, to=lambda _: MissingExtra("torch", "learn")):
    import torch
    from torch import Tensor
    from torch.nn import functional

    from shapechanger.demos.cloning.examples import (
        Batch,
        Examples,
        Mirror,
        Plain,
        batches,
        mirror_of,
        stretch,
    )
    from shapechanger.demos.cloning.network import CameraNetwork, CameraPolicy, joined, seeded

if TYPE_CHECKING:
    from shapechanger.demos.dataset import Dataset

Inputs = Literal["auto", "picture", "state", "both"]
"""Inputs of a policy; "auto" takes images if there are any, and states otherwise."""

# Error above which the loss is linear, so that one mistake does not outweigh ten small errors.
_HUBER_BETA: Final = 0.1
_MAX_INITIAL: Final = 0.95  # Keeps the initial output in the range where tanh can still learn.
_MAX_GRADIENT: Final = 1.0
# The decay of the average is lower in early steps: step / (step + 10).
_AVERAGE_FROM: Final = 10.0
# The previous action nearly always predicts the next one: a clone that sees it learns to repeat
# itself instead of looking.
_APPLIED: Final = "/applied"
_MIN_SPREAD: Final = 1e-6
_TEMPERATURES: Final = torch.logspace(-0.3, 0.7, 101)  # From twice to a fifth as confident.
_MIN_CALIBRATION_STEPS: Final = 20


class MemberCheck(msgspec.Struct, frozen=True):
    """Validation of one member after `step` training steps.

    `loss` is the mean of the batches since the last validation, NaN at the start; `error` is the
    loss on the steps held out for early stopping, NaN without any.
    """

    member: int
    step: int
    loss: float
    error: float


@dataclass(frozen=True, slots=True)
class Training:
    """Course of a training: validations, and the step of each member whose weights were kept.

    `mirror_note` states the share of mirrored images and its reason; "" if the settings' is used.
    """

    checks: tuple[MemberCheck, ...]
    best_steps: tuple[int, ...]
    mirror_note: str
    seconds: float


def learn(
    data: Dataset,
    *,
    settings: CloneSettings | None = None,
    head: AskedHead = "auto",
    inputs: Inputs = "auto",
    seed: int = 0,
    start: CameraPolicy | None = None,
    rehearsal: Dataset | None = None,
    symmetric: bool = False,
    on_check: Callable[[MemberCheck], None] = lambda check: None,
) -> tuple[CameraPolicy, Training]:
    """Learn the actions of a driver, and return the policy and the course of its training.

    If the settings have several `members`, the policy is the mean of their networks, each of which
    uses another stretch of time for early stopping. Equal arguments give an equal policy on the
    same machine with the same number of threads.

    `start` is a policy of the same layouts to train further, as one network with the same inputs
    and outputs. `rehearsal` is data that this policy was trained on, mixed in against forgetting.
    If the driver is `symmetric`, steering to both sides equally in the long run, as an
    expert in random worlds does, the settings state the share of mirrored images; otherwise the
    share depends on how evenly the driver steered.
    """
    seed = check_seed(seed, DemosError)
    began = time.monotonic()
    if (wrong := ~np.isfinite(data.actions).all(axis=1)).any():
        first = int(wrong.argmax())
        raise DemosError(f"Action {first} must be finite, got {data.actions[first].tolist()}.")
    if not len(data):
        raise DemosError("There is no step to learn from.")
    settings = settings_for(len(data)) if settings is None else settings
    if start is not None:
        start.card.require_layouts(data.action_layout, data.state_layout)
        feels = bool(start.net.nerves)
    else:
        if inputs == "auto":
            inputs = "state" if data.pictures is None else "picture"
        feels = inputs != "picture"
        if inputs != "state" and data.pictures is None:
            raise DemosError("These demonstrations have no images to learn from.")
        if feels and (data.states is None or not data.states.shape[1]):
            raise DemosError("These demonstrations have no state to learn from.")
    mirrors, share, note = _mirrors(data, feels, settings.augmentation.mirror if symmetric else -1)
    augmentation = msgspec.structs.replace(settings.augmentation, mirror=share)
    settings = msgspec.structs.replace(settings, augmentation=augmentation)
    card = _card(data, settings, head, inputs, mirrors[0]) if start is None else start.card
    shown = Examples.of(data, card, mirrors)
    again = None if rehearsal is None else Examples.of(rehearsal, card, mirrors)
    members = settings.members if start is None else 1
    networks: list[CameraNetwork] = []
    checks: list[MemberCheck] = []
    steps: list[int] = []
    validated: list[tuple[Tensor, Tensor]] = []

    def report(check: MemberCheck) -> None:
        checks.append(check)
        on_check(check)

    for member in range(members):
        own_seed = seed * members + member
        kept_back = stretch(len(data), member, members, settings.held_out)
        with seeded(own_seed):
            network = CameraNetwork(card) if start is None else copy.deepcopy(start.network)
        drawn = batches(shown, ~kept_back, again, settings, own_seed)
        if not card.network.seeds:
            _begin(network, shown.plain(~kept_back))
        validation = shown.plain(kept_back)
        total = settings.steps(int((~kept_back).sum()))
        with seeded(own_seed):  # Dropout draws from the global generator.
            steps.append(_fit(network, drawn, validation, total, settings, member, report))
        networks.append(network)
        validated.append(_validated(network, validation))
    several = {"members": members} if members > 1 else {}
    net = msgspec.structs.replace(card.network, seeds=(*card.network.seeds, seed), **several)
    card = msgspec.structs.replace(card, clone=net, seed=seed, steps=len(data), settings=settings)
    whole = networks[0] if members == 1 else joined(card, networks)
    if net.classes:
        # Scale the logits so that confidence matches accuracy on held-out steps.
        temperature = best_temperature(*map(torch.cat, zip(*validated, strict=True)))
        with torch.no_grad():
            whole.hands.weight.div_(temperature)
            whole.hands.bias.div_(temperature)
    training = Training(tuple(checks), tuple(steps), note, time.monotonic() - began)
    return CameraPolicy(whole, card), training


def _mirrors(
    data: Dataset, feels: bool, stated: float
) -> tuple[tuple[Mirror | None, Mirror | None], float, str]:
    """Return the mirrors of actions and states, the share of mirrored images, and its reason."""
    try:
        mirror = mirror_of(data.action_layout)
        layout = data.state_layout
        of_states = mirror_of(layout) if feels and layout is not None else None
    except DemosError as reason:
        return (None, None), 0.0, f"No image is mirrored, because {reason}."
    balance = mirror.balance(data.actions)
    share, note = stated, ""
    if stated < 0.0:
        share = 0.5 * balance
        note = (
            f"{share:.1%} of the images are mirrored, because the driver steered to one side "
            f"{balance:.1%} as much as to the other: the mirror image of a one-sided drive would "
            "teach the wrong side."
        )
    return (mirror if share else None, of_states), share, note


def _card(
    data: Dataset, settings: CloneSettings, head: AskedHead, inputs: Inputs, mirror: Mirror | None
) -> PolicyCard:
    """Return the card of a new policy for demonstrations."""
    state = None if inputs == "picture" else data.state_layout
    names = () if state is None else state.names
    unseen = tuple(name for name in names if name.endswith(_APPLIED))
    if names and len(unseen) == len(names):
        raise DemosError(
            "The state contains only the previous action, from which no policy can be learned."
        )
    net = CloneNetwork(
        framing=settings.framing,
        channels=settings.channels,
        features=settings.features,
        eyes="none" if inputs == "state" else settings.eyes,
        nerves=settings.nerves if names else (),
        unseen=unseen,
        **output_fields(data.actions, data.action_layout, head, mirror and mirror(data.actions)),
    )
    return PolicyCard(learner="cloning", observation=state, action=data.action_layout, clone=net)


@torch.no_grad()
def _validated(network: CameraNetwork, shown: Plain) -> tuple[Tensor, Tensor]:
    """Return the outputs of the last layer for examples, and their targets."""
    pictures, states, targets = shown
    return network.eval().hands(network.features(pictures, states)), torch.as_tensor(targets)


def _loss(out: Tensor, target: Tensor, smoothing: float = 0.0) -> Tensor:
    """Return the mean loss of outputs of the last layer; 1-D targets are class indices."""
    if target.ndim == 1:
        return functional.cross_entropy(out, target, label_smoothing=smoothing)
    return functional.smooth_l1_loss(torch.tanh(out), target, beta=_HUBER_BETA)


@torch.no_grad()
def _begin(network: CameraNetwork, shown: Plain) -> None:
    """Initialise the output to the mean action or class frequencies, and normalise the states."""
    _, states, targets = shown
    if classes := network.card.network.classes:
        counts = np.bincount(targets, minlength=len(classes)) + 1.0
        network.hands.weight.zero_()
        network.hands.bias.copy_(torch.as_tensor(np.log(counts / counts.sum())))
    else:
        mean = torch.as_tensor(targets.mean(axis=0))
        network.hands.bias.copy_(torch.atanh(mean.clamp(-_MAX_INITIAL, _MAX_INITIAL)))
    if states is not None:
        known = np.where(np.isfinite(states), states, np.nan)
        measured = np.isfinite(known).any(axis=0)
        middle, spread = (f(known[:, measured], axis=0) for f in (np.nanmean, np.nanstd))
        spread = np.where(spread > _MIN_SPREAD, spread, 1.0)
        for name, values in (("middle", middle), ("spread", spread)):
            getattr(network.nerves, name)[measured] = torch.as_tensor(values)


def _fit(
    network: CameraNetwork,
    drawn: Iterator[Batch],
    validation: Plain,
    total: int,
    settings: CloneSettings,
    member: int,
    report: Callable[[MemberCheck], None],
) -> int:
    """Train a network in place for `total` steps; keep its best weights, and return their step."""
    rate = settings.further_rate if network.card.network.seeds else settings.learning_rate
    optimizer = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=settings.weight_decay)
    every = max(total // settings.checks, 1)
    # The network to validate and keep: the trained one, or a copy with averaged weights.
    kept = copy.deepcopy(network) if settings.averaging else network
    losses: list[float] = []
    best_step, least = -1, math.nan
    best_weights = dict[str, Tensor]()
    for step in range(total + 1):
        if step % every == 0 or step == total:
            error = math.nan
            if len(validation[2]):
                error = float(_loss(*_validated(kept, validation)))
            loss = sum(losses) / len(losses) if losses else math.nan
            report(MemberCheck(member, step, loss, error))
            losses.clear()
            # NaN without held-out data: keep the last.
            if best_step < 0 or not error >= least:
                best_step, least = step, error
                best_weights = {n: w.clone() for n, w in kept.state_dict().items()}
            if step == total:
                break
        for group in optimizer.param_groups:
            # A linear warm-up, and half a cosine down to 0.
            rising = min((step + 1) / settings.warm_up, 1.0) if settings.warm_up else 1.0
            group["lr"] = rate * (rising * 0.5 * (1.0 + math.cos(math.pi * step / total)))
        pictures, states, targets = next(drawn)
        found = functional.dropout(network.train().perceive(pictures, states), settings.dropout)
        loss = _loss(network.hands(found), targets, settings.smoothing)
        optimizer.zero_grad()
        loss.backward()  # pyright: ignore[reportUnknownMemberType]
        torch.nn.utils.clip_grad_norm_(network.parameters(), _MAX_GRADIENT)
        optimizer.step()  # pyright: ignore[reportUnknownMemberType]
        losses.append(loss.item())
        if settings.averaging:
            share = min(settings.averaging, (step + 1) / (step + 1 + _AVERAGE_FROM))
            pairs = zip(kept.parameters(), network.parameters(), strict=True)
            with torch.no_grad():
                for old, new in pairs:
                    old.lerp_(new, 1.0 - share)
    network.load_state_dict(best_weights)
    return best_step


def best_temperature(logits: Tensor, target: Tensor) -> float:
    """Return the best temperature for logits, (n, classes), and classes, (n,); 1 if n < 20."""
    if len(target) < _MIN_CALIBRATION_STEPS:
        return 1.0
    losses = [float(functional.cross_entropy(logits / t, target)) for t in _TEMPERATURES]
    return float(_TEMPERATURES[int(torch.tensor(losses).argmin())])
