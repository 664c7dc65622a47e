"""Convert observations and actions of any body to rows: one for the trunk, one for each limb.

A row is a vector with the observations of a trunk or a limb and numbers that describe it, such as
lengths. Its columns are the same for all bodies of a family, so one network fits all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, cast

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import layouts_of
from shapechanger.errors import LayoutError, StudyError, TransplantError
from shapechanger.layout import Element, Feature, Layout

_Floats = NDArray[np.float64]

NUMBERS: Final = 22
"""Columns of a row for the numbers that describe a trunk or a limb."""
DESCRIBED: Final = 2 + NUMBERS
"""Columns of a row before the observations: whether the limb exists, whether it has a motor, and
`NUMBERS`."""
# Factors that scale observations to about 1, keyed by unit: joints of runners turn at about
# 10 rad/s, and runners move at 3 m/s. The envs clip contact forces to 1.
_SCALES: Final = {"rad/s": 0.1, "m/s": 0.3}


class Columns(msgspec.Struct, frozen=True):
    """Names of the observations of a trunk and of a limb, and of the numbers that describe them."""

    trunk: tuple[str, ...]
    limb: tuple[str, ...]
    trunk_numbers: tuple[str, ...]
    limb_numbers: tuple[str, ...]

    @property
    def width(self) -> int:
        """Length of a row; the shorter one of trunk and limb rows is padded with zeros."""
        return DESCRIBED + max(len(self.trunk), len(self.limb))

    def names(self, *, trunk: bool) -> list[str]:
        """Return the name of each number of a row."""
        names = ["exists", "has a motor", *(self.trunk_numbers if trunk else self.limb_numbers)]
        names += [f"number {k}" for k in range(len(names), DESCRIBED)]
        names += self.trunk if trunk else self.limb
        return names + [f"number {k}" for k in range(len(names), self.width)]


@dataclass(frozen=True)
class LimbRows:
    """Map from the observations of a body to rows, and from limbs' actions to the body's actions.

    Rows are `(observations * scale + offset) @ selection + constant`, flattened.

    Attributes:
        scale: Shape (observations,).
        offset: Shape (observations,).
        selection: Shape (observations, (room + 1) * width), of zeros and ones.
        constant: Shape ((room + 1) * width,).
    """

    columns: Columns
    limbs: tuple[str, ...]
    names: tuple[tuple[str, ...], tuple[str, ...]]
    scale: _Floats
    offset: _Floats
    selection: _Floats
    constant: _Floats
    actuators: NDArray[np.intp]
    low: _Floats
    high: _Floats

    def of(self, observation: Any) -> Any:
        """Return the rows, shape (..., (room + 1) * width), of observations, (..., observations).

        Both are arrays, the rows of float32; or tensors if this map consists of tensors.
        """
        return _single((observation * self.scale + self.offset) @ self.selection + self.constant)

    def actions(self, limbs: Any) -> Any:
        """Return a body's actions, in its units, for numbers from -1 to 1, shape (..., room)."""
        share = 0.5 * (limbs[..., self.actuators] + 1.0)
        return _single(self.low + share * (self.high - self.low))

    @staticmethod
    def stacked(each: Sequence[LimbRows]) -> LimbRows:
        """Stack the maps of bodies whose observations have the same order, along a new axis 0."""
        own = ("scale", "offset", "constant", "low", "high")
        return replace(
            each[0], **{name: np.stack([getattr(rows, name) for rows in each]) for name in own}
        )

    @property
    def room(self) -> int:
        """Number of rows for limbs, including empty rows."""
        return len(self.constant) // self.columns.width - 1

    def layouts(self) -> tuple[Layout, Layout]:
        """Return the layouts of the rows, flattened, and of the limbs' actions."""
        names = ["trunk", *self.limbs]
        names += [f"no limb {i}" for i in range(len(self.limbs), self.room)]
        features: list[Feature] = []
        for i, name in enumerate(names):
            element = Element("joint", name) if 0 < i <= len(self.limbs) else None
            own = self.columns.names(trunk=i == 0)
            features += [Feature(f"{name}: {kind}", "1", element=element) for kind in own]
        actions = [Feature(f"{name}: action", "1", -1.0, 1.0) for name in names[1:]]
        return Layout(tuple(features)), Layout(tuple(actions))


def _single(numbers: Any) -> Any:
    if not isinstance(numbers, np.ndarray):
        return numbers
    return cast("NDArray[Any]", numbers).astype(np.float32)


def rows_of(env: gym.Env[Any, Any], room: int = 0) -> LimbRows:
    """Return the rows of an env's body."""
    inner = env.unwrapped
    name = env.spec.id if env.spec else type(inner).__name__
    tree: Any = getattr(inner, "tree", None)
    if tree is None:
        raise StudyError(
            f"{name} has no kinematic tree, which a policy for many bodies needs: give the env a "
            "property `tree`, such as the MuJoCo bodies have."
        )
    observation, action = layouts_of(env)
    if room and len(tree.limbs) > room:
        raise StudyError(
            f"{name} has a body of {len(tree.limbs)} limbs, and the policy has room for {room}: "
            f"train it with --set room={len(tree.limbs)}."
        )
    room = room or len(tree.limbs)
    limb_of = {limb.joint: i for i, limb in enumerate(tree.limbs)}
    limb_of_body = {body: i for i, limb in enumerate(tree.limbs) for body in limb.bodies}
    found = [_column(each, limb_of, limb_of_body, tree.trunk) for each in observation.features]
    columns = Columns(
        tuple(dict.fromkeys(name for row, name in found if row == 0)),
        tuple(dict.fromkeys(name for row, name in found if row > 0)),
        tree.trunk_numbers,
        tree.limb_numbers,
    )
    if max(len(columns.trunk_numbers), len(columns.limb_numbers)) > NUMBERS:
        raise StudyError(f"{name} describes a limb by more than {NUMBERS} numbers.")
    width = columns.width
    selection = np.zeros((observation.size, (room + 1) * width))
    scale, offset = np.ones(observation.size), np.zeros(observation.size)
    for i, (row, kind) in enumerate(found):
        senses = columns.limb if row else columns.trunk
        selection[i, row * width + DESCRIBED + senses.index(kind)] = 1.0
        scale[i], offset[i] = _scaling(observation.features[i])
    constant = np.zeros((room + 1, width))
    constant[0, 0] = 1.0
    constant[0, 2 : 2 + len(tree.numbers)] = tree.numbers
    for i, limb in enumerate(tree.limbs):
        constant[i + 1, :2] = 1.0, bool(limb.actuator)
        constant[i + 1, 2 : 2 + len(limb.numbers)] = limb.numbers
    limb_of_actuator = {limb.actuator: i for i, limb in enumerate(tree.limbs) if limb.actuator}
    owners = [feature.element.name if feature.element else "" for feature in action.features]
    if lost := [owner for owner in owners if owner not in limb_of_actuator]:
        raise LayoutError(f"{name}: the action {lost[0]!r} moves no limb of the body.")
    return LimbRows(
        columns,
        tuple(limb_of),
        (observation.names, action.names),
        scale,
        offset,
        selection,
        constant.ravel(),
        np.array([limb_of_actuator[owner] for owner in owners], np.intp),
        action.low.astype(np.float64),
        action.high.astype(np.float64),
    )


def require_same_columns(trained: Layout, present: Layout, env: str) -> None:
    """Refuse a body whose rows have other columns than the rows that a policy was trained on."""

    def meanings(layout: Layout) -> tuple[str, ...]:
        rows: dict[str, list[str]] = {}
        for name in layout.names:
            row, _, kind = name.partition(": ")
            rows.setdefault(row, []).append(kind)
        _, limb, *_ = rows.values()
        return (*rows["trunk"], *limb)

    learned, own = meanings(trained), meanings(present)
    if learned != own:
        strange = [name for name in own if name not in learned] or list(own)
        raise TransplantError(
            f"The policy was trained on bodies of another family than {env}: it has no column "
            f"{strange[0]!r} among {', '.join(learned[:3])} and {len(learned) - 3} more."
        )


def _column(
    feature: Feature, limb_of: dict[str, int], limb_of_body: dict[str, int], trunk: tuple[str, ...]
) -> tuple[int, str]:
    """Return the index of a feature's row, and the name of its column.

    Measurements of several bodies of one limb, such as contact, share a column and are summed.
    """
    element = feature.element
    if element is None or element.kind == "task":
        return 0, feature.name
    quantity = feature.name.removeprefix(f"{element.name}/")
    if element.kind == "joint":
        # A joint of the trunk, such as the height of a runner, keeps its name.
        row = limb_of.get(element.name)
        return (0, feature.name) if row is None else (row + 1, quantity)
    if element.kind == "body" and element.name in limb_of_body:
        return limb_of_body[element.name] + 1, quantity
    if element.kind == "body" and element.name in trunk:
        return 0, f"trunk/{quantity}"
    raise LayoutError(f"{feature.name} must belong to a limb or the trunk of the body.")


def _scaling(feature: Feature) -> tuple[float, float]:
    finite = np.isfinite(feature.low) and np.isfinite(feature.high)
    if finite and feature.unit in ("rad", "m") and feature.high > feature.low:
        half = 0.5 * (feature.high - feature.low)
        return 1.0 / half, -feature.middle / half
    return _SCALES.get(feature.unit, 1.0), 0.0
