"""The bodies of ODRL have the published numbers.

The numbers come from ODRL's files; `shapechanger.envs.odrl` names their source. All
places are in the world's frame at the start pose, as ODRL writes the hopper and the walker.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from pathlib import Path

import gymnasium.envs.mujoco as gymnasium_mujoco
import mujoco
import numpy as np
import pytest

from shapechanger.envs.ant import ANT
from shapechanger.envs.catalogue import ODRL_ENVS
from shapechanger.envs.runners import HALF_CHEETAH, HOPPER, WALKER2D
from shapechanger.morphology import compile_body
from shapechanger.morphology.certificate import fingerprint
from shapechanger.morphology.families import Family
from tests.morphology.models import posed

_ASSETS = Path(gymnasium_mujoco.__file__).parent / "assets"
_ROBOTS: dict[str, tuple[Family, str]] = {
    "ant": (ANT, "ant.xml"),
    "halfcheetah": (HALF_CHEETAH, "half_cheetah.xml"),
    "hopper": (HOPPER, "hopper.xml"),
    "walker2d": (WALKER2D, "walker2d_v5.xml"),
}
# half_cheetah.xml sets a total mass in a way that MuJoCo deprecates.
pytestmark = pytest.mark.filterwarnings("ignore:.*settotalmass.*")

Point = tuple[float, float, float]


def _model(name: str) -> mujoco.MjModel:
    family, file = _ROBOTS[name.split("-")[1]]
    return compile_body(family.load(_ASSETS / file), family.body(name))


def _source(name: str) -> mujoco.MjModel:
    return _model("-".join(name.split("-")[:2]))


def _ends(model: mujoco.MjModel, geom: str) -> list[list[float]]:
    """Return both ends of a capsule's axis in the world, sorted."""
    data = posed(model)
    half = data.geom(geom).xmat.reshape(3, 3)[:, 2] * model.geom(geom).size[1]
    return sorted([(data.geom(geom).xpos + side * half).tolist() for side in (1.0, -1.0)])


def _walker(knee: float) -> dict[str, tuple[Point, Point, float]]:
    return {
        geom: each
        for side in ("", "_left")
        for geom, each in {
            f"thigh{side}_geom": ((0.0, 0.0, 1.05), (0.0, 0.0, knee), 0.05),
            f"leg{side}_geom": ((0.0, 0.0, knee), (0.0, 0.0, 0.1), 0.04),
            f"foot{side}_geom": ((0.0, 0.0, 0.1), (0.2, 0.0, 0.1), 0.06),
        }.items()
    }


# Ends and radius of capsules, m.
_CAPSULES: dict[str, dict[str, tuple[Point, Point, float]]] = {
    "odrl-hopper-morph-foot-easy": {"foot_geom": ((-0.104, 0, 0.1), (0.208, 0, 0.1), 0.048)},
    "odrl-hopper-morph-foot-medium": {"foot_geom": ((-0.078, 0, 0.1), (0.156, 0, 0.1), 0.036)},
    "odrl-hopper-morph-foot-hard": {"foot_geom": ((-0.052, 0, 0.1), (0.104, 0, 0.1), 0.024)},
    **{
        f"odrl-{robot}-morph-torso-{level}": {
            "torso_geom": ((0.0, 0.0, 1.05), (0.0, 0.0, top), radius)
        }
        for robot in ("hopper", "walker2d")
        for level, top, radius in (
            ("easy", 1.53, 0.075),
            ("medium", 1.69, 0.1),
            ("hard", 1.85, 0.125),
        )
    },
    "odrl-walker2d-morph-leg-easy": _walker(0.5),
    "odrl-walker2d-morph-leg-medium": _walker(0.35),
    "odrl-walker2d-morph-leg-hard": _walker(0.2),
    "odrl-halfcheetah-morph-thigh-easy": {
        "bthigh": ((-0.5, 0, 0.7), (-0.39, 0, 0.59), 0.046),
        "bshin": ((-0.39, 0, 0.59), (-0.52, 0, 0.44), 0.046),
        "fthigh": ((0.5, 0, 0.7), (0.41, 0, 0.6), 0.046),
        "fshin": ((0.41, 0, 0.6), (0.52, 0, 0.47), 0.046),
    },
    "odrl-halfcheetah-morph-thigh-medium": {
        "bthigh": ((-0.5, 0, 0.7), (-0.42, 0, 0.62), 0.046),
        "bshin": ((-0.42, 0, 0.62), (-0.55, 0, 0.47), 0.046),
        "fthigh": ((0.5, 0, 0.7), (0.43, 0, 0.62), 0.046),
        "fshin": ((0.43, 0, 0.62), (0.54, 0, 0.49), 0.046),
    },
    "odrl-halfcheetah-morph-thigh-hard": {
        "bthigh": ((-0.5, 0, 0.7), (-0.48, 0, 0.68), 0.046),
        "bshin": ((-0.48, 0, 0.68), (-0.61, 0, 0.53), 0.046),
        "fthigh": ((0.5, 0, 0.7), (0.46, 0, 0.65), 0.046),
        "fshin": ((0.46, 0, 0.65), (0.57, 0, 0.52), 0.046),
    },
    **{
        f"odrl-halfcheetah-morph-torso-{level}": {"torso": ((-half, 0, 0.7), (half, 0, 0.7), 0.046)}
        for level, half in (("easy", 0.4), ("medium", 0.25), ("hard", 0.1))
    },
    **{
        f"odrl-ant-morph-{shift}-{level}": {
            geom: ((x * 0.4, y * 0.4, 0.75), (x * far, y * far, 0.75), 0.08)
            for geom, (x, y, shortened) in {
                "left_ankle_geom": (1, 1, True),
                "right_ankle_geom": (-1, 1, True),
                "third_ankle_geom": (-1, -1, shift == "alllegs"),
                "fourth_ankle_geom": (1, -1, shift == "alllegs"),
            }.items()
            for far in [0.4 + (short if shortened else 0.4)]
        }
        for shift in ("alllegs", "halflegs")
        for level, short in (("easy", 0.32), ("medium", 0.2), ("hard", 0.08))
    },
}


def _degrees(lower: float, upper: float) -> tuple[float, float]:
    return math.radians(lower), math.radians(upper)


# Ranges of joints of the easy, medium and hard level, rad.
_RANGES: dict[str, dict[str, list[tuple[float, float]]]] = {
    "odrl-ant-kinematic-anklejnt": {
        f"ankle_{leg}": [_degrees(30, x) if ahead else _degrees(-x, -30) for x in (62, 50, 38)]
        for leg, ahead in ((1, True), (2, False), (3, False), (4, True))
    },
    "odrl-ant-kinematic-hipjnt": {
        f"hip_{leg}": [_degrees(-x, x) for x in (24, 15, 6)] for leg in (1, 2, 3, 4)
    },
    "odrl-halfcheetah-kinematic-footjnt": {
        "bfoot": [(-0.32, 0.628), (-0.2, 0.3925), (-0.08, 0.157)],
        "ffoot": [(-0.4, 0.4), (-0.25, 0.25), (-0.1, 0.1)],
    },
    "odrl-halfcheetah-kinematic-thighjnt": {
        "bthigh": [(-0.416, 0.84), (-0.26, 0.525), (-0.104, 0.21)],
        "fthigh": [(-0.8, 0.56), (-0.5, 0.35), (-0.2, 0.14)],
    },
    "odrl-hopper-kinematic-footjnt": {"foot_joint": [_degrees(-x, x) for x in (36, 22.5, 9)]},
    "odrl-hopper-kinematic-legjnt": {"leg_joint": [_degrees(-x, 0) for x in (120, 75, 30)]},
    "odrl-walker2d-kinematic-footjnt": {
        joint: [_degrees(-x, x) for x in (36, 22.5, 9)]
        for joint in ("foot_joint", "foot_left_joint")
    },
    "odrl-walker2d-kinematic-thighjnt": {
        joint: [_degrees(-x, 0) for x in (120, 75, 30)]
        for joint in ("thigh_joint", "thigh_left_joint")
    },
}
# Sliding, torsional and rolling friction at a factor of 1; hopper's floor is not scaled.
_FRICTION: dict[str, dict[str, Point]] = {
    "ant": {"floor": (1, 0.5, 0.5), "torso_geom": (1, 0.5, 0.5), "left_ankle_geom": (1, 0.5, 0.5)},
    "halfcheetah": {"floor": (0.4, 0.1, 0.1), "bfoot": (0.4, 0.1, 0.1)},
    "walker2d": {
        "floor": (0.7, 0.1, 0.1),
        "torso_geom": (0.9, 0.1, 0.1),
        "foot_geom": (0.9, 0.1, 0.1),
        "foot_left_geom": (1.9, 0.1, 0.1),
    },
}
_LEVELS = ("easy", "medium", "hard")
_FACTORS = (0.1, 0.5, 2.0, 5.0)


def test_every_target_has_an_id_and_is_compared_with_the_published_numbers() -> None:
    """The tables of this file contain all four sources and eighty targets."""
    kinematic = {f"{task}-{level}" for task in _RANGES for level in _LEVELS}
    kinds = itertools.product(_ROBOTS, ("friction", "gravity"), _FACTORS)
    scaled = {f"odrl-{robot}-{kind}-{factor}" for robot, kind, factor in kinds}
    compared = {*_CAPSULES, *kinematic, *scaled, *(f"odrl-{robot}" for robot in _ROBOTS)}
    families = {entry.name: entry.family for entry in ODRL_ENVS.values()}
    assert families == {name: _ROBOTS[name.split("-")[1]][0].name for name in compared}
    assert len(families) == 84
    assert {*families} == {name for family, _ in _ROBOTS.values() for name in family.published}


@pytest.mark.parametrize("name", _CAPSULES)
def test_shapes_equal_the_published_ones(name: str) -> None:
    """Ends and radii agree to 1e-12 m; other geoms keep their sizes, and joints their ranges."""
    model, source = _model(name), _source(name)
    for geom, (start, end, radius) in _CAPSULES[name].items():
        published = sorted([list(map(float, start)), list(map(float, end))])
        np.testing.assert_allclose(_ends(model, geom), published, rtol=0.0, atol=1e-12)
        assert model.geom(geom).size[0] == pytest.approx(radius, abs=1e-12)
    for i in range(model.ngeom):
        if (geom := model.geom(i).name) not in _CAPSULES[name]:
            np.testing.assert_allclose(model.geom(i).size, source.geom(geom).size, atol=1e-12)
    for field in ("jnt_range", "geom_friction", "actuator_gear", "dof_damping", "dof_armature"):
        np.testing.assert_allclose(getattr(model, field), getattr(source, field), atol=1e-12)


@pytest.mark.parametrize("level", range(3), ids=_LEVELS)
@pytest.mark.parametrize("task", _RANGES)
def test_ranges_equal_the_published_ones(task: str, level: int) -> None:
    """The ranges equal the published ones to 1e-12 rad, and the rest of the model is unchanged."""
    name = f"{task}-{_LEVELS[level]}"
    model, source = _model(name), _source(name)
    for joint, ranges in _RANGES[task].items():
        np.testing.assert_allclose(model.joint(joint).range, ranges[level], rtol=0.0, atol=1e-12)
    others = [i for i in range(model.njnt) if model.joint(i).name not in _RANGES[task]]
    np.testing.assert_allclose(model.jnt_range[others], source.jnt_range[others], atol=1e-12)
    _require_equal(model, source, "body_mass", "body_inertia", "body_pos", "geom_size")


def _require_equal(a: mujoco.MjModel, b: mujoco.MjModel, *fields: str) -> None:
    for field in (*fields, "geom_pos", "jnt_pos", "actuator_gear", "dof_damping", "geom_margin"):
        np.testing.assert_allclose(getattr(a, field), getattr(b, field), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("factor", _FACTORS)
@pytest.mark.parametrize("robot", _ROBOTS)
def test_gravity_is_scaled(robot: str, factor: float) -> None:
    model, source = _model(f"odrl-{robot}-gravity-{factor}"), _source(f"odrl-{robot}")
    np.testing.assert_allclose(model.opt.gravity, [0.0, 0.0, -9.81 * factor], atol=1e-12)
    _require_equal(model, source, "body_mass", "geom_friction", "jnt_range", "geom_size")


@pytest.mark.parametrize("factor", [1.0, *_FACTORS])
@pytest.mark.parametrize("robot", _ROBOTS)
def test_friction_is_scaled(robot: str, factor: float) -> None:
    """All coefficients are scaled; of the hopper, only sliding ones, and not the floor's."""
    model = _model(f"odrl-{robot}" + (f"-friction-{factor}" if factor != 1.0 else ""))
    published: Mapping[str, Point] = _FRICTION.get(robot, {})
    for geom, triple in published.items():
        np.testing.assert_allclose(
            model.geom(geom).friction, factor * np.array(triple), rtol=0.0, atol=1e-12
        )
    if robot == "hopper":
        for geom, sliding in {"floor": 1.0 / factor, "torso_geom": 0.9, "foot_geom": 2.0}.items():
            np.testing.assert_allclose(
                model.geom(geom).friction, [factor * sliding, 0.005, 0.0001], rtol=0.0, atol=1e-12
            )
    _require_equal(model, _source(f"odrl-{robot}"), "body_mass", "jnt_range", "geom_size")


def test_two_published_tasks_are_one() -> None:
    """A foot's friction below the floor's of 1 has no effect (issue 8 of ODRL).

    No other two of the 84 bodies are the same.
    """
    same: dict[str, list[str]] = {}
    for entry in ODRL_ENVS.values():
        same.setdefault(fingerprint(_model(entry.name)), []).append(entry.name)
    twins = [names for names in same.values() if len(names) > 1]
    assert twins == [["odrl-hopper-friction-0.1", "odrl-hopper-friction-0.5"]]
