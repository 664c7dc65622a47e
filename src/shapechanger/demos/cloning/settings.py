"""How a policy is cloned, as plain values."""

from __future__ import annotations

from typing import Literal

import msgspec

from shapechanger.demos.cloning.pictures import CloningError, Framing

__all__ = ["Augmentation", "CloneSettings"]


class Augmentation(msgspec.Struct, frozen=True, kw_only=True):
    """How each picture is changed each time that it is learned from.

    Attributes:
        mirror: Share of pictures that are mirrored, their steering negated.
        shift: Most pixels that a picture moves to each side, and up and down.
        gain: Largest factor of brightness, >= 1; its inverse is the smallest.
        colour: Largest factor of a single colour beyond that, >= 1; its inverse is the smallest.
        offset: Most that is added to or taken from every pixel, as a share of full brightness.
        noise: Largest standard deviation of a pixel's noise, as a share of full brightness.
        noisy: Share of pictures that have noise.
        blurred: Share of pictures that are blurred over 3 x 3 pixels.
    """

    mirror: float = 0.5
    shift: int = 2
    gain: float = 1.8
    colour: float = 1.2
    offset: float = 0.08
    noise: float = 0.04
    noisy: float = 0.3
    blurred: float = 0.2

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            CloningError: If a share is no share, or a strength is out of range.
        """
        for name in ("mirror", "noisy", "blurred"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise CloningError(f"{name} is a share in [0, 1], got {getattr(self, name)}.")
        if self.shift < 0 or not (self.offset >= 0.0 and self.noise >= 0.0):
            raise CloningError("shift, offset and noise are at least 0.")
        if not (self.gain >= 1.0 and self.colour >= 1.0):
            raise CloningError("gain and colour are factors of at least 1.")


class CloneSettings(msgspec.Struct, frozen=True, kw_only=True):
    """How a policy is cloned.

    Attributes:
        framing: What the policy sees; that of `start` where it begins with another policy.
        channels: Filters of each layer; each layer halves rows and columns.
        features: Numbers that a picture is boiled down to before steering and throttle.
        batch: Pictures a step.
        passes: How often each picture is learned from, between the two bounds below.
        fewest_steps: Steps for however few pictures.
        most_steps: Steps for however many pictures.
        learning_rate: At the start; falls to 0 along half a cosine.
        further_rate: The same, when another policy is trained further.
        warm_up: Steps in which the rate rises from 0.
        weight_decay: Of AdamW.
        throttle_weight: What an error of the throttle counts, where one of the steering counts 1.
        held_out: Share of each episode, at its end, that is not learned from but chooses when to
            stop; in [0, 1).
        checks: How often the policy is tried on those pictures.
        patience: How many checks in a row may bring no better policy before training ends.
        rehearsal: Share of each batch that comes from the rehearsed pictures, if there are any.
        augmentation: How pictures are changed.
        eyes: What the first layer sees: "colours" as they are, or "edges": how strong the edges of
            each direction are in each cell, which knows neither light nor colour.
        nerves: Widths of the layers that a state goes through.
        members: How many networks are averaged; each leaves out another stretch of time to choose
            when to stop, so that together they learn from all of it.
        dropout: Share of the features that are left out in each step.
        smoothing: Share of certainty that is taken from the classes that were shown.
        averaging: How much of the average of the weights of earlier steps is kept in each step;
            0 for the weights of the last step.
    """

    framing: Framing = Framing()
    # Few filters in the first layer, whose cost is by far the largest: 16 and 32 in the first two
    # took 1.8 times as long a step and drove no better after as many steps.
    channels: tuple[int, ...] = (8, 24, 48, 64)
    features: int = 96
    batch: int = 64
    passes: float = 12.0
    fewest_steps: int = 500
    most_steps: int = 1400
    learning_rate: float = 2e-3
    further_rate: float = 1e-3
    warm_up: int = 50
    weight_decay: float = 1e-3
    throttle_weight: float = 1.0
    held_out: float = 0.1
    checks: int = 10
    patience: int = 10
    rehearsal: float = 0.25
    augmentation: Augmentation = Augmentation()
    eyes: Literal["colours", "edges"] = "colours"
    nerves: tuple[int, ...] = (64, 64)
    members: int = 1
    dropout: float = 0.0
    smoothing: float = 0.0
    averaging: float = 0.0

    def __post_init__(self) -> None:
        """Refuse settings that contradict themselves.

        Raises:
            CloningError: If a number is out of its range.
        """
        counts = (self.features, self.batch, self.fewest_steps, self.checks, self.patience)
        if not self.channels or min(*counts, *self.channels) < 1:
            raise CloningError(
                "channels, features, batch, fewest_steps, checks and patience are at least 1."
            )
        if self.most_steps < self.fewest_steps:
            raise CloningError(
                f"most_steps ({self.most_steps}) is below fewest_steps ({self.fewest_steps})."
            )
        if not (self.learning_rate > 0.0 and self.further_rate > 0.0 and self.passes > 0.0):
            raise CloningError("passes and both learning rates are above 0.")
        if not (0.0 <= self.held_out < 1.0 and 0.0 <= self.rehearsal < 1.0):
            raise CloningError("held_out and rehearsal are shares in [0, 1).")
        if min(self.warm_up, self.weight_decay, self.throttle_weight) < 0:
            raise CloningError("warm_up, weight_decay and throttle_weight are at least 0.")
        if not self.nerves or min(self.members, *self.nerves) < 1:
            raise CloningError("members is at least 1, and so is each of nerves.")
        if not all(0.0 <= x < 1.0 for x in (self.dropout, self.smoothing, self.averaging)):
            raise CloningError("dropout, smoothing and averaging are shares in [0, 1).")

    def steps(self, pictures: int) -> int:
        """Steps of training for so many pictures."""
        wanted = round(self.passes * pictures / self.batch)
        return min(max(wanted, self.fewest_steps), self.most_steps)
