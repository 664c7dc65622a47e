"""`AntEnv.conclude` gives many ants of a vector env the results that each would compute alone.

It computes observations, rewards, ends and infos in one call, after all ants' physics has stepped.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from shapechanger.envs.ant import AntEnv
from shapechanger.envs.stepping.tuned import TunedStep
from shapechanger.envs.vector import ThreadVectorEnv
from tests.envs.vector.sameness import play_side_by_side, random_bodies, require_same

_ANT = "shapechanger/Ant-v1"


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Search for fast models at the first step."""
    monkeypatch.setattr(TunedStep, "patience", 0)


@pytest.fixture
def concluded(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list of the number of ants in each call of `AntEnv.conclude`."""
    counts: list[int] = []
    original = AntEnv.conclude

    def counting(env: AntEnv, bounds: Any, *rest: Any) -> Any:
        counts.append(len(bounds))
        return original(env, bounds, *rest)

    monkeypatch.setattr(AntEnv, "conclude", counting)
    return counts


def _pair(each: list[dict[str, Any]], threads: int = 1, mode: str = "NextStep") -> tuple[Any, Any]:
    """Return our vector env with fast models, and Gymnasium's with the same envs without them."""
    ours = ThreadVectorEnv(
        [partial(gym.make, _ANT, **one) for one in each],
        threads=threads,
        autoreset_mode=AutoresetMode(mode),
    )
    theirs = SyncVectorEnv(
        [partial(gym.make, _ANT, **{**one, "fast_model": False}) for one in each],
        autoreset_mode=AutoresetMode(mode),
    )
    return ours, theirs


def _close(*envs: Any) -> None:
    for one in envs:
        one.close()


@pytest.mark.parametrize(("mode", "threads"), [("NextStep", 1), ("SameStep", 2), ("Disabled", 2)])
def test_bodies_and_rewards_may_differ(mode: str, threads: int, concluded: list[int]) -> None:
    """Envs of different kinds are computed in groups; an ended episode affects no other env."""
    kinds: list[dict[str, Any]] = [
        *({"body": body} for body in random_bodies(_ANT, 3)),
        {"healthy_reward": 0, "forward_reward_weight": 2, "ctrl_cost_weight": 3},
        {"contact_force_range": (-5.0, 0.0), "terminate_when_unhealthy": False},
        {"frame_skip": 2, "contact_cost_weight": 1e-2, "main_body": "shank_1"},
        {"healthy_z_range": (0.3, 0.7)},
        {"fast_model": False},
    ]
    ours, theirs = _pair([{"max_episode_steps": 40, **kind} for kind in kinds], threads, mode)
    assert play_side_by_side(ours, theirs, 120, mode) > 10
    assert max(concluded) >= 3 - threads // 2
    _close(ours, theirs)


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64, np.int64])
@pytest.mark.parametrize(
    ("order", "arguments"),
    [
        ("C", {"exclude_current_positions_from_observation": False}),
        ("F", {"include_cfrc_ext_in_observation": False}),
    ],
)
def test_precision_and_order_of_actions(
    kind: Any, order: Any, arguments: dict[str, Any], concluded: list[int]
) -> None:
    """Costs are summed in the precision of the actions, in any memory order."""
    ours, theirs = _pair([arguments] * 5)
    for envs in (ours, theirs):
        envs.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(5):
        actions = np.array(rng.uniform(-3.0, 3.0, (5, 8)), kind, order=order)
        require_same(ours.step(actions), theirs.step(actions))
    assert max(concluded) == 5
    _close(ours, theirs)


def _lighter(model: Any) -> None:
    model.body_mass[1] *= 0.5


def _slower(model: Any) -> None:
    model.opt.timestep = 0.005


@pytest.mark.parametrize("edit", [_lighter, _slower])
def test_an_edit_takes_effect_at_the_next_step(edit: Callable[[Any], None]) -> None:
    """Edits of one env's model affect only that env, until they are undone."""
    ours, theirs = _pair([{"terminate_when_unhealthy": False}] * 3, mode="Disabled")
    for envs in (ours, theirs):
        envs.reset(seed=0)
    rng = np.random.default_rng(0)

    def play() -> None:
        for _ in range(8):
            actions = rng.uniform(-1.0, 1.0, (3, 8)).astype(np.float32)
            require_same(ours.step(actions), theirs.step(actions))

    play()
    fast = ours.envs[1].unwrapped._bound.stepping
    model = ours.envs[1].unwrapped.model
    mass, timestep = float(model.body_mass[1]), model.opt.timestep
    assert fast is not model
    for envs in (ours, theirs):  # Within an episode.
        edit(envs.envs[1].unwrapped.model)
    play()
    middle = np.array([False, True, False])
    for envs in (ours, theirs):
        envs.reset(seed=2, options={"reset_mask": middle})
    play()
    for envs in (ours, theirs):
        envs.envs[1].unwrapped.model.body_mass[1] = mass
        envs.envs[1].unwrapped.model.opt.timestep = timestep
    play()
    assert ours.envs[1].unwrapped._bound.stepping is fast
    _close(ours, theirs)


def test_overridden_steps_are_called() -> None:
    """Overrides of `step` by a class or an instance are used."""

    class Generous(AntEnv):
        def step(self, action: Any) -> Any:
            observation, reward, *rest = super().step(action)
            return (observation, reward + 1000.0, *rest)

    plain = gym.make(_ANT).unwrapped
    plain.step = lambda action: (np.zeros(105), 7.0, False, False, {})  # type: ignore[method-assign]
    envs = ThreadVectorEnv([Generous, AntEnv, lambda: plain])
    envs.reset(seed=0)
    _, rewards, _, truncated, _ = envs.step(np.zeros((3, 8), np.float32))
    assert rewards[0] > 900.0 > rewards[1] != rewards[2] == 7.0
    assert not truncated.any()  # These envs have no time limit.
    envs.close()


def test_an_ant_that_another_thread_still_steps_is_not_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Results are computed when both threads are done, also for an ant that changed threads."""
    ours, theirs = _pair([{}] * 4, threads=2)
    require_same(ours.reset(seed=0), theirs.reset(seed=0))
    actions = np.full((4, 8), 0.5, np.float32)
    require_same(ours.step(actions), theirs.step(actions))
    first, second, third = (ours.envs[i].unwrapped._bound for i in (0, 1, 2))
    move_first, move_second, move_third = first.move, second.move, third.move
    begun, taken, done, never_set = (threading.Event() for _ in range(4))

    def own() -> None:
        begun.set()
        assert taken.wait(20.0)
        move_first()
        done.set()

    def helped() -> None:
        taken.set()
        assert done.wait(20.0)
        never_set.wait(0.3)  # Never set: gives the other thread time to read too early.
        move_second()

    def of_the_other() -> None:
        assert begun.wait(20.0)  # The thread must not take ants of the other thread before that.
        move_third()

    monkeypatch.setattr(first, "move", own)
    monkeypatch.setattr(second, "move", helped)
    monkeypatch.setattr(third, "move", of_the_other)
    require_same(ours.step(actions), theirs.step(actions))
    _close(ours, theirs)
