"""The argument `body=`, and changes of the body at a reset."""

from __future__ import annotations

import contextlib
import copy
import math
import pickle
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import gymnasium.envs.mujoco
import mujoco
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from shapechanger.envs import CATALOGUE
from shapechanger.envs.ant import ANT, LEGS
from shapechanger.errors import (
    BrokenModel,
    EnvArgumentError,
    MorphologyError,
    SpaceMismatch,
    UnknownName,
)
from shapechanger.morphology import (
    AddSegment,
    Cut,
    Gear,
    JointRange,
    Lock,
    Mass,
    Remove,
    Split,
    Stretch,
    from_json,
    to_json,
)
from shapechanger.morphology.certificate import fingerprint
from shapechanger.morphology.families import BodyLike
from tests.morphology.models import ant as ant_spec
from tests.morphology.models import built, posed

_BIG = (Stretch("shank_*", 2.0),)
_OTHER = (Stretch("shank_*", 1.5), Cut("shank_4", 0.25), Gear("hip_1", to=40.0))


def _compiled(model: mujoco.MjModel) -> bytes:
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def _model(env_id: str, **arguments: Any) -> mujoco.MjModel:
    with contextlib.closing(gym.make(env_id, **arguments)) as env:
        return env.unwrapped.model


def _everything(env: Any) -> dict[str, Any]:
    """Return all attributes of an env that depend on its body, and the state."""
    return {
        "body": env.body,
        "model": _compiled(env.model),
        "layouts": (env.observation_layout, env.action_layout),
        "spaces": (env.observation_space, env.action_space),
        "pose": env.init_qpos.tolist(),
        "velocity": env.init_qvel.tolist(),
        "standing": env.standing_height,
        "healthy": getattr(env, "healthy_z_range", None),
        "spec": env.spec.to_json(),
        "state": env.state_vector().tolist(),
        "rng": env.np_random.bit_generator.state,
    }


def _episode(env: Any, seed: int) -> list[np.ndarray]:
    observation, _ = env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    seen = [observation]
    for _ in range(20):
        seen.append(env.step(rng.uniform(-1.0, 1.0, env.action_space.shape))[0])
    return seen


@pytest.fixture
def ant() -> Iterator[Any]:
    with gym.make("shapechanger/Ant-v1") as env:
        env.reset(seed=5)
        yield env


# Making an env.


@pytest.mark.parametrize(
    "body",
    [
        "BigAnt",
        _BIG[0],
        _BIG,
        list(_BIG),
        '[{"edit": "stretch", "body": "shank_*", "factor": 2.0}]',
        ' {"edit": "stretch", "body": "shank_*", "factor": 2}',
        iter(_BIG),
    ],
    ids=["name", "edit", "tuple", "list", "JSON list", "JSON object", "iterator"],
)
def test_a_body_is_given_in_any_form(body: BodyLike) -> None:
    """Names, edits, iterables of edits and JSON give the same model."""
    with gym.make("shapechanger/Ant-v1", body=body) as env:
        assert env.unwrapped.body == _BIG
        model = env.unwrapped.model
    assert fingerprint(model) == fingerprint(_model("shapechanger/BigAnt-v1"))


@pytest.mark.parametrize(
    ("body", "error", "sentence"),
    [
        ("BigAnd", UnknownName, "body of the family Ant matches 'BigAnd'. Did you mean 'BigAnt'"),
        ("BigInvertedPendulum", UnknownName, "There are: Ant, AmputatedAnt, BigAnt, ExtendedAnt"),
        ("", UnknownName, "body of the family Ant matches ''"),
        (Stretch("shank_5", 2.0), UnknownName, "No body matches 'shank_5'. Did you mean 'shank_"),
        ('{"edit": "strech", "body": "a"}', UnknownName, "'strech'. Did you mean 'stretch'"),
        ('{"edit": "stretch", "faktor": 2}', UnknownName, "'faktor'. Did you mean 'factor'"),
        ("[1, 2]", MorphologyError, "A body is made of edits"),
        ("[", MorphologyError, "JSON list of edits"),
        (7, MorphologyError, "made of edits such as Stretch"),
        (None, MorphologyError, "made of edits such as Stretch"),
        (Cut("torso", 0.5), MorphologyError, "'torso' is the trunk"),
        (Mass("shank_1", to=1e-18), BrokenModel, "MuJoCo cannot compile the body .*mass"),
    ],
)
def test_an_invalid_body_is_refused(
    ant: Any, body: Any, error: type[Exception], sentence: str
) -> None:
    """Errors at `make` and `reset` state what is wrong; the env does not change."""
    with pytest.raises(error, match=sentence):
        gym.make("shapechanger/Ant-v1", body=body)
    before = _everything(ant.unwrapped)
    with pytest.raises(error, match=sentence):
        ant.reset(seed=99, options={"body": body})
    assert _everything(ant.unwrapped) == before


# Rebuilding an env.


@pytest.mark.parametrize("env_id", CATALOGUE)
def test_the_spec_and_a_pickle_make_the_same_model(env_id: str) -> None:
    with gym.make(env_id) as env:
        same = _compiled(env.unwrapped.model)
        rebuilt = [
            gym.make(EnvSpec.from_json(env.spec.to_json())),
            pickle.loads(pickle.dumps(env)),
            pickle.loads(pickle.dumps(env.unwrapped)),
            copy.deepcopy(env),
        ]
    for again in rebuilt:
        assert _compiled(again.unwrapped.model) == same
        again.close()


def test_the_spec_holds_the_body_as_json() -> None:
    arguments = {"healthy_z_range": (0.1, 3.0), "ctrl_cost_weight": 0.125, "fast_model": False}
    with gym.make("shapechanger/Ant-v1", body=_OTHER, **arguments) as env:
        assert env.spec.kwargs == {"body": to_json(_OTHER), **arguments}
        model = env.unwrapped.model
        again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.body == from_json(again.spec.kwargs["body"]) == _OTHER
    assert _compiled(again.unwrapped.model) == _compiled(model)
    assert tuple(again.unwrapped.healthy_z_range) == (0.1, 3.0)
    with pickle.loads(pickle.dumps(again)) as copied:
        assert copied.unwrapped.fast_model is False
        for x, y in zip(_episode(copied, 1), _episode(again, 1), strict=True):
            np.testing.assert_array_equal(x, y)
    again.close()


def test_an_assigned_spec_is_not_modified() -> None:
    spec = gym.spec("shapechanger/BigAnt-v1")
    with gym.make("shapechanger/Ant-v1") as env:
        env.unwrapped.spec = spec
        env.reset(seed=0, options={"body": "AmputatedAnt"})
        assert env.unwrapped.spec.kwargs == {"body": to_json((Cut("shank_4", 0.25),))}
        env.unwrapped.spec = None
        env.reset(seed=0, options={"body": "Ant"})
        assert env.unwrapped.spec is None
    assert spec.kwargs == {"body": "BigAnt"}


# Changing the body at a reset.


@pytest.mark.parametrize("body", ["BigAnt", "AmputatedAnt", _OTHER], ids=["big", "cut", "other"])
def test_everything_follows_the_body(ant: Any, body: BodyLike) -> None:
    observation, _ = ant.reset(seed=6, options={"body": body})
    with gym.make("shapechanger/Ant-v1", body=body) as made:
        expected, _ = made.reset(seed=6)
        np.testing.assert_array_equal(observation, expected)
        mine, theirs = _everything(ant.unwrapped), _everything(made.unwrapped)
        assert mine == theirs
        for x, y in zip(_episode(ant, 7), _episode(made, 7), strict=True):
            np.testing.assert_array_equal(x, y)
        for again in (pickle.loads(pickle.dumps(ant)), pickle.loads(pickle.dumps(ant.unwrapped))):
            assert _compiled(again.unwrapped.model) == _compiled(made.unwrapped.model)
            again.close()


@pytest.mark.parametrize("factor", [0.3, 0.5, 0.75, 0.9])
def test_small_ants_land_from_their_start(factor: float) -> None:
    with gym.make("shapechanger/Ant-v1", body=Stretch("shank_*", factor)) as env:
        env.action_space.seed(0)
        for seed in range(10):
            env.reset(seed=seed)
            for _ in range(20):
                assert not env.step(np.zeros(8))[2]


def test_heights_and_ranges_follow_the_body(ant: Any) -> None:
    env = ant.unwrapped
    small, data, model = env.standing_height, env.data, env.model
    ant.reset(seed=0, options={"body": (*_BIG, JointRange("hip_1", -0.1, 0.2))})
    assert env.standing_height > 1.5 * small
    assert env.healthy_z_range == (-math.inf, 1.9 * env.standing_height)
    hip = env.observation_layout["hip_1/angle"]
    assert (hip.low, hip.high) == (-0.1, 0.2)
    assert env.data is not data
    assert env.model is not model
    ant.reset(options={"body": Gear("hip_4", 0.5)})
    assert env.action_layout["hip_4/motor"].gain == 75.0
    assert env.standing_height == small


def test_the_body_stays_until_it_is_changed(ant: Any) -> None:
    """Resets without a body keep it; an equal body is not compiled again."""
    ant.reset(options={"body": "BigAnt"})
    model = ant.unwrapped.model
    for options in (None, {}, {"body": "BigAnt"}, {"body": _BIG[0]}):
        ant.reset(options=options)
        assert ant.unwrapped.body == _BIG
        assert ant.unwrapped.model is model
    ant.reset(options={"body": "Ant"})
    assert _compiled(ant.unwrapped.model) == _compiled(_model("shapechanger/Ant-v1"))


def _pendulum_with_a_motor_on_its_hinge(folder: Path) -> str:
    assets = Path(gymnasium.envs.mujoco.__file__).parent / "assets"
    text = (assets / "inverted_pendulum.xml").read_text()
    changed = text.replace('joint="slider"', 'joint="hinge"').replace(
        'name="slide"', 'name="hinge"'
    )
    path = folder / "driven.xml"
    path.write_text(changed)
    return str(path)


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("ExtendedAnt", "the observation space from 105 to 137 numbers, such as foot_1/angle, "),
        (Remove("aux_2"), "the observation space from 105 to 89 numbers, such as ankle_2/angle"),
        (Lock("ankle_1"), "space from 105 to 103 numbers, such as ankle_1/angle, ankle_1/velo"),
    ],
    ids=["more segments", "one leg less", "one joint less"],
)
def test_a_body_of_other_spaces_is_refused(ant: Any, body: BodyLike, sentence: str) -> None:
    """The error lists lost and gained features, and the env does not change."""
    before = _everything(ant.unwrapped)
    with pytest.raises(SpaceMismatch, match=f"{sentence}.*make another env with this body"):
        ant.reset(seed=99, options={"body": body})
    assert _everything(ant.unwrapped) == before
    with gym.make("shapechanger/Ant-v1") as fresh:
        fresh.reset(seed=5)
        action = np.full(8, 0.3, np.float32)
        np.testing.assert_array_equal(ant.step(action)[0], fresh.step(action)[0])


_FEET = [AddSegment(f"shank_{leg}", f"foot_{leg}", (0.1, 0.1, 0.0), gear=9.0) for leg in (1, 4)]
_WEAKER = (Lock("hinge"), Split("pole", "hinge", lower=-1.0, upper=1.0, gear=9.0, axis=(0, 1, 0)))


@pytest.mark.parametrize(
    ("name", "arguments", "body", "sentence"),
    [
        ("ExtendedAnt", {}, "ExtendedAntPassive", "from 12 to 8 numbers, such as foot_1"),
        ("Ant", {"body": _FEET}, _FEET[::-1], "from 10 to 10 numbers, such as foot_1"),
        ("InvertedPendulum", {}, _WEAKER, "from 1 to 1 numbers, such as hinge/motor"),
    ],
)
def test_other_motors_are_refused(
    name: str, arguments: dict[str, Any], body: Any, sentence: str, tmp_path: Path
) -> None:
    if name == "InvertedPendulum":
        arguments = {"xml_file": _pendulum_with_a_motor_on_its_hinge(tmp_path)}
    with gym.make(f"shapechanger/{name}-v1", **arguments) as env:
        env.reset(seed=0)
        before = env.unwrapped.action_layout  # type: ignore[attr-defined]
        with pytest.raises(SpaceMismatch, match=f"action space {sentence}"):
            env.reset(options={"body": body})
        assert env.unwrapped.action_layout == before  # type: ignore[attr-defined]
        env.step(env.action_space.sample())


def test_a_custom_model_can_be_edited(tmp_path: Path) -> None:
    """`xml_file` replaces the model that bodies edit, in copies too."""
    driven = _pendulum_with_a_motor_on_its_hinge(tmp_path)
    with gym.make("shapechanger/BigInvertedPendulum-v1", xml_file=driven) as env:
        assert env.unwrapped.action_layout.names == ("hinge/motor",)
        model = _compiled(env.unwrapped.model)
        again = pickle.loads(pickle.dumps(env))
    assert _compiled(again.unwrapped.model) == model
    again.close()


@pytest.mark.parametrize(
    ("env_id", "arguments", "sentence"),
    [
        ("Ant", {"fast_modell": False}, "Did you mean 'fast_model'?"),
        ("Ant", {"ctrl_cost_weight": "x"}, "Ant: ctrl_cost_weight must be a number, got 'x'."),
        ("Ant", {"healthy_z_range": 0.3}, "Ant: healthy_z_range must be two numbers, got 0.3."),
        ("Hopper", {"healthy_z_range": "ab"}, "Hopper: healthy_z_range must be two numbers"),
        ("HalfCheetah", {"fast_model": 1}, "HalfCheetah: fast_model must be True or False, got 1."),
        ("InvertedPendulum", {"frame_skip": True}, "frame_skip must be a number, got True."),
    ],
)
def test_an_unknown_argument_or_one_of_another_type_is_refused(
    env_id: str, arguments: dict[str, Any], sentence: str
) -> None:
    """The error names the env, the argument and the expected type, or the nearest spelling."""
    with pytest.raises((EnvArgumentError, UnknownName), match=re.escape(sentence)):
        gym.make(f"shapechanger/{env_id}-v1", **arguments)
    env = gym.make(f"shapechanger/{env_id}-v1")
    with env, pytest.raises(UnknownName, match=r"Did you mean 'body'\?"):
        env.reset(options={"boddy": env_id})


@pytest.mark.parametrize("seed", [-1, 1.5, True, "3", [3]])
def test_invalid_seeds_are_refused(seed: Any) -> None:
    """An invalid seed is refused before the env changes; NumPy integers are valid."""
    with contextlib.closing(gym.make("shapechanger/Ant-v1", disable_env_checker=True)) as env:
        with pytest.raises(EnvArgumentError, match="A seed must be a whole number from 0, got "):
            env.reset(seed=seed)
        with pytest.raises(EnvArgumentError, match="A seed must be a whole number from 0, got "):
            env.unwrapped.drawn_bodies(2, seed, "training")  # type: ignore[attr-defined]
        same = [env.reset(seed=cast("Any", one))[0] for one in (2**63, np.uint64(2**63))]
        np.testing.assert_array_equal(*same)


def test_legs_are_in_the_order_of_the_motors() -> None:
    """`LEGS` has the order of the motors and the directions of the legs."""
    model = built(ant_spec())
    motors = [model.actuator(i).name for i in range(model.nu)]
    assert motors == [f"{joint}_{leg}" for leg in LEGS for joint in ("hip", "ankle")]
    data = posed(model)
    for leg, (x, y) in LEGS.items():
        place = data.body(f"shank_{leg}").xpos
        assert (np.sign(place[0]), np.sign(place[1])) == (x, y)
    extended = built(ant_spec(), *ANT.body("ExtendedAnt"))
    assert [extended.actuator(i).name for i in range(8, 12)] == [f"foot_{leg}" for leg in LEGS]
