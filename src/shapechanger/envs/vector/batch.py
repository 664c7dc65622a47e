"""One step of many envs: the physics of each, then the results of all at once."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.vector.infos import InfoColumns, Results, SubEnv
from shapechanger.envs.vector.threads import Failures

if TYPE_CHECKING:
    from shapechanger.envs.stepping.tuned import TunedStep

__all__ = ["BatchStep"]

# The number of an env, and work to do for it.
_Task = tuple[int, Callable[[], object]]


class BatchStep:
    """One step of many envs: threads `advance` different envs in parallel, then one concludes.

    The physics of all envs come first, because stepping one env empties a core's caches of what the
    results need. Envs that cannot be stepped this way take their whole step in `advance`.

    Args:
        members: All envs.
        actions: One action per env.
        observations: Overwritten in the rows of the envs that step.
        results: Receives the results.
        restart: Resets an env by its number after its episode has ended; None if nothing does. It
            is not called for envs that are concluded together.
        threads: How many threads advance envs.
    """

    def __init__(
        self,
        members: Sequence[SubEnv],
        actions: NDArray[Any],
        observations: NDArray[Any],
        results: Results,
        restart: Callable[[int], None] | None,
        threads: int,
    ) -> None:
        self._members = members
        self._actions = actions
        self._observations = observations
        self._results = results
        self._restart = restart
        # Bindings of the envs whose physics steps here, and what they remember from before.
        self._bounds: list[Any] = [None] * len(members)
        self._before: list[Any] = [None] * len(members)
        # Threads rarely take equally long, so each takes its own tasks from the front and then
        # those of others from the back. A deque hands out each task once.
        self._tasks: list[deque[_Task]] = [deque() for _ in range(threads)]

    def advance(
        self, thread: int, numbers: Sequence[int], begin: Sequence[_Task], failures: Failures
    ) -> None:
        """Step the physics of envs, and take the whole step of those that step by themselves.

        Args:
            thread: The number of the thread; it helps the others when its own envs are done.
            numbers: Numbers of its envs.
            begin: Resets of others of its envs, which any thread may do.
            failures: Receives what an env raises; the others go on.
        """
        moves: list[_Task] = []
        timers: set[AbstractContextManager[None]] = set()
        for number in numbers:
            try:
                bound = self._members[number].ready()
                if bound is None:
                    self._step_alone(number)
                    continue
            except Exception as error:  # It crosses to the caller, who raises it.
                failures.append((number, error))
                continue
            self._bounds[number] = bound
            self._before[number] = bound.remember()
            bound.ctrl[:] = self._actions[number]
            timers.add(bound.timer)
            moves.append((number, bound.move))
        # Resets mostly run Python, so threads that reset at the same time would wait for one
        # another; spread out, they run while the other threads step physics.
        place = len(moves) * (2 * thread + 1) // (2 * len(self._tasks))
        moves[place:place] = begin
        own = self._tasks[thread]
        own.extend(moves)
        # The timer keeps running unless all envs agree to pause it.
        with timers.pop() if len(timers) == 1 else nullcontext():
            _work_off(own, own.popleft, failures)
            for tasks in self._tasks:
                _work_off(tasks, tasks.pop, failures)

    def _step_alone(self, number: int) -> None:
        step = self._members[number].step(self._actions[number])
        self._results.tell(number, step)
        if self._restart is not None and (step[1] or step[2]):
            self._restart(number)

    def conclude(self) -> None:
        """Compute the results of all envs whose physics has stepped."""
        kinds: dict[str, list[int]] = {}
        for number, bound in enumerate(self._bounds):
            if bound is not None:
                kinds.setdefault(bound.kind, []).append(number)
        for numbers in kinds.values():
            self._conclude(numbers)

    def _conclude(self, numbers: list[int]) -> None:
        members = [self._members[number] for number in numbers]
        where = slice(None) if len(numbers) == len(self._members) else np.array(numbers)
        outcomes = cast("TunedStep", members[0].tuned).conclude(
            [self._bounds[number] for number in numbers],
            [self._before[number] for number in numbers],
            self._actions[where],
        )
        self._observations[where] = outcomes.observations
        truncated = [member.ticked() for member in members]
        infos = InfoColumns(numbers, outcomes.infos)
        self._results.tell_together(outcomes.rewards, outcomes.terminated, truncated, infos)
        for place in outcomes.diverged:
            self._results.tell_diverged(numbers[place], members[place])


def _work_off(tasks: deque[_Task], take: Callable[[], _Task], failures: Failures) -> None:
    while tasks:
        try:
            number, work = take()
        except IndexError:  # Another thread was quicker.
            return
        try:
            work()
        except Exception as error:  # It crosses to the caller, who raises it.
            failures.append((number, error))
