"""Envs that are alike: their numbers are read and written together."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from shapechanger.envs.vector.scattered import Rows, Scattered

if TYPE_CHECKING:
    from shapechanger.envs.stepping.tuned import Binding, Kind

__all__ = ["Alike", "Group"]


class Group(NamedTuple):
    """Envs of one kind, a row each.

    Attributes:
        bindings: By the number of an env the views of its data.
        row_of: By the number of an env its row.
        controls: What they do.
        before: What is remembered of the time before a step.
        after: What is kept after it.
    """

    bindings: dict[int, Binding]
    row_of: dict[int, int]
    controls: Scattered
    before: Scattered
    after: Scattered

    def rows(self, numbers: list[int]) -> Rows:
        """The rows of envs; those that have just been reset do not step with the others."""
        if len(numbers) == len(self.row_of):
            return None
        return np.array([self.row_of[number] for number in numbers])


class Alike:
    """Finds the groups of envs, and remembers them as long as they hold.

    Attributes:
        ready: By number the bindings of envs that step their physics apart, until they are
            distrusted.
    """

    def __init__(self) -> None:
        self.ready: dict[int, Binding] = {}
        self._bindings: dict[int, Binding] = {}
        self._groups: dict[Kind, Group] = {}

    def forget(self, number: int) -> None:
        """An env has been reset or changed: it must be asked again whether it is ready."""
        self.ready.pop(number, None)

    def group(self, kind: Kind, numbers: list[int], bindings: list[Binding]) -> Group:
        """The group that the envs `numbers` of one kind are in."""
        group = self._groups.get(kind)
        if group is None or [*map(group.bindings.get, numbers)] != bindings:
            self._bindings.update(zip(numbers, bindings, strict=True))
            kinds = {bound.kind for bound in self._bindings.values()}
            self._groups = {each: old for each, old in self._groups.items() if each in kinds}
            group = self._groups[kind] = self._made(kind)
        return group

    def _made(self, kind: Kind) -> Group:
        known = sorted(self._bindings.items())
        bindings = {number: bound for number, bound in known if bound.kind is kind}
        return Group(
            bindings,
            {number: row for row, number in enumerate(bindings)},
            Scattered([[bound.ctrl] for bound in bindings.values()]),
            Scattered([bound.before for bound in bindings.values()]),
            Scattered([bound.after for bound in bindings.values()]),
        )
