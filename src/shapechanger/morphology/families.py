"""Families of bodies: one model each, the named bodies that edits make from it, and its splits."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal, get_args

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology import (
    Body,
    Edit,
    Friction,
    Gear,
    Mass,
    Stretch,
    as_body,
    name_elements,
    reshape,
)

BodyLike = str | Edit | Iterable[Edit]
"""A body as users give it: its name, edits as JSON, one edit, or several."""

Split = Literal["train", "interpolation", "extrapolation", "composition"]
"""Splits of a family: one for training, three for evaluation."""

# Share of the training bodies that have one of the family's parts.
_WITH_PART: Final = 0.5


@dataclass(frozen=True)
class Axis:
    """A number by which the bodies of a family differ.

    Attributes:
        name: Its name, such as "length of shank_4".
        edit: Makes the edit of a value.
        low: Smallest value of the training bodies.
        high: Largest value of the training bodies.
        lowest: Smallest value of all bodies.
        highest: Largest value of all bodies.
        unit: Its unit; "1" for a ratio to the model's own value.
    """

    name: str
    edit: Callable[[float], Edit]
    low: float
    high: float
    lowest: float
    highest: float
    unit: str = "1"


@dataclass(frozen=True)
class Family:
    """One model, its named bodies, and how its other bodies differ.

    Attributes:
        name: Name of the family and of its unedited body.
        bodies: Edits of each named body.
        bodies_by_joint: Names for bodies that the model leaves unnamed, by the name of their joint.
        axes: The numbers by which its bodies differ; none for a family that cannot be sampled.
        parts: Parts that a place, such as a leg, can have instead of the model's own, by the name
            of the place and of the part.
        published: Edits of published bodies, or their JSON, keyed by name.
        rig: Edits that are applied before those of any body, such as two more legs.
    """

    name: str
    bodies: Mapping[str, Body]
    bodies_by_joint: Mapping[str, str] = field(default_factory=dict[str, str])
    axes: tuple[Axis, ...] = ()
    parts: Mapping[str, Mapping[str, Body]] = field(default_factory=dict[str, Mapping[str, Body]])
    published: Mapping[str, Any] = field(default_factory=dict[str, Any])
    rig: Body = ()

    def load(self, path: str | Path) -> mujoco.MjSpec:
        """Load the model at `path` with the rig, and name all its elements.

        Raises:
            MorphologyError: If the rig does not fit it.
        """
        spec = mujoco.MjSpec.from_file(str(path))
        name_elements(spec, self.bodies_by_joint)
        return reshape(spec, self.rig) if self.rig else spec

    def body(self, value: BodyLike) -> Body:
        """Edits of a body.

        Args:
            value: Name of a body of this family, edits as JSON, one edit, or several.

        Raises:
            UnknownName: If the family has no body of this name.
            MorphologyError: If `value` is not a valid body.
        """
        if isinstance(value, str) and not value.lstrip().startswith(("[", "{")):
            named = {**self.bodies, **self.published}
            if value not in named:
                raise UnknownName(f"body of the family {self.name}", value, named)
            return as_body(named[value])
        return as_body(value)

    def body_at(self, values: Mapping[str, float], parts: Mapping[str, str] | None = None) -> Body:
        """Return the body at some values of the family's axes, by their names; the others are 1.

        Args:
            values: Value of each axis, by its name.
            parts: Name of the part at each place that has not the model's own.

        Raises:
            UnknownName: If the family has no such axis, place or part.
            MorphologyError: If a value lies beyond its axis.
        """
        edits: list[Edit] = []
        for place, part in (parts or {}).items():
            if place not in self.parts:
                raise UnknownName(f"place of the family {self.name}", place, self.parts)
            if part not in self.parts[place]:
                raise UnknownName(f"part of {place}", part, self.parts[place])
            edits += self.parts[place][part]
        axes = {axis.name: axis for axis in self.axes}
        for name, value in values.items():
            if name not in axes:
                raise UnknownName(f"axis of the family {self.name}", name, axes)
            axis = axes[name]
            if not axis.lowest <= value <= axis.highest:  # Also refuses NaN.
                raise MorphologyError(
                    f"{name} of the family {self.name} lies between {axis.lowest:g} and "
                    f"{axis.highest:g} [{axis.unit}], got {value:g}."
                )
            edits.append(axis.edit(value))
        return tuple(edits)

    def sample(self, n: int, seed: int = 0, split: Split = "train") -> list[Body]:
        """Draw bodies; the first ones do not depend on the number.

        - "train": each axis within its training range, drawn uniformly in its logarithm, and in
          half of the bodies one part.
        - "interpolation": other bodies of the same distribution.
        - "extrapolation": each axis within its whole range, at least one outside its training
          range; parts as in "train".
        - "composition": axes as in "train", and parts at two places or more.

        The bodies depend on the version of Shapechanger, since its axes may change.

        Args:
            n: How many.
            seed: Seed of the draws; the draws of splits are independent.
            split: Which part of the family.

        Raises:
            UnknownName: If there is no such split.
            MorphologyError: If the family has no axes, or for "composition" not two places.
        """
        if split not in get_args(Split):
            raise UnknownName("split", split, get_args(Split))
        if not self.axes:
            raise MorphologyError(f"The family {self.name} declares no axes to draw bodies from.")
        if split == "composition" and len(self.parts) < 2:
            raise MorphologyError(
                f"The family {self.name} has no parts to combine: its splits are "
                f"{', '.join(get_args(Split)[:3])}."
            )
        rng = np.random.default_rng([seed, get_args(Split).index(split)])
        return [self._draw(rng, split) for _ in range(n)]

    def _draw(self, rng: np.random.Generator, split: Split) -> Body:
        """Draw one body."""
        places: list[str] = list(self.parts)
        if split == "composition":
            count = int(rng.integers(2, len(places) + 1))
        else:
            count = int(rng.uniform() < _WITH_PART) if places else 0
        numbers: list[int] = sorted(rng.permutation(len(places))[:count].tolist())
        chosen = [places[i] for i in numbers]
        parts = {place: str(rng.choice(list(self.parts[place]))) for place in chosen}
        far = split == "extrapolation"
        while True:
            values: dict[str, float] = {}
            for axis in self.axes:
                ends = (axis.lowest, axis.highest) if far else (axis.low, axis.high)
                value = math.exp(rng.uniform(math.log(ends[0]), math.log(ends[1])))
                values[axis.name] = round(value, 4)  # So that the edits can be read.
            if far == any(not a.low <= values[a.name] <= a.high for a in self.axes):
                return self.body_at(values, parts)


def length_axes(bodies: Iterable[str], low: float, high: float) -> tuple[Axis, ...]:
    """Return an axis for the length of each of these bodies.

    In training it is `low` to `high` times the model's; of all, 0.3 below to 0.4 above these.
    """
    return tuple(
        Axis(f"length of {body}", partial(Stretch, body), low, high, low - 0.3, high + 0.4)
        for body in bodies
    )


def strength_axes(trunk: str, actuators: str = "*") -> tuple[Axis, ...]:
    """Return axes for the mass of the trunk, a body, the strength of motors and all friction."""
    return (
        Axis(f"mass of {trunk}", partial(Mass, trunk), 0.7, 1.5, 0.5, 2.5),
        Axis("strength of the motors", partial(Gear, actuators), 0.8, 1.25, 0.6, 1.6),
        Axis("friction", partial(Friction, "*"), 0.7, 1.4, 0.45, 2.0),
    )
