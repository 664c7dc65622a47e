"""Base class of edits: frozen values that can be printed, compared and converted to JSON.

Every edit has an `amount`, the share of the change that is made. It is 1 except between two
bodies, where it makes the path continuous (see `shapechanger.morphology.body.interpolate`).
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any, ClassVar, Final, TypeVar, cast

import msgspec
import mujoco
import numpy as np
from msgspec.structs import force_setattr

from shapechanger.errors import MorphologyError

if TYPE_CHECKING:
    from shapechanger.morphology.spec.carried import Keyframes

Vector = tuple[float, float, float]
_N = TypeVar("_N", float, np.ndarray)

EDITS: Final[dict[str, type[Edit]]] = {}
"""The kinds of edits by their names in JSON; a subclass of `Edit` with an `apply` enters itself."""

# Of modules whose kinds of edits cannot be replaced.
_SHIPPED: Final = "shapechanger."
# A limb a hundred times longer or shorter is a typing mistake, and the softness of MuJoCo's
# contacts, which is absolute, does not fit it.
_SMALLEST_FACTOR: Final = 0.01
_LARGEST_FACTOR: Final = 100.0


def _tag(class_name: str) -> str:
    """Return the tag of an edit in JSON: `add_segment` for `AddSegment`."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", class_name).lower()


class Edit(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    omit_defaults=True,
    repr_omit_defaults=True,
    forbid_unknown_fields=True,
    tag_field="edit",
    tag=_tag,
):
    """One change to a model.

    A subclass with an `apply` is known to JSON by the snake case of its name, as worker processes
    and files need, once its module is imported.

    Attributes:
        amount: Share of the change that is made, 0 (none) to 1 (all).
        needs: Flag of the model that disables what the edit changes, and the word for it.

    Raises:
        MorphologyError: If the amount, or a number of the edit, is out of its range; of a subclass,
            if another one has its name.
    """

    needs: ClassVar[tuple[mujoco.mjtDisableBit, str] | None] = None
    amount: float = 1.0

    def __init_subclass__(cls, **settings: Any) -> None:
        super().__init_subclass__(**settings)
        if "apply" not in vars(cls):
            return  # A base of several kinds.
        tag = _tag(cls.__name__)
        known = EDITS.get(tag, cls)
        # A module that is imported again, perhaps under another name, defines its classes again.
        ours = known.__module__.startswith(_SHIPPED) and known.__module__ != cls.__module__
        if ours or known.__qualname__ != cls.__qualname__:
            raise MorphologyError(
                f"There is an edit {tag!r} already: give {cls.__name__} a new name."
            )
        EDITS[tag] = cls

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            value: Any = getattr(self, name)
            if isinstance(value, np.generic | np.ndarray):
                force_setattr(self, name, _as_python(value))
        try:
            if not 0.0 <= self.amount <= 1.0:  # Also refuses NaN.
                raise MorphologyError(f"amount must be between 0 and 1, got {self.amount}.")
            self.check()
        except TypeError as error:
            raise MorphologyError(f"A value has the wrong type in {self}.") from error

    def check(self) -> None:
        """Refuse numbers out of range; subclasses override it."""

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change `spec` in place.

        Raises:
            UnknownName: If the edit names an element that the model lacks.
            MorphologyError: If the element cannot be changed this way.
        """
        raise NotImplementedError

    def follow_in_keyframes(self, spec: mujoco.MjSpec, keyframes: Keyframes) -> None:
        """Make the change in the keyframes too, after `apply`; most edits change none.

        Args:
            spec: The changed specification; its keyframes are elsewhere meanwhile.
            keyframes: Its keyframes.
        """

    def require_effect(self, spec: mujoco.MjSpec) -> None:
        """Refuse an edit of something that the model's options switch off.

        Args:
            spec: The specification.

        Raises:
            MorphologyError: If the edit would change nothing.
        """
        if self.needs is not None and spec.option.disableflags & int(self.needs[0]):
            raise MorphologyError(
                f"{type(self).__name__} would change nothing, because the model switches "
                f"{self.needs[1]} off: change its <flag> first."
            )

    def partly(self, alpha: float) -> Edit:
        """Return the edit with its amount scaled by `alpha`, 0 to 1."""
        return msgspec.structs.replace(self, amount=self.amount * alpha)


def _as_python(value: Any) -> Any:
    """Return a NumPy scalar as a Python number, and an array as a tuple of them."""
    plain = value.tolist()
    return tuple(cast("list[Any]", plain)) if isinstance(plain, list) else plain


def part_of_the_way(old: _N, new: _N, amount: float) -> _N:
    """Interpolate between two values or vectors; exactly `new` at an `amount` of 1."""
    return new if amount == 1.0 else old + amount * (new - old)


def require_factor(name: str, value: float) -> None:
    """Refuse a ratio that is zero, negative, NaN or out of range.

    Args:
        name: Name of the ratio, for the message.
        value: The ratio.

    Raises:
        MorphologyError: Unless `value` lies between 0.01 and 100.
    """
    if not _SMALLEST_FACTOR <= value <= _LARGEST_FACTOR:  # Also refuses NaN.
        raise MorphologyError(
            f"{name} must be a ratio between {_SMALLEST_FACTOR:g} and {_LARGEST_FACTOR:g}, "
            f"got {value}."
        )


def require_vector(name: str, value: Vector, *, nonzero: bool = True) -> None:
    """Refuse anything but three finite numbers.

    Args:
        name: Name of the vector, for the message.
        value: The vector.
        nonzero: Whether to refuse a vector of zeros, which has no direction.

    Raises:
        MorphologyError: If `value` is anything else.
    """
    given: Any = value  # Not checked at run time.
    if not isinstance(given, tuple) or len(value) != 3 or not all(map(math.isfinite, value)):
        raise MorphologyError(f"{name} must be a tuple of three finite numbers, got {value}.")
    if nonzero and not any(value):
        raise MorphologyError(f"{name} must not be zero.")
