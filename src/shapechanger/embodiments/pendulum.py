"""The inverted pendulum: a pole on a cart on a rail.

Model: `inverted_pendulum.xml` of Gymnasium (MIT). Bodies: `InvertedPendulum`,
`SmallInvertedPendulum` and `BigInvertedPendulum` of the 2017 Shapechanger release, whose poles end
at (0.001, 0, h) m with h = 0.6, 0.3 and 1.2: the lean of 1 mm stays when the pole is stretched.
"""

from __future__ import annotations

from typing import Final

from shapechanger.embodiments.family import Family
from shapechanger.morphology import Stretch

__all__ = ["PENDULUM"]

PENDULUM: Final = Family(
    name="InvertedPendulum",
    bodies={
        "InvertedPendulum": (),
        "SmallInvertedPendulum": (Stretch("pole", 0.5, axis="z"),),
        "BigInvertedPendulum": (Stretch("pole", 2.0, axis="z"),),
    },
)
