"""The tuned step on the fast model equals Gymnasium's step on the stock model, bitwise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shapechanger.envs.ant import AntEnv
from shapechanger.envs.pendulum import InvertedPendulumEnv
from shapechanger.morphology import Body
from tests.envs.stepping.side_by_side import random_ant, random_pendulum, same, step_together

_ANTS = ("Ant", "AmputatedAnt", "BigAnt", "ExtendedAnt")
_POLES = ("InvertedPendulum", "SmallInvertedPendulum", "BigInvertedPendulum")


class _GymnasiumsAnt(AntEnv):
    """Ant that uses Gymnasium's step, because it overrides a method."""

    def do_simulation(self, ctrl: Any, n_frames: int) -> None:
        super().do_simulation(ctrl, n_frames)


class _GymnasiumsPendulum(InvertedPendulumEnv):
    """Pendulum that uses Gymnasium's step."""

    def do_simulation(self, ctrl: Any, n_frames: int) -> None:
        super().do_simulation(ctrl, n_frames)


def _ants(body: Body | str, **arguments: Any) -> tuple[AntEnv, _GymnasiumsAnt]:
    return AntEnv(body, **arguments), _GymnasiumsAnt(body, fast_model=False, **arguments)


def _steps_fast(env: Any) -> bool:
    return env._bound.has_fast_model is True and env._bound.stepping is not env.model


@pytest.mark.parametrize(
    "arguments",
    [
        {"fast_model": False},
        {"exclude_current_positions_from_observation": False, "contact_force_range": (-5.0, 0.0)},
        {"include_cfrc_ext_in_observation": False, "forward_reward_weight": 2.0, "frame_skip": 2},
        {"main_body": "shank_1", "ctrl_cost_weight": 3, "healthy_reward": 0},
        {"healthy_z_range": (0.3, 0.9), "contact_cost_weight": 1e-2},
        {"terminate_when_unhealthy": False, "healthy_z_range": (0.5, 0.7)},
    ],
    ids=["stock model", "positions", "no contacts", "main body", "z range", "never terminates"],
)
def test_arguments_of_the_ant(arguments: dict[str, Any]) -> None:
    """Arguments of Gymnasium's env have the same effect."""
    ours = AntEnv(**arguments)
    theirs = _GymnasiumsAnt(**{**arguments, "fast_model": False})
    step_together(ours, theirs, 60, seed=2)


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.float16, np.int64, bool])
def test_types_of_actions(kind: type) -> None:
    """Action costs are summed in the precision of the action; lists and tuples are accepted."""
    ours, theirs = _ants("Ant")
    for env in (ours, theirs):
        env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(5):
        action = (3.0 * rng.uniform(-1.0, 1.0, 16)).astype(kind)
        for given in (action[:8], action[::2], action[:8].tolist(), tuple(action[:8].tolist())):
            assert same(ours.step(given), theirs.step(given))


_SEEDS = [*range(3), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(3, 25))]


@pytest.mark.parametrize("seed", [*_ANTS, *_SEEDS])
def test_ants(seed: int | str) -> None:
    """Named and random ants equal Gymnasium's for 1,000 steps with falls, resets and contacts."""
    if isinstance(seed, str):
        ours, theirs = _ants(seed)
        seed = 1
    else:
        ours, theirs = _ants(random_ant(seed), healthy_z_range=(0.1, 3.0) if seed % 2 else None)
    ends, touches = step_together(ours, theirs, 1000, seed=seed)
    assert _steps_fast(ours)
    assert theirs._bound is None
    assert ends
    assert touches > 100


@pytest.mark.parametrize("seed", [*_POLES, *_SEEDS])
def test_pendulums(seed: int | str) -> None:
    """Named and random poles equal Gymnasium's for 1,000 steps, also at the ends of the rail."""
    body = seed if isinstance(seed, str) else random_pendulum(seed)
    seed = 1 if isinstance(seed, str) else seed
    ours, theirs = InvertedPendulumEnv(body), _GymnasiumsPendulum(body)
    step_together(ours, theirs, 1000, seed=seed, reach=1.0 if seed % 2 else 0.1)
    assert _steps_fast(ours)


def test_steps_start_from_a_set_state() -> None:
    """`set_state` and writes to the public data take effect."""
    ours, theirs = _ants("Ant")
    for env in (ours, theirs):
        env.reset(seed=0)
        env.step(np.ones(8))
        env.set_state(env.init_qpos + 0.01, env.init_qvel + 1.0)
        env.data.qvel[7] = 3.0
        env.data.xfrc_applied[1, 2] = 5.0
    for _ in range(20):
        assert same(ours.step(np.zeros(8)), theirs.step(np.zeros(8)))
