"""Finger logs: validation and files."""

from __future__ import annotations

import json
import math
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shapechanger.errors import FingerError, OutputError, UnknownName
from shapechanger.finger.anatomy import JOINTS, TENDONS
from shapechanger.finger.identify import FingerLog, identify, load_log, save_log
from shapechanger.finger.identify.log import SIGNALS, require_informative
from shapechanger.finger.parameters import NOMINAL, CommandPath
from tests.finger.identify.logs import changed, made_up


def test_a_log_round_trips(tmp_path: Path) -> None:
    """All signals and names are kept."""
    log = changed(made_up(), source="finger of the third shelf", actions="tension")
    save_log(log, tmp_path / "log")
    back = load_log(tmp_path / "log")
    for name in SIGNALS:
        np.testing.assert_array_equal(getattr(back, name), getattr(log, name))
    for name in ("actions", "control_dt", "source"):
        assert getattr(back, name) == getattr(log, name)


def test_a_log_knows_its_length() -> None:
    """`len` counts rows, and `seconds` lasts from the first to the last."""
    assert len(made_up(151)) == 151
    assert made_up(151).seconds == pytest.approx(3.0)
    assert made_up(0).seconds == 0.0


def with_row(name: str, row: int, value: float) -> dict[str, Any]:
    """Return a signal of the synthetic log with one value changed."""
    values = getattr(made_up(), name).copy()
    values[row] = value
    return {name: values}


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (with_row("angles", 7, math.nan), "angles is not finite in row 7"),
        (with_row("tensions", 0, math.inf), "tensions is not finite in row 0"),
        (with_row("t", 20, 0.1), r"backwards in row 20 .* 0\.100 s comes after 0\.380 s"),
        ({"t": 0.02 * np.r_[:100, 150:350]}, r"every 20 ms, .* none between 1\.980 s and 3\.000 s"),
        ({"lengths": np.zeros((300, 6))}, r"lengths must have the shape \(300, 7\), got \(300, 6"),
        ({"t": np.zeros((300, 1))}, r"t must have the shape \(300,\), got \(300, 1\)"),
        ({"control_dt": 0.0}, r"control_dt must be above 0 s and finite, got 0\.0"),
        ({"control_dt": math.inf}, "control_dt must be above 0 s and finite, got inf"),
    ],
)
def test_invalid_logs_are_rejected(changes: dict[str, Any], sentence: str) -> None:
    """The message names the signal and the row."""
    with pytest.raises(FingerError, match=sentence):
        changed(made_up(), **changes)


def test_clocks_may_jitter_by_half_a_period() -> None:
    """Steps of up to 1.5 periods are accepted; longer ones are gaps."""
    t = made_up().t
    changed(made_up(), t=np.where(t > 1.0, t + 0.0099, t))
    with pytest.raises(FingerError, match="has a gap"):
        changed(made_up(), t=np.where(t > 1.0, t + 0.0101, t))


def test_an_unknown_mode_is_rejected() -> None:
    """The error suggests the nearest name."""
    with pytest.raises(UnknownName, match="Did you mean 'tension'"):
        changed(made_up(), actions="tensions")


def only(joint: int, factor: float) -> FingerLog:
    """Return the synthetic log with the motion of one joint scaled."""
    log = made_up()
    return changed(log, angles=log.angles * np.where(np.arange(4) == joint, factor, 1.0))


def test_uninformative_logs_are_rejected() -> None:
    """Short logs, and joints that do not move on their own, raise an error."""
    with pytest.raises(FingerError, match=r"3\.0 s long; identification needs at least 4 s"):
        identify(made_up(151))
    with pytest.raises(FingerError, match=r"MCP_abduction moved by 1\.\d degrees only"):
        identify(only(1, 0.01))
    log = made_up()
    coupled = log.angles.copy()
    coupled[:, 3] = 0.6 * coupled[:, 2]
    with pytest.raises(FingerError, match="PIP_flexion moved only along with the other joints"):
        identify(changed(log, angles=coupled))


def test_limits_of_informative_logs() -> None:
    """A log needs 4 s, to half a period, and a range of 10 degrees per joint."""
    require_informative(made_up(201))
    with pytest.raises(FingerError, match="at least 4 s"):
        require_informative(made_up(200))
    low, high = np.percentile(made_up().angles[:, 0], [5.0, 95.0])
    degrees = math.degrees(high - low)
    require_informative(only(0, 10.1 / degrees))
    with pytest.raises(FingerError, match=r"MCP_flexion moved by 9\.9 degrees only; .* least 10"):
        require_informative(only(0, 9.9 / degrees))


@pytest.mark.parametrize(("own", "passes"), [(2.1, True), (1.9, False)])
def test_a_joint_must_move_on_its_own_by_two_degrees(own: float, passes: bool) -> None:
    """The standard deviation that other joints do not explain must be 2 degrees."""
    log = made_up()
    others, fresh = log.angles[:, :3] - log.angles[:, :3].mean(axis=0), log.angles[:, 3]
    fresh = fresh - fresh.mean()
    fresh = fresh - others @ np.linalg.lstsq(others, fresh)[0]
    coupled = log.angles.copy()
    coupled[:, 3] = 0.6 * others[:, 2] + math.radians(own) * fresh / fresh.std()
    if passes:
        require_informative(changed(log, angles=coupled))
    else:
        with pytest.raises(FingerError, match="flexion moved only along with the other joints"):
            require_informative(changed(log, angles=coupled))


def test_other_files_are_rejected(tmp_path: Path) -> None:
    """Missing, foreign, truncated and incomplete files raise an error."""
    path = tmp_path / "log.npz"
    with pytest.raises(FingerError, match="There is no file"):
        load_log(path)
    path.write_text("t,x,y,z\n")
    with pytest.raises(FingerError, match="not a finger log; `shapechanger finger record`"):
        load_log(path)
    with path.open("wb") as file:
        np.save(file, np.zeros(3))
    with pytest.raises(FingerError, match="not a finger log;"):
        load_log(path)
    save_log(made_up(), path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FingerError, match="cut short or damaged"):
        load_log(path)
    np.savez(path, t=np.zeros(3))
    with pytest.raises(FingerError, match="it has no header"):
        load_log(path)
    with pytest.raises(FingerError, match="cannot be read: Is a directory"):
        load_log(tmp_path)


def test_pipes_and_devices_are_refused_unread(tmp_path: Path) -> None:
    """A pipe without a writer would wait forever."""
    pipe = tmp_path / "log.npz"
    os.mkfifo(pipe)
    for path in (pipe, Path(os.devnull)):
        with pytest.raises(FingerError, match="cannot be read: it is not a regular file"):
            load_log(path)


@pytest.mark.parametrize(
    "header",
    [b"{}", b'{"format": "cake", "version": 1', b'{"format": "cake", "version": 1}'],
)
def test_invalid_headers_are_rejected(tmp_path: Path, header: bytes) -> None:
    """Headers that are incomplete or not JSON raise an error."""
    np.savez(tmp_path / "log.npz", header=np.frombuffer(header, np.uint8))
    with pytest.raises(FingerError, match="its header is invalid"):
        load_log(tmp_path / "log.npz")


FINGER_LOG = '"format": "shapechanger finger log", "version": 1'


@pytest.mark.parametrize(
    ("kind", "arrays", "sentence"),
    [
        ('"format": "cake", "version": 1', {}, "not a finger log: its format is 'cake'"),
        ('"format": "shapechanger finger log", "version": 9', {}, "version 9; this .* up to 1"),
        (FINGER_LOG, {}, "not a complete log: it lacks commands"),
        (FINGER_LOG, dict.fromkeys(SIGNALS, np.array(["x"])), "its arrays must hold numbers"),
        (FINGER_LOG, dict.fromkeys(SIGNALS, np.zeros((3, 1))), "t must have one dimension"),
    ],
)
def test_other_archives_are_rejected(
    tmp_path: Path, kind: str, arrays: dict[str, np.ndarray], sentence: str
) -> None:
    """Other formats, later versions, and missing or invalid arrays raise an error."""
    names = {"actions": "tension", "control_dt": 0.02, "joints": JOINTS, "tendons": TENDONS}
    rest = json.dumps(names).removeprefix("{")
    header = np.frombuffer(f"{{{kind}, {rest}".encode(), np.uint8)
    np.savez(tmp_path / "log.npz", header=header, **{"t": np.zeros(3), **arrays})
    with pytest.raises(FingerError, match=sentence):
        load_log(tmp_path / "log.npz")


@pytest.mark.parametrize(
    ("joints", "tendons", "sentence"),
    [
        (["thumb", "b"], TENDONS, "the joints thumb, b, but the finger has MCP_flexion"),
        (JOINTS, [], "the tendons none, but the finger has FDP"),
    ],
)
def test_logs_of_other_fingers_are_rejected(
    tmp_path: Path, joints: list[str], tendons: list[str], sentence: str
) -> None:
    """Logs with other joints or tendons raise an error."""
    names = {"actions": "tension", "control_dt": 0.02, "joints": joints, "tendons": tendons}
    whole = {"format": "shapechanger finger log", "version": 1, **names}
    header = np.frombuffer(json.dumps(whole).encode(), np.uint8)
    np.savez(tmp_path / "log.npz", header=header, t=np.zeros(3))
    with pytest.raises(FingerError, match=sentence):
        load_log(tmp_path / "log.npz")


def test_an_unwritable_path_is_refused(tmp_path: Path) -> None:
    """Saving to a folder raises OutputError."""
    with pytest.raises(OutputError, match="cannot be written"):
        save_log(made_up(), tmp_path)


def test_a_path_that_contradicts_the_log_is_refused() -> None:
    """Rate of the path and period of the log are both named; a fitting path is no error."""
    log = made_up()
    fits = changed(log, motors=NOMINAL.replace(path=CommandPath(control_hz=100.0)))
    require_informative(fits)
    for hz in (40.0, 75.0):
        path = CommandPath(control_hz=hz, tick_hz=2.0 * hz)
        with pytest.raises(FingerError, match=rf"control_hz={hz:g}, but the log has 50 .*=0.02"):
            require_informative(changed(log, motors=NOMINAL.replace(path=path)))


def test_a_log_of_an_old_version_knows_no_motors(tmp_path: Path) -> None:
    """A header without motors reads as one of a finger about whose motors nothing is known."""
    path = tmp_path / "old.npz"
    save_log(made_up(), path)
    with np.load(path) as read:
        arrays = {name: read[name] for name in read.files}
    header = json.loads(bytes(arrays["header"]))
    del header["motors"]
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    with path.open("wb") as file:
        np.savez(file, **arrays)
    assert load_log(path).motors is None


def test_an_archive_that_unpacks_to_anything_is_refused(tmp_path: Path) -> None:
    """A log of 300 kilobytes that holds 300 megabytes, and one with a pickled object."""
    bomb = tmp_path / "bomb.npz"
    with (
        zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("t.npy", "w", force_zip64=True) as file,
    ):
        for _ in range(300):
            file.write(bytes(1 << 20))
    with pytest.raises(FingerError, match="unpacks to 314572800 bytes"):
        load_log(bomb)
    pickled = tmp_path / "pickled.npz"
    np.savez(pickled, t=np.array([object()], dtype=object))
    with pytest.raises(FingerError):
        load_log(pickled)
