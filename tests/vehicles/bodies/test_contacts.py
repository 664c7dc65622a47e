"""Counting of collisions, and the bumper."""

import math

import mujoco
import pytest

from shapechanger.vehicles.bodies import Motion
from shapechanger.vehicles.bodies.model import APART_S, BUMPER_SPREAD, ContactTracker

_DT = 0.01
# A movable ball of 0.1 m, a wall with its face at x = 1 m, and the ground.
_MODEL = """
<mujoco><option gravity="0 0 0"/><worldbody>
<geom name="world/ground" type="plane" size="5 5 1"/>
<geom name="world/wall/0" type="box" pos="1.5 0 0.5" size="0.5 3 0.5"/>
<body name="vehicle/chassis" pos="0 0 0.1"><freejoint/>
<geom name="vehicle/hull" type="sphere" size="0.1"/></body>
</worldbody></mujoco>
"""


class _Bench:
    def __init__(self) -> None:
        self.model = mujoco.MjModel.from_xml_string(_MODEL)
        self.data = mujoco.MjData(self.model)
        self.touch = ContactTracker(self.model)

    def stand(self, x: float, seconds: float = _DT, heading: float = 0.0) -> None:
        """Stay at x for a while."""
        self.data.qpos[:3] = x, 0.0, 0.1
        mujoco.mj_forward(self.model, self.data)
        for _ in range(round(seconds / _DT)):
            self.touch.follow(self.data, Motion(x, 0.0, heading, 0.0, 0.0, 0.0), _DT)


def test_a_wall_is_one_collision_also_when_it_is_left_for_a_moment() -> None:
    """Contacts within 0.5 s are one collision, later ones another."""
    bench = _Bench()
    bench.stand(0.91, seconds=3.0)
    assert bench.touch.touches
    for away, collisions in ((0.9 * APART_S, 1), (1.1 * APART_S, 2)):
        bench.stand(0.5, seconds=away)
        assert not bench.touch.touches
        bench.stand(0.91)
        assert bench.touch.collisions == collisions


def test_release_begins_another_collision_and_reset_clears_all() -> None:
    bench = _Bench()
    bench.stand(0.91)
    bench.touch.release()
    assert not bench.touch.touches
    bench.stand(0.91)
    assert bench.touch.collisions == 2
    bench.touch.reset()
    assert (bench.touch.collisions, bench.touch.bumped) == (0, False)


@pytest.mark.parametrize(
    ("off", "felt"), [(0.0, True), (0.9, True), (-0.9, True), (1.1, False), (math.pi, False)]
)
def test_the_bumper_is_at_the_front(off: float, felt: bool) -> None:
    """Contacts at the side or rear are collisions without a bump.

    `off` is the bearing of the wall over `BUMPER_SPREAD`, or pi for behind.
    """
    bench = _Bench()
    bench.stand(0.91, heading=off if off == math.pi else off * BUMPER_SPREAD)
    assert bench.touch.collisions == 1
    assert bench.touch.bumped is felt
