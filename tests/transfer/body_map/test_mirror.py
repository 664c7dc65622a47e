"""The mirror image of a body."""

from __future__ import annotations

import numpy as np
import pytest

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
    """Return the left-right mirror of the ant."""
    return BodyMap.mirror(ant_observation(), ant_action(), swap=ANT_SWAP, flip=ANT_FLIP)


def test_the_mirror_of_an_ant() -> None:
    """Worked out by hand: y and axial x and z are negated, hips too, ankles not."""
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


def test_a_mirrored_quaternion_is_the_mirrored_rotation() -> None:
    """R(mirrored q) = S R(q) S with S = diag(1, -1, 1), which is what mirroring a pose means."""
    q = np.random.default_rng(0).normal(size=4)
    q /= np.linalg.norm(q)
    flip = np.diag([1.0, -1.0, 1.0])

    def rotation(w: float, x: float, y: float, z: float) -> np.ndarray:
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return np.eye(3) + 2 * w * cross + 2 * cross @ cross

    built = ant_mirror()
    sensed = np.zeros(built.target_observation.size)
    sensed[1:5] = q
    mirrored = built.adapt_observation(sensed)[1:5]
    np.testing.assert_allclose(rotation(*mirrored), flip @ rotation(*q) @ flip, atol=1e-12)


def test_the_mirror_of_either_body_gives_the_same_map() -> None:
    there = BodyMap.between(
        ant_observation(),
        ant_observation(feet=True),
        ant_action(),
        ant_action(feet=True),
        rules={"foot_*/motor": "copy ankle_*/motor"},
    )
    of_target = BodyMap.mirror(
        ant_observation(feet=True), ant_action(feet=True), swap=ANT_SWAP, flip=ANT_FLIP
    )
    assert there.then(of_target) == ant_mirror().then(there)
    whys = {entry.why for entry in there.then(of_target).observation}
    assert whys == {"same name", "symmetry"}


def test_only_similar_features_can_swap() -> None:
    """Partners exist, and have one unit, shape and gain."""
    mixed = Layout((Feature("a", "m"), Feature("b", "rad"), Feature("c/x", "m")))
    motors = pendulum_action()
    with pytest.raises(MapError, match="their unit is 'm' and 'rad'"):
        BodyMap.mirror(mixed, motors, swap={"a": "b"})
    with pytest.raises(UnknownName, match="No feature matches 'c'"):
        BodyMap.mirror(mixed, motors, swap={"c": "a"})


def test_a_body_whose_ranges_differ_is_not_symmetric() -> None:
    """Features whose ranges are not mirror images cannot swap."""
    with pytest.raises(MapError, match=r"'ankle_1/angle' reaches from 0.52.* no such symmetry"):
        BodyMap.mirror(ant_observation(), ant_action(), swap=ANT_SWAP, flip=["hip_*", "ankle_*"])


@pytest.mark.parametrize(
    ("swap", "flip", "message"),
    [
        ({"hip_1": "hip_9"}, [], "No element matches 'hip_9'"),
        ({"leg_*": "hip_*"}, [], r"No element matches 'leg_\*'"),
        ({"hip_1": "hip_4"}, ["hop_*"], r"No element matches 'hop_\*'"),
    ],
)
def test_unknown_elements_are_refused(swap: dict[str, str], flip: list[str], message: str) -> None:
    with pytest.raises(UnknownName, match=message):
        BodyMap.mirror(ant_observation(), ant_action(), swap=swap, flip=flip)


@pytest.mark.parametrize(
    ("swap", "flip", "message"),
    [
        (
            {"hip_1": "hip_4", "hip_2": "hip_4"},
            [],
            "'hip_4' cannot mirror both 'hip_1' and 'hip_2'",
        ),
        (ANT_SWAP, ["hip_1"], "flip both or neither"),
    ],
)
def test_contradictory_mirrors_are_refused(
    swap: dict[str, str], flip: list[str], message: str
) -> None:
    """Contradicting pairs, and pairs of which one element flips, are refused."""
    with pytest.raises(MapError, match=message):
        BodyMap.mirror(ant_observation(), ant_action(), swap=swap, flip=flip)


def test_blocks_have_no_mirror() -> None:
    seeing = Layout((Feature("eye", "1", shape=(2, 2)),))
    with pytest.raises(MapError, match="'eye' is a block of numbers"):
        BodyMap.mirror(seeing, pendulum_action())


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
    [
        (1.0, 1.0 + 5e-10, True),
        (1.0, 1.0 + 1e-8, False),
        (0.0, 5e-13, True),
        (0.0, 1e-11, False),
    ],
)
def test_ranges_of_a_pair_agree_up_to_rounding(left: float, right: float, fits: bool) -> None:
    layout = Layout((Feature("l/x", "m", -2.0, left), Feature("r/x", "m", -2.0, right)))
    motor = Layout((Feature("motor", "1", -1.0, 1.0),))
    if fits:
        BodyMap.mirror(layout, motor, swap={"l": "r"})
    else:
        with pytest.raises(MapError, match="no such symmetry"):
            BodyMap.mirror(layout, motor, swap={"l": "r"})
