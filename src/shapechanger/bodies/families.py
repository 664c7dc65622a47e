"""Families of bodies: one model each, and the named bodies that edits make from it.

All models are those of Gymnasium (MIT). `InvertedPendulum`, `SmallInvertedPendulum` and
`BigInvertedPendulum` are bodies of the 2017 Shapechanger release, whose poles end at (0.001, 0, h)
m with h = 0.6, 0.3 and 1.2: stretching along z keeps the lean of 1 mm.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import mujoco

from shapechanger.errors import UnknownName
from shapechanger.morphology import Body, Edit, Stretch, as_body, name_elements

BodyLike = str | Edit | Iterable[Edit]
"""A body as users give it: its name, edits as JSON, one edit, or several."""


@dataclass(frozen=True)
class Family:
    """One model and its named bodies.

    Attributes:
        name: Name of the family, which is also that of its unedited body.
        bodies: Edits of each named body.
        bodies_by_joint: Names for bodies that the model leaves unnamed, by the name of their joint.
    """

    name: str
    bodies: Mapping[str, Body]
    bodies_by_joint: Mapping[str, str] = field(default_factory=dict[str, str])

    def load(self, path: str | Path) -> mujoco.MjSpec:
        """Load the model at `path`, and name all its elements."""
        spec = mujoco.MjSpec.from_file(str(path))
        name_elements(spec, self.bodies_by_joint)
        return spec

    def body(self, value: BodyLike) -> Body:
        """Edits of a body.

        Args:
            value: Name of a body of this family, edits as JSON, one edit, or several.

        Raises:
            UnknownName: If the family has no body of this name.
            MorphologyError: If `value` is not a valid body.
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
    """Family whose only named body is the unedited model."""
    return Family(name, {name: ()})


HALF_CHEETAH: Final = _plain("HalfCheetah")
HOPPER: Final = _plain("Hopper")
WALKER2D: Final = _plain("Walker2d")
SWIMMER: Final = _plain("Swimmer")
HUMANOID: Final = _plain("Humanoid")
DOUBLE_PENDULUM: Final = _plain("InvertedDoublePendulum")
