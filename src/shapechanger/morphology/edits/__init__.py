"""The edits: one class for each change to a model, a frozen value that converts to JSON.

Every edit has an `amount`, the share of the change that is made. It is 1 except between two
bodies, where it makes the path continuous (see `shapechanger.morphology.interpolate`). Every
module of this folder is imported, so a new file with an edit needs no further registration.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
import re
from typing import Annotated, Any, ClassVar, Final, TypeVar, cast

import msgspec
import mujoco
import numpy as np
from msgspec.structs import force_setattr

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.carried import Keyframes

_N = TypeVar("_N", float, np.ndarray)

Vector = tuple[float, float, float]
# A limb more than a hundred times longer or shorter is a typing mistake, and the softness of
# MuJoCo's contacts, which is absolute, does not fit its size.
Ratio = Annotated[float, msgspec.Meta(ge=0.01, le=100.0)]
Positive = Annotated[float, msgspec.Meta(gt=0.0)]

EDITS: Final[dict[str, type[Edit]]] = {}
"""The kinds of edits, keyed by name in JSON; a subclass of `Edit` with an `apply` adds itself."""


def _tag(class_name: str) -> str:
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

    When the module of a subclass is imported, its name in snake case becomes a kind of edit in
    JSON, which files and worker processes use. A base class of several kinds must have no `apply`,
    or a name that begins with an underscore. The types of the fields, with their bounds as
    `msgspec.Meta`, are checked when an edit is made.

    Attributes:
        amount: Share of the change that is made, 0 (none) to 1 (all).
        needs: Flag of the model that disables the edited property, and a label for it.

    Raises:
        MorphologyError: If a field has the wrong type, or a number is not finite or out of its
            range; for the definition of a subclass, if another kind has its name.
    """

    needs: ClassVar[tuple[mujoco.mjtDisableBit, str] | None] = None
    amount: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 1.0

    def __init_subclass__(cls, **settings: Any) -> None:
        super().__init_subclass__(**settings)
        if cls.apply is Edit.apply or cls.__name__.startswith("_"):
            return  # A base class of several kinds of edits.
        tag = _tag(cls.__name__)
        known = EDITS.get(tag, cls)
        # A module that is imported again, perhaps under another name, defines its classes again.
        ours = known.__module__.startswith("shapechanger.") and known.__module__ != cls.__module__
        if ours or known.__qualname__ != cls.__qualname__:
            raise MorphologyError(
                f"There is an edit {tag!r} already: give {cls.__name__} a new name."
            )
        EDITS[tag] = cls

    def __post_init__(self) -> None:
        for field in msgspec.structs.fields(self):
            value: Any = getattr(self, field.name)
            if isinstance(value, np.generic | np.ndarray):
                value = cast("Any", value).tolist()
            if isinstance(value, list):
                value = tuple(cast("list[Any]", value))
            force_setattr(self, field.name, value)
            numbers = cast("tuple[Any, ...]", value) if isinstance(value, tuple) else (value,)
            try:
                msgspec.convert(value, field.type)
                if not all(math.isfinite(x) for x in numbers if isinstance(x, float)):
                    raise msgspec.ValidationError("Expected a finite number")
            except msgspec.ValidationError as error:
                place = f"{field.name} of {type(self).__name__}"
                raise MorphologyError(f"{place}: {error}, got {value!r}.") from error
        self.check()

    def check(self) -> None:
        """Refuse values that do not fit each other; subclasses override it."""

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
            spec: The changed specification, without its keyframes.
            keyframes: The keyframes.
        """

    def require_effect(self, spec: mujoco.MjSpec) -> None:
        """Refuse an edit of something that the model's options switch off.

        Raises:
            MorphologyError: If the edit would have no effect.
        """
        if self.needs is not None and spec.option.disableflags & int(self.needs[0]):
            raise MorphologyError(
                f"{type(self).__name__} would change nothing, because the model switches "
                f"{self.needs[1]} off: change its <flag> first."
            )

    def partly(self, alpha: float) -> Edit:
        """Return the edit with its amount scaled by `alpha`, 0 to 1."""
        return msgspec.structs.replace(self, amount=self.amount * alpha)


def part_of_the_way(old: _N, new: _N, amount: float) -> _N:
    """Interpolate between two values or vectors; exactly `new` at an `amount` of 1."""
    return new if amount == 1.0 else old + amount * (new - old)


# These modules subclass `Edit`, so they are imported after it is defined.
for _module in pkgutil.iter_modules(__path__, f"{__name__}."):
    importlib.import_module(_module.name)
