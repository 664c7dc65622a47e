"""Layouts: the meaning of each number of an observation or an action.

A `Layout` is an ordered list of `Feature`s. Every embodiment, simulated or real, has a layout of
its observations and a layout of its actions. A body map maps between two layouts.

>>> layout = Layout((Feature("hinge/angle", "rad", -1.6, 1.6), Feature("hinge/velocity", "rad/s")))
>>> layout.size, layout.names
(2, ('hinge/angle', 'hinge/velocity'))
"""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Iterable, Iterator
from typing import Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import LayoutError, UnknownName
from shapechanger.files import decoded

ElementKind = Literal["body", "joint", "actuator", "tendon", "sensor", "camera", "task"]

_LOWEST: Final = -math.inf
_HIGHEST: Final = math.inf


class Element(msgspec.Struct, frozen=True):
    """The part of the embodiment that a feature belongs to.

    Attributes:
        kind: Kind of part; "task" for a number that belongs to no part, such as a goal.
        name: Name in the model or in the robot's profile.
    """

    kind: ElementKind
    name: str


class Feature(msgspec.Struct, frozen=True, omit_defaults=True):
    """One number, or one block of numbers, of an observation or an action.

    Attributes:
        name: Path from the element to the quantity, such as `hip_1/angle` or `shank_4/contact/fx`.
        unit: SI unit of the number; "1" for a dimensionless number.
        low: Smallest value, in `unit`; minus infinity for no limit. Limits of joints are soft: a
            contact or a motor can press a joint a little beyond them.
        high: Largest value, in `unit`; infinity for no limit.
        element: The body, joint, actuator or other part that the feature belongs to.
        shape: () for one number; the shape of the block otherwise, such as (120, 160, 3).
        gain: Effect of one unit of an action, in `gain_unit`: 150 for a motor whose control of 1
            is a torque of 150 N·m; 1 for observations.
        gain_unit: Unit of the product of `gain` and the feature; empty for observations.

    Raises:
        LayoutError: If the name is empty, the range is empty or NaN, the gain is not finite and
            above zero, or the shape has a number below one.
    """

    name: str
    unit: str
    low: float = _LOWEST
    high: float = _HIGHEST
    element: Element | None = None
    shape: tuple[int, ...] = ()
    gain: float = 1.0
    gain_unit: str = ""

    def __post_init__(self) -> None:
        if not self.name:
            raise LayoutError("A feature needs a name.")
        # Also refuses NaN, and ranges without finite numbers, which JSON cannot distinguish.
        if not self.low <= self.high or self.low == math.inf or self.high == -math.inf:
            raise LayoutError(f"{self.name}: the range {self.low} to {self.high} is empty.")
        if not (math.isfinite(self.gain) and self.gain > 0.0):
            raise LayoutError(f"{self.name}: the gain must be above zero, got {self.gain}.")
        if any(n < 1 for n in self.shape):
            raise LayoutError(f"{self.name}: the shape {self.shape} has a number below one.")
        # JSON has no infinity, so infinite bounds must be omitted. msgspec only omits the default
        # object itself, so equal values are replaced by it.
        if self.low == _LOWEST:
            msgspec.structs.force_setattr(self, "low", _LOWEST)
        if self.high == _HIGHEST:
            msgspec.structs.force_setattr(self, "high", _HIGHEST)

    def __str__(self) -> str:
        """Return the name with its unit, such as `torso/z [m]`."""
        return f"{self.name} [{self.unit}]"

    @property
    def size(self) -> int:
        """Number of values."""
        return math.prod(self.shape)

    @property
    def middle(self) -> float:
        """The middle of the range; 0, or the bound nearest to it, if a bound is infinite."""
        if math.isfinite(self.low) and math.isfinite(self.high):
            return 0.5 * (self.low + self.high)
        return min(max(0.0, self.low), self.high)


class Layout(msgspec.Struct, frozen=True):
    """Meaning of each number of a flat observation or action, in order.

    Attributes:
        features: The features; a block of n numbers takes n places, in C order.

    Raises:
        LayoutError: If two features have the same name.
    """

    features: tuple[Feature, ...]

    def __post_init__(self) -> None:
        names = self.names
        if len(set(names)) != len(names):
            twice = next(name for i, name in enumerate(names) if name in names[:i])
            raise LayoutError(f"Two features have the name {twice!r}.")

    def __len__(self) -> int:
        """Return the number of features."""
        return len(self.features)

    def __iter__(self) -> Iterator[Feature]:
        """Iterate over the features in order."""
        return iter(self.features)

    def __contains__(self, name: object) -> bool:
        """Return whether a feature has this name."""
        return any(feature.name == name for feature in self.features)

    def __getitem__(self, name: str | int) -> Feature:
        """Return the feature with a name or an index; UnknownName if there is no such name."""
        if not isinstance(name, str):
            return self.features[name]
        for feature in self.features:
            if feature.name == name:
                return feature
        raise UnknownName("feature", name, self.names)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the features, in order."""
        return tuple(feature.name for feature in self.features)

    @property
    def size(self) -> int:
        """Size of the flat vector."""
        return sum(feature.size for feature in self.features)

    @property
    def slices(self) -> dict[str, slice]:
        """Indices in the flat vector, keyed by name."""
        places: dict[str, slice] = {}
        start = 0
        for feature in self.features:
            places[feature.name] = slice(start, start + feature.size)
            start += feature.size
        return places

    @property
    def low(self) -> NDArray[np.float64]:
        """Smallest values, shape (size,)."""
        return self._per_number([feature.low for feature in self.features])

    @property
    def high(self) -> NDArray[np.float64]:
        """Largest values, shape (size,)."""
        return self._per_number([feature.high for feature in self.features])

    def matching(self, pattern: str) -> tuple[Feature, ...]:
        """Return the features whose name is `pattern` or matches it, such as `hip_*/angle`.

        The exact name of a feature is not used as a glob, even if it contains brackets, such as
        `wheel[0]`.

        Raises:
            UnknownName: If no such feature exists.
        """
        if pattern in self:
            return (self[pattern],)
        found = tuple(f for f in self.features if fnmatch.fnmatchcase(f.name, pattern))
        if not found:
            raise UnknownName("feature", pattern, self.names)
        return found

    def to_json(self) -> str:
        """Return the layout as JSON; infinite bounds are omitted."""
        return msgspec.json.encode(self).decode()

    @classmethod
    def from_json(cls, text: str | bytes) -> Layout:
        """Read a layout from the JSON of `to_json`.

        Raises:
            LayoutError: If the text is not a layout.
        """
        return decoded(text, cls, LayoutError, "This is not a layout")

    def _per_number(self, values: list[float]) -> NDArray[np.float64]:
        return np.repeat(np.asarray(values, dtype=np.float64), [f.size for f in self.features])


def value_names(layout: Iterable[Feature]) -> list[str]:
    """Return a name for each value of a layout; values of a block are numbered, like `map[3]`."""
    return [
        f"{feature.name}[{place}]" if feature.shape else feature.name
        for feature in layout
        for place in range(feature.size)
    ]
