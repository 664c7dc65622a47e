"""Fingers on a device compared with CPU envs, for many motors, tendons, delays and paths."""

from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from numpy.typing import NDArray

import shapechanger
from shapechanger.envs.warp import WarpVectorEnv
from shapechanger.envs.warp.devices import as_torch
from shapechanger.errors import FingerError, UnknownName, VectorEnvError
from shapechanger.finger.gap import GAPS
from shapechanger.finger.parameters import NOMINAL, CommandPath, FingerParameters
from shapechanger.finger.paths import FingertipPath
from shapechanger.finger.plant import JointVelocities
from shapechanger.finger.postures import draw_posture, draw_start
from shapechanger.finger.reach import FingerReachEnv
from shapechanger.finger.task import fingertip
from shapechanger.finger.track import FingerTrackEnv
from tests.envs.warp.side_by_side import OBSERVATION_TOLERANCE, REWARD_TOLERANCE, apart, names_of

ROUNDS = 3


def sway(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points of an open path, m, (n, 3)."""
    return np.column_stack([np.full_like(t, 0.05), 0.01 * np.sin(3.0 * t), np.full_like(t, -0.045)])


def drawn(count: int, gap: str = "wide") -> list[FingerParameters]:
    rng = np.random.default_rng(7)
    fingers = [GAPS[gap].draw(rng) for _ in range(count)]
    return [finger.replace(joint_noise=0.0, tension_noise=0.0) for finger in fingers]


OTHER = NOMINAL.replace(
    joint_stiffness=(0.05, 0.03, 0.03, 0.01), joint_damping=(0.02, 0.01, 0.01, 0.004),
    joint_friction=(0.002, 0.001, 0.001, 0.0005), least_tension=0.8, motor_lag=0.03,
    most_tension=(20.0, 25.0, 7.0, 22.0, 6.0, 20.0, 24.0), motor_kg=0.03, tendon_damping=3.0,
)  # fmt: skip
PATH = CommandPath(slew_per_s=20.0, slew_down_per_s=5.0)
QUANTISED = CommandPath(slew_per_s=3.0, tension_step=0.3)

# The fingers of each batch, and the arguments of their env.
KINDS: dict[str, tuple[list[Any], dict[str, Any]]] = {
    "plain": ([None, "an-1983", OTHER], {}),
    "weights": (
        [OTHER.replace(tendon_friction=0.4), {"tendon_friction": 0.9}],
        {"actions": "tension", "reward": {"change": 5.0, "effort": 2.0}},
    ),
    "lengths": ([None, "an-1983", OTHER], {"actions": "length"}),
    "late": ([{"command_delay": 0.0061}, {"command_delay": 0.0129}], {}),
    "stretched": ([{"tendon_stiffness": 8e3}, {"tendon_stiffness": 5e3, "backlash": 4e-4}], {}),
    "path": ([{"path": PATH}, OTHER.replace(path=QUANTISED)], {}),
    "path of lengths": ([{"path": QUANTISED}, {"path": PATH}], {"actions": "length"}),
    "rigs": (drawn(4), {}),
    "circles": ([None, OTHER], {"task": "FingerTrack"}),
    "open paths": (drawn(2), {"task": "FingerTrack", "path": FingertipPath(sway, 1.0, False)}),
}


def fingers(count: int, **arguments: Any) -> WarpVectorEnv:
    return shapechanger.make_vec("Finger", count, backend="warp", device="cpu", **arguments)


def many(kind: str) -> tuple[WarpVectorEnv, list[Any]]:
    """Return fingers on the CPU device, and the CPU env of each."""
    bodies, arguments = KINDS[kind]
    task, rest = arguments.get("task", "Finger"), arguments | {"task": None}
    del rest["task"]
    worlds = shapechanger.make_vec(
        task, len(bodies), backend="warp", device="cpu", bodies=bodies, **rest
    )
    env_id = f"shapechanger/{task}-v1"
    return worlds, [gym.make(env_id, parameters=body, **rest).unwrapped for body in bodies]


def start_alike(worlds: WarpVectorEnv, alone: list[Any], seed: int) -> list[Any]:
    """Start the same episodes in worlds and CPU envs; return observation and info of each env."""
    _, infos = worlds.reset(seed=seed)
    batch: Any = worlds.batches[0]
    begun: list[Any] = []
    for i, env in enumerate(alone):
        options = {"posture": batch.qpos[i, :4].double().numpy()}
        if isinstance(env, FingerReachEnv):
            target = infos["target"][i].double().numpy()
            begun.append(env.reset(seed=seed, options={**options, "target": target}))
            continue
        env.reset(seed=seed, options=options)
        env._t = batch._times[i]
        env._look()
        begun.append((env._observation(env._senses), env._info()))
    return begun


def copy_states(worlds: WarpVectorEnv, alone: list[Any]) -> None:
    """Copy the states of CPU envs to the worlds, and round the CPU states to single precision."""
    batch: Any = worlds.batches[0]
    for i, env in enumerate(alone):
        data = env.plant.data
        for name in ("qpos", "qvel", "act", "ctrl", "history"):
            there, here = getattr(batch, name)[i], getattr(data, name)
            there[:] = torch.as_tensor(here)
            here[:] = there.double().numpy()
        batch.time[i] = data.time
        warm = as_torch(batch._data.qacc_warmstart)
        warm[i] = torch.as_tensor(data.qacc_warmstart)
        batch._commands[i] = torch.as_tensor(env._senses.commands)
        if isinstance(env, FingerReachEnv):
            batch._target[i] = torch.as_tensor(env._target)
            batch._near[i] = env._steps_near
        else:
            batch._times[i], batch._steps[i] = env._t, env._steps
            batch._squares[i] = env._squares
        if env.plant.held is not None:
            batch._shares[i] = torch.as_tensor(env.plant.held._now)


def require_equal(results: Any, alone: list[Any], actions: Any) -> Any:
    """Require that CPU envs have the results of worlds in a step; return the infos."""
    observations, rewards, terminated, truncated, infos = results
    assert not terminated.any()
    assert not truncated.any()
    for i, env in enumerate(alone):
        observation, reward, ended, _, info = env.step(actions[i])
        assert apart(observations[i], observation) < OBSERVATION_TOLERANCE
        assert apart(rewards[i], reward) < REWARD_TOLERANCE
        assert not ended
        assert names_of(infos) == set(info)
        for name, value in info.items():
            assert apart(infos[name][i], value) < REWARD_TOLERANCE, name
            assert infos[f"_{name}"].all()
    return infos


@pytest.fixture(scope="module", params=KINDS)
def pair(request: pytest.FixtureRequest) -> Iterator[tuple[WarpVectorEnv, list[Any]]]:
    """Fingers that share a batch, and the CPU env of each."""
    worlds, alone = many(request.param)
    assert len(worlds.batches) == 1
    yield worlds, alone
    worlds.close()


def test_a_step_from_the_same_state_has_the_same_results(
    pair: tuple[WarpVectorEnv, list[Any]],
) -> None:
    worlds, alone = pair
    assert worlds.observation_layout == alone[0].observation_layout
    assert worlds.action_layout == alone[0].action_layout
    assert worlds.single_action_space == alone[0].action_space
    rng = np.random.default_rng(0)
    shape = (len(alone), 7)
    for _ in range(ROUNDS):
        start_alike(worlds, alone, int(rng.integers(1000)))
        for _ in range(5):
            for env, action in zip(alone, rng.uniform(-1.2, 1.2, shape), strict=True):
                env.step(action.astype(np.float32))
        if isinstance(alone[0], FingerTrackEnv):
            alone[0]._steps, alone[0]._squares = 40, 15 * 0.002**2
        else:  # The next step at the target is the tenth, which is a success.
            alone[0]._target, alone[0]._steps_near = alone[0].plant.fingertip, 9
        copy_states(worlds, alone)
        actions = rng.uniform(-1.2, 1.2, shape).astype(np.float32)
        require_equal(worlds.step(actions), alone, actions)


@pytest.mark.parametrize("kind", ["plain", "rigs", "circles", "open paths"])
def test_an_episode_from_the_same_start_is_the_same(kind: str) -> None:
    worlds, alone = many(kind)
    rng = np.random.default_rng(1)
    begun = start_alike(worlds, alone, 3)
    observations, infos = worlds.reset(seed=3)
    for i, (observation, info) in enumerate(begun):
        assert apart(observations[i], observation) < OBSERVATION_TOLERANCE
        assert names_of(infos) == set(info)
        for name, value in info.items():
            assert apart(infos[name][i], value) < REWARD_TOLERANCE, name
    if kind == "circles":  # Starts are spread over closed paths.
        times = worlds.batches[0]._times  # pyright: ignore[reportAttributeAccessIssue]
        assert 0.0 <= times.min() < times.max() < alone[0].path.duration_s
    for _ in range(30 if kind == "circles" else 8):
        actions = rng.uniform(-1.0, 1.0, (len(alone), 7)).astype(np.float32)
        require_equal(worlds.step(actions), alone, actions)


def test_starts_and_targets_have_the_distribution_of_the_cpu() -> None:
    worlds = fingers(8)
    found: list[Any] = []
    worlds.reset(seed=0)
    for _ in range(60):
        observations, infos = worlds.reset()
        found.append(torch.cat([observations[:, :4], infos["target"]], dim=1))
    rng = np.random.default_rng(0)
    places = [fingertip(draw_posture(rng)) for _ in range(4000)]
    starts = [draw_start(rng) for _ in range(4000)]
    expected = np.concatenate([starts, places], axis=1)
    rows = torch.cat(found).numpy()
    spread = expected.std(axis=0)
    quantiles = [0.02, 0.25, 0.5, 0.75, 0.98]
    apart_by = np.quantile(rows, quantiles, axis=0) - np.quantile(expected, quantiles, axis=0)
    assert (np.abs(apart_by) < 0.25 * spread).all()
    np.testing.assert_allclose(rows.std(axis=0), spread, rtol=0.12)


def noisy(seed: int, steps: int, **noise: float) -> tuple[Any, Any]:
    """Return observations (steps + 1, 2, 38) of two noisy fingers, and their true angles."""
    worlds = fingers(2, parameters=noise, max_episode_steps=1000)
    seen = [worlds.reset(seed=seed)[0]]
    true = [worlds.batches[0].qpos.clone()]
    for _ in range(steps):
        seen.append(worlds.step(torch.zeros(2, 7))[0])
        true.append(worlds.batches[0].qpos.clone())
    return torch.stack(seen).double().numpy(), torch.stack(true).double().numpy()


def test_noisy_sensors() -> None:
    """Noise has the size of the parameters, and velocities are estimated as on a CPU."""
    seen, true = noisy(0, 50, joint_noise=0.02, tension_noise=0.1)
    errors = seen[..., :4] - true
    assert errors.std() == pytest.approx(0.02, rel=0.12)
    assert abs(errors.mean()) < 0.004
    assert abs(np.corrcoef(errors[1:].ravel(), errors[:-1].ravel())[0, 1]) < 0.2
    exact, _ = noisy(0, 50, joint_noise=0.02)
    errors = seen[..., 8:15] - exact[..., 8:15]
    assert errors.std() == pytest.approx(0.1, rel=0.12)
    assert seen[..., 8:15].min() >= 0.0
    for finger in range(2):
        velocities = JointVelocities()
        for step in range(len(seen)):
            angles = seen[step, finger, :4]
            np.testing.assert_allclose(
                seen[step, finger, 4:8], velocities.of(angles), rtol=1e-4, atol=1e-4
            )
            places = fingertip(angles)
            np.testing.assert_allclose(seen[step, finger, 29:32], places, atol=1e-6)


@pytest.mark.parametrize(
    "parameters",
    [{"path": PATH}, {"command_delay": 0.0061, "joint_noise": 0.01}],
    ids=["path", "late and noisy"],
)
def test_time_limits_restart_fingers_alone(parameters: Any) -> None:
    worlds = fingers(2, parameters=parameters)
    assert worlds.max_episode_steps == 100
    _, infos = worlds.reset(seed=0)
    targets = infos["target"].clone()
    worlds.episode_steps[1] = 99
    pull = torch.ones(2, 7)
    seen, _, _, truncated, infos = worlds.step(pull)
    assert truncated.tolist() == [False, True]
    assert infos["final_info"]["_target"].tolist() == [False, True]
    assert torch.equal(infos["final_info"]["target"][1], targets[1])
    assert infos["final_obs"][1, 8:15].max() > 0.6
    assert infos["_target"].all()
    assert torch.equal(infos["target"][0], targets[0])
    assert not torch.equal(infos["target"][1], targets[1])
    assert not seen[1, 4:8].any()
    np.testing.assert_allclose(seen[1, 8:15], 0.5, atol=0.05)
    assert seen[0, 8:15].max() > 0.6
    # The restarted finger continues like a new one.
    other = fingers(1, parameters=parameters)
    other.reset(seed=1)
    began, _ = other.reset()
    assert torch.equal(began[0], seen[1])
    assert torch.equal(other.step(pull[:1])[0][0], worlds.step(pull)[0][1])


def test_a_reset_can_replace_a_finger() -> None:
    """The world then has the motors and history of the new finger; unsuitable ones are refused."""
    bodies, arguments = KINDS["late"]
    worlds, _ = many("late")
    late: Any = {"command_delay": 0.0173, "motor_lag": 0.01}
    mask = np.array([False, True])
    worlds.reset(seed=0)
    worlds.reset(options={"bodies": [late], "reset_mask": mask})
    assert worlds.bodies[1] == NOMINAL.replace(**late)
    alone = [
        gym.make("shapechanger/Finger-v1", parameters=body, **arguments).unwrapped
        for body in (bodies[0], late)
    ]
    rng = np.random.default_rng(2)
    start_alike(worlds, alone, 5)
    for _ in range(4):
        actions = rng.uniform(-1.0, 1.0, (2, 7)).astype(np.float32)
        require_equal(worlds.step(actions), alone, actions)
    other: Any = {"tendon_stiffness": 8e3}
    for body, error, sentence in (
        (other, VectorEnvError, r"a finger cannot join"),
        ("an-1984", UnknownName, "Did you mean 'an-1983'"),
        ({"moment_arms": np.eye(7, 4)}, FingerError, "cannot balance the joints"),
    ):
        with pytest.raises(error, match=sentence):
            worlds.reset(options={"bodies": [body], "reset_mask": mask})


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"goal": True}, "supports no goal: its observations are vectors"),
        ({"path": "random"}, "supports no path='random', because its resets draw no paths"),
        ({"gap": "wide"}, "needs a finger_seed with a gap, because its resets draw no fingers"),
        ({"parameters": {"command_delay": 0.012}}, r"no command_delay of 0.012 s: .* Use 0.0118 s"),
    ],
)
def test_unsupported_arguments_are_refused(arguments: dict[str, Any], sentence: str) -> None:
    task = "FingerTrack" if "path" in arguments else "Finger"
    with pytest.raises(VectorEnvError, match=sentence):
        shapechanger.make_vec(task, 2, backend="warp", device="cpu", **arguments)
