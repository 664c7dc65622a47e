"""Results of benchmarks, and choosing some of their rows."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from benchmarks import run
from benchmarks.row import Row, asked


def test_rows_that_only_leaves_out_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run of a part replaces its rows, and says by which command the others were measured."""
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


def test_a_wrong_name_in_only_gets_the_nearest(monkeypatch: pytest.MonkeyPatch) -> None:
    """It ends in one sentence, before anything is measured."""
    monkeypatch.setattr(sys, "argv", ["run", "vehicles-clone"])
    monkeypatch.setenv("ONLY", "baot")
    with pytest.raises(SystemExit, match=r"^No vehicle matches 'baot'\. Did you mean 'boat'\?"):
        run.main()
