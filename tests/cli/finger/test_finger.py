"""`shapechanger finger`: record a log, identify a finger from it, and export a finger."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from shapechanger.errors import FingerError
from shapechanger.finger.anatomy import TENDONS
from shapechanger.finger.gap import GAPS, shipped_rig
from shapechanger.finger.identify import FingerLog, load_log
from shapechanger.finger.identify.log import save_log
from shapechanger.finger.model import finger_mjcf
from shapechanger.finger.parameters import NOMINAL, PARAMETER_SETS, FingerParameters
from shapechanger.finger.tensions import drive_of
from tests.cli.running import Cli
from tests.finger.identify.logs import recorded


def test_a_finger_is_recorded(tmp_path: Path, finger: Cli) -> None:
    out = tmp_path / "new" / "log.npz"
    arguments = ("--seconds", 2.4, "--seed", 4, "--gap", "real-like", "--finger-seed", 3)
    printed = finger.output("record", "Finger", "--out", out, *arguments, "--actions", "tension")
    assert "wrote 121 rows, 2.4 s" in printed
    log = load_log(out)
    assert (log.actions, log.source) == ("tension", "shapechanger/Finger-v1")
    again, _ = recorded(2.4, seed=4, gap="real-like", finger_seed=3, actions="tension")
    np.testing.assert_array_equal(log.angles, again.angles)
    np.testing.assert_array_equal(log.commands, again.commands)


def test_invalid_recordings_are_refused(tmp_path: Path, finger: Cli) -> None:
    out = ("--out", tmp_path / "log.npz")
    assert "No argument of Ant matches 'actions'" in finger.refused("record", "Ant", *out)
    assert "--seconds must be above 0" in finger.refused("record", "Finger", *out, "--seconds", "0")
    assert "omit `goal`" in finger.refused("record", "Finger", *out, "--options", '{"goal": true}')
    assert "real-like" in finger.refused("record", "Finger", *out, "--gap", "real-lik")


def test_invalid_logs_are_refused(tmp_path: Path, finger: Cli) -> None:
    log = tmp_path / "log.npz"
    assert "cannot be read: No such file" in finger.refused("identify", log)
    finger.output("record", "Finger", "--out", log, "--seconds", "1")
    assert "1.0 s long" in finger.refused("identify", log)
    assert "it is the log" in finger.refused("identify", log, "--report", log)
    assert "it is a folder" in finger.refused("identify", log, "--out", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["log.npz"]


def test_geared_motors_can_be_assumed_if_the_log_does_not_describe_them(
    tmp_path: Path, finger: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, _ = recorded(2.4)
    own = NOMINAL.replace(motor_kg=0.5)
    save_log(dataclasses.replace(log, motors=None), tmp_path / "log.npz")
    save_log(dataclasses.replace(log, motors=own), tmp_path / "own.npz")
    taken: list[FingerParameters | None] = []

    def identify(log: FingerLog, _: object) -> None:
        taken.append(log.motors)
        raise FingerError("That is enough.")

    monkeypatch.setattr("shapechanger.cli.finger.identify", identify)
    for arguments in (("log.npz",), ("log.npz", "--geared"), ("own.npz", "--geared")):
        assert "That is enough." in finger.refused(
            "identify", tmp_path / arguments[0], *arguments[1:]
        )
    assert taken == [None, shipped_rig(), own]


@pytest.mark.slow
def test_a_finger_is_identified(tmp_path: Path, finger: Cli) -> None:
    log, out = tmp_path / "log.npz", tmp_path / "finger.json"
    gap = ("--gap", "real-like", "--finger-seed", 3)
    finger.output("record", "Finger", "--out", log, "--seconds", 6, *gap)
    lines = finger.output("identify", log, "--out", out).splitlines()
    rows = [line.split() for line in lines]
    assert [row[0] for row in rows if row and row[0] in TENDONS] == list(TENDONS)
    assert sum(line.startswith("joint ") for line in lines) == 8
    assert len(lines) < 35
    assert any(line.startswith("backlash cannot be determined: ") for line in lines)
    assert lines[-1].startswith("arms: 25 intervals, ")
    assert FingerParameters.from_json(out.read_text()).gives
    assert "Parameters that this log cannot determine" in (tmp_path / "log.html").read_text()


def test_a_finger_is_exported(tmp_path: Path, finger: Cli) -> None:
    out, file = tmp_path / "finger.xml", tmp_path / "finger.json"
    drawn = GAPS["real-like"].draw(np.random.default_rng(3))
    file.write_text(drawn.to_json())
    texts = []
    gap, named = ("--gap", "real-like", "--finger-seed", 3), ("--parameters", "an-1983")
    for arguments in (gap, ("--parameters", file), (), named):
        assert f"wrote {out}" in finger.output("export", "--out", out, *arguments)
        texts.append(out.read_text())
    drive = drive_of("impedance", NOMINAL)
    assert texts[0] == texts[1] == finger_mjcf(drawn, drive)
    assert texts[2] == finger_mjcf(NOMINAL, drive)
    assert texts[3] == finger_mjcf(PARAMETER_SETS["an-1983"], drive)
    to = ("--out", out)
    both = ("--gap", "wide", "--parameters", file)
    assert "not both" in finger.refused("export", *to, *both)
    assert "real-like" in finger.refused("export", *to, "--gap", "real-lik")
    assert "cannot be read" in finger.refused("export", *to, "--parameters", tmp_path / "no.json")
    os.mkfifo(pipe := tmp_path / "pipe.json")  # Opening a pipe without a writer would block.
    assert "not a regular file" in finger.refused("export", *to, "--parameters", pipe)
    file.write_text("{}]")
    assert "Invalid finger parameters" in finger.refused("export", *to, "--parameters", file)
