"""Results of benchmarks, and choosing some of their rows."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from benchmarks import run
from benchmarks.finger_reach import Statics
from benchmarks.row import Row, asked
from shapechanger.finger.anatomy import JOINT_REST
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.task import fingertip


def test_a_run_of_some_rows_keeps_the_other_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run with ONLY replaces these rows, and notes the command that measured the other rows."""
    values = iter("12")

    def measured() -> list[Row]:
        value = next(values)
        return [Row(f"speed, {name}", value, "", "none", True) for name in asked("ant", "ab")]

    monkeypatch.setattr(run, "RESULTS", tmp_path)
    monkeypatch.setattr(run, "SUITES", {"speeds": measured})
    monkeypatch.setattr(sys, "argv", ["run", "speeds"])
    monkeypatch.delenv("ONLY", raising=False)
    run.main()
    monkeypatch.setenv("ONLY", "b")
    run.main()
    result = json.loads((tmp_path / "speeds.json").read_text())
    assert "ONLY=b " in result["command"]
    a, b = result["rows"]
    assert (a["name"], a["value"]) == ("speed, a", "1")
    assert a["measured_by"].endswith("python -m benchmarks.run speeds")
    assert "ONLY" not in a["measured_by"]
    assert (b["name"], b["value"]) == ("speed, b", "2")
    assert "measured_by" not in b


def test_every_suite_is_a_function_of_its_module() -> None:
    """Modules are imported only when their suite runs, so a wrong name would show late."""
    for name, suite in run.SUITES.items():
        module, function = cast("Any", suite).args
        source = Path(run.__file__).with_name(f"{module}.py").read_text()
        assert f"def {function}(" in source, name


def test_a_wrong_name_in_only_has_a_suggestion(monkeypatch: pytest.MonkeyPatch) -> None:
    """The run ends with one sentence before anything is measured."""
    monkeypatch.setattr(sys, "argv", ["run", "vehicles-clone"])
    monkeypatch.setenv("ONLY", "baot")
    with pytest.raises(SystemExit, match=r"^No vehicle matches 'baot'\. Did you mean 'boat'\?"):
        run.main()


@pytest.mark.filterwarnings("ignore:Values in x were outside:RuntimeWarning")  # SciPy 1.15.
def test_friction_keeps_a_weak_finger_from_a_hook() -> None:
    """In a hook, the knuckle is straight above a bent finger: it is held, but not reached."""
    hook = fingertip(np.radians([0.0, 0.0, 85.0, 55.0]))
    tensions = {
        share: tuple(share * most for most in NOMINAL.most_tension) for share in (0.4, 0.56)
    }
    strong, weak, rubbing = (
        Statics(finger)
        for finger in (
            NOMINAL,
            NOMINAL.replace(most_tension=tensions[0.4]),
            NOMINAL.replace(most_tension=tensions[0.56], least_tension=1.0, tendon_friction=0.8),
        )
    )
    assert strong.distance_coming_from_rest(hook) < 1e-4
    assert weak.distance(hook) > 1e-3
    assert rubbing.distance(hook) < 1e-4
    assert rubbing.distance_coming_from_rest(hook) > 4e-3
    assert rubbing.distance_coming_from_rest(fingertip(JOINT_REST)) < 1e-4
