"""Gymnasium's other bodies (MIT), each as its model is.

Any edits of it make a body of its family.
"""

from __future__ import annotations

from typing import Final

from shapechanger.embodiments.family import Family

__all__ = ["DOUBLE_PENDULUM", "HALF_CHEETAH", "HOPPER", "HUMANOID", "SWIMMER", "WALKER2D"]


def _plain(name: str) -> Family:
    """The family whose only named body is the model as it is."""
    return Family(name, {name: ()})


HALF_CHEETAH: Final = _plain("HalfCheetah")
HOPPER: Final = _plain("Hopper")
WALKER2D: Final = _plain("Walker2d")
SWIMMER: Final = _plain("Swimmer")
HUMANOID: Final = _plain("Humanoid")
DOUBLE_PENDULUM: Final = _plain("InvertedDoublePendulum")
