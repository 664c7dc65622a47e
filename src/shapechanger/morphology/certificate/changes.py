"""The differences between two models, each in numbers and in a sentence."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import msgspec
import mujoco

from shapechanger.morphology.effective.elements import (
    ROUNDING,
    margin,
    names_of,
    scales,
    words,
)
from shapechanger.morphology.effective.model import EffectiveModel, effective_model

if TYPE_CHECKING:
    from shapechanger.morphology.effective.elements import Value

Amount = float | str | tuple[float | str, ...] | None
"""A number, a word, some of them, or None for what is not there."""

# A change of one of these is of the element as a whole, which only one model has.
_ONE_OF: Final = {
    "bodies": "body",
    "joints": "joint",
    "geoms": "geom",
    "sites": "site",
    "contacts": "contact",
    "actuators": "actuator",
    "tendons": "tendon",
    "equalities": "equality constraint",
    "flexes": "flex",
    "plugins": "plugin",
    # Of what decides no motion.
    "places": "geom",
    "marks": "site",
    "sensors": "sensor",
    "keyframes": "keyframe",
    "custom": "custom number",
    "cameras": "camera",
    "drawing": "drawing",
}
# Quantities whose ratios mean nothing.
_WITHOUT_RATIO: Final = frozenset(("orientation", "inertia axes", "axis", "dimensions"))
_DIGITS: Final = (4, 8, 17)


class Change(msgspec.Struct, frozen=True):
    """One difference between the target and the source.

    Attributes:
        quantity: Name of the quantity, such as "mass", "length", "contact friction" or "gear"; the
            kind of element, such as "body", if only one of the two has the element.
        element: Name of the element that it belongs to; names, with commas, in a group.
        before: Value in the source; None if it has none.
        after: Value in the target; None if it has none.
        unit: Unit of both; "1" for a dimensionless number, empty for words and for mixed units.
        sentence: The change in words.
    """

    quantity: str
    element: str
    before: Amount
    after: Amount
    unit: str
    sentence: str


def change(
    quantity: str,
    element: str,
    before: Sequence[float | str] | None,
    after: Sequence[float | str] | None,
    unit: str = "",
) -> Change:
    """Describe a change in a sentence.

    Args:
        quantity: What changes, such as "length".
        element: Its element, such as "shank_4"; "" for the whole model.
        before: Values before; None if the element was missing.
        after: Values after; None if the element is missing.
        unit: Unit of the values; "" for none.
    """
    old, new = _plain(before), _plain(after)
    return Change(
        quantity, element, old, new, unit, f"{element}: {_words(quantity, old, new, unit)}"
    )


def grouped(changes: Iterable[Change]) -> tuple[Change, ...]:
    """Merge changes that are the same for several elements."""
    groups: dict[tuple[str, str], list[Change]] = {}
    for item in changes:
        text = item.sentence.removeprefix(f"{item.element}: ")
        groups.setdefault((item.quantity, text), []).append(item)
    merged: list[Change] = []
    for (_, text), members in groups.items():
        names = ", ".join(member.element for member in members)
        merged.append(
            msgspec.structs.replace(members[0], element=names, sentence=f"{names}: {text}")
        )
    return tuple(merged)


def _plain(values: Sequence[float | str] | None) -> Amount:
    """Convert values for JSON: a single value stays scalar, infinite numbers become strings."""
    if values is None:
        return None
    finite = tuple(
        value if isinstance(value, str) or math.isfinite(value) else str(value) for value in values
    )
    return finite[0] if len(finite) == 1 else finite


def _words(quantity: str, before: Amount, after: Amount, unit: str) -> str:
    """Format the part of a sentence after the name of the element."""
    suffix = f" {unit}" if unit not in ("", "1") else ""
    if quantity in _ONE_OF.values():
        there = before if after is None else after
        return (
            f"{quantity} {'removed' if after is None else 'added'} "
            f"({_shown(there, _DIGITS[0])}{suffix})"
        )
    old, new = "", ""
    for digits in _DIGITS:  # As many digits as it takes to tell the two apart.
        old, new = _shown(before, digits), _shown(after, digits)
        if old != new:
            break
    old, new = (text if text == "none" else f"{text}{suffix}" for text in (old, new))
    ratio = None if quantity in _WITHOUT_RATIO else _ratio(before, after)
    times = "" if ratio is None else f" (x{ratio:.3g})"
    return f"{quantity} {old} -> {new}{'' if times == ' (x1)' else times}"


def _shown(amount: Amount, digits: int) -> str:
    """Format an amount with so many significant digits; equal numbers of a list are shown once."""
    if amount is None:
        return "none"
    if not isinstance(amount, tuple):
        return amount if isinstance(amount, str) else f"{amount:.{digits}g}"
    texts = [_shown(value, digits) for value in amount]
    if not texts:
        return "none"
    return f"{texts[0]} each" if len(set(texts)) == 1 else f"({', '.join(texts)})"


def _ratio(before: Amount, after: Amount) -> float | None:
    """Return new over old, if it is the same for all numbers that are not zero in both."""
    old = before if isinstance(before, tuple) else (before,)
    new = after if isinstance(after, tuple) else (after,)
    if len(old) != len(new):
        return None
    ratios: list[float] = []
    for a, b in zip(old, new, strict=True):
        if not isinstance(a, float) or not isinstance(b, float) or (a == 0.0) != (b == 0.0):
            return None
        if a != 0.0:
            ratios.append(b / a)
    # Three digits are shown, so ratios that agree to four are one ratio.
    same = all(math.isclose(ratio, ratios[0], rel_tol=1e-4) for ratio in ratios)
    return ratios[0] if ratios and same else None


_Fields = dict[str, tuple["Value", ...]]

# The field that describes an element that only one model has; its type otherwise.
_DESCRIBED_BY: Final = {"bodies": "mass", "contacts": "contact dimension", "actuators": "target"}
_UNITS: Final = {
    "mass": "kg",
    "inertia": "kg·m²",
    "position": "m",
    "centre of mass": "m",
    "anchor": "m",
    "size": "m",
    "gravity": "m/s²",
    "timestep": "s",
    "density": "kg/m³",
    "viscosity": "Pa·s",
    "wind": "m/s",
    "contact friction": "1",
    "contact margin": "m",
    "contact gap": "m",
    "contact adhesion": "N",
    "gear": "1",
    "crank length": "m",
    "delay": "s",
    "dimensions": "1",
}
# Units of a joint that slides and of one that turns.
_JOINT_UNITS: Final = {
    "joint range": ("m", "deg"),
    "limit margin": ("m", "rad"),
    "rest position": ("m", "rad"),
    "spring reference": ("m", "rad"),
    "stiffness": ("N/m", "N·m/rad"),
    "damping": ("N·s/m", "N·m·s/rad"),
    "armature": ("kg", "kg·m²"),
    "friction loss": ("N", "N·m"),
    "actuator force range": ("N", "N·m"),
}
_ROUND: Final = frozenset(("capsule", "cylinder"))


def compare(
    source: mujoco.MjModel,
    target: mujoco.MjModel,
    *,
    standing_height: tuple[float | None, float | None] = (None, None),
) -> tuple[Change, ...]:
    """Return the differences between the effective models of two models.

    Args:
        source: The model that a policy is trained on.
        target: The model that it is transferred to.
        standing_height: Height at which the source and the target stand, m, if known.

    Returns:
        The changes, empty for models that move equally, whatever their elements are called:
        standing height, dimensions and total mass first, then element by element.
    """
    one, two = effective_model(source), effective_model(target)
    changes: list[Change] = []
    before, after = standing_height
    if before is not None and after is not None and not _equal((before,), (after,), 0.0):
        changes.append(change("standing height", "robot", (before,), (after,), "m"))
    if _alike(one, two):
        return tuple(changes)
    if names_of(source) != names_of(target):
        unnamed = (effective_model(model, anonymous=True) for model in (source, target))
        if _alike(*unnamed):
            return tuple(changes)
    changes += _totals(source, target)
    changes += _lengths(source, target, one, two)
    return (*changes, *compare_effective(one, two, derived=not changes, sizes=False))


def compare_effective(
    one: EffectiveModel, two: EffectiveModel, *, derived: bool = True, sizes: bool = True
) -> tuple[Change, ...]:
    """Return the differences between two effective models, element by element.

    Args:
        one: The source's.
        two: The target's.
        derived: Whether derived constants count if nothing else differs.
        sizes: Whether the sizes of capsules and cylinders count, which `compare` reports as lengths
            and radii.
    """
    found: list[Change] = []
    for section, _ in one.sections:
        if section != "derived":
            found += _section(section, one, two, sizes)
    if derived and not found:
        old, new = one["derived"], two["derived"]
        found = [
            change("derived constant", name, old[name]["values"], new[name]["values"])
            for name in old
            if not _equal(old[name]["values"], new[name]["values"], 0.0)
        ]
    return tuple(found)


def differ_in_names(source: mujoco.MjModel, target: mujoco.MjModel) -> bool:
    """Return whether two models that move equally call something that decides it differently."""
    return not _alike(effective_model(source), effective_model(target))


def _alike(one: EffectiveModel, two: EffectiveModel) -> bool:
    """Return whether two effective models agree up to rounding."""
    return not compare_effective(one, two)


def _equal(before: tuple[Value, ...] | None, after: tuple[Value, ...] | None, scale: float) -> bool:
    """Return whether the values of a field agree up to rounding.

    Args:
        before: Values before.
        after: Values after.
        scale: Largest number of this field in both models; 0 if it has no other elements.
    """
    if before is None or after is None or len(before) != len(after):
        return before == after
    limit = margin((*before, *after), scale)
    return all(
        old == new
        or (
            not isinstance(old, str)
            and not isinstance(new, str)
            and (abs(old - new) <= limit or (math.isnan(old) and math.isnan(new)))
        )
        for old, new in zip(before, after, strict=True)
    )


def _totals(source: mujoco.MjModel, target: mujoco.MjModel) -> list[Change]:
    """Return the differences of the number of bodies and of the total mass."""
    found: list[Change] = []
    if source.nbody != target.nbody:
        sizes = (float(source.nbody),), (float(target.nbody),)
        found.append(change("dimensions", "nbody", *sizes, "1"))
    before, after = (
        math.fsum(model.body_mass[model.body_treeid >= 0].tolist()) for model in (source, target)
    )
    # The order of the bodies may change the last digit of the sum.
    if not math.isclose(before, after, rel_tol=ROUNDING):
        found.append(change("total mass", "robot", (before,), (after,), "kg"))
    return found


def _section(section: str, one: EffectiveModel, two: EffectiveModel, sizes: bool) -> list[Change]:
    """Return the differences within one section."""
    found: list[Change] = []
    before, after = one[section], two[section]
    scale = scales((*dict(one.sections)[section], *dict(two.sections)[section]))
    for element in dict.fromkeys((*before, *after)):
        old, new = before.get(element), after.get(element)
        if old is None or new is None:
            field = _DESCRIBED_BY.get(section, "type")
            there, then = (
                None if fields is None else fields.get(field, ("there",)) for fields in (old, new)
            )
            unit = _UNITS[field] if section == "bodies" else ""
            found.append(change(_ONE_OF[section], element, there, then, unit))
            continue
        kinds = {*old.get("type", ()), *new.get("type", ())}
        has_length = not sizes and section == "geoms" and len(kinds) == 1 and kinds <= _ROUND
        found += [
            _difference(section, element, field, old, new)
            for field in dict.fromkeys((*old, *new))
            if not _equal(old.get(field), new.get(field), scale[field])
            and not (has_length and field == "size")  # `_lengths` reports it.
        ]
    shared_before = [name for name in before if name in after]
    shared_after = [name for name in after if name in before]
    if shared_before != shared_after:
        found.append(change("order", section, shared_before, shared_after))
    return found


def _difference(section: str, element: str, field: str, before: _Fields, after: _Fields) -> Change:
    """Describe one field that differs, in its usual unit."""
    old, new = before.get(field), after.get(field)
    unit = _UNITS.get(field, "")
    if section == "joints" and field in _JOINT_UNITS:
        (kind,) = before["type"]
        sliding, turning = _JOINT_UNITS[field]
        unit = {"slide": sliding, "hinge": turning, "ball": turning}.get(str(kind), "")
        if unit == "deg":
            old, new = _in_degrees(old), _in_degrees(new)
    elif section == "tendons":
        unit = ""  # A fixed tendon adds lengths and angles as the model pleases.
    return change(field, element, old, new, unit)


def _in_degrees(angles: tuple[Value, ...] | None) -> tuple[float, ...] | None:
    """Convert angles to degrees; None stays None."""
    return None if angles is None else tuple(math.degrees(float(angle)) for angle in angles)


class _Segment(NamedTuple):
    """A capsule or cylinder; its length is without the caps.

    Attributes:
        body: Name of its body.
        label: Name of the body if the geom is the body's only one; else of the geom.
        kind: "capsule" or "cylinder".
        radius: Radius, m.
        length: Length, m.
    """

    body: str
    label: str
    kind: str
    radius: float
    length: float


def _lengths(
    source: mujoco.MjModel, target: mujoco.MjModel, one: EffectiveModel, two: EffectiveModel
) -> list[Change]:
    """Return the differences of lengths and radii of segments, m.

    A geom that touches nothing is reported only if its body differs.
    """
    old_bodies, new_bodies = one["bodies"], two["bodies"]
    touching = one["geoms"].keys() & two["geoms"].keys()
    segments = _segments(target)
    found: list[Change] = []
    for geom, before in _segments(source).items():
        after = segments.get(geom)
        if after is None or after.kind != before.kind:
            continue
        if geom not in touching and old_bodies.get(before.body) == new_bodies.get(before.body):
            continue
        for quantity in ("length", "radius"):
            old, new = getattr(before, quantity), getattr(after, quantity)
            if not _equal((old,), (new,), 0.0):
                found.append(change(quantity, before.label, (old,), (new,), "m"))
    return found


def _segments(model: mujoco.MjModel) -> dict[str, _Segment]:
    """Return the capsules and cylinders of a model by name."""
    names = names_of(model)
    found: dict[str, _Segment] = {}
    for geom, kind, owner, (radius, half_length, _) in zip(
        names.geoms,
        words(mujoco.mjtGeom, model.geom_type),
        map(int, model.geom_bodyid),
        model.geom_size.tolist(),
        strict=True,
    ):
        if kind in _ROUND:
            body = names.bodies[owner]
            label = body if model.body_geomnum[owner] == 1 else geom
            found[geom] = _Segment(body, label, kind, radius, 2.0 * half_length)
    return found
