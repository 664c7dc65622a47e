"""What changing a body costs, compared with loading it, on whatever machine this is."""

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
    """The shortest of several runs, s: what the work costs when nothing disturbs it."""
    durations: list[float] = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        durations.append(time.perf_counter() - start)
    return min(durations)


def test_an_extended_ant_costs_a_few_plain_ones() -> None:
    """Load, edit and compile the largest named body: less than six times the plain ant."""
    plain = _fastest(lambda: mujoco.MjSpec.from_file(_PATH).compile())
    extended = _fastest(lambda: compile_body(ANT.load(_PATH), ANT.body("ExtendedAnt")))
    assert extended < 6.0 * plain
