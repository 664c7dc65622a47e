"""`find_fast_model` finds a cheaper MuJoCo model that moves equally to the last bit, or none."""

from __future__ import annotations

import copy
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.envs.ant import AntEnv
from shapechanger.envs.stepping import tuned
from shapechanger.envs.stepping.fast_model import find_fast_model, moves_equally
from tests.models import xml

pytestmark = pytest.mark.usefixtures("log_elsewhere")

_ISLAND = int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
_SPRING = int(mujoco.mjtDisableBit.mjDSBL_SPRING)
_DAMPER = int(mujoco.mjtDisableBit.mjDSBL_DAMPER)
_FRICTION = int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS)
_SENSOR = int(mujoco.mjtDisableBit.mjDSBL_SENSOR)

_BALL = '<geom name="{0}" size="0.1" {1}/>'
_SCENE = xml("scene_fast")
_SILENT = 'conaffinity="0"'


def _scene(**parts: str) -> mujoco.MjSpec:
    """Return a trunk with a leg on a floor; geoms touch only the floor by default."""
    given = dict.fromkeys(("floor", "fixed", "trunk", "more", "legs", "other", "rest"), "")
    given |= {"trunk": _SILENT, "legs": _SILENT} | parts
    return mujoco.MjSpec.from_string(_SCENE.format(**given))


def _fast_model_of(spec: mujoco.MjSpec) -> tuple[mujoco.MjModel, mujoco.MjModel | None]:
    model = spec.compile()
    return model, find_fast_model(model, spec.copy)


_margins = st.sampled_from(["", 'margin="0.02"', 'margin="0.03" gap="0.01"'])
_frictions = st.sampled_from(["", 'friction="0.2 0.1 0.1"', 'friction="1 0.01 0.3"'])
_softness = st.sampled_from(["", 'solref="0.05 0.5"', 'solref="-500 -5"', 'solref="0.3 1"'])
_impedance = st.sampled_from(["", 'solimp="0.5 0.9 0.01 0.3 3"'])
_mixing = st.sampled_from(["", 'solmix="0"', 'solmix="3"'])
_dimensions = st.sampled_from(["", 'condim="1"', 'condim="4"', 'condim="6"'])
_geoms = st.tuples(_margins, _frictions, _softness, _impedance, _mixing, _dimensions).map(" ".join)


def _stiff(spec: Any) -> None:
    spec.joint("hip").stiffness = [0.0, 20.0, 0.0]  # A quadratic term only.


def _rough(spec: Any) -> None:
    spec.joint("hip").frictionloss = 0.2


def _sensing(spec: Any) -> None:
    spec.add_sensor(
        type=mujoco.mjtSensor.mjSENS_JOINTPOS, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname="hip"
    )


def _dense(spec: Any) -> None:
    spec.option.density = 1000.0


def _viscous(spec: Any) -> None:
    spec.option.viscosity = 10.0


def _undamped(spec: Any) -> None:
    """Disable dampers: if springs were disabled too, MuJoCo would skip gravity compensation."""
    spec.option.disableflags = _DAMPER
    spec.body("shin").gravcomp = 1.0


_features = st.sampled_from([_stiff, _rough, _sensing, _dense, _viscous, _undamped])


@settings(deadline=None, max_examples=60)
@given(floor=_geoms, trunk=_geoms, legs=_geoms, add=st.sets(_features))
def test_a_fast_model_moves_as_its_model(floor: str, trunk: str, legs: str, add: set[Any]) -> None:
    """Motion is equal to the last bit, with any contact parameters and any features.

    Explicit pairs replace the contact search, and the public model is unchanged.
    """
    spec = _scene(floor=floor, trunk=f"{_SILENT} {trunk}", legs=f"{_SILENT} {legs}")
    for feature in add:
        feature(spec)
    model, fast = _fast_model_of(spec)
    assert fast is not None
    assert fast.npair == 3
    assert not fast.geom_contype.any()
    assert fast.opt.disableflags & _ISLAND
    assert not model.npair
    assert not model.opt.disableflags & _ISLAND
    _roll(model, fast, 120)


_FREE = '<body name="ball" pos="1 0 0.5"><freejoint/><geom name="ball" size="0.1"/></body>'


@pytest.mark.parametrize(
    "parts",
    [
        {"other": _FREE},
        {"rest": '<tendon><fixed name="t"><joint joint="hip" coef="1"/></fixed></tendon>'},
        {"rest": '<equality><joint joint1="hip" joint2="knee"/></equality>'},
        {"other": '<body name="hand" mocap="true"><geom name="hand" size="0.1"/></body>'},
        {"rest": '<option><flag energy="enable"/></option>'},
        {"more": _BALL.format("bump", 'pos="0 0.2 0" conaffinity="0"')},
        {"fixed": _BALL.format("stone", 'pos="0.3 0 0"')},
        {"rest": '<contact><pair geom1="shin" geom2="trunk" friction="2 2 1 1 1"/></contact>'},
        {"legs": "", "trunk": ""},
        {"legs": f'{_SILENT} priority="1"'},
    ],
    ids=[
        *("two trees", "tendon", "equality", "mocap", "energy", "two geoms of a body"),
        *("two fixed geoms", "a pair", "bodies touch each other", "several priorities"),
    ],
)
def test_unsupported_models_have_no_fast_model(parts: dict[str, str]) -> None:
    """Unsupported elements, or an ambiguous order of contacts, prevent a fast model."""
    assert _fast_model_of(_scene(**parts))[1] is None


@pytest.mark.parametrize(
    ("add", "flag"),
    [(_stiff, _SPRING), (_undamped, _SPRING), (_rough, _FRICTION), (_sensing, _SENSOR)],
)
def test_only_unused_features_are_disabled(add: Any, flag: int) -> None:
    """Springs, friction and sensors are disabled only in models without them."""
    _, plain = _fast_model_of(_scene())
    spec = _scene()
    add(spec)
    model, fast = _fast_model_of(spec)
    assert plain is not None
    assert fast is not None
    assert plain.opt.disableflags & flag
    assert not fast.opt.disableflags & flag
    assert _roll(model, fast, 400) > 50


def test_a_contact_filter_prevents_a_fast_model() -> None:
    """Explicit pairs would bypass the filter."""
    mujoco.set_mjcb_contactfilter(lambda *_: 0)
    try:
        assert _fast_model_of(_scene(floor='friction="0.77 0.1 0.1"'))[1] is None
    finally:
        mujoco.set_mjcb_contactfilter(None)


@pytest.mark.parametrize(
    "change",
    [
        lambda model: model.pair_friction.__setitem__((3, 0), 0.9),
        lambda model: model.pair_solimp.__setitem__((12, 0), 0.89),
        lambda model: model.pair_gap.__setitem__(5, 0.3),
        lambda model: model.pair_margin.__setitem__(slice(None), 0.01),  # One geom's margin.
        lambda model: model.body_mass.__setitem__(4, 0.1),
        lambda model: setattr(model.opt, "iterations", 1),
        lambda model: setattr(model.opt, "jacobian", mujoco.mjtJacobian.mjJAC_SPARSE),
    ],
    ids=["friction", "impedance", "gap", "margins", "mass", "iterations", "sparse"],
)
def test_a_model_that_moves_differently_is_detected(change: Any) -> None:
    """`moves_equally` detects differences of a pair, a body and the solver."""
    ant = AntEnv()
    fast = copy.copy(find_fast_model(ant.model, ant.body_spec))
    assert moves_equally(ant.model, fast)
    change(fast)
    assert not moves_equally(ant.model, fast)


def test_envs_of_a_body_count_steps_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search starts after `patience` steps in total, and later envs reuse its result."""
    monkeypatch.setattr(AntEnv, "patience", 6)
    tuned.shared_by.cache_clear()
    envs = [AntEnv(), AntEnv(), AntEnv()]
    for env in envs:
        env.reset(seed=0)
    for step in range(4):
        for env in envs:
            env.step(np.zeros(8))
            assert env._bound.has_fast_model is (True if step >= 2 else None)
    late = AntEnv()
    late.reset(seed=0)
    late.step(np.zeros(8))
    assert late._bound.stepping is envs[0]._bound.stepping


def test_the_number_of_remembered_bodies_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """The most recent bodies are kept, with their fast models."""
    monkeypatch.setattr(tuned, "shared_by", lru_cache(2)(tuned.shared_by.__wrapped__))
    found = []
    for body in ("Ant", "BigAnt", "AmputatedAnt", "BigAnt", "Ant"):
        env = AntEnv(body)
        env.reset(seed=0)
        env.step(np.zeros(8))
        found.append(env._bound.stepping)
    assert found[1] is found[3]
    assert found[0] is not found[4]
    assert tuned.shared_by.cache_info().currsize == 2


def _roll(model: mujoco.MjModel, fast: mujoco.MjModel, steps: int) -> int:
    """Assert that both models move equally under random controls; return the contact count."""
    rng = np.random.default_rng(1)
    one, two = mujoco.MjData(model), mujoco.MjData(model)
    contacts = 0
    for _ in range(steps):
        one.ctrl[:] = two.ctrl[:] = rng.uniform(-1.0, 1.0, model.nu)
        mujoco.mj_step(model, one)
        mujoco.mj_step(fast, two)
        mujoco.mj_rnePostConstraint(model, one)
        mujoco.mj_rnePostConstraint(fast, two)
        assert one.qpos.tobytes() == two.qpos.tobytes()
        assert one.cfrc_ext.tobytes() == two.cfrc_ext.tobytes()
        contacts += one.ncon
    return contacts


def test_a_spec_of_another_model_gives_no_fast_model() -> None:
    """A fast model that is built from another model's spec moves differently and is rejected."""
    spec = _scene()
    model = spec.compile()
    heavier = spec.copy()
    heavier.geoms[-1].density = 2.0 * heavier.geoms[-1].density
    assert find_fast_model(model, lambda: heavier) is None
