"""Loading named methods: shipped, installed and registered ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.errors import StudyError, UnknownName
from shapechanger.registry import METHODS
from shapechanger.transfer.methods import Method, load_method, register
from shapechanger.transfer.plan import ARMS, Run
from tests.transfer.studies import tiny_plan


@pytest.fixture
def no_other(monkeypatch: pytest.MonkeyPatch) -> dict[str, type[Method]]:
    """An empty registry."""
    found: dict[str, type[Method]] = {}
    monkeypatch.setattr(METHODS, "_registered", found)
    return found


@pytest.mark.parametrize("name", METHODS.names())
def test_shipped_methods_have_their_names(name: str) -> None:
    method = load_method(name)
    assert method.name == name
    assert type(method).__doc__
    assert method.paper or name in ("scratch", "zero-shot", "shuffled-map")


def test_a_name_that_does_not_exist(no_other: dict[str, type[Method]]) -> None:
    """The message suggests the nearest name; a missing module is an UnknownName."""
    with pytest.raises(UnknownName, match="'kickstart'"):
        load_method("kickstarts")
    with pytest.raises(UnknownName, match="no_such_module:patient"):
        load_method("no_such_module:patient")


def test_names_are_taken_once(no_other: dict[str, type[Method]]) -> None:
    """A second method of one name is refused; the same class again is not."""

    class First(Method):
        name = "mine"

    class Second(Method):
        name = "mine"

    class Random(Method):
        name = "random"

    class Spaced(Method):
        name = "my method"

    assert register(First) is First
    assert register(First) is First
    with pytest.raises(StudyError, match="already a method 'mine'"):
        register(Second)
    with pytest.raises(StudyError, match="already a method 'random'"):
        register(Random)
    with pytest.raises(StudyError, match="made of letters"):
        register(Spaced)
    assert isinstance(load_method("mine"), First)
    no_other["broken"] = Path  # type: ignore[assignment]
    with pytest.raises(StudyError, match="not a subclass of Method"):
        load_method("broken")


def test_a_study_can_gain_arms() -> None:
    first = tiny_plan(steps=32)
    grown = tiny_plan(steps=32, arms=(*ARMS, "kickstart"))
    assert grown.extends(first)
    assert not first.extends(grown)
    assert not first.extends(first)


def test_seeds_do_not_depend_on_other_arms() -> None:
    small, large = tiny_plan(), tiny_plan(arms=("scratch", "kickstart", "fine-tune"))
    assert small.seed_of(Run("fine-tune", 1)) == large.seed_of(Run("fine-tune", 1))
    kinds = ("scratch", "fine-tune", "kickstart", "evolution", "a:b")
    assert len({small.seed_of(Run(kind, 0)) for kind in kinds}) == len(kinds)
