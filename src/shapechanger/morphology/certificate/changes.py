"""The differences between two models, each in numbers and in a sentence, and their fingerprints."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable
from typing import Final

import msgspec
import mujoco
import numpy as np

from shapechanger.morphology.certificate.numbers import (
    KINDS,
    MOVED,
    Field,
    Numbers,
    Values,
    moved_numbers,
    names_of,
    sensed_values,
)

_Elements = dict[str, dict[str, Values]]
_Row = tuple[str, str, float | None, float | None, str]  # The fields of a `Change` of one number.
ROUNDING: Final = 1e-9
"""Tolerance of equal numbers, relative to the largest of the compared ones. A total mass that is
written out, another order of a sum and another processor change the last bits, and constants that
MuJoCo derives are less exact."""
_NOISE: Final = 1e-14
"""Tolerance relative to the largest number of a field in the whole model: a computed zero, such as
after turning a frame, is not exactly zero."""
_ROUNDED_TO: Final = 10  # Digits of the largest number; the error is at most half `ROUNDING`.
# 64 bits: the chance that two of a million different models collide is 1 in 37 million.
_HEX_DIGITS: Final = 16

# Title of each kind of element, and the quantity shown for an element that only one model has.
_TITLES: Final = {section: title for section, (title, _, _) in KINDS.items()} | {
    "contacts": "contact",
    "whole": "array",
}
_DESCRIBED_BY: Final = {"bodies": "mass", "actuators": "target", "contacts": "contact dimension"}
_ROUND: Final = (int(mujoco.mjtGeom.mjGEOM_CAPSULE), int(mujoco.mjtGeom.mjGEOM_CYLINDER))


class Change(msgspec.Struct, frozen=True):
    """One difference between the target and the source.

    Attributes:
        quantity: Name of the quantity, such as "mass", "length", "contact friction" or "gear"; the
            kind of element, such as "body", if only one of the two has the element.
        element: Name of the element that changes; several names, with commas, for a group.
        before: Numbers or words in the source; None if it has none.
        after: Numbers or words in the target; None if it has none.
        unit: Unit of both; "1" for a dimensionless number, empty for words and for mixed units.
    """

    quantity: str
    element: str
    before: Values | None
    after: Values | None
    unit: str = ""

    @property
    def sentence(self) -> str:
        """The change in words."""
        return f"{self.element}: {self.difference}"

    @property
    def difference(self) -> str:
        """The change in words, without the element."""
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        if self.quantity in _TITLES.values():
            there, done = (self.before, "removed") if self.after is None else (self.after, "added")
            return f"{self.quantity} {done} ({_shown(there, '.4g', unit)})"
        for digits in (".4g", ""):  # Show all digits if four do not distinguish the numbers.
            old, new = (_shown(values, digits, unit) for values in (self.before, self.after))
            if old != new:
                break
        return f"{self.quantity} {old} -> {new}{_times(self.before or (), self.after or ())}"


def grouped(changes: Iterable[Change]) -> list[str]:
    """Return a sentence for each change, one for several elements that change in the same way."""
    groups: dict[str, list[str]] = {}
    for item in changes:
        groups.setdefault(item.difference, []).append(item.element)
    return [f"{', '.join(elements)}: {text}" for text, elements in groups.items()]


def _shown(values: Values | None, digits: str, unit: str) -> str:
    if not values:
        return "none"
    texts = [value if isinstance(value, str) else f"{value:{digits}}" for value in values]
    if len(texts) == 1:
        return texts[0] + unit
    return (f"{texts[0]} each" if len(set(texts)) == 1 else f"({', '.join(texts)})") + unit


def _times(before: Values, after: Values) -> str:
    """Format the ratio of new to old, if all numbers that are not zero have the same ratio."""
    if len(before) != len(after) or len(_finite((*before, *after))) != 2 * len(before):
        return ""
    old, new = np.array(before), np.array(after)
    used = old != 0.0
    ratios = new[used] / old[used]
    # Three digits are shown, so ratios that agree to four are one ratio.
    same = ratios.size and np.allclose(ratios, ratios[0], rtol=1e-4, atol=0.0)
    if not same or np.any(used != (new != 0.0)) or f"{ratios[0]:.3g}" == "1":
        return ""
    return f" (x{ratios[0]:.3g})"


def compare(
    source: mujoco.MjModel,
    target: mujoco.MjModel,
    *,
    standing_height: tuple[float | None, float | None] = (None, None),
) -> tuple[Change, ...]:
    """Return the differences between two models that affect their motion.

    Args:
        source: The model that a policy is trained on.
        target: The model that it is transferred to.
        standing_height: Heights at which the source and the target stand, m; None if unknown.

    Returns:
        The changes: standing height, number of bodies, total mass and lengths, then each element.
            Empty for models whose elements have the same names and numbers.
    """
    robot: list[_Row] = [("standing height", "robot", *standing_height, "m")]
    one, two = moved_numbers(source), moved_numbers(target)
    found, measured = list[Change](), set[str]()
    for section in MOVED:
        found += _differences(section, one[section], two[section])
    derived = [
        Change("derived constant", name, fields["values"], two["derived"][name]["values"])
        for name, fields in one["derived"].items()
        if not _equal(fields["values"], two["derived"][name]["values"])
    ]
    if found or derived:
        # `fsum` is exact; in a plain sum, the order of the bodies may change the last digit.
        old, new = (math.fsum(m.body_mass[m.body_treeid >= 0].tolist()) for m in (source, target))
        robot.append(("dimensions", "nbody", float(source.nbody), float(target.nbody), "1"))
        robot.append(("total mass", "robot", old, new, "kg"))
        lengths, measured = _lengths(source, target, one, two)
        robot += lengths
    changes = [
        Change(quantity, element, (old,), (new,), unit)
        for quantity, element, old, new, unit in robot
        if old is not None and new is not None and not _equal((old,), (new,))
    ]
    changes += [each for each in found if each.quantity != "size" or each.element not in measured]
    # Constants that MuJoCo derives count only if all other numbers are equal.
    return tuple(changes or derived)


def _lengths(
    source: mujoco.MjModel, target: mujoco.MjModel, one: Numbers, two: Numbers
) -> tuple[list[_Row], set[str]]:
    """Return lengths, without caps, and radii of round geoms in both models, and the geoms' names.

    A geom that touches no other is reported only if its body differs. The only geom of a body is
    reported under the body's name.
    """
    found, measured = list[_Row](), set[str]()
    names, targets = names_of(source), names_of(target)["geoms"]
    for i, geom in enumerate(names["geoms"]):
        j = targets.index(geom) if geom in targets else -1
        if j < 0 or not source.geom_type[i] == target.geom_type[j] in _ROUND:
            continue
        measured.add(geom)
        owner = int(source.geom_bodyid[i])
        body = names["bodies"][owner]
        touches = geom in one["geoms"] and geom in two["geoms"]
        if touches or one["bodies"].get(body) != two["bodies"].get(body):
            label = body if source.body_geomnum[owner] == 1 else geom
            old, new = source.geom_size[i].tolist(), target.geom_size[j].tolist()
            found.append(("length", label, 2.0 * old[1], 2.0 * new[1], "m"))
            found.append(("radius", label, old[0], new[0], "m"))
    return found, measured


def _differences(section: str, before: _Elements, after: _Elements) -> list[Change]:
    found, scales = list[Change](), _scales(before, after)
    for element in dict.fromkeys((*before, *after)):
        old, new = before.get(element), after.get(element)
        if old is None or new is None:
            quantity = _DESCRIBED_BY.get(section, "type")
            there = (old or new or {}).get(quantity, ("there",))
            ends = (None, there) if old is None else (there, None)
            unit = "kg" if quantity == "mass" else ""
            found.append(Change(_TITLES[section], element, *ends, unit))
            continue
        for quantity in dict.fromkeys((*old, *new)):
            if not _equal(old.get(quantity), new.get(quantity), scales[quantity]):
                field = MOVED[section].get(quantity, Field(""))
                found.append(_difference(quantity, field, element, old, new))
    old_order = tuple(name for name in before if name in after)
    new_order = tuple(name for name in after if name in before)
    if old_order != new_order:
        found.append(Change("order", section, old_order, new_order))
    return found


def _difference(
    quantity: str, field: Field, element: str, before: dict[str, Values], after: dict[str, Values]
) -> Change:
    old, new, unit = before.get(quantity), after.get(quantity), field.unit
    if field.padded and old is not None and new is not None:
        used = [i for values in (old, new) for i, value in enumerate(values) if value != 0.0]
        old, new = (values[: max(used, default=0) + 1] for values in (old, new))
    if isinstance(unit, tuple):
        unit = {"slide": unit[0], "free": ""}.get(str(before["type"][0]), unit[1])
    if unit == "deg":
        old, new = (v and tuple(math.degrees(float(each)) for each in v) for v in (old, new))
    return Change(quantity, element, old, new, unit)


def _scales(*sections: _Elements) -> dict[str, float]:
    """Return the largest finite number of each field over the elements of some sections."""
    found: dict[str, float] = {}
    for fields in (fields for section in sections for fields in section.values()):
        for quantity, values in fields.items():
            found[quantity] = max(found.get(quantity, 0.0), _largest(values))
    return found


def _finite(values: Iterable[float | str]) -> list[float]:
    return [float(x) for x in values if not isinstance(x, str) and math.isfinite(x)]


def _largest(values: Iterable[float | str]) -> float:
    """Return the largest magnitude of the finite numbers; 0 without any."""
    return max(map(abs, _finite(values)), default=0.0)


def _equal(before: Values | None, after: Values | None, scale: float = 0.0) -> bool:
    """Return whether values agree up to rounding; `scale` is the largest of their field."""
    if before == after or before is None or after is None or len(before) != len(after):
        return before == after
    if any(isinstance(value, str) for value in (*before, *after)):
        return False
    limit = max(ROUNDING * _largest((*before, *after)), _NOISE * scale)
    old, new = np.array(before), np.array(after)
    return np.allclose(old, new, rtol=0.0, atol=limit, equal_nan=True)


def fingerprint(model: mujoco.MjModel) -> str:
    """Return the first 16 hex digits of the SHA-256 of all that decides a model's motion.

    Numbers are rounded, so it is the same in every process and on every machine, although compilers
    and processors round differently. Colours, cameras, lights and other data without an effect on
    the motion do not change it.
    """
    rounded: list[object] = []
    for section, elements in moved_numbers(model).items():
        scales = _scales(elements)
        for element, fields in elements.items():
            row = {name: _rounded(values, scales[name]) for name, values in fields.items()}
            rounded.append((section, element, row))
    return _digest_of(rounded)


def fingerprints(model: mujoco.MjModel, *, drawn: bool) -> tuple[str, str]:
    """Return the fingerprint of a model's motion, and one of all other data that envs may read.

    The second includes cameras, lights and colours if `drawn`.
    """
    sensed = [_rounded(values, 0.0) for values in sensed_values(model, drawn=drawn)]
    return fingerprint(model), _digest_of(sensed)


def _digest_of(values: object) -> str:
    return hashlib.sha256(msgspec.msgpack.encode(values)).hexdigest()[:_HEX_DIGITS]


def _rounded(values: Values, scale: float) -> Values:
    """Round numbers to the digits that all machines share; `scale` is their field's largest."""
    # Slightly more, so that a number just below a power of ten counts as that power.
    largest = max(_largest(values), _NOISE / 10.0 ** (1 - _ROUNDED_TO) * scale) * (1.0 + ROUNDING)
    places = _ROUNDED_TO - 1 - math.floor(math.log10(largest)) if largest > 0.0 else 0
    return tuple(
        round(x, places) + 0.0 if not isinstance(x, str) and math.isfinite(x) else x for x in values
    )
