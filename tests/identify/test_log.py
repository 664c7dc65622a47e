"""Logs of fingers: what they hold, how they are kept, and what is wrong with bad ones."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shapechanger.errors import FingerError, OutputError, UnknownName
from shapechanger.identify import FingerLog, identify, load_log, save_log
from shapechanger.identify.log import SIGNALS
from tests.identify.logs import changed, made_up


def test_a_log_comes_back_as_it_was(tmp_path: Path) -> None:
    """Every number and every name."""
    log = changed(made_up(), source="finger of the third shelf", actions="tension")
    save_log(log, tmp_path / "log")
    back = load_log(tmp_path / "log")
    for name in SIGNALS:
        np.testing.assert_array_equal(getattr(back, name), getattr(log, name))
    for name in ("actions", "control_dt", "joints", "tendons", "source"):
        assert getattr(back, name) == getattr(log, name)


def with_row(name: str, row: int, value: float) -> dict[str, Any]:
    """A signal of the made-up log with another value in one row."""
    values = getattr(made_up(), name).copy()
    values[row] = value
    return {name: values}


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (with_row("angles", 7, math.nan), "angles holds no number in row 7"),
        (with_row("tensions", 0, math.inf), "tensions holds no number in row 0"),
        (with_row("t", 20, 0.1), r"backwards in row 20 .* 0\.100 s comes after 0\.380 s"),
        ({"t": 0.02 * np.r_[:100, 150:350]}, r"gap: between 1\.980 s and 3\.000 s .* every 20 ms"),
        ({"joints": ("thumb", "b", "c", "d")}, "another finger: its joints are thumb, b, c, d"),
        ({"tendons": ()}, "another finger: its tendons are none, not FDP"),
        ({"lengths": np.zeros((300, 6))}, r"lengths has the shape \(300, 6\), not \(300, 7\)"),
        ({"control_dt": 0.0}, "period of control is above 0 s"),
    ],
)
def test_bad_logs_are_refused(changes: dict[str, Any], sentence: str) -> None:
    """The sentence says what is wrong, and where."""
    with pytest.raises(FingerError, match=sentence):
        changed(made_up(), **changes)


def test_an_unknown_mode_is_refused() -> None:
    """With the nearest spelling."""
    with pytest.raises(UnknownName, match="Did you mean 'tension'"):
        changed(made_up(), actions="tensions")


def only(joint: int, factor: float) -> FingerLog:
    """The made-up log in which one joint moves less."""
    log = made_up()
    return changed(log, angles=log.angles * np.where(np.arange(4) == joint, factor, 1.0))


def test_logs_that_tell_nothing_are_refused() -> None:
    """Too short, or a joint that stands still or moves only with others: which one is said."""
    with pytest.raises(FingerError, match=r"3\.0 s long; it takes 4 s"):
        identify(made_up(151))
    with pytest.raises(FingerError, match=r"MCP_abduction hardly moved, by 1\.\d degrees"):
        identify(only(1, 0.01))
    log = made_up()
    coupled = log.angles.copy()
    coupled[:, 3] = 0.6 * coupled[:, 2]
    with pytest.raises(FingerError, match="PIP_flexion moved only along with the other joints"):
        identify(changed(log, angles=coupled))


def test_files_that_are_no_logs_are_refused(tmp_path: Path) -> None:
    """Another file, half of one, none, one without numbers, and one of tomorrow."""
    path = tmp_path / "log.npz"
    with pytest.raises(FingerError, match="There is no file"):
        load_log(path)
    path.write_text("t,x,y,z\n")
    with pytest.raises(FingerError, match="no log of a finger; `shapechanger finger record`"):
        load_log(path)
    with path.open("wb") as file:
        np.save(file, np.zeros(3))
    with pytest.raises(FingerError, match="no log of a finger;"):
        load_log(path)
    save_log(made_up(), path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FingerError, match="cut short or damaged"):
        load_log(path)
    np.savez(path, t=np.zeros(3))
    with pytest.raises(FingerError, match="it has no header"):
        load_log(path)


@pytest.mark.parametrize(
    ("header", "sentence"),
    [
        (b"{}", "its header says"),
        (b'{"format": "cake", "version": 1', "its header says"),
        (b'{"format": "cake", "version": 1}', "its header says"),
    ],
)
def test_bad_headers_are_refused(tmp_path: Path, header: bytes, sentence: str) -> None:
    """What is missing in them is said."""
    np.savez(tmp_path / "log.npz", header=np.frombuffer(header, np.uint8))
    with pytest.raises(FingerError, match=sentence):
        load_log(tmp_path / "log.npz")


@pytest.mark.parametrize(
    ("said", "sentence"),
    [
        ('"format": "cake", "version": 1', "no log of a finger, but 'cake'"),
        ('"format": "shapechanger finger log", "version": 9', "version 9, and this .* up to 1"),
        ('"format": "shapechanger finger log", "version": 1', "no whole log: it lacks commands"),
    ],
)
def test_other_files_of_arrays_are_refused(tmp_path: Path, said: str, sentence: str) -> None:
    """Another format, a later version, and one that lacks arrays."""
    rest = ', "actions": "tension", "control_dt": 0.02, "joints": [], "tendons": []'
    header = np.frombuffer(f"{{{said}{rest}}}".encode(), np.uint8)
    np.savez(tmp_path / "log.npz", header=header, t=np.zeros(3))
    with pytest.raises(FingerError, match=sentence):
        load_log(tmp_path / "log.npz")


def test_a_place_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    """A folder is none for a file."""
    with pytest.raises(OutputError, match="cannot be written"):
        save_log(made_up(), tmp_path)
