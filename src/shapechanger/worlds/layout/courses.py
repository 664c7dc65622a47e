"""Courses by the name of their world and a seed."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from shapechanger.errors import UnknownName, WorldError
from shapechanger.worlds.course import Course
from shapechanger.worlds.layout.corridor import corridor
from shapechanger.worlds.layout.harbour import harbour
from shapechanger.worlds.layout.yard import yard

__all__ = ["WORLDS", "lay_out"]

_MAKERS: Final[Mapping[str, Callable[[np.random.Generator, int], Course | None]]] = (
    MappingProxyType({"corridor": corridor, "yard": yard, "harbour": harbour})
)

WORLDS: Final = tuple(_MAKERS)
"""Names of the worlds that can be laid out."""

_ATTEMPTS: Final = 500


def lay_out(world: str, seed: int) -> Course:
    """The course that belongs to a seed: the same one whenever and wherever it is asked for.

    Args:
        world: One of `WORLDS`.
        seed: From 0. `TRAINING` and `HELD_OUT` of `shapechanger.worlds.course` say which are for
            what.

    Raises:
        UnknownName: If there is no such world.
        WorldError: If the seed is negative, or chance makes no course that fits.
    """
    if world not in _MAKERS:
        raise UnknownName("world", world, WORLDS)
    if seed < 0:
        raise WorldError(f"Seeds of courses count from 0, and {seed} is less.")
    rng = np.random.default_rng([zlib.crc32(world.encode()), seed])
    for _ in range(_ATTEMPTS):
        course = _MAKERS[world](rng, seed)
        if course is not None:
            return course
    raise WorldError(
        f"No {world} with seed {seed} can be laid out: {_ATTEMPTS} attempts came out too tight."
    )
