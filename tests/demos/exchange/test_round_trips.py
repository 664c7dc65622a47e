"""An export followed by an import returns the same recording, as far as the format stores it."""

from __future__ import annotations

import json
import math
import tempfile
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shapechanger.demos.episodes import DRIVERS, Drop, EpisodeWriter, Step, edit
from shapechanger.demos.exchange import export_recording, import_recording
from shapechanger.layout import Layout
from tests.demos.exchange.small import (
    all_of,
    content_of,
    drive,
    findings_of,
    header,
    picture,
    record,
)

# Lone surrogates are not valid text.
_TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
_ANY = st.floats(width=64)
_FINITE = st.floats(allow_nan=False, allow_infinity=False)
_PAIRS = st.tuples(_ANY, _ANY)
_TIMES = st.none() | st.integers(0, 2**62)
_BEGUN = 10**18
_MS = 10**6


@st.composite
def _steps(
    draw: st.DrawFn, image: tuple[int, int] | None, state: bool, grey: bool
) -> list[tuple[Step, bytes | None, list[str]]]:
    steps = []
    clock = 0
    for number in range(draw(st.integers(1, 4))):
        clock += draw(st.integers(0, 10**9))
        step = Step(
            action=draw(st.tuples(_FINITE, _FINITE)),
            driver=draw(st.sampled_from(DRIVERS)),
            applied=draw(st.none() | _PAIRS),
            wanted=draw(st.none() | _PAIRS),
            state=draw(_PAIRS) if state else (),
            captured_ns=draw(st.sampled_from([None, clock])),
            decided_ns=draw(st.sampled_from([None, clock])),
            wall_ns=draw(_TIMES),
            reward=draw(st.none() | _ANY),
            terms=draw(st.dictionaries(_TEXTS, _ANY, max_size=2)),
            terminated=draw(st.booleans()),
            truncated=draw(st.booleans()),
            stop_reason=draw(_TEXTS | st.sampled_from(["=1+1", '"', "a\r\nb", "a\0b", "@x,y"])),
        )
        fresh = image is not None and (number == 0 or draw(st.booleans()))
        jpeg = picture(draw(st.integers(0, 3)), *(image or ()), grey=grey) if fresh else None
        steps.append((step, jpeg, draw(st.lists(_TEXTS, max_size=2))))
    return steps


@st.composite
def _headers(draw: st.DrawFn) -> dict[str, Any]:
    return {
        "control_hz": draw(st.floats(0.1, 1000.0)),
        "robot": draw(_TEXTS),
        "env": draw(_TEXTS),
        "env_kwargs": draw(st.dictionaries(_TEXTS, st.booleans() | _TEXTS, max_size=2)),
        "driver": draw(_TEXTS),
        "clock": draw(st.sampled_from(["real", "twin", "none"])),
        "seed": draw(st.none() | st.integers(0, 2**31)),
        "notes": draw(st.dictionaries(_TEXTS, st.lists(_TEXTS, max_size=2), max_size=2)),
    }


@pytest.mark.parametrize(
    ("image", "state", "grey"),
    [((40, 32), *other) for other in ((True, False), (False, False), (True, True))]
    + [(None, True, False)],
)
@pytest.mark.parametrize("name", ["csv", "minari"])
@settings(max_examples=3, suppress_health_check=list(HealthCheck))
@given(head=_headers(), outcome=_TEXTS, data=st.data())
def test_any_recording_round_trips(
    name: str,
    image: tuple[int, int] | None,
    state: bool,
    grey: bool,
    head: dict[str, Any],
    outcome: str,
    data: st.DataObject,
) -> None:
    steps = data.draw(_steps(image, state, grey))
    head |= {"image_size": image} | ({} if state else {"state_layout": Layout(())})
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        with EpisodeWriter.create(place / "data", header(**head)) as writer:
            for step, jpeg, marks in steps:
                writer.add(step, jpeg)
                for mark in marks:
                    writer.mark(mark)
            writer.close(outcome)
        if data.draw(st.booleans()):
            first = data.draw(st.integers(0, len(steps) - 1))
            last = data.draw(st.integers(first, len(steps) - 1))
            edit(writer.path, Drop(first, last, data.draw(_TEXTS)))
        export_recording(place / "data", place / "x-v0", name, dropped=True)
        import_recording(place / "x-v0", place / "back")
        (before,), (after,) = all_of(place / "data"), all_of(place / "back")
        assert content_of(after) == content_of(before)


@pytest.mark.parametrize("name", ["csv", "minari"])
def test_many_episodes_keep_their_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Folders are relative, and one episode is read in several chunks."""
    monkeypatch.chdir(tmp_path)
    for count in (3, 1, 300):
        drive(Path("data"), count)
    export_recording(Path("data"), Path("x-v0"), name)
    done = import_recording(Path("x-v0"), Path("back"))
    assert (done.format, done.episodes, done.steps) == (name, 3, 304)
    before, after = all_of(Path("data")), all_of(Path("back"))
    assert [content_of(e) for e in after] == [content_of(e) for e in before]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["back", "data", "x-v0"]


def test_a_tub_round_trips(tmp_path: Path) -> None:
    first: dict[str, Any] = {"action": (-0.5, 1.0), "wall_ns": _BEGUN}
    second: dict[str, Any] = {"action": (0.75, 0.0), "wall_ns": _BEGUN + 100 * _MS}
    steps = [
        Step(driver="person", state=(0.1, math.nan), wanted=(0.25, 0.5), **first),
        Step(driver="policy", state=(1 / 3, 20.0), **second),
    ]
    what = header(control_hz=10.0, body="car", clock="none", driver="", notes={})
    record(tmp_path / "data", what, [(step, picture(n)) for n, step in enumerate(steps)])
    export_recording(tmp_path / "data", tmp_path / "tub", "tub")
    import_recording(tmp_path / "tub", tmp_path / "back")
    (before,), (after,) = all_of(tmp_path / "data"), all_of(tmp_path / "back")
    # The times of a tub become those of the robot's clock.
    timed = [step | {"captured_ns": step["wall_ns"]} for step in content_of(before)["steps"]]
    assert content_of(after)["steps"] == timed
    assert content_of(after)["pictures"] == content_of(before)["pictures"]
    assert after.header.control_hz == 10.0


def with_a_pause(data: Path) -> Path:
    """Record eight steps: four 50 ms apart and, after a pause of about 7 s, four 80 ms apart."""
    times_ns = [n * 50_000_000 if n < 4 else 7 * 10**9 + n * 80_000_000 for n in range(8)]
    steps = [
        Step(action=(n / 10, 0.0), driver="person", state=(0.0, 0.0), captured_ns=0, decided_ns=at)
        for n, at in enumerate(times_ns)
    ]
    # All steps share an image.
    jpegs = [picture(0), *[None] * 7]
    return record(data, header(), list(zip(steps, jpegs, strict=True)), "time")


@pytest.mark.parametrize(("name", "folder"), [("lerobot", "out"), ("minari", "out-v0")])
def test_steps_that_do_not_follow_each_other_are_separate_episodes(
    tmp_path: Path, name: str, folder: str
) -> None:
    edit(with_a_pause(tmp_path / "data"), Drop(1, 1, "bad"))
    assert export_recording(tmp_path / "data", tmp_path / "csv", "csv").episodes == 1
    done = export_recording(tmp_path / "data", tmp_path / folder, name)
    assert (done.episodes, done.steps) == (3, 7)
    text = findings_of(done)
    assert "Dropped steps are left out (1)" in text
    assert "where steps are excluded or missing: 1 became 3." in text
    assert ("off by up to 0.09 s" in text) == (name == "lerobot")
    import_recording(tmp_path / folder, tmp_path / "back")
    back = all_of(tmp_path / "back")
    actions = [[round(10 * step.action[0]) for step in one.steps] for one in back]
    assert actions == [[0], [2, 3], [4, 5, 6, 7]]
    assert [one.outcome for one in back] == ["", "", "time"]
    assert all(one.jpeg(one.steps[0]) for one in back)
    began = [datetime.fromisoformat(one.header.created) for one in back]
    after_s = [round((one - began[0]).total_seconds(), 3) for one in began]
    assert after_s == [0.0, 0.1, 7.32]


@pytest.mark.parametrize(
    ("clock", "captured_ns", "wall_ns"),
    [
        # The twin ran three times as fast as real time, and the computer's clock was set back.
        (
            "twin",
            [7_000 * _MS + n * 50 * _MS for n in range(16)],
            [_BEGUN + n * 17 * _MS - (n > 8) * 10**9 for n in range(16)],
        ),
        ("none", [None] * 16, [None] * 16),
        ("real", [None] * 4, [_BEGUN, _BEGUN + 50 * _MS, None, _BEGUN + 60 * _MS]),
    ],
)
def test_times_of_a_tub_ascend_at_the_rate(
    tmp_path: Path, clock: Any, captured_ns: list[int | None], wall_ns: list[int | None]
) -> None:
    """A simulated drive has the times of its own clock, and unknown times follow the rate."""
    still: dict[str, Any] = {"action": (0.0, 0.5), "driver": "expert", "state": (0.0, 20.0)}
    times = zip(captured_ns, wall_ns, strict=True)
    made = [
        (Step(**still, captured_ns=captured, wall_ns=wall), picture(n))
        for n, (captured, wall) in enumerate(times)
    ]
    record(tmp_path / "data", header(clock=clock, control_hz=20.0), made)
    export_recording(tmp_path / "data", tmp_path / "tub", "tub")
    lines = (tmp_path / "tub" / "catalog_0.catalog").read_text().splitlines()
    times = np.array([json.loads(line)["_timestamp_ms"] for line in lines])
    assert (np.diff(times) == 50).all()
    import_recording(tmp_path / "tub", tmp_path / "back")
    (back,) = all_of(tmp_path / "back")
    assert back.header.control_hz == pytest.approx(20.0)
