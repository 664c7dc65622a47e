"""One step of a thread's envs: the physics of each, then what follows from it for all at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.vector.crew import Failures
from shapechanger.envs.vector.member import Member, Step

if TYPE_CHECKING:
    from shapechanger.envs.stepping.tuned import Kind, TunedStep

__all__ = ["stride"]

_NO_TROUBLE: Final = [0, 0, 0]


class _Group:
    """Envs of one kind whose physics has stepped.

    Args:
        most: How many envs there may be.
        width: How many numbers are kept of each.
    """

    def __init__(self, most: int, width: int) -> None:
        self.numbers: list[int] = []
        self.befores: list[Any] = []
        self.bad: list[bool] = []
        self.gathered = np.empty((most, width))


def stride(
    members: Sequence[Member],
    actions: NDArray[Any],
    observations: NDArray[Any],
    numbers: Sequence[int],
    done: Callable[[int, Step], None],
    failures: Failures,
) -> None:
    """Step some envs.

    Args:
        members: All envs.
        actions: The action of each.
        observations: Is overwritten in the rows of those that step.
        numbers: Numbers of the envs that step.
        done: Is told what came of the step of each env.
        failures: Takes what an env raises; the others go on.
    """
    groups: dict[Kind | None, _Group] = {}
    for number in numbers:
        try:
            bound = members[number].ready()
            if bound is None:
                done(number, members[number].step(actions[number]))
                continue
            group = groups.get(bound.kind)
            if group is None:
                group = groups[bound.kind] = _Group(len(numbers), bound.width)
            before = bound.move(actions[number])
            np.concatenate(bound.gathered, out=group.gathered[len(group.numbers)])
            group.numbers.append(number)
            group.befores.append(before)
            group.bad.append(bound.trouble.tolist() != _NO_TROUBLE)
        except Exception as error:  # It crosses to the caller, who raises it.
            failures.append((number, error))
    for group in groups.values():
        if not group.numbers:
            continue
        try:
            _conclude(members, actions, observations, group, done, failures)
        except Exception as error:
            failures.append((group.numbers[0], error))


def _conclude(
    members: Sequence[Member],
    actions: NDArray[Any],
    observations: NDArray[Any],
    group: _Group,
    done: Callable[[int, Step], None],
    failures: Failures,
) -> None:
    """What follows from the physics of one kind of envs."""
    numbers = group.numbers
    envs = [members[number].tuned for number in numbers]
    chosen = actions if len(numbers) == len(actions) else actions[numbers]
    one = cast("TunedStep", envs[0])
    seen, outcomes = one.conclude(envs, group.befores, group.gathered[: len(numbers)], chosen)
    observations[numbers] = seen
    for number, outcome, bad in zip(numbers, outcomes, group.bad, strict=True):
        try:
            done(number, members[number].concluded(*outcome, bad))
        except Exception as error:  # It crosses to the caller, who raises it.
            failures.append((number, error))
