"""Loading named methods: shipped, installed and registered ones."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest

from shapechanger import registry
from shapechanger.errors import StudyError, UnknownName
from shapechanger.registry import METHODS
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.methods import Method, MethodRun, load_method, register
from shapechanger.transfer.plan import ARMS, Run
from shapechanger.transfer.study import run_study
from tests.transfer.studies import tiny_plan

_PLUGIN = '''
from shapechanger.transfer.methods import Method, register

@register
class Patient(Method):
    """Learn the target from the start, as scratch does."""

    name = "patient"
    uses_source_policy = False
    uses_source = False

    def learn(self, run):
        return run.train(run.target, run.steps, on_evaluation=run.report)
'''


@pytest.fixture
def no_other(monkeypatch: pytest.MonkeyPatch) -> dict[str, type[Method]]:
    """An empty registry."""
    found: dict[str, type[Method]] = {}
    monkeypatch.setattr(METHODS, "_registered", found)
    return found


@pytest.fixture
def plugin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, no_other: dict[str, type[Method]]
) -> str:
    """Name of a method in a module that is not imported yet."""
    (tmp_path / "my_methods.py").write_text(_PLUGIN)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.delitem(sys.modules, "my_methods", raising=False)
    return "my_methods:patient"


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


def test_methods_of_other_packages(
    monkeypatch: pytest.MonkeyPatch, no_other: dict[str, type[Method]], plugin: str
) -> None:
    """Methods load from entry points; other objects are refused."""
    points = {
        "patient": EntryPoint("patient", "my_methods:Patient", "shapechanger.methods"),
        "broken": EntryPoint("broken", "pathlib:Path", "shapechanger.methods"),
    }

    def installed(group: str, name: str = "") -> list[EntryPoint]:
        assert group == "shapechanger.methods"
        return [point for key, point in points.items() if name in ("", key)]

    monkeypatch.setattr(registry, "entry_points", installed)
    assert load_method("patient").name == "patient"
    assert {"patient", "broken"} < set(METHODS.names())
    with pytest.raises(StudyError, match="not a subclass of Method"):
        load_method("broken")


def test_a_study_can_gain_arms(tmp_path: Path) -> None:
    first = tiny_plan(steps=32)
    run_study(first, tmp_path / "study", executor=Serial())
    grown = tiny_plan(steps=32, arms=(*ARMS, "kickstart"))
    assert grown.extends(first)
    assert not first.extends(grown)
    assert not first.extends(first)


def test_seeds_do_not_depend_on_other_arms() -> None:
    small, large = tiny_plan(), tiny_plan(arms=("scratch", "kickstart", "fine-tune"))
    assert small.seed_of(Run("fine-tune", 1)) == large.seed_of(Run("fine-tune", 1))
    kinds = ("scratch", "fine-tune", "kickstart", "evolution", "a:b")
    assert len({small.seed_of(Run(kind, 0)) for kind in kinds}) == len(kinds)


def test_a_method_must_implement_learn() -> None:
    run: Any = None
    with pytest.raises(NotImplementedError):
        Method().learn(run)
    assert MethodRun.__doc__
