"""Layouts: the meaning of each number of an observation or an action.

A `Layout` is an ordered list of `Feature`s. Every embodiment, simulated or real, publishes two:
one for what it senses and one for what it moves. Transfer is a map between two layouts.

>>> layout = Layout((Feature("hinge/angle", "rad", -1.6, 1.6), Feature("hinge/velocity", "rad/s")))
>>> layout.size, layout.names
(2, ('hinge/angle', 'hinge/velocity'))
"""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Iterator
from typing import Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import LayoutError, UnknownName

ElementKind = Literal["body", "joint", "actuator", "tendon", "sensor", "camera", "task"]

_GLOB_CHARACTERS: Final = frozenset("*?[")
_LOWEST: Final = -math.inf
_HIGHEST: Final = math.inf


class Element(msgspec.Struct, frozen=True):
    """The part of the embodiment that a feature belongs to.

    Attributes:
        kind: What it is; "task" for a number that belongs to no part, such as a goal.
        name: Its name in the model or in the robot's profile.
    """

    kind: ElementKind
    name: str


class Feature(msgspec.Struct, frozen=True, omit_defaults=True):
    """One number, or one block of numbers, of an observation or an action.

    Attributes:
        name: Path from the element to the quantity, such as `hip_1/angle` or `shank_4/contact/fx`.
        unit: SI unit of the number as the env gives it; "1" for a pure number.
        low: Smallest value, in `unit`; minus infinity where there is none. A joint's limit is soft:
            a contact or a motor can press it a little beyond.
        high: Largest value, in `unit`.
        element: The body, joint, actuator or other part that the feature belongs to.
        shape: () for one number; the shape of the block otherwise, such as (120, 160, 3).
        gain: What one unit of an action does, in `gain_unit`: 150 for a motor whose control of 1
            gives 150 N·m. 1 for anything that is not an action.
        gain_unit: Unit of `gain` times the feature; empty for anything that is not an action.

    Raises:
        LayoutError: If the name is empty, the range is empty or NaN, the gain is not finite and
            above zero, or the shape holds a number below one.
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
        # Also refuses NaN, and ranges that hold no finite number, which JSON could not tell apart.
        if not self.low <= self.high or self.low == math.inf or self.high == -math.inf:
            raise LayoutError(f"{self.name}: the range {self.low} to {self.high} is empty.")
        if not (math.isfinite(self.gain) and self.gain > 0.0):
            raise LayoutError(f"{self.name}: the gain must be above zero, got {self.gain}.")
        if any(n < 1 for n in self.shape):
            raise LayoutError(f"{self.name}: the shape {self.shape} holds a number below one.")
        # JSON has no infinity, so infinite bounds are left out; msgspec leaves out what *is* the
        # default, not what equals it.
        if self.low == _LOWEST:
            msgspec.structs.force_setattr(self, "low", _LOWEST)
        if self.high == _HIGHEST:
            msgspec.structs.force_setattr(self, "high", _HIGHEST)

    def __str__(self) -> str:
        """The name with its unit, as in `torso/z [m]`."""
        return f"{self.name} [{self.unit}]"

    @property
    def size(self) -> int:
        """Size of the feature."""
        return math.prod(self.shape)

    @property
    def middle(self) -> float:
        """The middle of the range; 0, or the bound nearest to it, where the range is unbounded."""
        if math.isfinite(self.low) and math.isfinite(self.high):
            return 0.5 * (self.low + self.high)
        return min(max(0.0, self.low), self.high)


class Layout(msgspec.Struct, frozen=True):
    """Meaning of each number of a flat observation or action, in order.

    Attributes:
        features: The features; a block of n numbers takes n places, in C order.

    Raises:
        LayoutError: If two features bear the same name.
    """

    features: tuple[Feature, ...]

    def __post_init__(self) -> None:
        names = self.names
        if len(set(names)) != len(names):
            twice = next(name for i, name in enumerate(names) if name in names[:i])
            raise LayoutError(f"Two features are called {twice!r}.")

    def __len__(self) -> int:
        """The number of features, which is `size` only where no feature is a block."""
        return len(self.features)

    def __iter__(self) -> Iterator[Feature]:
        """The features in order."""
        return iter(self.features)

    def __contains__(self, name: object) -> bool:
        """Return whether a feature has this name."""
        for feature in self.features:  # Faster than building the names or a generator.  # noqa: SIM110
            if feature.name == name:
                return True
        return False

    def __getitem__(self, name: str) -> Feature:
        """The feature of this name.

        Raises:
            UnknownName: If there is none.
        """
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
        """For each name the places that it takes in the flat vector."""
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
        """The features whose name is `pattern` or fits it as a glob, such as `hip_*/angle`.

        Raises:
            UnknownName: If there is none.
        """
        if _GLOB_CHARACTERS.isdisjoint(pattern):
            return (self[pattern],)
        found = tuple(f for f in self.features if fnmatch.fnmatchcase(f.name, pattern))
        if not found:
            raise UnknownName("feature", pattern, self.names)
        return found

    def to_json(self) -> str:
        """The layout as JSON; infinite bounds are left out."""
        return msgspec.json.encode(self).decode()

    @classmethod
    def from_json(cls, text: str | bytes) -> Layout:
        """Read what `to_json` wrote.

        Raises:
            LayoutError: If the text is not a layout.
        """
        try:
            return msgspec.json.decode(text, type=cls)
        except msgspec.MsgspecError as error:
            raise LayoutError(f"This is not a layout: {error}.") from error

    def _per_number(self, values: list[float]) -> NDArray[np.float64]:
        return np.repeat(np.asarray(values, dtype=np.float64), [f.size for f in self.features])
