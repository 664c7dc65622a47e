"""Bodies as values: edits of a model, their JSON, interpolated bodies, and families of bodies.

>>> from shapechanger.morphology import Stretch, to_json
>>> to_json([Stretch("*shank*", 1.5)])
'[{"edit":"stretch","body":"*shank*","factor":1.5}]'
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Callable, Generator, Hashable, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal, cast, get_args

import msgspec
import mujoco
import numpy as np

from shapechanger.errors import BrokenModel, MorphologyError, ShapechangerError, require_known
from shapechanger.files import converted
from shapechanger.morphology.edits import EDITS, Edit, part_of_the_way
from shapechanger.morphology.edits.places import Stretch
from shapechanger.morphology.edits.values import Friction, Gear, Mass
from shapechanger.morphology.spec import make_explicit, name_elements
from shapechanger.morphology.spec.carried import carried

Body = tuple[Edit, ...]
"""The edits, in order, that make a body from the model of its family."""

# MuJoCo uses sparse constraint Jacobians from 60 degrees of freedom on. Newton's solver of this
# version then factorises a wrong Hessian; 4.0.1 fixes this (google-deepmind/mujoco#3767).
_WRONG_SPARSE: Final = "4.0.0"
_WITH_PART: Final = 0.5  # Share of bodies with one part, except in "composition".


def to_json(body: Iterable[Edit]) -> str:
    """Return the edits as a JSON list of tagged objects."""
    return msgspec.json.encode(list(body)).decode()


def from_json(text: str | bytes) -> Body:
    """Read a body from JSON as `to_json` writes it; a single object is a body of one edit.

    Raises:
        UnknownName: If an edit has an unknown kind or an unknown field.
        MorphologyError: If the text is not such a list, or a number is out of its range.
    """
    try:
        # A text that was read from a file may begin with a byte-order mark.
        parsed: Any = json.loads(text.removeprefix("\ufeff") if isinstance(text, str) else text)
    except (ValueError, RecursionError) as error:  # Not JSON, not UTF-8, or nested too deeply.
        raise MorphologyError(f"A body must be a JSON list of edits: {error}.") from error
    return as_body(cast("list[Any]", parsed) if isinstance(parsed, list) else [parsed])


def as_body(value: Edit | Iterable[Edit] | str) -> Body:
    """Return a body from one edit, several, or their JSON, which may be parsed already.

    Raises:
        UnknownName: If an edit has an unknown kind or an unknown field.
        MorphologyError: If `value` is something else, or a number is out of its range.
    """
    if isinstance(value, str):
        return from_json(value)
    given: Any = value  # Not checked at run time.
    one = isinstance(given, Edit | Mapping) or not isinstance(given, Iterable)
    return tuple(map(_edit, [given] if one else cast("Iterable[Any]", given)))


def _edit(item: Any) -> Edit:
    if isinstance(item, Edit):
        return item
    if not isinstance(item, Mapping) or "edit" not in item:
        raise MorphologyError(
            "A body is made of edits such as Stretch('shank_*', 1.5), in JSON objects with the key "
            f'"edit", not of {item!r}.'
        )
    fields = dict(cast("Mapping[str, Any]", item))
    name = str(fields["edit"])
    require_known("edit", EDITS, name)
    kind = EDITS[name]
    own = [field for field in fields if field != "edit"]
    require_known(f"field of {name!r}", kind.__struct_fields__, *own)
    return converted(fields, kind, MorphologyError, name)


def interpolate(a: Body, b: Body, alpha: float) -> Body:
    """Return a body on the way from `a` to `b`.

    Both ends are exact: 0 returns `a` itself, 1 returns `b` itself. Physical quantities are
    continuous in `alpha`, except the inertia of a segment that is split, which jumps by the inertia
    of the rounded ends of its parts. Dimensions cannot be continuous: a limb or motor that only `b`
    has exists, small and weak, for every `alpha` above 0; a limb or motor that only `a` has exists
    for every `alpha` below 1, and shrinks as `alpha` grows.

    Args:
        a: Body at 0.
        b: Body at 1, made from the same model as `a`.
        alpha: Position on the way, 0 to 1.

    Raises:
        MorphologyError: If `alpha` lies outside [0, 1].
    """
    if not 0.0 <= alpha <= 1.0:
        raise MorphologyError(f"alpha must be between 0 and 1, got {alpha}.")
    if alpha in (0.0, 1.0):
        return a if alpha == 0.0 else b
    steps: list[Edit] = []
    matcher = difflib.SequenceMatcher(None, [_key(x) for x in a], [_key(x) for x in b], False)
    for kind, *ends in matcher.get_opcodes():
        old, new = a[ends[0] : ends[1]], b[ends[2] : ends[3]]
        if kind == "equal":
            steps += [_between(x, y, alpha) for x, y in zip(old, new, strict=True)]
        else:
            steps += [edit.partly(1.0 - alpha) for edit in old]
            steps += [edit.partly(alpha) for edit in new]
    return tuple(steps)


def _key(edit: Edit) -> Hashable:
    """Return the parts that two edits must share to be interpolated: all but their numbers.

    If only one edit has a motor, the edits between them have one with a gear that fades to zero.
    """
    values: dict[str, Any] = msgspec.structs.asdict(edit)
    return type(edit), tuple(
        (name, None if isinstance(value, int | float | tuple) else value)
        for name, value in values.items()
        if value is not None and name != "gear"
    )


def _between(x: Edit, y: Edit, alpha: float) -> Edit:
    changes: dict[str, Any] = {}
    new: dict[str, Any] = msgspec.structs.asdict(y)
    for name, old in msgspec.structs.asdict(x).items():
        if old != new[name]:
            start, end = (np.array(number or 0.0, float) for number in (old, new[name]))
            value: Any = part_of_the_way(start, end, alpha)
            changes[name] = tuple(value.tolist()) if isinstance(old, tuple) else float(value)
    return msgspec.structs.replace(x, **changes)


def reshape(spec: mujoco.MjSpec, edits: Iterable[Edit]) -> mujoco.MjSpec:
    """Return a copy of a specification with edits applied in order.

    Raises:
        UnknownName: If an edit names an element that the model lacks.
        MorphologyError: If an element cannot be changed that way.
    """
    result = spec.copy()
    effective = [edit for edit in edits if edit.amount > 0.0]
    if not effective:
        return result
    make_explicit(result)
    with carried(result) as keyframes:
        for edit in effective:
            edit.require_effect(result)
            edit.apply(result)
            edit.follow_in_keyframes(result, keyframes)
    return result


@contextmanager
def compiling(work: str) -> Generator[None]:
    """Report errors of MuJoCo as a `BrokenModel`; `work` is what MuJoCo cannot do then."""
    try:
        yield
    except ShapechangerError:
        raise
    except (ValueError, mujoco.FatalError) as error:
        raise BrokenModel(f"MuJoCo cannot {work}: {reason_of(error)}.") from error


def compile_body(spec: mujoco.MjSpec, edits: Iterable[Edit] = ()) -> mujoco.MjModel:
    """Compile a copy of a specification with edits applied in order.

    Raises:
        MorphologyError: As for `reshape`; a `BrokenModel` if MuJoCo does not compile the result.
    """
    body = tuple(edits)
    with compiling(f"compile the body {to_json(body)}"):
        model = reshape(spec, body).compile()
    if mujoco.__version__ == _WRONG_SPARSE and mujoco.mj_isSparse(model):
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    return model


def reason_of(error: BaseException) -> str:
    """Return the message of an error of MuJoCo in one line, to be quoted in a sentence."""
    lines = [" ".join(line.split()) for line in str(error).splitlines()]
    return "; ".join(filter(None, lines)).removeprefix("Error: ").removesuffix(".")


BodyLike = str | Edit | Iterable[Edit]
"""A body as users give it: its name, edits as JSON, one edit, or several."""

Split = Literal["train", "interpolation", "extrapolation", "composition"]
"""Splits of a family: one for training, three for evaluation."""


@dataclass(frozen=True)
class Axis:
    """A number by which the bodies of a family differ.

    Attributes:
        name: Name of the number, such as "length of shank_4".
        edit: Function from a value of the number to the edit that sets it.
        low: Smallest value of the training bodies; `high` is their largest.
        lowest: Smallest value of all bodies; `highest` is their largest.
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
        """Load the model at `path` with the rig, and name all its elements."""
        spec = mujoco.MjSpec.from_file(str(path))
        name_elements(spec, self.bodies_by_joint)
        return reshape(spec, self.rig) if self.rig else spec

    def body(self, value: BodyLike) -> Body:
        """Return the edits of a body of this family from its name, JSON, one edit, or several."""
        if isinstance(value, str) and not value.lstrip().startswith(("[", "{")):
            return as_body(self._named("body", value, {**self.bodies, **self.published}))
        return as_body(value)

    def _named(self, kind: str, name: str, known: Mapping[str, Any]) -> Any:
        require_known(f"{kind} of the family {self.name}", known, name)
        return known[name]

    def body_at(self, values: Mapping[str, float], parts: Mapping[str, str] | None = None) -> Body:
        """Return the body with some values of the family's axes; the other axes are unedited.

        `parts` names the part at each place where it replaces the model's own part.
        """
        edits: list[Edit] = []
        for place, part in (parts or {}).items():
            edits += self._named(f"part of {place}", part, self._named("place", place, self.parts))
        axes = {axis.name: axis for axis in self.axes}
        for name, value in values.items():
            axis: Axis = self._named("axis", name, axes)
            if not axis.lowest <= value <= axis.highest:  # Also refuses NaN.
                raise MorphologyError(
                    f"{name} of the family {self.name} lies between {axis.lowest:g} and "
                    f"{axis.highest:g} [{axis.unit}], got {value:g}."
                )
            edits.append(axis.edit(value))
        return tuple(edits)

    def sample(self, n: int, seed: int = 0, split: Split = "train") -> list[Body]:
        """Draw bodies; a larger `n` adds bodies after the same first ones.

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
        require_known("split", get_args(Split), split)
        if not self.axes or (split == "composition" and len(self.parts) < 2):
            missing = "parts at two places" if self.axes else "axes"
            raise MorphologyError(f"The family {self.name} declares no {missing} to draw from.")
        rng = np.random.default_rng([seed, get_args(Split).index(split)])
        return [self._draw(rng, split) for _ in range(n)]

    def _draw(self, rng: np.random.Generator, split: Split) -> Body:
        places: list[str] = list(self.parts)
        if split == "composition":
            count = int(rng.integers(2, len(places) + 1))
        else:
            count = int(rng.uniform() < _WITH_PART) if places else 0
        numbers: list[int] = rng.permutation(len(places))[:count].tolist()
        chosen = [places[i] for i in sorted(numbers)]
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
    """Return an axis for the length of each of these bodies, as a factor of the model's length.

    The whole range begins 0.3 below the training range, and ends 0.4 above it.
    """
    return tuple(
        Axis(f"length of {body}", partial(Stretch, body), low, high, low - 0.3, high + 0.4)
        for body in bodies
    )


def strength_axes(trunk: str) -> tuple[Axis, ...]:
    """Return axes for the mass of the trunk, a body, the strength of motors and the friction."""
    return (
        Axis(f"mass of {trunk}", partial(Mass, trunk), 0.7, 1.5, 0.5, 2.5),
        Axis("strength of the motors", partial(Gear, "*"), 0.8, 1.25, 0.6, 1.6),
        Axis("friction", partial(Friction, "*"), 0.7, 1.4, 0.45, 2.0),
    )
