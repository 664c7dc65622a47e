"""The differences between two models, each in numbers and in a sentence, and their fingerprints."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from typing import Final

import msgspec
import mujoco

from shapechanger.morphology.certificate.fields import KINDS, MOVED, SENSED, Field, Numbers, Values
from shapechanger.morphology.certificate.numbers import moved_numbers, names_of, sensed_numbers

Amount = float | str | tuple[float | str, ...] | None
"""A number, a word, some of them, or None for what is not there."""

ROUNDING: Final = 1e-9
"""Part of a field's largest number up to which two numbers are equal. Writing out a total mass,
another order of a sum and another processor change the last bits, and constants that MuJoCo derives
lose more."""
_NOISE: Final = 1e-14
"""The same, as a part of the largest number of this field in the whole model: a zero that was
computed, as by turning a frame, is not zero."""
_ROUNDED_TO: Final = 10  # Digits of the largest number of a field: a half of `ROUNDING` at most.
# 64 bits: the chance that two of a million different models collide is 1 in 37 million.
_HEX_DIGITS: Final = 16

_TITLES: Final = frozenset(kind.title for kind in KINDS.values())
# Quantities whose ratios mean nothing.
_WITHOUT_RATIO: Final = frozenset(("orientation", "inertia axes", "axis", "dimensions"))
_DIGITS: Final = (4, 8, 17)
_ROUND: Final = (int(mujoco.mjtGeom.mjGEOM_CAPSULE), int(mujoco.mjtGeom.mjGEOM_CYLINDER))


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
    """Describe a change of a quantity of an element, which has it before, after, or both."""
    old, new = _plain(before), _plain(after)
    suffix = f" {unit}" if unit not in ("", "1") else ""
    if quantity in _TITLES:
        there, done = (old, "removed") if new is None else (new, "added")
        words = f"{done} ({_shown(there, _DIGITS[0])}{suffix})"
    else:
        pairs = [(_shown(old, digits), _shown(new, digits)) for digits in _DIGITS]
        # As many digits as it takes to tell the two apart.
        texts = next((pair for pair in pairs if pair[0] != pair[1]), pairs[-1])
        words = " -> ".join(text if text == "none" else f"{text}{suffix}" for text in texts)
        words += "" if quantity in _WITHOUT_RATIO else _times(old, new)
    return Change(quantity, element, old, new, unit, f"{element}: {quantity} {words}")


def grouped(changes: Iterable[Change]) -> tuple[Change, ...]:
    """Merge changes that are the same for several elements."""
    groups: dict[tuple[str, str], list[Change]] = {}
    for item in changes:
        text = item.sentence.removeprefix(f"{item.element}: ")
        groups.setdefault((item.quantity, text), []).append(item)
    merged: list[Change] = []
    for (_, text), members in groups.items():
        name = ", ".join(member.element for member in members)
        merged.append(msgspec.structs.replace(members[0], element=name, sentence=f"{name}: {text}"))
    return tuple(merged)


def _plain(values: Sequence[float | str] | None) -> Amount:
    """Convert values for JSON: a single value stays scalar, infinite numbers become strings."""
    if values is None:
        return None
    finite = tuple(
        value if isinstance(value, str) or math.isfinite(value) else str(value) for value in values
    )
    return finite[0] if len(finite) == 1 else finite


def _shown(amount: Amount, digits: int) -> str:
    """Format an amount with so many significant digits; equal numbers of a list are shown once."""
    if isinstance(amount, tuple):
        texts = [_shown(value, digits) for value in amount] or ["none"]
        if len(texts) == 1:
            return texts[0]
        return f"{texts[0]} each" if len(set(texts)) == 1 else f"({', '.join(texts)})"
    if amount is None:
        return "none"
    return amount if isinstance(amount, str) else f"{amount:.{digits}g}"


def _times(before: Amount, after: Amount) -> str:
    """Format new over old, if it is the same for all numbers that are not zero in both."""
    old, new = (each if isinstance(each, tuple) else (each,) for each in (before, after))
    ratios: list[float] = []
    for a, b in zip(old, new, strict=False):
        if not isinstance(a, float) or not isinstance(b, float) or (a == 0.0) != (b == 0.0):
            return ""
        if a != 0.0:
            ratios.append(b / a)
    # Three digits are shown, so ratios that agree to four are one ratio.
    same = ratios and all(math.isclose(ratio, ratios[0], rel_tol=1e-4) for ratio in ratios)
    if len(old) != len(new) or not same or f"{ratios[0]:.3g}" == "1":
        return ""
    return f" (x{ratios[0]:.3g})"


def compare(
    source: mujoco.MjModel,
    target: mujoco.MjModel,
    *,
    standing_height: tuple[float | None, float | None] = (None, None),
) -> tuple[Change, ...]:
    """Return the differences between two models that decide their motion.

    Args:
        source: The model that a policy is trained on.
        target: The model that it is transferred to.
        standing_height: Height at which the source and the target stand, m, if known.

    Returns:
        The changes: standing height, dimensions and total mass first, then element by element.
        Empty for models whose elements have the same names and numbers.
    """
    changes: list[Change] = []
    before, after = standing_height
    if before is not None and after is not None and not _equal((before,), (after,)):
        changes.append(change("standing height", "robot", (before,), (after,), "m"))
    one, two = moved_numbers(source), moved_numbers(target)
    found = differences(one, two)
    if not found:
        return tuple(changes)
    if source.nbody != target.nbody:
        old, new = float(source.nbody), float(target.nbody)
        changes.append(change("dimensions", "nbody", (old,), (new,), "1"))
    old, new = (math.fsum(m.body_mass[m.body_treeid >= 0].tolist()) for m in (source, target))
    # The order of the bodies may change the last digit of the sum.
    if not math.isclose(old, new, rel_tol=ROUNDING):
        changes.append(change("total mass", "robot", (old,), (new,), "kg"))
    lengths, measured = _lengths(source, target, one, two)
    changes += lengths
    if found[0].quantity == "derived constant" and changes:
        return tuple(changes)
    found = (item for item in found if item.quantity != "size" or item.element not in measured)
    return (*changes, *found)


def _lengths(
    source: mujoco.MjModel, target: mujoco.MjModel, one: Numbers, two: Numbers
) -> tuple[list[Change], set[str]]:
    """Return changes of the lengths, without caps, and radii of round geoms, and their names.

    A geom that touches nothing is reported only if its body differs; one that is the only one of
    its body is called by the name of the body.
    """
    found, measured = list[Change](), set[str]()
    names, targets = names_of(source), names_of(target)["geoms"]
    for i, geom in enumerate(names["geoms"]):
        kind, owner = source.geom_type[i], int(source.geom_bodyid[i])
        j = targets.index(geom) if kind in _ROUND and geom in targets else -1
        if j < 0 or target.geom_type[j] != kind:
            continue
        measured.add(geom)
        body = names["bodies"][owner]
        touches = geom in one["geoms"] and geom in two["geoms"]
        if not touches and one["bodies"].get(body) == two["bodies"].get(body):
            continue
        label = body if source.body_geomnum[owner] == 1 else geom
        old, new = source.geom_size[i].tolist(), target.geom_size[j].tolist()
        for quantity, a, b in (("length", 2.0 * old[1], 2.0 * new[1]), ("radius", old[0], new[0])):
            if not _equal((a,), (b,)):
                found.append(change(quantity, label, (a,), (b,), "m"))
    return found, measured


def differences(one: Numbers, two: Numbers) -> tuple[Change, ...]:
    """Return the differences of the numbers of two models, element by element.

    Constants that MuJoCo derives count if nothing else differs.
    """
    found: list[Change] = []
    for section in one:
        if section != "derived":
            found += _section(section, one[section], two[section])
    if not found and "derived" in one:
        for name, fields in one["derived"].items():
            old, new = fields["values"], two["derived"][name]["values"]
            if not _equal(old, new):
                found.append(change("derived constant", name, old, new))
    return tuple(found)


def _section(
    section: str, before: dict[str, dict[str, Values]], after: dict[str, dict[str, Values]]
) -> list[Change]:
    """Return the differences within one section."""
    found: list[Change] = []
    kind, fields, scales = KINDS[section], (MOVED | SENSED)[section], _scales(before, after)
    for element in dict.fromkeys((*before, *after)):
        old, new = before.get(element), after.get(element)
        if old is None or new is None:
            described = fields.get(kind.described_by)
            there, then = (
                None if values is None else values.get(kind.described_by, ("there",))
                for values in (old, new)
            )
            unit = described.unit if described and isinstance(described.unit, str) else ""
            found.append(change(kind.title, element, there, then, unit))
            continue
        for quantity in dict.fromkeys((*old, *new)):
            if not _equal(old.get(quantity), new.get(quantity), scales[quantity]):
                field = fields.get(quantity, Field(""))
                found.append(_difference(quantity, field, element, old, new))
    old_order = [name for name in before if name in after]
    new_order = [name for name in after if name in before]
    if old_order != new_order:
        found.append(change("order", section, old_order, new_order))
    return found


def _difference(
    quantity: str, field: Field, element: str, before: dict[str, Values], after: dict[str, Values]
) -> Change:
    """Describe a quantity that differs, in its usual unit."""
    old, new, unit = before.get(quantity), after.get(quantity), field.unit
    if field.padded and old is not None and new is not None:
        used = [i for values in (old, new) for i, value in enumerate(values) if value != 0.0]
        count = max(used, default=0) + 1
        old, new = old[:count], new[:count]
    if isinstance(unit, tuple):
        kinds = {"slide": unit[0], "hinge": unit[1], "ball": unit[1]}
        unit = kinds.get(str(before["type"][0]), "")
    if unit == "deg":
        old, new = (
            None if values is None else tuple(math.degrees(float(value)) for value in values)
            for values in (old, new)
        )
    return change(quantity, element, old, new, unit)


def _scales(*sections: dict[str, dict[str, Values]]) -> dict[str, float]:
    """Return the largest finite number of each field over the elements of some sections."""
    found: dict[str, float] = {}
    for section in sections:
        for fields in section.values():
            for quantity, values in fields.items():
                found[quantity] = max(found.get(quantity, 0.0), _largest(values))
    return found


def _largest(values: Iterable[float | str]) -> float:
    """Return the largest magnitude of the finite numbers; 0 without any."""
    numbers = [abs(v) for v in values if not isinstance(v, str) and math.isfinite(v)]
    return max(numbers, default=0.0)


def _equal(before: Values | None, after: Values | None, scale: float = 0.0) -> bool:
    """Return whether values agree up to rounding; `scale` is the largest of their field."""
    if before == after or before is None or after is None or len(before) != len(after):
        return before == after
    limit = max(ROUNDING * _largest((*before, *after)), _NOISE * scale)
    for old, new in zip(before, after, strict=True):
        if isinstance(old, str) or isinstance(new, str):
            near = old == new
        else:
            near = old == new or abs(old - new) <= limit or (math.isnan(old) and math.isnan(new))
        if not near:
            return False
    return True


def fingerprint(model: mujoco.MjModel) -> str:
    """Return the first 16 hex digits of the SHA-256 of all that decides a model's motion.

    It is the same in every process and on every machine, whose compilers and processors may round
    differently: numbers count up to rounding. It does not change with colours, cameras, lights, or
    anything else without effect.
    """
    return _digest_of(moved_numbers(model))


def _digest_of(numbers: Numbers) -> str:
    """Return the first 16 hex digits of the SHA-256 of numbers, which are rounded."""
    rounded: list[object] = []
    for section, elements in numbers.items():
        scales = _scales(elements)
        for element, fields in elements.items():
            row = {name: _rounded(values, scales[name]) for name, values in fields.items()}
            rounded.append((section, element, row))
    return hashlib.sha256(msgspec.msgpack.encode(rounded)).hexdigest()[:_HEX_DIGITS]


def _rounded(values: Values, scale: float) -> Values:
    """Round numbers, of a field up to `scale`, to as many digits as all machines agree on."""
    # Slightly more, so that a number just below a power of ten counts as that power.
    largest = max(_largest(values), _NOISE / 10.0 ** (1 - _ROUNDED_TO) * scale) * (1.0 + ROUNDING)
    places = _ROUNDED_TO - 1 - math.floor(math.log10(largest)) if largest > 0.0 else 0
    return tuple(
        value if isinstance(value, str) or not math.isfinite(value) else round(value, places) + 0.0
        for value in values
    )


class ModelNumbers:
    """Fingerprints and differences of MuJoCo models, for `shapechanger.identity`."""

    @staticmethod
    def read(model: mujoco.MjModel, *, drawn: bool) -> tuple[str, str, bytes]:
        """Return the fingerprints of the motion and of other numbers, and all as MessagePack."""
        moved, sensed = moved_numbers(model), sensed_numbers(model, drawn=drawn)
        return _digest_of(moved), _digest_of(sensed), msgspec.msgpack.encode([moved, sensed])

    @staticmethod
    def changes(old: bytes, new: bytes) -> tuple[str, ...]:
        """Return the differences in words between the numbers of two models.

        Raises:
            msgspec.MsgspecError: If they are not such numbers.
        """
        (moved, sensed), (new_moved, new_sensed) = (
            msgspec.msgpack.decode(each, type=tuple[Numbers, Numbers]) for each in (old, new)
        )
        # A geom that moves differently also lies differently.
        found = differences(moved, new_moved) or differences(sensed, new_sensed)
        return tuple(item.sentence for item in grouped(found))
