"""Trial of a GPU: parity with the CPU, speed, waits, training, and the cost of different bodies.

Each part writes its rows as it ends, and a part that fails writes a row with its error. Without a
GPU the trial measures nothing and keeps earlier results; `python -m benchmarks.run gpu-on-cpu`
measures ratios on Warp's CPU device. `scripts/gpu_machine.sh` prepares a machine without a network,
and runs the trial there.

`python -m benchmarks.run gpu-generalist` trains one policy in many bodies on a GPU and keeps it in
`benchmarks/results`, and `python -m benchmarks.run generalist-gpu` evaluates it on a CPU.

    LIMIT: Seconds for `gpu-generalist`, whose training is shortened to as many steps as fit.
    GPU_REFERENCE: A file of `python -m benchmarks.gpu FILE`, written on a machine on which Warp
        compiles for CPUs; without it the CPU device of this machine is the reference.
"""

from __future__ import annotations

import math
import os
import statistics
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, cast

import msgspec
import numpy as np
import torch

import shapechanger
from benchmarks.row import Row
from shapechanger.contract.env_ref import EnvRef, each_body
from shapechanger.envs.warp.devices import on, wp
from shapechanger.morphology import Stretch
from shapechanger.policy import save_policy
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.presets import learner_settings

GPU: Final = torch.cuda.is_available()
DEVICE: Final = "cuda:0" if GPU else "cpu"
# Number of worlds for speeds on a GPU, and for ratios on a CPU.
MANY: Final = 8192
FEW: Final = 64
STEPS: Final = 100
SPEED: Final = 300_000
ANT: Final = EnvRef("shapechanger/Ant-v1")
# Settings of the training. Compared with `ppo-run`, an update has 8 times as many worlds with a
# quarter of the steps each; the number of passes is the same.
TRAINING: Final = 1_048_576
LONGEST_S: Final = 60
TRAINING_SETTINGS: Final = {"n_envs": 512, "n_steps": 32}
# Settings of the training of one policy in many bodies.
GENERALIST: Final = 100_000_000
GENERALIST_BODIES: Final = {"count": 256, "seed": 0}
GENERALIST_SETTINGS: Final = {"n_envs": 2 * MANY, "n_steps": 24, "batch_size": 49_152}
GENERALIST_FILE: Final = Path("benchmarks", "results", "generalist-gpu.safetensors")
# Seconds for evaluations and for making the bodies, and the fraction of the remaining time that the
# training may use.
ASIDE_S: Final = 40
CAREFUL: Final = 0.93
# Rounds of each ratio, and targets: of two ratios, and of the seconds to make many envs.
ROUNDS: Final = 15
DEAREST: Final = 1.1
CAPTURED: Final = 3.0
CONSTRUCTION_S: Final = 1.0
# Tolerance of the first step, relative to 1 + the number, as in the tests. Later steps may differ
# more: with single precision and another order of contacts, trajectories drift apart.
PARITY: Final = 2e-4
TASKS: Final = ("Ant", "HalfCheetah", "InvertedDoublePendulum", "Humanoid", "Finger")


def gpu() -> Iterator[Row]:
    """Measure all parts, the most important first."""
    if _there():
        yield from _all(
            parity, speed, waiting, graphs, construction, differing, batches, training, humanoid
        )


def on_cpu() -> Iterator[Row]:
    """Measure the ratios that are meaningful on Warp's CPU device."""
    if GPU:
        sys.exit("This machine has a GPU: run `python -m benchmarks.run gpu`.")
    yield from _all(graphs, construction, differing)


def generalist() -> Iterator[Row]:
    """Train one policy in many bodies."""
    if _there():
        yield from _all(many)


def _there() -> bool:
    """Return whether there is a GPU; print a message if not."""
    if not GPU:
        sys.stderr.write("There is no GPU here: its results stay as they are.\n")
    return GPU


def _all(*parts: Callable[[], Iterator[Row]]) -> Iterator[Row]:
    if GPU:
        wp.config.cuda_output = "cubin"  # `benchmarks.gpu_kernels` compiles such files.
    for part in parts:
        began = time.monotonic()
        try:
            yield from part()
        except Exception as error:
            # The other parts do not depend on this one.
            traceback.print_exc()
            yield Row(part.__name__, "failed", f"{type(error).__name__}: {error}", "none", False)
        sys.stderr.write(f"{part.__name__} took {time.monotonic() - began:.0f} s.\n")


def _card() -> str:
    """Return the name of the device."""
    return torch.cuda.get_device_name() if GPU else "Warp's CPU device"


def _wait() -> None:
    if GPU:
        torch.cuda.synchronize()


def made(name: str, count: int, device: str = DEVICE, **arguments: Any) -> Any:
    """Return a vector env of `count` worlds after a reset."""
    envs = shapechanger.make_vec(name, count, backend="warp", device=device, **arguments)
    envs.reset(seed=0)
    return envs


def actions(envs: Any, steps: int, seed: int = 0) -> list[Any]:
    """Return random actions of all worlds, one tensor for each step."""
    shape = (steps, envs.num_envs, envs.action_layout.size)
    drawn = 2.0 * torch.rand(shape, generator=torch.Generator().manual_seed(seed)) - 1.0
    return list(drawn.to(envs.device))


def _seconds(work: Callable[[], object], repeats: int) -> float:
    """Return the mean wall-clock time of a call, s."""
    _wait()
    began = time.perf_counter()
    for _ in range(repeats):
        work()
    _wait()
    return (time.perf_counter() - began) / repeats


def _ratio(one: Callable[[], object], other: Callable[[], object], repeats: int) -> list[float]:
    """Return the sorted ratios of the time of `one` to that of `other`, in alternating order."""
    ratios: list[float] = []
    for i in range(ROUNDS):
        order = (one, other) if i % 2 else (other, one)
        times = {each: _seconds(each, repeats) for each in order}
        ratios.append(times[one] / times[other])
    return sorted(ratios)


def _stepper(envs: Any, several: list[Any]) -> Callable[[], object]:
    """Return a function whose calls take steps with some actions in turn."""
    place = [0]

    def step() -> object:
        place[0] = (place[0] + 1) % len(several)
        return envs.step(several[place[0]])

    return step


def rollouts(device: str) -> dict[str, Any]:
    """Return the observations of a reset and four steps, keyed by task and step."""
    found: dict[str, Any] = {}
    for name in TASKS:
        bodies = {"bodies": ["Ant", [Stretch("shank_*", 1.2)]] * 4} if name == "Ant" else {}
        envs = made(name, 8, device, **bodies)
        found[f"{name}/0"] = envs.reset(seed=0)[0].cpu().numpy()
        for i, action in enumerate(actions(envs, 4, seed=7), 1):
            # The first step launches kernels, the others replay a graph.
            found[f"{name}/{i}"] = envs.step(action)[4]["final_obs"].cpu().numpy()
        envs.close()
    return found


def parity() -> Iterator[Row]:
    """Compare a start, a step and four steps with Warp's CPU device."""
    target = f"< {PARITY:g} in a step"
    file = os.environ.get("GPU_REFERENCE")
    reference: Any = np.load(file) if file else rollouts("cpu")
    here = rollouts(DEVICE)
    for name in TASKS:
        apart = []
        for i in range(5):
            one, other = here[f"{name}/{i}"], reference[f"{name}/{i}"]
            finite = np.isfinite(other)
            difference = np.abs(one - other)[finite] / (1.0 + np.abs(other[finite]))
            apart.append(float(difference.max(initial=0.0)))
        worst = max(apart[:2])
        spread = f"{max(apart):.1e} after four steps, {_card()}"
        yield Row(f"{name}: parity with the CPU", f"{worst:.1e}", spread, target, worst < PARITY)


def speed() -> Iterator[Row]:
    """Measure whole env steps, with observations, rewards and restarts, and physics alone."""
    name = f"Ant, N={MANY}: env steps per second on a GPU"
    target = f">= {SPEED:,}"
    envs = made("Ant", MANY, task_infos=False)
    step = _stepper(envs, actions(envs, 50))
    _seconds(step, STEPS)  # Warm up: afterwards worlds restart at different times.
    rates = sorted(MANY / _seconds(step, STEPS) for _ in range(5))
    value = statistics.median(rates)
    spread = f"{rates[0]:,.0f} to {rates[-1]:,.0f} in {len(rates)} rounds, {_card()}"
    yield Row(name, f"{value:,.0f}", spread, target, value >= SPEED)
    worlds = envs.batches[0]
    share = value * _seconds(worlds.simulate, STEPS) / MANY
    yield Row(
        f"Ant, N={MANY}: share of physics in a whole step",
        f"{share:.0%}",
        f"most contacts and rows with memory: {worlds.limits}",
        "none: whatever comes out",
        True,
    )
    envs.close()


def waiting() -> Iterator[Row]:
    """Count how often a step waits for the GPU, from CUDA's warnings."""
    name = "Ant: questions to the GPU in a step"
    envs = made("Ant", FEW)
    step = _stepper(envs, actions(envs, 5))
    _seconds(step, 3)
    torch.cuda.set_sync_debug_mode("warn")
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        step()
    torch.cuda.set_sync_debug_mode("default")
    count = sum("synchroniz" in str(each.message).lower() for each in heard)
    yield Row(name, f"{count}", "torch.cuda.set_sync_debug_mode", "1", count == 1)
    envs.close()


def graphs() -> Iterator[Row]:
    """Compare physics that is launched kernel by kernel with a captured graph of it."""
    envs = made("Ant", FEW)
    _seconds(_stepper(envs, actions(envs, 20)), 20)
    worlds = envs.batches[0]

    def launched() -> None:
        with on(worlds.device):
            worlds._simulate()

    ratios = _ratio(launched, worlds.simulate, 4)
    value = statistics.median(ratios)
    yield Row(
        f"Ant, N={FEW}: time of physics by kernels over that of its graph, {_card()}",
        f"{value:.1f}x",
        f"{ratios[0]:.1f} to {ratios[-1]:.1f}x in {ROUNDS} rounds",
        f">= {CAPTURED:g}x",
        value >= CAPTURED,
    )
    envs.close()


def construction() -> Iterator[Row]:
    """Measure the time to make a vector env of many equal ants."""
    made("Ant", 2).close()
    times = sorted(
        _seconds(lambda: shapechanger.make_vec("Ant", MANY, backend="warp", device=DEVICE), 1)
        for _ in range(3)
    )
    yield Row(
        f"Ant, N={MANY}: seconds to make them, {_card()}",
        f"{times[1]:.2f}",
        f"{times[0]:.2f} to {times[-1]:.2f} in 3 rounds",
        f"< {CONSTRUCTION_S:g}",
        times[1] < CONSTRUCTION_S,
    )


def differing() -> Iterator[Row]:
    """Compare ants with different legs, and ants that are drawn from a pool, with equal ants."""
    count = MANY if GPU else FEW
    bodies = [[Stretch("shank_*", 0.8 + 0.4 * i / 63)] for i in range(FEW)]
    # Equal ants have the middle length, so that both sides touch the floor equally often.
    equal = made("Ant", count)
    sides = {
        "differing bodies": made("Ant", count, bodies=[bodies[i % FEW] for i in range(count)]),
        f"bodies drawn from a pool of {FEW}": made("Ant", count, pool=bodies),
    }
    drawn = actions(equal, 20)
    one = _stepper(equal, drawn)
    _seconds(one, 20)
    for label, envs in sides.items():
        other = _stepper(envs, drawn)
        _seconds(other, 20)
        ratios = _ratio(other, one, 4)
        value = statistics.median(ratios)
        yield Row(
            f"Ant, N={count}: time of {label} over that of equal ones, {_card()}",
            f"{value:.2f}x",
            f"{ratios[0]:.2f} to {ratios[-1]:.2f}x in {ROUNDS} rounds",
            f"<= {DEAREST:g}x",
            value <= DEAREST,
        )


def batches() -> Iterator[Row]:
    """Compare a step of ants of several shapes with steps of one shape after another."""
    drawn = ANT.having({"bodies": GENERALIST_BODIES | {"count": 32}})
    bodies = [body.kwargs["body"] for body in each_body(drawn)]
    count = MANY // 2 if GPU else FEW
    worlds = [bodies[i % len(bodies)] for i in range(count)]
    all_at_once = made("Ant", count, bodies=worlds, task_infos=False)
    kinds = [[worlds[i] for i in batch.numbers.tolist()] for batch in all_at_once.batches]
    each = [made("Ant", len(kind), bodies=kind, task_infos=False) for kind in kinds]
    given = [actions(envs, 1)[0] for envs in each]

    def together() -> None:
        all_at_once.step(given)

    def one_by_one() -> None:
        for envs, action in zip(each, given, strict=True):
            envs.step(action)

    _seconds(together, 20)
    _seconds(one_by_one, 20)
    ratios = _ratio(one_by_one, together, 4)
    yield Row(
        f"Ant, N={count}: time of {len(kinds)} shapes one by one over that of all, {_card()}",
        f"{statistics.median(ratios):.2f}x",
        f"{ratios[0]:.2f} to {ratios[-1]:.2f}x in {ROUNDS} rounds",
        "none: whatever comes out",
        True,
    )


def _trained(
    learner: str,
    settings: dict[str, int],
    env: EnvRef,
    steps: int,
    on_steps: Callable[[int], object] = lambda done: None,
) -> tuple[TrainedPolicy, float, list[float]]:
    """Train a policy; return it, its training time, s, and forward speeds before and after.

    The time includes the evaluation at the end, on a CPU env.
    """
    # This import needs rsl-rl, which other parts do not need.
    from shapechanger.transfer.runs import learner_of

    times: list[float] = []
    speeds: list[float] = []

    def on_evaluation(evaluation: Evaluation) -> None:
        speeds.append(evaluation.value("forward speed"))
        times.append(time.perf_counter())

    plain: Any = learner_settings(learner)
    changed = msgspec.structs.replace(plain, **settings, eval_every=steps)
    policy = learner_of(learner, changed).train(
        env, steps, 0, on_evaluation=on_evaluation, on_steps=cast("Any", on_steps)
    )
    return policy, times[-1] - times[0], speeds


def training() -> Iterator[Row]:
    """Measure the time of a training with PPO, and the speed of its policy."""
    name = f"Ant: seconds of PPO with rsl-rl for {TRAINING:,} steps on a GPU"
    target = f"< {LONGEST_S}"
    # Compile the kernels first.
    _trained("rsl-ppo", TRAINING_SETTINGS, ANT, math.prod(TRAINING_SETTINGS.values()))
    _, seconds, speeds = _trained("rsl-ppo", TRAINING_SETTINGS, ANT, TRAINING)
    spread = f"forward speed {speeds[0]:.2f} to {speeds[-1]:.2f} m/s, seed 0, {_card()}"
    yield Row(name, f"{seconds:.0f}", spread, target, seconds < LONGEST_S)


def many() -> Iterator[Row]:
    """Train one policy in many bodies, and keep it."""
    count = GENERALIST_BODIES["count"]
    ends = time.monotonic() + float(os.environ.get("LIMIT", "inf"))
    update = GENERALIST_SETTINGS["n_envs"] * GENERALIST_SETTINGS["n_steps"]
    # Time an update in a few bodies, after one that compiles the kernels.
    few = ANT.having({"bodies": {**GENERALIST_BODIES, "count": 32}})
    times: dict[int, float] = {}
    _trained(
        "rsl-limbs",
        GENERALIST_SETTINGS,
        few,
        3 * update,
        lambda done: times.setdefault(done // update, time.monotonic()),
    )
    seconds = (times[3] - times[1]) / 2
    left = (ends - time.monotonic() - ASIDE_S) * CAREFUL
    steps = int(min(GENERALIST, max(update, left / seconds * update)))
    env = ANT.having({"bodies": GENERALIST_BODIES})
    policy, seconds, speeds = _trained("rsl-limbs", GENERALIST_SETTINGS, env, steps)
    save_policy(policy.carded(command="python -m benchmarks.run gpu-generalist"), GENERALIST_FILE)
    yield Row(
        f"one policy in {count} ants on a GPU: steps",
        f"{policy.card.steps:,}",
        f"{seconds:.0f} s with its evaluations; forward speed {speeds[0]:.2f} to {speeds[-1]:.2f} "
        f"m/s in the first bodies, seed 0, {_card()}",
        f"{GENERALIST:,}",
        policy.card.steps >= GENERALIST,
    )


def humanoid() -> Iterator[Row]:
    """Measure whole env steps of the largest body."""
    name = f"Humanoid, N={MANY}: env steps per second on a GPU"
    envs = made("Humanoid", MANY, task_infos=False)
    step = _stepper(envs, [0.4 * action for action in actions(envs, 10)])
    _seconds(step, 12)
    rate = MANY / _seconds(step, 10)
    yield Row(name, f"{rate:,.0f}", _card(), "none: whatever comes out", True)


if __name__ == "__main__":
    np.savez_compressed(Path(sys.argv[1]), **cast("Any", rollouts("cpu")))
