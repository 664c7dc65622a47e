"""One step of many envs: the physics of each, then the results of all at once."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final, cast

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit
from numpy.typing import NDArray

from shapechanger.envs.vector.infos import InfoColumns, Step, StepResults
from shapechanger.envs.vector.threads import Failures, attempt

if TYPE_CHECKING:
    from shapechanger.envs.stepping.tuned import TunedStep

# The number of an env, and work to do for it.
_Task = tuple[int, Callable[[int], None]]

# Indices of mjWARN_BADQPOS, mjWARN_BADQVEL and mjWARN_BADQACC in `data.warning`.
_BAD_STATE: Final = slice(3, 6)


class SubEnv:
    """One env of a vector env, which writes its observations into a row of a batch.

    An env with a method `step_into(action, row)` is stepped by it, past the wrappers of `gym.make`:
    the clock of `TimeLimit` is counted here, and the others do nothing between two resets.

    A simulation has diverged when the env's info says so, when MuJoCo found a position, velocity or
    acceleration that is huge or not finite, or when an observation is not finite. MuJoCo then
    restarts from the model's own pose, which the action did not cause: the env is terminated, the
    reward is 0, and the info has `diverged`. Observations that are not finite read 0.

    Args:
        env: The env as `gym.make` makes it.
        row: Where to write its observations.

    Attributes:
        tuned: The env without its wrappers if its physics can be stepped separately, else None.
    """

    __slots__ = ("_clock", "_limit", "_step_into", "_warnings", "env", "row", "tuned")

    def __init__(self, env: gym.Env[Any, Any], row: NDArray[Any]) -> None:
        self.env = env
        self.row = row
        self._clock: Any = None
        self._limit = math.inf
        self._step_into: Any = None
        self._warnings: NDArray[Any] | None = None
        inner: Any = env
        while isinstance(inner, OrderEnforcing | PassiveEnvChecker | TimeLimit):
            if isinstance(inner, TimeLimit):
                self._clock = inner
                self._limit = cast("Any", inner)._max_episode_steps
            inner = cast("Any", inner).env
        if inner is env.unwrapped and row.dtype == np.float64:
            self._step_into = getattr(inner, "step_into", None)
        self.tuned: TunedStep | None = (
            cast("TunedStep", inner)
            if self._step_into is not None and hasattr(inner, "ready_together")
            else None
        )

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> dict[str, Any]:
        """Start an episode, and return its info.

        Args:
            seed: Seed of the env; None to go on with its generator.
            options: Options of the env's reset.
        """
        observation, info = self.env.reset(seed=seed, options=options)
        self.row[...] = observation
        if self._step_into is None:
            # A reset may have replaced the data.
            data = getattr(self.env.unwrapped, "data", None)
            self._warnings = None if data is None else data.warning.number[_BAD_STATE]
        return info

    def step(self, action: Any) -> Step:
        """Take one step."""
        if self._step_into is None:
            observation, reward, terminated, truncated, info = self.env.step(action)
            self.row[...] = observation
        else:
            reward, terminated, truncated, info = self._step_into(action, self.row)
            truncated = self.tick() or truncated
        if "diverged" in info or (self._warnings is not None and self._warnings.any()):
            return self.diverged(truncated, info)
        return reward, terminated, truncated, info

    def tick(self) -> bool:
        """Count one more step; return whether the episode's time limit is reached."""
        clock = self._clock
        if clock is None:
            return False
        clock._elapsed_steps += 1
        return clock._elapsed_steps >= self._limit

    def diverged(self, truncated: Any, info: dict[str, Any]) -> Step:
        """Return the result of a step whose simulation has diverged.

        Args:
            truncated: Whether the step was truncated.
            info: Info of the step.
        """
        self.row[~np.isfinite(self.row)] = 0.0
        return 0.0, True, truncated, {**info, "diverged": True}


class BatchStep:
    """Steps many envs: threads `advance` different envs in parallel, then one `conclude`s the step.

    Envs whose physics can be stepped separately have their results computed together afterwards;
    all others take their whole step in `advance`.

    Args:
        subs: All envs.
        observations: Overwritten in the rows of the envs that step.
        threads: How many threads advance envs.
    """

    def __init__(
        self,
        subs: Sequence[SubEnv],
        observations: NDArray[Any],
        threads: int,
    ) -> None:
        self._subs = subs
        self._observations = observations
        self._bounds: list[Any] = [None] * len(subs)
        # Threads rarely take equally long, so each takes its own tasks from the front and then
        # the other threads' from the back. A deque hands out each task once.
        self._tasks: list[deque[_Task]] = [deque() for _ in range(threads)]

    def begin(
        self, actions: NDArray[Any], results: StepResults, restart: Callable[[int], None] | None
    ) -> None:
        """Begin a step.

        Args:
            actions: One action per env.
            results: Receives the results.
            restart: Resets the env of an index after its episode has ended; None for no resets.
                It is not called for envs that are concluded together.
        """
        for tasks in self._tasks:
            tasks.clear()  # An interruption may have left some.
        self._actions = actions
        self._results = results
        self._restart = restart
        # Each binding's state from before the physics; None if it has not stepped.
        self._before: list[Any] = [None] * len(self._subs)

    def advance(
        self,
        thread: int,
        numbers: Sequence[int],
        resets: Sequence[int],
        reset: Callable[[int], None],
        failures: Failures,
    ) -> None:
        """Step the physics of envs, and take the whole step of those that step by themselves.

        Args:
            thread: The number of the thread; it helps the others when its own envs are done.
            numbers: Numbers of its envs that step.
            resets: Numbers of its envs that are reset instead, by any thread.
            reset: Resets an env.
            failures: Receives what an env raises; the others go on.
        """
        moving: list[int] = []
        for number in numbers:
            bound = self._bounds[number]
            if bound is None or not bound.valid:
                attempt(self._bind, number, failures)
                bound = self._bounds[number]
            if bound is not None:
                moving.append(number)
        tasks: list[_Task] = [(number, self._move) for number in moving]
        # Resets mostly run Python, so threads that reset at the same time would wait for one
        # another; spread out, they run while the other threads step physics.
        place = len(tasks) * (2 * thread + 1) // (2 * len(self._tasks))
        tasks[place:place] = [(number, reset) for number in resets]
        own = self._tasks[thread]
        own.extend(tasks)
        _work_off(own, own.popleft, failures)
        for others in self._tasks:
            _work_off(others, others.pop, failures)

    def _bind(self, number: int) -> None:
        """Look up how an env steps its physics; if it declares no physics, take its whole step."""
        self._bounds[number] = None
        tuned = self._subs[number].tuned
        self._bounds[number] = None if tuned is None else tuned.ready_together()
        if self._bounds[number] is None:
            self._step_alone(number)

    def _move(self, number: int) -> None:
        """Step the physics of an env; with an edited model it takes its whole step by itself."""
        bound = self._bounds[number]
        if bound.valid and not bound.unedited():
            self._step_alone(number)
            return
        self._before[number] = bound.remember()
        bound.ctrl[:] = self._actions[number]
        bound.move()

    def _step_alone(self, number: int) -> None:
        step = self._subs[number].step(self._actions[number])
        self._results.put(number, step)
        if self._restart is not None and (step[1] or step[2]):
            self._restart(number)

    def conclude(self) -> None:
        """Compute the results of all envs whose physics has stepped."""
        kinds: dict[str, list[int]] = {}
        for number, before in enumerate(self._before):
            if before is not None:
                kinds.setdefault(self._bounds[number].kind, []).append(number)
        for numbers in kinds.values():
            self._conclude(numbers)

    def _conclude(self, numbers: list[int]) -> None:
        subs = [self._subs[number] for number in numbers]
        everyone = len(numbers) == len(self._subs)
        where = slice(None) if everyone else np.array(numbers)
        outcomes = cast("TunedStep", subs[0].tuned).conclude(
            [self._bounds[number] for number in numbers],
            [self._before[number] for number in numbers],
            self._actions[where],
            self._observations if everyone else None,
        )
        if not everyone:
            self._observations[where] = outcomes.observations
        truncated = [sub.tick() for sub in subs]
        infos = InfoColumns(numbers, outcomes.infos)
        self._results.put_columns(infos, outcomes.rewards, outcomes.terminated, truncated)
        for place in outcomes.diverged:
            self.end_diverged(numbers[place])

    def end_diverged(self, number: int) -> None:
        """End the episode of an env that has stepped, because its simulation has diverged."""
        results = self._results
        step = self._subs[number].diverged(bool(results.truncated[number]), results.info(number))
        results.put(number, step)


def _work_off(tasks: deque[_Task], take: Callable[[], _Task], failures: Failures) -> None:
    """Do tasks until none is left; other threads may take some too."""
    while tasks:
        try:
            number, work = take()
        except IndexError:  # Another thread was quicker.
            return
        try:
            work(number)
        except Exception as error:  # It crosses to the caller, who raises it.
            failures.append((number, error))
