"""Edits of the public model take effect at the next step or reset."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest

from shapechanger.envs.ant import AntEnv
from shapechanger.envs.stepping.tuned import ModelWatch, shared_by
from tests.envs.stepping.side_by_side import same

_MODEL = AntEnv().model
# Every array of the model except the pixels of textures.
_ARRAYS = [
    name
    for name in dir(_MODEL)
    if not name.startswith("_")
    and isinstance(getattr(_MODEL, name), np.ndarray)
    and getattr(_MODEL, name).size
    and getattr(_MODEL, name).dtype != object
    and name != "tex_data"
]

Edit = Callable[[Any], None]


def _gravity(model: Any) -> None:
    model.opt.gravity[2] = -3.0


def _timestep(model: Any) -> None:
    model.opt.timestep = 0.005


def _no_floor(model: Any) -> None:
    model.geom_contype[:] = 0
    model.geom_conaffinity[:] = 0


def _heavier(model: Any) -> None:
    model.body_mass[:] *= 2.0


# Tests below check that each single number is watched.
_EDITS: list[Edit] = [_gravity, _timestep, _no_floor, _heavier]


def _ants() -> tuple[AntEnv, AntEnv]:
    return AntEnv(), AntEnv(fast_model=False)


def _play(envs: tuple[Any, Any], steps: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        action = rng.uniform(-1.0, 1.0, envs[0].action_space.shape).astype(np.float32)
        one, other = (env.step(action) for env in envs)
        assert same(one, other)
        assert same(envs[0].data.qpos, envs[1].data.qpos)


@pytest.mark.parametrize("edit", _EDITS, ids=lambda edit: edit.__name__)
def test_an_edit_takes_effect(edit: Edit) -> None:
    """Edits take effect between and within episodes, until they are undone."""
    ours, _ = envs = _ants()
    kept = [(env.model, copy.copy(env.model)) for env in envs]
    for env in envs:
        env.reset(seed=0)
    _play(envs, 10, seed=0)
    assert ours._bound.has_fast_model
    before = ours.data.qpos.copy()
    for env in envs:
        edit(env.model)
    assert not ours._watch.unedited()
    _play(envs, 15, seed=1)
    for env in envs:
        env.reset(seed=1)
    _play(envs, 15, seed=2)
    for model, saved in kept:
        _restore(model, saved)
    assert ours._watch.unedited()
    _play(envs, 15, seed=3)
    assert not np.array_equal(before, ours.data.qpos)


def test_an_edit_before_the_first_step_takes_effect() -> None:
    """The fast model is searched only while the model is unedited."""
    shared_by.cache_clear()
    ours, theirs = envs = _ants()
    for env in envs:
        env.model.body_mass[1] *= 1.75
        env.reset(seed=0)
    _play(envs, 20, seed=0)
    assert ours._bound.has_fast_model is None
    for env in envs:
        env.model.body_mass[1] /= 1.75
    _play(envs, 20, seed=1)
    assert ours._bound.has_fast_model is True
    assert theirs._bound.has_fast_model is None


def test_a_replaced_model_is_stepped() -> None:
    """Replacing `model` and `data` takes effect."""
    envs = _ants()
    for env in envs:
        env.reset(seed=0)
    _play(envs, 5, seed=0)
    for env in envs:
        model = AntEnv("BigAnt").model
        env.model, env.data = model, mujoco.MjData(model)
        env.reset(seed=1)
    _play(envs, 10, seed=1)
    for env in envs:
        env.data = mujoco.MjData(env.model)
        env.reset(seed=2)
    _play(envs, 10, seed=2)


# Tests of `ModelWatch`.


@pytest.mark.parametrize("name", _ARRAYS)
def test_every_array_is_watched(name: str) -> None:
    """Changes of the first and last number of each array, and their undoing, are noticed."""
    watch = ModelWatch(_MODEL)
    flat = getattr(_MODEL, name).reshape(-1)
    for place in (0, -1):
        before = flat[place].copy()
        flat[place] = not before if flat.dtype == bool else _other(before, flat.dtype)
        assert not watch.unedited(), f"{name}[{place}]"
        flat[place] = before
        assert watch.unedited()


@pytest.mark.parametrize(
    ("part", "name"),
    [
        (part, name)
        for part in ("opt", "stat")
        for name in dir(getattr(_MODEL, part))
        if not name.startswith("_")
    ],
)
def test_every_option_and_statistic_is_watched(part: str, name: str) -> None:
    """Statistics are watched too, because the solver scales its tolerance by one."""
    watch, owner = ModelWatch(_MODEL), getattr(_MODEL, part)
    value = getattr(owner, name)
    before = np.copy(value)
    if isinstance(value, np.ndarray):
        value[-1] += 1
    else:
        setattr(owner, name, value + 1)
    assert not watch.unedited()
    if isinstance(value, np.ndarray):
        value[:] = before
    else:
        setattr(owner, name, before.item())
    assert watch.unedited()


def test_steps_and_resets_are_no_edits() -> None:
    """Steps and resets leave the model unedited; equal models have equal digests."""
    env = AntEnv()
    watch = ModelWatch(env.model)
    env.reset(seed=0)
    env.step(np.ones(8))
    assert watch.unedited()
    assert watch.digest == ModelWatch(AntEnv().model).digest
    assert watch.digest != ModelWatch(AntEnv("BigAnt").model).digest
    assert len({ModelWatch(AntEnv().model).digest for _ in range(20)}) == 1  # At any address.


def _other(value: Any, kind: np.dtype[Any]) -> Any:
    if kind.kind == "S":
        return b"x" if value != b"x" else b"y"
    return np.nextafter(value, np.inf, dtype=kind) if kind.kind == "f" else value ^ 1


def _restore(model: Any, original: Any) -> None:
    for name in _ARRAYS:
        getattr(model, name)[...] = getattr(original, name)
    for part in ("opt", "stat"):
        for name in dir(getattr(model, part)):
            if not name.startswith("_"):
                value = getattr(getattr(original, part), name)
                if isinstance(value, np.ndarray):
                    getattr(getattr(model, part), name)[:] = value
                else:
                    setattr(getattr(model, part), name, value)


@pytest.mark.parametrize("undone", [False, True])
def test_a_start_keeps_within_edited_limits(undone: bool) -> None:
    """Starts respect joint ranges that a user has edited, or the old ones if the edit is undone."""
    env = AntEnv(reset_noise_scale=1.0)
    env.reset(seed=0)
    before = env.model.jnt_range.copy()
    joint = env.model.joint("hip_1").id
    place = env.model.jnt_qposadr[joint]
    env.model.jnt_range[joint] = (0.11, 0.12)
    if undone:
        env.model.jnt_range[:] = before
    starts = [env.reset(seed=seed) and float(env.data.qpos[place]) for seed in range(20)]
    inside = [0.11 <= start <= 0.12 for start in starts]
    assert all(inside) is not undone
    assert all(before[joint, 0] <= start <= before[joint, 1] for start in starts)
