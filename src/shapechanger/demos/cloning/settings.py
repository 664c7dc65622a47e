"""Settings of behaviour cloning, as plain values."""

from __future__ import annotations

from typing import Final, Literal

import msgspec

from shapechanger.demos.cloning.pictures import CloningError, Framing


class Augmentation(msgspec.Struct, frozen=True, kw_only=True):
    """Random changes of each image each time it is learned from.

    Attributes:
        mirror: Share of images that are mirrored, with their actions.
        shift: Maximum shift to each side, and up and down, pixels.
        gain: Maximum brightness factor, >= 1; its inverse is the minimum.
        colour: Maximum further factor of a single colour, >= 1; its inverse is the minimum.
        offset: Maximum offset of all pixels in either direction, as a share of full brightness.
        noise: Maximum standard deviation of the noise, as a share of full brightness.
        noisy: Share of images with noise.
        blurred: Share of images that are blurred over 3 x 3 pixels.
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
        """Validate the ranges."""
        for name in ("mirror", "noisy", "blurred"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise CloningError(f"{name} must be in [0, 1], got {getattr(self, name)}.")
        if self.shift < 0 or not (self.offset >= 0.0 and self.noise >= 0.0):
            raise CloningError("shift, offset and noise must be at least 0.")
        if not (self.gain >= 1.0 and self.colour >= 1.0):
            raise CloningError("gain and colour must be at least 1.")


class CloneSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Hyperparameters of behaviour cloning.

    Attributes:
        framing: Crop and resolution; those of `start` where training starts from another policy.
        channels: Filters of each convolution; each one halves rows and columns.
        features: Number of features between image and actions.
        batch: Examples per step.
        passes: Number of passes over the data, within the two bounds below.
        fewest_steps: Minimum number of steps.
        most_steps: Maximum number of steps.
        learning_rate: Initial learning rate; falls to 0 along half a cosine.
        further_rate: Initial learning rate when another policy is trained further.
        warm_up: Steps in which the rate rises from 0.
        weight_decay: Of AdamW.
        held_out: Share of the steps, in [0, 1), in one stretch, that is not learned from but used
            for early stopping.
        checks: Number of validations during training.
        patience: Number of validations without improvement after which training stops.
        rehearsal: Share of each batch that comes from the rehearsal data, if there are any.
        augmentation: Random changes of the images.
        eyes: Input of the first layer: "colours", or "edges": strength of the edges of each
            direction in each cell, independent of light and colour.
        nerves: Widths of the layers for the state.
        members: Number of averaged networks; each uses another stretch of time for early stopping,
            so that together they learn from all data.
        dropout: Share of the features that are dropped in each step.
        smoothing: Label smoothing of classes.
        averaging: Decay of the exponential moving average of the weights; 0 for no average.
    """

    framing: Framing = Framing()
    # Few filters in the first layer, which is by far the most expensive one: 16 and 32 in the first
    # two took 1.8 times as long per step, and drove no better after the same number of steps.
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
        """Validate the ranges."""
        counts = (self.features, self.batch, self.fewest_steps, self.checks, self.patience)
        if not self.channels or min(*counts, *self.channels) < 1:
            raise CloningError(
                "channels, features, batch, fewest_steps, checks and patience must be at least 1."
            )
        if self.most_steps < self.fewest_steps:
            raise CloningError(
                f"most_steps ({self.most_steps}) must be at least fewest_steps "
                f"({self.fewest_steps})."
            )
        if not (self.learning_rate > 0.0 and self.further_rate > 0.0 and self.passes > 0.0):
            raise CloningError("passes and both learning rates must be positive.")
        if not (0.0 <= self.held_out < 1.0 and 0.0 <= self.rehearsal < 1.0):
            raise CloningError("held_out and rehearsal must be in [0, 1).")
        if min(self.warm_up, self.weight_decay) < 0:
            raise CloningError("warm_up and weight_decay must be at least 0.")
        if not self.nerves or min(self.members, *self.nerves) < 1:
            raise CloningError("members and nerves must be at least 1.")
        if not all(0.0 <= x < 1.0 for x in (self.dropout, self.smoothing, self.averaging)):
            raise CloningError("dropout, smoothing and averaging must be in [0, 1).")

    def steps(self, pictures: int) -> int:
        """Return the number of training steps for this many images."""
        wanted = round(self.passes * pictures / self.batch)
        return min(max(wanted, self.fewest_steps), self.most_steps)


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

# Steps, two and a half minutes at 20 Hz, from which demonstrations are many. One network on colours
# and finer images learns from them; with fewer it would learn irrelevant details.
_MANY: Final = 3000


def settings_for(steps: int) -> CloneSettings:
    """Return the settings for this many steps.

    With many steps nothing is held out, and the last network is kept. When a tenth of twenty
    minutes was held out, the network after 140 of 1,400 steps was best by 0.3 %, and drove badly;
    see docs/cloning.md.
    """
    return DEMOS if steps < _MANY else CloneSettings(held_out=0.0)
