"""Speed of ants on a GPU, the time of a training there, and what differing bodies cost in a batch.

Rounds of the last are paired: each steps both sides one after the other, in alternating order,
from the same states, and gives one ratio.
"""

from __future__ import annotations

import statistics
import time
from typing import Any, Final, cast

import msgspec
import torch

import shapechanger
from benchmarks.row import Row
from shapechanger.morphology import Stretch
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.learners import ignore
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.presets import learner_settings
from shapechanger.transfer.learners.rsl import RslLearner
from shapechanger.transfer.learners.settings import RslPpoSettings

# Of the speed, on a GPU.
MANY: Final = 8192
STEPS: Final = 100
SPEED: Final = 300_000
# Of the training.
TRAINING: Final = 1_048_576
LONGEST_S: Final = 60
ON_A_GPU: Final = {"n_envs": 4096, "n_steps": 24, "batch_size": 24_576}
# Of the ratio: worlds on a GPU and on the CPU, and rounds of steps.
WORLDS: Final = {"cuda": 8192, "cpu": 64}
ROUNDS: Final = 15
STEPS_PER_ROUND: Final = 4
DEAREST: Final = 1.1


def _seconds(envs: Any, actions: list[Any]) -> float:
    """Return the wall-clock time of steps."""
    _wait(envs)
    began = time.perf_counter()
    for action in actions:
        envs.step(action)
    _wait(envs)
    return time.perf_counter() - began


def _wait(envs: Any) -> None:
    if envs.device != "cpu":
        torch.cuda.synchronize(envs.device)


def _actions(envs: Any, steps: int, generator: torch.Generator) -> list[Any]:
    shape = (steps, envs.num_envs, envs.action_layout.size)
    drawn = 2.0 * torch.rand(shape, generator=generator) - 1.0
    return list(drawn.to(envs.device))


def steps_per_second() -> Row:
    """Measure whole env steps: physics, observations, rewards and restarts."""
    name = f"Ant, N={MANY}: env steps per second on a GPU"
    target = f">= {SPEED:,}"
    if not torch.cuda.is_available():
        return Row(name, "not measured", "there is no GPU here", target, False)
    envs = shapechanger.make_vec("Ant", MANY, backend="warp")
    envs.reset(seed=0)
    actions = _actions(envs, STEPS, torch.Generator().manual_seed(0))
    _seconds(envs, actions)
    rates = sorted(MANY * STEPS / _seconds(envs, actions) for _ in range(5))
    value = statistics.median(rates)
    spread = f"{rates[0]:,.0f} to {rates[-1]:,.0f} in {len(rates)} rounds, {_card()}"
    return Row(name, f"{value:,.0f}", spread, target, value >= SPEED)


def training_time() -> Row:
    """Measure a training with PPO, its compiled kernels given, and what it has learned."""
    name = f"Ant: seconds of PPO with rsl-rl for {TRAINING:,} steps on a GPU"
    target = f"< {LONGEST_S}"
    if not torch.cuda.is_available():
        return Row(name, "not measured", "there is no GPU here", target, False)
    settings = cast("RslPpoSettings", learner_settings("rsl-ppo"))
    settings = msgspec.structs.replace(settings, **ON_A_GPU, eval_every=TRAINING)
    short = msgspec.structs.replace(settings, eval_every=settings.update_steps)
    ant = EnvRef("shapechanger/Ant-v1")
    RslLearner("rsl-ppo", short).train(ant, settings.update_steps, 0, on_evaluation=ignore)
    learner = RslLearner("rsl-ppo", settings)
    found: list[Evaluation] = []
    times: list[float] = []

    def on_evaluation(evaluation: Evaluation) -> None:
        found.append(evaluation)
        times.append(time.perf_counter())

    learner.train(ant, TRAINING, 0, on_evaluation=on_evaluation)
    seconds = times[-1] - times[0]  # With the evaluation at the end, some seconds of a CPU env.
    speeds = [one.value("forward speed") for one in found]
    spread = f"forward speed {speeds[0]:.2f} to {speeds[-1]:.2f} m/s, seed 0, {_card()}"
    return Row(name, f"{seconds:.0f}", spread, target, seconds < LONGEST_S)


def cost_of_differing_bodies() -> Row:
    """Compare a batch in which every ant has its own legs with one of equal ants."""
    on = "cuda" if torch.cuda.is_available() else "cpu"
    count = WORLDS[on]
    bodies = [[Stretch("shank_*", 0.8 + 0.4 * i / (count - 1))] for i in range(count)]
    # The body in the middle, so that both sides touch the floor equally often.
    equal = shapechanger.make_vec("Ant", count, backend="warp", device=on)
    differing = shapechanger.make_vec("Ant", count, backend="warp", device=on, bodies=bodies)
    generator = torch.Generator().manual_seed(0)
    sides: list[Any] = [equal, differing]
    for envs in sides:
        envs.reset(seed=0)
        for action in _actions(envs, 20, generator):
            envs.step(action)
    ratios: list[float] = []
    for i in range(ROUNDS):
        actions = _actions(equal, STEPS_PER_ROUND, generator)
        times = {place: _seconds(sides[place], actions) for place in ((0, 1) if i % 2 else (1, 0))}
        ratios.append(times[1] / times[0])
    ratios.sort()
    value = statistics.median(ratios)
    where = _card() if on == "cuda" else "Warp's CPU device"
    return Row(
        f"Ant, N={count}: time of differing bodies over that of equal ones, {where}",
        f"{value:.2f}x",
        f"{ratios[0]:.2f} to {ratios[-1]:.2f}x in {ROUNDS} rounds",
        f"<= {DEAREST:g}x",
        value <= DEAREST,
    )


def _card() -> str:
    """Return the name of the GPU."""
    return torch.cuda.get_device_name()


def gpu() -> list[Row]:
    """Measure all three."""
    return [steps_per_second(), training_time(), cost_of_differing_bodies()]
