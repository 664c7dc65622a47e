"""The mirror image of a body."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import shapechanger  # noqa: F401 - registers the ids.
from shapechanger.errors import MapError, UnknownName
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap, Copy
from tests.transfer.body_map.bodies import (
    ANT_FLIP,
    ANT_SWAP,
    ant_action,
    ant_observation,
    pendulum_action,
)


def ant_mirror() -> BodyMap:
    return BodyMap.mirror(ant_observation(), ant_action(), swap=ANT_SWAP, flip=ANT_FLIP)


def test_the_mirror_of_an_ant() -> None:
    """The mirror negates y, axial x and z, and angles of hips, but not angles of ankles."""
    taken = {entry.feature: entry.rule for entry in ant_mirror().observation}

    def scale(name: str) -> float:
        rule = taken[name]
        assert isinstance(rule, Copy)
        return rule.scale

    assert taken["torso/z"] == Copy("torso/z")
    assert [scale(f"torso/{q}") for q in ("qw", "qx", "qy", "qz")] == [1, -1, 1, -1]
    assert [scale(f"torso/{v}") for v in ("vx", "vy", "vz")] == [1, -1, 1]
    assert [scale(f"torso/{w}") for w in ("wx", "wy", "wz")] == [-1, 1, -1]
    assert taken["hip_1/angle"] == Copy("hip_4/angle", -1.0)
    assert taken["hip_2/velocity"] == Copy("hip_3/velocity", -1.0)
    assert taken["ankle_3/angle"] == Copy("ankle_2/angle")
    assert [taken[f"shank_1/contact/{c}"] for c in ("tx", "ty", "tz", "fx", "fy", "fz")] == [
        Copy("shank_4/contact/tx", -1.0),
        Copy("shank_4/contact/ty"),
        Copy("shank_4/contact/tz", -1.0),
        Copy("shank_4/contact/fx"),
        Copy("shank_4/contact/fy", -1.0),
        Copy("shank_4/contact/fz"),
    ]
    moved = {entry.feature: entry.rule for entry in ant_mirror().action}
    assert moved["hip_3/motor"] == Copy("hip_2/motor", -1.0)
    assert moved["ankle_4/motor"] == Copy("ankle_1/motor")


MIXED = Layout((Feature("a", "m"), Feature("b", "rad"), Feature("c/x", "m")))


@pytest.mark.parametrize(
    ("layout", "swap", "flip", "kind", "message"),
    [
        (MIXED, {"a": "b"}, [], MapError, "their unit is 'm' and 'rad'"),
        (MIXED, {"c": "a"}, [], UnknownName, "No feature matches 'c'"),
        (None, ANT_SWAP, ["hip_*", "ankle_*"], MapError, "'ankle_1/angle' reaches from 0.52.* sym"),
        (None, {"hip_1": "hip_9"}, [], UnknownName, "No element matches 'hip_9'"),
        (None, {"leg_*": "hip_*"}, [], UnknownName, r"No element matches 'leg_\*'"),
        (None, {"hip_1": "hip_4"}, ["hop_*"], UnknownName, r"No element matches 'hop_\*'"),
        (
            None,
            {"hip_1": "hip_4", "hip_2": "hip_4"},
            [],
            MapError,
            "'hip_4' cannot mirror both 'hip_1' and 'hip_2'",
        ),
        (None, ANT_SWAP, ["hip_1"], MapError, "flip both or neither"),
        (Layout((Feature("eye", "1", shape=(2, 2)),)), {}, [], MapError, "'eye' is a block of num"),
    ],
)
def test_a_wrong_symmetry_is_refused(
    layout: Layout | None,
    swap: dict[str, str],
    flip: list[str],
    kind: type[Exception],
    message: str,
) -> None:
    """Partners must exist, have one unit and mirrored ranges, flip together, and be no blocks."""
    action = ant_action() if layout is None else pendulum_action()
    with pytest.raises(kind, match=message):
        BodyMap.mirror(layout or ant_observation(), action, swap=swap, flip=flip)


def test_paths_of_several_parts_are_kept() -> None:
    """The element is before the first "/", and the component after the last."""
    layout = Layout(tuple(Feature(f"leg_{n}/foot/force/fy", "N", -1.0, 1.0) for n in (1, 2)))
    motors = Layout((Feature("hip/motor", "1", -1.0, 1.0), Feature("hip/spare", "1", -1.0, 1.0)))
    found = BodyMap.mirror(layout, motors, swap={"leg_1": "leg_2"})
    assert [entry.rule for entry in found.observation] == [
        Copy("leg_2/foot/force/fy", -1.0),
        Copy("leg_1/foot/force/fy", -1.0),
    ]
    assert [entry.why for entry in (*found.observation, *found.action)] == [
        *("symmetry", "symmetry"),
        *("same name", "same name"),
    ]


@pytest.mark.parametrize(
    ("left", "right", "fits"),
    [(1.0, 1.0 + 5e-10, True), (1.0, 1.0 + 1e-8, False), (0.0, 5e-13, True), (0.0, 1e-11, False)],
)
def test_ranges_of_a_pair_agree_up_to_rounding(left: float, right: float, fits: bool) -> None:
    layout = Layout((Feature("l/x", "m", -2.0, left), Feature("r/x", "m", -2.0, right)))
    motor = Layout((Feature("motor", "1", -1.0, 1.0),))
    if fits:
        BodyMap.mirror(layout, motor, swap={"l": "r"})
    else:
        with pytest.raises(MapError, match="no such symmetry"):
            BodyMap.mirror(layout, motor, swap={"l": "r"})


LEGS = {"front_left_leg": "right_back_leg", "front_right_leg": "back_leg"}


@pytest.mark.parametrize("name", ["Ant", "BigAnt", "ExtendedAnt"])
def test_the_mirror_is_a_symmetry_of_the_ant(name: str) -> None:
    env = gym.make(f"shapechanger/{name}-v1")
    ant: Any = env.unwrapped
    layouts = ant.observation_layout, ant.action_layout
    mirrored = BodyMap.mirror(*layouts, swap=ANT_SWAP | LEGS, flip=ANT_FLIP)
    rng = np.random.default_rng(0)
    n_position, n_velocity = ant.model.nq - 2, ant.model.nv  # x and y are not observed.
    env.reset(seed=0)
    touched = 0
    for _ in range(30):
        action = rng.uniform(-1.0, 1.0, env.action_space.shape or ()).astype(np.float32)
        position, velocity = ant.data.qpos.copy(), ant.data.qvel.copy()
        sensed = np.zeros(layouts[0].size)
        sensed[: n_position + n_velocity] = [*position[2:], *velocity]
        turned = mirrored.adapt_observation(sensed)
        ant.set_state(
            np.array([position[0], -position[1], *turned[:n_position]]),
            turned[n_position : n_position + n_velocity],
        )
        ant.data.qacc_warmstart[:] = 0.0
        seen_mirrored, *_ = env.step(mirrored.adapt_action(action))
        ant.set_state(position, velocity)
        ant.data.qacc_warmstart[:] = 0.0
        seen, *_ = env.step(action)
        touched += ant.data.ncon > 0
        np.testing.assert_allclose(mirrored.adapt_observation(seen), seen_mirrored, atol=1e-6)
    assert touched > 5
    env.close()
