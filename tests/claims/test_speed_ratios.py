"""Cost of editing a body relative to loading it."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import mujoco

from shapechanger.bodies.ant import ANT
from shapechanger.morphology import compile_body
from tests.morphology.scenes import ASSETS

_PATH = os.path.join(ASSETS, "ant.xml")


def _fastest(work: Callable[[], object], rounds: int = 15) -> float:
    """Return the shortest duration of several runs, s."""
    durations: list[float] = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        durations.append(time.perf_counter() - start)
    return min(durations)


def test_an_extended_ant_costs_a_few_plain_ones() -> None:
    """Loading, editing and compiling it takes less than six plain ants."""
    plain = _fastest(lambda: mujoco.MjSpec.from_file(_PATH).compile())
    extended = _fastest(lambda: compile_body(ANT.load(_PATH), ANT.body("ExtendedAnt")))
    assert extended < 6.0 * plain
