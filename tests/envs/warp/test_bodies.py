"""Bodies of worlds: rows of models, new bodies at resets, batches of several shapes."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch

import shapechanger
from shapechanger.envs.warp import WarpVectorEnv
from shapechanger.envs.warp.devices import mjw, wp
from shapechanger.envs.warp.worlds import device_body, differing_arrays
from shapechanger.errors import BadAction, UnknownName, VectorEnvError
from shapechanger.morphology import (
    AddSegment,
    Cut,
    Damping,
    Edit,
    Friction,
    Gear,
    Gravity,
    JointRange,
    Mass,
    Radius,
    Stiffness,
    Stretch,
)
from tests.envs.warp.side_by_side import OBSERVATION_TOLERANCE, apart, set_all

LONG = [Stretch("shank_*", 1.7), Mass("torso", 1.2), Friction("floor", 0.5)]


@pytest.fixture(scope="module")
def ants() -> Iterator[WarpVectorEnv]:
    envs = shapechanger.make_vec("Ant", 3, backend="warp", device="cpu")
    yield envs
    envs.close()


def model_rows(envs: WarpVectorEnv, name: str) -> Any:
    """Return an array of the device's model, one row per world."""
    rows = envs.batches[0].row(name)
    return rows.expand(envs.num_envs, *rows.shape[1:]).numpy()


def test_worlds_step_with_the_bodies_of_the_last_reset(ants: WarpVectorEnv) -> None:
    bodies: list[Any] = [LONG, "AmputatedAnt", [Gravity((0.0, 0.0, -4.0))]]
    ants.reset(seed=1, options={"bodies": bodies})
    alone: list[Any] = [gym.make("shapechanger/Ant-v1", body=body).unwrapped for body in bodies]
    for env in alone:
        env.reset(seed=0)
    qpos = ants.batches[0].qpos
    assert len({float(height) for height in qpos[:, 2]}) == 3
    states = [(env.init_qpos - 0.3 * np.eye(env.model.nq)[2], env.init_qvel) for env in alone]
    set_all(ants, alone, states)
    action = np.linspace(-1.0, 1.0, 8, dtype=np.float32)
    _, _, terminated, _, infos = ants.step(np.tile(action, (3, 1)))
    for i, env in enumerate(alone):
        observation, _, ended, *_ = env.step(action)
        assert apart(infos["final_obs"][i], observation) < OBSERVATION_TOLERANCE
        assert bool(terminated[i]) == ended


def test_a_body_with_other_arrays_is_refused(ants: WarpVectorEnv) -> None:
    """The message names the arrays and both bodies, and no world changes."""
    ants.reset(seed=0, options={"bodies": ["Ant", "BigAnt", "Ant"]})
    before = ants.bodies
    sentence = r"body ExtendedAnt cannot join the batch of .*, body Ant, because nq, .* differ"
    with pytest.raises(VectorEnvError, match=sentence):
        ants.reset(options={"bodies": ["AmputatedAnt", "Ant", "ExtendedAnt"]})
    assert ants.bodies == before
    mask = torch.tensor([True, False, False])
    with pytest.raises(VectorEnvError, match="1 worlds that start again and 2 bodies"):
        ants.reset(options={"bodies": ["Ant", "Ant"], "reset_mask": mask})
    with pytest.raises(UnknownName, match="No body matches 'nose'"):
        ants.reset(options={"bodies": [[Stretch("nose", 2.0)], "Ant", "Ant"]})
    with pytest.raises(UnknownName, match="Did you mean 'bodies'"):
        ants.reset(options={"body": "Ant"})


@pytest.mark.parametrize(
    "edit",
    [
        Stretch("shank_*", 1.3),
        Radius("shank_1", 1.5),
        Cut("shank_4", 0.25),
        Mass("torso", 2.0),
        Friction("floor", 0.3),
        Gear("*", 80.0),
        JointRange("ankle_1", 0.6, 1.0),
        Damping("hip_*", 2.0),
        Stiffness("hip_1", 3.0),
        Gravity((0.0, 0.0, -3.7)),
        AddSegment("shank_1", "foot_1", (0.2, 0.2, 0.0), -0.5, 0.5, 100.0),
    ],
    ids=lambda edit: type(edit).__name__,
)
def test_bodies_share_a_batch_if_mujoco_warp_can_share_their_arrays(edit: Edit) -> None:
    """Bodies without differing arrays have equal models, except for the rows of each world."""
    plain: Any = gym.make("shapechanger/Ant-v1").unwrapped
    edited: Any = gym.make("shapechanger/Ant-v1", body=edit).unwrapped
    bodies = [device_body("", env.model, {}) for env in (plain, edited)]
    fits = not differing_arrays(*bodies)
    assert fits == (not isinstance(edit, AddSegment))
    if not fits:
        return
    one, other = mjw.put_model(plain.model), mjw.put_model(edited.model)
    for field in dataclasses.fields(mjw.Model):
        left, right = getattr(one, field.name), getattr(other, field.name)
        if field.name in ("dof_length", "site_size"):
            continue  # Only sleeping bodies and sensors read these.
        if isinstance(left, int | bool):
            assert left == right, field.name
        elif isinstance(left, wp.array) and field.type.shape[0] != "*":
            assert np.array_equal(left.numpy(), right.numpy()), field.name


def test_bodies_with_and_without_a_kind_of_force_share_no_batch() -> None:
    """A fluid, or a friction in joints, needs a separate batch if others have none."""
    plain, wet, rough = (gym.make("shapechanger/Ant-v1").unwrapped.model for _ in range(3))
    wet.opt.density = 3.0
    rough.dof_frictionloss[:] = 0.1
    base, *others = (device_body("", model, {}) for model in (plain, wet, rough))
    names = [differing_arrays(base, other) for other in others]
    assert names == [["has_fluid"], ["zeros of dof_frictionloss"]]


def test_bodies_of_other_shapes_form_batches() -> None:
    """If spaces differ, there is one tensor of observations or actions per batch, not per world."""
    bodies, more = ["ExtendedAnt", "BigAnt", "ExtendedAnt"], {"max_episode_steps": 2}
    envs = shapechanger.make_vec("Ant", 3, backend="warp", device="cpu", bodies=bodies, **more)
    assert [batch.numbers.tolist() for batch in envs.batches] == [[0, 2], [1]]
    observations, infos = envs.reset(seed=0)
    assert [part.shape for part in observations] == [(2, 137), (1, 105)]
    assert infos["x_position"].shape == (3,)
    actions = [torch.zeros(2, 12), torch.zeros(1, 8)]
    envs.step(actions)
    observations, rewards, _, truncated, infos = envs.step(actions)
    assert truncated.all()
    assert rewards.shape == (3,)
    assert [part.shape for part in infos["final_obs"]] == [(2, 137), (1, 105)]
    assert envs.observation_space.contains(tuple(part.numpy() for part in observations))
    with pytest.raises(BadAction, match="a sequence of 2 tensors, one per batch"):
        envs.step(torch.zeros(3, 8))
    with pytest.raises(BadAction, match=r"actions of batch 1 must be numbers of shape \(1, 8\)"):
        envs.step([torch.zeros(2, 12), torch.zeros(2, 8)])
    envs.close()


def test_bodies_of_other_shapes_and_equal_spaces_share_tensors() -> None:
    """Worlds of two batches with the same spaces are rows of one tensor, in the worlds' order."""
    bound = [JointRange("free_body_rot", -2.0, 2.0)]
    envs = shapechanger.make_vec(
        "Swimmer", 3, backend="warp", device="cpu", bodies=["Swimmer", bound, "Swimmer"]
    )
    assert [batch.numbers.tolist() for batch in envs.batches] == [[0, 2], [1]]
    observations, _ = envs.reset(seed=[3, 3, 4])
    assert observations.shape == (3, 8)
    one = shapechanger.make_vec("Swimmer", 1, backend="warp", device="cpu")
    assert torch.equal(one.reset(seed=4)[0][0], observations[2])
    with pytest.raises(VectorEnvError, match=r"because jnt_limited, .* differ"):
        envs.reset(options={"bodies": ["Swimmer", "Swimmer", bound]})


def test_a_pool_gives_each_episode_one_of_its_bodies() -> None:
    """Seed and episode of a world determine its body, and the world is simulated with it."""
    pool: list[Any] = ["Ant", LONG, "BigAnt"]
    made = [
        shapechanger.make_vec(
            "Ant", 4, backend="warp", device="cpu", pool=pool, max_episode_steps=2
        )
        for _ in range(2)
    ]
    compiled = {
        tuple(made[0]._reader.body(body)): gym.make("shapechanger/Ant-v1", body=body).unwrapped
        for body in pool
    }
    seen: list[list[Any]] = []
    for envs in made:
        seen.append([])
        envs.reset(seed=5)
        for _ in range(8):
            seen[-1].append(envs.bodies)
            for i, body in enumerate(envs.bodies):
                model: Any = compiled[tuple(body)].model
                np.testing.assert_allclose(
                    model_rows(envs, "geom_size")[i], model.geom_size, rtol=1e-6
                )
            envs.step(torch.zeros(4, 8))
    assert seen[0] == seen[1]
    assert {tuple(body) for bodies in seen[0] for body in bodies} == set(compiled)
    # Between restarts bodies stay.
    assert seen[0][0] == seen[0][1] != seen[0][2]
    with pytest.raises(VectorEnvError, match="draw their bodies from a pool"):
        made[0].reset(options={"bodies": [*pool, "Ant"]})


def test_a_pool_of_several_shapes_draws_within_each() -> None:
    """A world draws only bodies with the spaces that it was made with."""
    envs = shapechanger.make_vec(
        "Ant", 2, backend="warp", device="cpu", pool=["Ant", "ExtendedAnt", "BigAnt"]
    )
    assert [len(batch.bodies) for batch in envs.batches] == [2, 1]
    for seed in range(4):
        envs.reset(seed=seed)
        assert [len(body) > 1 for body in envs.bodies] == [False, True]
    with pytest.raises(VectorEnvError, match=r"form 2 batches.* there are 1 worlds, so make more"):
        shapechanger.make_vec("Ant", 1, backend="warp", device="cpu", pool=["Ant", "ExtendedAnt"])


@pytest.mark.parametrize("limit", ["njmax", "nconmax"])
def test_too_little_memory_for_contacts_or_constraints_gives_a_warning(limit: str) -> None:
    arguments: Any = {limit: 1}
    envs = shapechanger.make_vec("Ant", 2, backend="warp", device="cpu", **arguments)
    envs.reset(seed=0)
    envs._steps = 254  # Overflows are checked every 256 steps.
    envs.batches[0].qpos[:, 2] = 0.1
    envs.step(torch.zeros(2, 8))
    with pytest.warns(UserWarning, match=f"2 worlds had more .*{limit}=1 .*memory for"):
        envs.step(torch.zeros(2, 8))


def test_there_is_memory_for_the_worst_case(ants: WarpVectorEnv) -> None:
    """Each of an ant's capsules can touch the floor at both ends, with a pyramid of four rows."""
    model: Any = gym.make("shapechanger/Ant-v1").unwrapped.model
    capsules = int((model.geom_type == 3).sum())
    limits = ants.batches[0].limits
    assert limits["nconmax"] >= 2 * capsules + 1
    assert limits["njmax"] >= 4 * (2 * capsules + 1) + 8
