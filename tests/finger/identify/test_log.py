"""Finger logs: validation, files, and recordings of random motion."""

import json
import math
import os
import zipfile
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import shapechanger  # noqa: F401 - Registers the ids.
from shapechanger.errors import FingerError, LayoutError, OutputError, UnknownName
from shapechanger.finger.anatomy import JOINT_RANGE, JOINTS
from shapechanger.finger.controller import FingerBabble
from shapechanger.finger.identify import FingerLog, identify, load_log, save_log
from shapechanger.finger.identify.log import SIGNALS, record_babble, require_informative
from shapechanger.layout import Feature, Layout
from tests.finger.identify.logs import changed, made_up, recorded


def test_a_log_round_trips(tmp_path: Path) -> None:
    log = changed(made_up(), source="finger of the third shelf", actions="tension")
    save_log(log, tmp_path / "log")
    back = load_log(tmp_path / "log")
    for name in SIGNALS:
        np.testing.assert_array_equal(getattr(back, name), getattr(log, name))
    for name in ("actions", "control_dt", "source"):
        assert getattr(back, name) == getattr(log, name)


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
        (with_row("t", 20, 0.1), r"backwards .* in row 20: .* 0\.100 s comes after 0\.380 s"),
        ({"t": 0.02 * np.r_[:100, 150:350]}, r"gap .* every 20 ms, and 3\.000 s .* 1\.980 s"),
        ({"lengths": np.zeros((300, 6))}, r"lengths must have the shape \(300, 7\), got \(300, 6"),
        ({"control_dt": 0.0}, r"control_dt must be above 0 s and finite, got 0\.0"),
        ({"actions": "tensions"}, "Did you mean 'tension'"),
    ],
)
def test_invalid_logs_are_rejected(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises((FingerError, UnknownName), match=sentence):
        changed(made_up(), **changes)


def coupled(own_deg: float) -> FingerLog:
    """Return the synthetic log; its last joint follows another, plus its own `own_deg` degrees."""
    log = made_up()
    others, fresh = log.angles[:, :3] - log.angles[:, :3].mean(axis=0), log.angles[:, 3]
    fresh = fresh - fresh.mean()
    fresh = fresh - others @ np.linalg.lstsq(others, fresh)[0]
    angles = log.angles.copy()
    angles[:, 3] = 0.6 * others[:, 2] + math.radians(own_deg) * fresh / fresh.std()
    return changed(log, angles=angles)


def knuckle(degrees: float) -> FingerLog:
    """Return the synthetic log, in which the first joint moves over a range of `degrees`."""
    log = made_up()
    low, high = np.percentile(log.angles[:, 0], [5.0, 95.0])
    factor = degrees / math.degrees(high - low)
    return changed(log, angles=log.angles * (factor, 1.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("enough", "less", "sentence"),
    [
        (made_up(201), made_up(200), "at least 4 s"),
        (knuckle(10.1), knuckle(9.9), r"MCP_flexion moved by 9\.9 degrees only; .* least 10"),
        (coupled(2.1), coupled(1.9), "flexion moved only along with the other joints"),
    ],
    ids=["duration", "range", "independence"],
)
def test_limits_of_informative_logs(enough: FingerLog, less: FingerLog, sentence: str) -> None:
    """A log must last 4 s, and move each joint over 10 degrees, by 2 degrees on its own."""
    require_informative(enough)
    with pytest.raises(FingerError, match=sentence):
        identify(less)


def test_clocks_may_jitter_by_half_a_period() -> None:
    """Steps of up to 1.5 periods are accepted; longer ones are gaps."""
    t = made_up().t
    changed(made_up(), t=np.where(t > 1.0, t + 0.0099, t))
    with pytest.raises(FingerError, match="has a gap"):
        changed(made_up(), t=np.where(t > 1.0, t + 0.0101, t))


DAMAGED = r"is damaged, or not a finger log: .*\. Record one with `shapechanger finger record`"


def test_files_that_are_no_logs_are_refused(tmp_path: Path) -> None:
    path, pipe = tmp_path / "log.npz", tmp_path / "pipe.npz"
    for one in (path, tmp_path):
        with pytest.raises(FingerError, match=r"cannot be read: (No such file|Is a directory)"):
            load_log(one)
    with pytest.raises(OutputError, match="Cannot write"):
        save_log(made_up(), tmp_path)
    os.mkfifo(pipe)  # Opening a pipe without a writer would block.
    for one in (pipe, Path(os.devnull)):
        with pytest.raises(FingerError, match="cannot be read: it is not a regular file"):
            load_log(one)
    save_log(made_up(), path)
    whole = path.read_bytes()
    for content in (b"t,x,y,z\n", b"", whole[: len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(FingerError, match=DAMAGED):
            load_log(path)
    np.savez(path, header=np.array([object()], dtype=object))
    with pytest.raises(FingerError, match=DAMAGED):
        load_log(path)
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("t.npy", "w", force_zip64=True) as file,
    ):
        for _ in range(300):  # 300 kilobytes that unpack to 300 megabytes.
            file.write(bytes(1 << 20))
    with pytest.raises(FingerError, match="unpacks to 314572800 bytes"):
        load_log(path)


def rewritten(path: Path, header: dict[str, Any], arrays: dict[str, Any]) -> None:
    """Write a log with changed fields of its header and arrays; None removes a field or array."""
    save_log(made_up(), path)
    with np.load(path) as read:
        kept = {name: read[name] for name in read.files}
    fields = json.loads(bytes(kept.pop("header"))) | header
    fields = {name: value for name, value in fields.items() if value is not None}
    kept = {name: value for name, value in (kept | arrays).items() if value is not None}
    np.savez(path, header=np.frombuffer(json.dumps(fields).encode(), np.uint8), **kept)


@pytest.mark.parametrize(
    ("header", "arrays", "sentence"),
    [
        ({"format": "cake"}, {}, "'cake' - at `\\$.format`"),
        ({"format": None}, {}, "missing required field `format`"),
        ({"version": 9}, {}, "9 - at `\\$.version`"),
        ({"control_dt": "x"}, {}, "Expected `float`, got `str`"),
        ({"joints": ["thumb"]}, {}, "its joints and tendons are thumb, FDP"),
        ({"motors": {"motor_kg": -1.0}}, {}, "motor_kg must be"),
        ({}, {"commands": None}, "commands"),
        ({}, {"angles": np.array(["x"])}, "could not convert string"),
        ({}, {"t": np.zeros((3, 1))}, r"t must have the shape \(3,\), got \(3, 1\)"),
    ],
)
def test_other_archives_are_refused(
    tmp_path: Path, header: dict[str, Any], arrays: dict[str, Any], sentence: str
) -> None:
    path = tmp_path / "log.npz"
    rewritten(path, header, arrays)
    with pytest.raises(FingerError, match=sentence):
        load_log(path)


def test_motors_are_optional_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    rewritten(path, {"motors": None}, {})
    assert load_log(path).motors is None


@pytest.mark.parametrize("actions", ["impedance", "tension", "length"])
@pytest.mark.parametrize("finger_seed", [0, 7])
def test_every_joint_moves_far_and_on_its_own(actions: str, finger_seed: int) -> None:
    """Joints cover half of their range, knuckle flexion a third; only the end joint follows one."""
    log, _ = recorded(10.0, gap="real-like", finger_seed=finger_seed, actions=actions)
    low, high = np.percentile(log.angles, [5.0, 95.0], axis=0)
    share = (high - low) / (JOINT_RANGE[:, 1] - JOINT_RANGE[:, 0])
    assert (share > [0.33, 0.5, 0.5, 0.5]).all()
    correlation = np.corrcoef(log.angles.T) - np.eye(4)
    assert abs(correlation[2, 3]) < 0.97  # Middle and end joint.
    correlation[2, 3] = correlation[3, 2] = 0.0
    assert np.abs(correlation).max() < 0.8
    assert (log.tensions > 1.0).mean() > 0.88  # Tendons are rarely slack.


def test_the_seed_determines_the_motion() -> None:
    layout = Layout(tuple(Feature(f"{name}/angle", "rad") for name in JOINTS))
    first, same, other = (FingerBabble(layout, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first(np.zeros(4)), same(np.zeros(4)))
    assert np.abs(first.posture(1.0) - other.posture(1.0)).max() > 0.01
    postures = np.array([first.posture(t) for t in np.linspace(0.0, 10.0, 50)])
    assert (postures > JOINT_RANGE[:, 0]).all()
    assert (postures < JOINT_RANGE[:, 1]).all()
    with pytest.raises(UnknownName, match="MCP_flexion/angle"):
        FingerBabble(Layout((Feature("thigh/angle", "rad"),)))


@pytest.mark.parametrize(
    ("env", "error", "text"),
    [
        (("shapechanger/Finger-v1", {"goal": True}), FingerError, "omit `goal`"),
        (("Pendulum-v1", {}), LayoutError, "Pendulum-v1 publishes no observation_layout"),
        (("shapechanger/Finger-v1", {}), FingerError, r"ended after 2\.0 s of 3 s\.$"),
    ],
)
def test_envs_that_give_no_log_are_refused(
    env: tuple[str, dict[str, Any]], error: type[Exception], text: str
) -> None:
    with gym.make(env[0], **env[1]) as made, pytest.raises(error, match=text):
        record_babble(made, 3.0)
