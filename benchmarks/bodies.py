"""Time of edits and compilation, and of a fingerprint."""

from __future__ import annotations

import time
from collections.abc import Callable

import mujoco
from gymnasium.envs.mujoco.mujoco_env import expand_model_path

from benchmarks.row import Row
from shapechanger.envs.ant import ANT
from shapechanger.morphology import compile_body
from shapechanger.morphology.certificate import fingerprint

ROUNDS = 30


def times_ms(work: Callable[[], object]) -> list[float]:
    """Return the milliseconds of each round, sorted."""
    work()
    times: list[float] = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - began))
    return sorted(times)


def timed_row(name: str, work: Callable[[], object], limit_ms: float) -> Row:
    """Return the row of a function with a time limit."""
    times = times_ms(work)
    median = times[len(times) // 2]
    spread = f"{times[0]:.2f} to {times[-1]:.2f} ms in {ROUNDS} rounds"
    return Row(name, f"{median:.2f} ms", spread, f"< {limit_ms:g} ms", median < limit_ms)


def bodies() -> list[Row]:
    """Time edits, compilation and a fingerprint."""
    ant_xml = expand_model_path("ant.xml")
    spec = ANT.load(ant_xml)
    rows = [
        timed_row(
            f"edit and compile {name}",
            lambda body=body: compile_body(spec, body),
            10.0,
        )
        for name, body in ANT.bodies.items()
    ]
    bare = times_ms(lambda: mujoco.MjModel.from_xml_path(ant_xml))
    whole = times_ms(lambda: compile_body(ANT.load(ant_xml), ANT.bodies["ExtendedAnt"]))
    ratio = whole[0] / bare[0]
    rows.append(
        Row(
            "load, edit and compile ExtendedAnt, over loading ant.xml",
            f"{ratio:.2f}x",
            f"best of {ROUNDS} rounds each",
            "< 6x",
            ratio < 6.0,
        )
    )
    model = compile_body(spec)
    rows.append(timed_row("fingerprint of Ant", lambda: fingerprint(model), 20.0))
    return rows
