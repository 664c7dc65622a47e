"""Symmetries of a body, and its mirror image."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from shapechanger.errors import MapError, UnknownName
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap, Copy, Symmetry, mirror
from tests.transfer.body_map.bodies import (
    ANT_FLIP,
    ANT_SWAP,
    ant_action,
    ant_observation,
    pendulum_action,
    pendulum_observation,
)


def ant_mirror() -> Symmetry:
    """Return the left-right mirror of the ant."""
    return mirror(ant_observation(), ant_action(), swap=ANT_SWAP, flip=ANT_FLIP)


def legs(*names: str, low: float = -1.0, high: float = 1.0) -> Layout:
    """Return a layout of features with equal ranges."""
    return Layout(tuple(Feature(name, "1", low, high) for name in names))


def test_the_mirror_of_an_ant() -> None:
    """Worked out by hand: y and axial x and z are negated, hips too, ankles not."""
    taken = dict(zip(ant_observation().names, ant_mirror().observation, strict=True))
    assert taken["torso/z"] == Copy("torso/z")
    assert [taken[f"torso/{q}"].scale for q in ("qw", "qx", "qy", "qz")] == [1, -1, 1, -1]
    assert [taken[f"torso/{v}"].scale for v in ("vx", "vy", "vz")] == [1, -1, 1]
    assert [taken[f"torso/{w}"].scale for w in ("wx", "wy", "wz")] == [-1, 1, -1]
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
    moved = dict(zip(ant_action().names, ant_mirror().action, strict=True))
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

    built = BodyMap.identity(ant_observation(), ant_action()).with_symmetry(ant_mirror())
    sensed = np.zeros(built.target_observation.size)
    sensed[1:5] = q
    mirrored = built.adapt_observation(sensed)[1:5]
    np.testing.assert_allclose(rotation(*mirrored), flip @ rotation(*q) @ flip, atol=1e-12)


def test_mirroring_twice_is_the_identity() -> None:
    once = BodyMap.identity(ant_observation(), ant_action()).with_symmetry(ant_mirror())
    assert once.then(once) == BodyMap.identity(ant_observation(), ant_action())
    assert ant_mirror().inverse() == ant_mirror()


def test_a_rotated_policy_is_equivariant() -> None:
    """With g a quarter turn, the map makes of a policy p the policy g⁻¹ p(g o)."""
    names = ("a", "b", "c", "d")
    turn = {name: Copy(names[(i + 1) % 4], -1.0 if i == 0 else 1.0) for i, name in enumerate(names)}
    symmetry = Symmetry.of(legs(*names), legs(*names), observation=turn, action=turn)
    built = BodyMap.identity(legs(*names), legs(*names)).with_symmetry(symmetry)
    g = built.observation_matrix
    np.testing.assert_allclose(built.action_matrix, np.linalg.inv(g))
    assert not np.array_equal(g, g.T)
    back = BodyMap.identity(legs(*names), legs(*names)).with_symmetry(symmetry.inverse())
    assert built.then(back) == BodyMap.identity(legs(*names), legs(*names))


def test_the_symmetry_of_either_body_is_accepted() -> None:
    """The symmetries of the source and of the target give the same map."""
    there = BodyMap.between(
        ant_observation(),
        ant_observation(feet=True),
        ant_action(),
        ant_action(feet=True),
        rules={"foot_*/motor": "copy ankle_*/motor"},
    )
    of_target = mirror(
        ant_observation(feet=True), ant_action(feet=True), swap=ANT_SWAP, flip=ANT_FLIP
    )
    assert there.with_symmetry(of_target) == there.with_symmetry(ant_mirror())
    whys = {entry.why for entry in there.with_symmetry(of_target).observation}
    assert whys == {"same name", "symmetry"}


def test_the_symmetry_of_a_third_body_is_refused() -> None:
    """The message names the difference from the source."""
    built = BodyMap.identity(pendulum_observation(), pendulum_action())
    with pytest.raises(
        MapError, match=r"belongs neither to the source nor to the target: .* torso/z"
    ):
        built.with_symmetry(ant_mirror())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"a": Copy("b")}, "'a' and 'b' both copy 'b'"),
        ({"a": Copy("b", 2.0), "b": Copy("a", 0.5)}, "in a symmetry the scale is 1 or -1"),
    ],
)
def test_only_signed_permutations_are_accepted(changes: Mapping[str, Copy], message: str) -> None:
    """Scales other than 1 and -1, and two copies of one feature, are refused."""
    with pytest.raises(MapError, match=message):
        Symmetry.of(legs("a", "b"), legs("a"), observation=changes)


def test_names_and_numbers_of_a_symmetry_are_checked() -> None:
    with pytest.raises(UnknownName, match="No feature matches 'hip'"):
        Symmetry.of(legs("hop"), legs("a"), observation={"hip": Copy("hop")})
    with pytest.raises(UnknownName, match="No action feature matches 'b'"):
        Symmetry.of(legs("a"), legs("a"), action={"a": Copy("b")})
    with pytest.raises(MapError, match="needs 1 action rules, one a feature: 0 given"):
        Symmetry(legs("a"), legs("a"), (Copy("a"),), ())


def test_only_similar_features_can_swap() -> None:
    """Features that differ in unit, shape or gain cannot swap."""
    mixed = Layout((Feature("a", "m"), Feature("b", "rad")))
    swap = {"a": Copy("b"), "b": Copy("a")}
    with pytest.raises(MapError, match="their unit is 'm' and 'rad'"):
        Symmetry.of(mixed, legs("a"), observation=swap)


def test_a_body_whose_ranges_differ_is_not_symmetric() -> None:
    """Features whose ranges are not mirror images cannot swap."""
    with pytest.raises(MapError, match=r"'ankle_1/angle' reaches from 0.52.* no such symmetry"):
        mirror(ant_observation(), ant_action(), swap=ANT_SWAP, flip=["hip_*", "ankle_*"])


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
        mirror(ant_observation(), ant_action(), swap=swap, flip=flip)


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
        mirror(ant_observation(), ant_action(), swap=swap, flip=flip)


def test_blocks_have_no_mirror() -> None:
    seeing = Layout((Feature("eye", "1", shape=(2, 2)),))
    with pytest.raises(MapError, match="'eye' is a block of numbers"):
        mirror(seeing, pendulum_action())
