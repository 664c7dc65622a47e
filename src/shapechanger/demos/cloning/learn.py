"""Behaviour cloning: any actions from any demonstrations."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import CloneCard
from shapechanger.demos.cloning.evaluation import AskedHead, output_fields
from shapechanger.demos.cloning.pictures import CloningError
from shapechanger.demos.cloning.settings import CloneSettings, settings_for
from shapechanger.errors import MissingExtra, check_seed

try:
    import torch
    from torch import Tensor
    from torch.nn import functional

    from shapechanger.demos.cloning.examples import Examples, Mirror, batches, mirror_of, stretch
    from shapechanger.demos.cloning.network import CameraNetwork, joined
    from shapechanger.demos.cloning.policy import CameraPolicy, seeded
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


def learn(
    data: Dataset,
    learned: NDArray[np.bool_] | None = None,
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
        start: Policy to train further, which is not changed; one network then keeps its inputs and
            outputs. None for a new one.
        rehearsal: Demonstrations that `start` was trained on, mixed in so that they are not
            forgotten; None for none.
        symmetric: Whether the driver steers to both sides equally in the long run, as an expert in
            random worlds does. The settings then state the share of mirrored images; otherwise it
            depends on how evenly the driver steered.
        on_check: Called after each validation.

    Returns:
        The policy, and the course of the training.

    Raises:
        CloningError: If the data are unsuitable, or the seed is not a whole number from 0 to
            2^32 - 1.
        PolicyError: If the layouts of the data are other ones than those of `start`.
    """
    seed = check_seed(seed, CloningError)
    began = time.monotonic()
    which = np.ones(len(data), np.bool_) if learned is None else learned
    if (wrong := which & ~np.isfinite(data.actions).all(axis=1)).any():
        first = int(wrong.argmax())
        raise CloningError(f"Action {first} must be finite, got {data.actions[first].tolist()}.")
    data = data.part(which)
    if not len(data):
        raise CloningError("There is no step to learn from.")
    settings = settings_for(len(data)) if settings is None else settings
    if start is None:
        with_pictures, with_states = _inputs_of(data, inputs)
    else:
        start.card.require_layouts(data.action_layout, data.state_layout)
        with_pictures, with_states = start.card.eyes != "none", bool(start.card.nerves)
    mirror, state_mirror, share, note = _mirrors(data, with_states)
    if symmetric and mirror is not None:
        share, note = settings.augmentation.mirror, ""
    mirror = mirror if share else None
    settings = msgspec.structs.replace(
        settings, augmentation=msgspec.structs.replace(settings.augmentation, mirror=share)
    )
    card = (
        start.card
        if start is not None
        else CloneCard(
            framing=settings.framing,
            channels=settings.channels,
            features=settings.features,
            eyes=settings.eyes if with_pictures else "none",
            nerves=settings.nerves if with_states else (),
            action_layout=data.action_layout,
            state_layout=data.state_layout if with_states else None,
            unseen=_unseen(data) if with_states else (),
            **output_fields(
                data.actions, data.action_layout, head, mirror and mirror(data.actions)
            ),
        )
    )
    shown = Examples.of(data, card, mirror, state_mirror)
    again = None if rehearsal is None else Examples.of(rehearsal, card, mirror, state_mirror)
    lesson = _Lesson(shown, again, settings, on_check)
    members = settings.members if start is None else 1
    networks: list[CameraNetwork] = []
    checks: list[MemberCheck] = []
    steps: list[int] = []
    validated: list[tuple[Tensor, Tensor]] = []
    for member in range(members):
        own_seed = seed * members + member
        policy = CameraPolicy.blank(card, own_seed) if start is None else start.copy()
        kept_back = stretch(len(shown), member, members, settings.held_out)
        with seeded(own_seed):  # Dropout draws from the global generator.
            found, best = lesson.fit(policy, kept_back, own_seed, member)
        networks.append(policy.network)
        checks += found
        steps.append(best)
        validated.append(_validation(policy, shown.part(kept_back)))
    card = msgspec.structs.replace(
        card,
        members=card.members if members == 1 else members,
        seeds=(*card.seeds, seed),
        steps=max(steps),
        settings=settings,
    )
    whole = networks[0] if members == 1 else joined(card, networks)
    if card.classes:
        # Scale the logits so that confidence matches accuracy on held-out steps.
        temperature = best_temperature(*map(torch.cat, zip(*validated, strict=True)))
        with torch.no_grad():
            whole.hands.weight.div_(temperature)
            whole.hands.bias.div_(temperature)
    seconds = time.monotonic() - began
    training = Training(tuple(checks), tuple(steps), len(data), share, note, seconds)
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


def _mirrors(data: Dataset, with_states: bool) -> tuple[Mirror | None, Mirror | None, float, str]:
    """Return the mirrors of actions and states, the share to mirror, and the reason for it."""
    try:
        mirror = mirror_of(data.action_layout)
        layout = data.state_layout
        of_states = mirror_of(layout) if with_states and layout is not None else None
    except CloningError as reason:
        return None, None, 0.0, f"No image is mirrored, because {reason}."
    balance = mirror.balance(data.actions)
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


def _validation(policy: CameraPolicy, shown: Examples) -> tuple[Tensor, Tensor]:
    """Return the outputs of the last layer for examples, and their targets."""
    return policy.logits(shown.pictures, shown.states), torch.as_tensor(shown.targets)


def _loss(card: CloneCard, out: Tensor, wanted: Tensor, smoothing: float = 0.0) -> Tensor:
    """Return the mean loss of outputs of the last layer."""
    if card.classes:
        return functional.cross_entropy(out, wanted, label_smoothing=smoothing)
    return functional.smooth_l1_loss(torch.tanh(out), wanted, beta=_HUBER_BETA)


@dataclass(frozen=True, slots=True)
class _Lesson:
    """Training of networks on examples."""

    shown: Examples
    rehearsal: Examples | None
    settings: CloneSettings
    on_check: Callable[[MemberCheck], None]

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

    def fit(
        self, policy: CameraPolicy, kept_back: NDArray[np.bool_], seed: int, member: int
    ) -> tuple[list[MemberCheck], int]:
        """Train the network of a policy in place, and restore its best weights at the end."""
        network, card, settings = policy.network, policy.card, self.settings
        rate = settings.further_rate
        if not card.seeds:  # It is untrained.
            rate = settings.learning_rate
            self.begin(policy, ~kept_back)
        drawn = batches(self.shown, ~kept_back, self.rehearsal, settings, seed)
        validation = self.shown.part(kept_back)
        optimizer = torch.optim.AdamW(
            network.parameters(), lr=rate, weight_decay=settings.weight_decay
        )
        total = settings.steps(len(kept_back) - len(validation))
        every = max(total // settings.checks, 1)
        # Validated and kept: the network itself, or the average of its weights.
        kept = CameraPolicy(copy.deepcopy(network) if settings.averaging else network, card)
        checks: list[MemberCheck] = []
        losses: list[float] = []
        best, best_weights = -1, dict[str, Tensor]()
        step = worse = 0
        while True:
            if step % every == 0 or step == total:
                mean_loss = sum(losses) / len(losses) if losses else math.nan
                kept.network.eval()
                now = math.nan
                if len(validation):
                    now = float(_loss(card, *_validation(kept, validation)))
                checks.append(MemberCheck(member, step, mean_loss, now))
                self.on_check(checks[-1])
                losses.clear()
                worse += 1
                # NaN without held-out data: keep the last.
                if best < 0 or not now >= checks[best].error:
                    best, worse = len(checks) - 1, 0
                    best_weights = {n: w.clone() for n, w in kept.network.state_dict().items()}
                if step == total or worse >= settings.patience:
                    break
            for group in optimizer.param_groups:
                group["lr"] = rate * _share_of_rate(step, total, settings.warm_up)
            network.train()
            batch = next(drawn)
            found = network.perceive(batch.pictures, batch.states)
            out = network.hands(functional.dropout(found, settings.dropout))
            loss = _loss(card, out, batch.targets, settings.smoothing)
            optimizer.zero_grad()
            loss.backward()  # pyright: ignore[reportUnknownMemberType]
            torch.nn.utils.clip_grad_norm_(network.parameters(), _MAX_GRADIENT)
            optimizer.step()  # pyright: ignore[reportUnknownMemberType]
            losses.append(loss.item())
            step += 1
            if settings.averaging:
                share = min(settings.averaging, step / (step + _AVERAGE_FROM))
                pairs = zip(kept.network.parameters(), network.parameters(), strict=True)
                with torch.no_grad():
                    for old, new in pairs:
                        old.lerp_(new, 1.0 - share)
        network.load_state_dict(best_weights)
        network.eval()
        return checks, checks[best].step


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
