"""One step of many envs: the physics of each, then what follows from it for all at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.vector.alike import Alike, Group
from shapechanger.envs.vector.crew import Failures
from shapechanger.envs.vector.infos import Columns
from shapechanger.envs.vector.member import Member
from shapechanger.envs.vector.results import Results
from shapechanger.envs.vector.scattered import Rows
from shapechanger.envs.vector.shares import Shares

if TYPE_CHECKING:
    from shapechanger.envs.stepping.tuned import Binding, Kind, TunedStep

__all__ = ["Stride"]

# An env's number, and what is to be done for it.
_Task = tuple[int, Callable[[], object]]


@dataclass(slots=True)
class _Part:
    """Envs of one kind and one thread that step.

    Attributes:
        numbers: Their numbers, from the lowest up.
        group: The group they are in.
        rows: Their rows there.
        before: What is remembered of the time before the step, a row each.
        after: And of the time after it, once that has been read.
    """

    numbers: list[int]
    group: Group
    rows: Rows
    before: NDArray[np.float64]
    after: NDArray[np.float64] | None = None

    def read_after(self) -> NDArray[np.float64]:
        """What is remembered of the time after the step, which is over."""
        if self.after is None:
            self.after = self.group.after.read(self.rows)
        return self.after


class Stride:
    """One step of many envs. Threads `advance` different envs at the same time; then one ends it.

    What is done for many envs is done in passes, the physics in one of its own: after the physics
    of an env little of anything else is left in the caches of a core, and what each pass needs
    comes back once and not for each env.

    Args:
        members: All envs.
        actions: The action of each.
        observations: Is overwritten in the rows of those that step.
        results: Is told what came of it.
        restart: Starts the env of a number again whose episode has ended; None if nothing does. It
            is not asked for those that are concluded.
        alike: For each thread what finds the groups of its envs.
    """

    def __init__(
        self,
        members: Sequence[Member],
        actions: NDArray[Any],
        observations: NDArray[Any],
        results: Results,
        restart: Callable[[int], None] | None,
        alike: Sequence[Alike],
    ) -> None:
        self._members = members
        self._actions = actions
        self._observations = observations
        self._results = results
        self._restart = restart
        self._alike = alike
        self._shares: Shares[_Task] = Shares(len(alike))
        self._parts: list[dict[Kind, _Part]] = [{} for _ in alike]

    def advance(
        self, thread: int, numbers: Sequence[int], begin: Sequence[_Task], failures: Failures
    ) -> None:
        """Step the physics of envs, and all of those that do not step it apart.

        Args:
            thread: The number of the thread; when it is done with its own envs it helps others.
            numbers: Numbers of its envs, from the lowest up.
            begin: What begins the episodes of others of its envs; any thread may do that.
            failures: Takes what an env raises; the others go on.
        """
        kinds: dict[Kind, tuple[list[int], list[Binding]]] = {}
        # An env that is not asked again is not brought back into the caches of a core.
        ready = self._alike[thread].ready
        for number in numbers:
            bound = ready.get(number)
            if bound is None:
                try:
                    bound = self._members[number].ready()
                    if bound is None:
                        self._alone(number)
                        continue
                except Exception as error:  # It crosses to the caller, who raises it.
                    failures.append((number, error))
                    continue
                if bound.has_twin:
                    ready[number] = bound
            own, bindings = kinds.setdefault(cast("Kind", bound.kind), ([], []))
            own.append(number)
            bindings.append(bound)
        tasks: list[_Task] = []
        stopwatches: set[AbstractContextManager[None]] = set()
        for kind, (own, bindings) in kinds.items():
            self._parts[thread][kind] = self._prepare(thread, kind, own, bindings)
            tasks.extend((number, bound.move) for number, bound in zip(own, bindings, strict=True))
            stopwatches.update(bound.stopwatch for bound in bindings)
        # Python's part of a reset is long. Threads that reset at the same time would wait for one
        # another; while the others step physics nobody waits.
        place = len(tasks) * (2 * thread + 1) // (2 * len(self._alike))
        tasks[place:place] = begin
        # Where envs do not agree on the stopwatch it goes on.
        with stopwatches.pop() if len(stopwatches) == 1 else nullcontext():
            done = _do(self._shares.own(thread, tasks), failures)
            if done == len(tasks):  # Nobody else is still at it, and the others are not held up.
                for part in self._parts[thread].values():
                    part.read_after()
            _do(self._shares.others(thread), failures)

    def _alone(self, number: int) -> None:
        step = self._members[number].step(self._actions[number])
        self._results.tell(number, step)
        if self._restart is not None and (step[1] or step[2]):
            self._restart(number)

    def _prepare(
        self, thread: int, kind: Kind, numbers: list[int], bindings: list[Binding]
    ) -> _Part:
        group = self._alike[thread].group(kind, numbers, bindings)
        rows = group.rows(numbers)
        group.controls.write(self._actions[self._where(numbers)], rows)
        return _Part(numbers, group, rows, group.before.read(rows))

    def conclude(self) -> None:
        """Work out what follows for all envs that stepped their physics apart."""
        kinds: dict[Kind, list[_Part]] = {}
        for of_thread in self._parts:
            for kind, part in of_thread.items():
                kinds.setdefault(kind, []).append(part)
        for parts in kinds.values():
            self._conclude(
                [number for part in parts for number in part.numbers],
                _stacked([part.before for part in parts]),
                _stacked([part.read_after() for part in parts]),
            )

    def _conclude(
        self, numbers: list[int], before: NDArray[np.float64], after: NDArray[np.float64]
    ) -> None:
        members = [self._members[number] for number in numbers]
        where = self._where(numbers)
        one = cast("TunedStep", members[0].tuned)
        outcomes = one.conclude(before, after, self._actions[where])
        self._observations[where] = outcomes.observations
        truncated = [member.ticked() for member in members]
        infos = Columns(numbers, outcomes.infos)
        self._results.tell_together(outcomes.rewards, outcomes.terminated, truncated, infos)
        for place in outcomes.diverged:
            self._results.tell_diverged(numbers[place], members[place])

    def _where(self, numbers: list[int]) -> slice | NDArray[np.intp]:
        return slice(None) if len(numbers) == len(self._members) else np.array(numbers)


def _do(tasks: Iterable[_Task], failures: Failures) -> int:
    """Do what is to be done; how much of it could be."""
    done = 0
    for number, work in tasks:
        try:
            work()
            done += 1
        except Exception as error:  # It crosses to the caller, who raises it.
            failures.append((number, error))
    return done


def _stacked(parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
