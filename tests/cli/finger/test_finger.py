"""`shapechanger finger`: from an env to a log, and from a log to a finger."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shapechanger.bodies.finger import FingerParameters
from shapechanger.cli import main
from shapechanger.identify import load_log
from tests.identify.logs import recorded


def said(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """What a command prints."""
    main(["finger", *map(str, words)])
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """Why a command is refused."""
    with pytest.raises(SystemExit) as stop:
        main(["finger", *map(str, words)])
    assert stop.value.code == 2
    return capsys.readouterr().err


def test_a_finger_is_recorded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As from Python, with the same seeds."""
    out = tmp_path / "new" / "log.npz"
    words = ("--seconds", 2.4, "--seed", 4, "--gap", "real-like", "--finger-seed", 3)
    printed = said(capsys, "record", "Finger", "--out", out, *words, "--actions", "tension")
    assert "wrote 121 rows, 2.4 s" in printed
    log = load_log(out)
    assert (log.actions, log.source) == ("tension", "shapechanger/Finger-v1")
    again, _ = recorded(2.4, seed=4, gap="real-like", finger_seed=3, actions="tension")
    np.testing.assert_array_equal(log.angles, again.angles)
    np.testing.assert_array_equal(log.commands, again.commands)


def test_what_cannot_be_recorded_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Another body, another name, no time, no options, and a goal."""
    out = ("--out", tmp_path / "log.npz")
    assert "is not a finger env" in refused(capsys, "record", "Ant", *out)
    assert "Did you mean" in refused(capsys, "record", "Fingr", *out)
    assert "--seconds is more than 0" in refused(capsys, "record", "Finger", *out, "--seconds", "0")
    assert "--options must be JSON" in refused(capsys, "record", "Finger", *out, "--options", "a")
    assert "omit `goal`" in refused(capsys, "record", "Finger", *out, "--options", '{"goal": true}')
    assert "real-like" in refused(capsys, "record", "Finger", *out, "--gap", "real-lik")


def test_what_cannot_be_identified_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A log that is too short, none, and a report that would take the log's place."""
    log = tmp_path / "log.npz"
    assert "There is no file" in refused(capsys, "identify", log)
    said(capsys, "record", "Finger", "--out", log, "--seconds", "1")
    assert "1.0 s long" in refused(capsys, "identify", log)
    assert "it is the log" in refused(capsys, "identify", log, "--report", log)
    assert "it is a folder" in refused(capsys, "identify", log, "--out", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["log.npz"]


@pytest.mark.slow
def test_a_finger_is_identified(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A line for each parameter, what cannot be determined, and a last line that sums it up."""
    log, out = tmp_path / "log.npz", tmp_path / "finger.json"
    gap = ("--gap", "real-like", "--finger-seed", 3)
    said(capsys, "record", "Finger", "--out", log, "--seconds", 6, *gap)
    lines = said(capsys, "identify", log, "--out", out).splitlines()
    assert sum(line.startswith("moment arm ") for line in lines) == 25
    assert any(line.startswith("backlash cannot be determined: ") for line in lines)
    assert lines[-1].startswith("arms: 25 intervals, ")
    assert FingerParameters.from_json(out.read_text()).gives
    assert "Parameters that this log cannot determine" in (tmp_path / "log.html").read_text()
