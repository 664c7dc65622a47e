"""A family: one model and the named bodies that edits make of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import mujoco

from shapechanger.errors import UnknownName
from shapechanger.morphology import Body, Edit, Stretch, as_body, name_elements

__all__ = [
    "DOUBLE_PENDULUM",
    "HALF_CHEETAH",
    "HOPPER",
    "HUMANOID",
    "PENDULUM",
    "SWIMMER",
    "WALKER2D",
    "BodyLike",
    "Family",
]

# What a user may give for a body: its name, its JSON, an edit or several.
BodyLike = str | Edit | Iterable[Edit]


@dataclass(frozen=True)
class Family:
    """One model, and the bodies that have a name.

    Attributes:
        name: Name of the family, which is that of its first body.
        bodies: For each named body the edits that make it from the model as it is.
        bodies_by_joint: For a joint's name that of the body it moves, where the model gives none.
    """

    name: str
    bodies: Mapping[str, Body]
    bodies_by_joint: Mapping[str, str] = field(default_factory=dict[str, str])

    def load(self, path: str | Path) -> mujoco.MjSpec:
        """The model at `path`, with a name for every element."""
        spec = mujoco.MjSpec.from_file(str(path))
        name_elements(spec, self.bodies_by_joint)
        return spec

    def body(self, value: BodyLike) -> Body:
        """The body that `value` stands for.

        Args:
            value: Name of a body of this family, edits as JSON, one edit, or several.

        Raises:
            UnknownName: If it is the name of no body.
            MorphologyError: If it is nothing that a body can be made of.
        """
        if isinstance(value, str) and not value.lstrip().startswith(("[", "{")):
            if value not in self.bodies:
                raise UnknownName(f"body of the family {self.name}", value, self.bodies)
            return self.bodies[value]
        return as_body(value)


PENDULUM: Final = Family(
    name="InvertedPendulum",
    bodies={
        "InvertedPendulum": (),
        "SmallInvertedPendulum": (Stretch("pole", 0.5, axis="z"),),
        "BigInvertedPendulum": (Stretch("pole", 2.0, axis="z"),),
    },
)


def _plain(name: str) -> Family:
    """The family whose only named body is the model as it is."""
    return Family(name, {name: ()})


HALF_CHEETAH: Final = _plain("HalfCheetah")
HOPPER: Final = _plain("Hopper")
WALKER2D: Final = _plain("Walker2d")
SWIMMER: Final = _plain("Swimmer")
HUMANOID: Final = _plain("Humanoid")
DOUBLE_PENDULUM: Final = _plain("InvertedDoublePendulum")
