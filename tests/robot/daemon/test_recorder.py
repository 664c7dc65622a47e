"""Recorder: pairing of commands with observations, and the writer thread."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.demos.episodes import (
    EpisodeHeader,
    Step,
    episodes_of,
    read_episode,
    repair,
    writer,
)
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.control import ClientIdentity, NumberedFrame
from shapechanger.robot.daemon.recorder import (
    DISK_TOO_SLOW,
    EpisodeThread,
    StepBuilder,
)
from shapechanger.robot.link.messages import Mark, Observation, Undo
from tests.robot.daemon.plans import ACTIONS, picture

pytestmark = pytest.mark.realtime

HEADER = EpisodeHeader(action_layout=ACTIONS.to_json())
WITHIN_S = 20.0


def step(number: int) -> tuple[Step, bytes]:
    """Return a step that encodes its number, and its frame."""
    return (
        Step(action=(0.0, number / 1e6), driver="person", captured_ns=number * 50_000_000),
        picture(number % 5),
    )


def test_all_calls_are_written_in_order(tmp_path: Path) -> None:
    reports: list[tuple[str, str]] = []
    answers: list[str] = []
    thread = EpisodeThread(tmp_path, HEADER, lambda *report: reports.append(report))
    thread.edit(Mark(text="too early"), answers.append)
    thread.edit(Undo(), answers.append)
    assert all(thread.add(*step(number)) for number in range(40))
    thread.edit(Mark(text="here"), answers.append)
    thread.edit(Undo(seconds=0.5), answers.append)
    thread.end("time")
    assert thread.add(*step(41))  # Ignored after the end.
    assert thread.join(WITHIN_S)
    assert reports == [("begun", ""), ("ended", "")]
    assert answers == ["There is no step to mark yet.", "There is nothing to undo.", "", ""]
    episode = read_episode(tmp_path / thread.progress.episode)
    assert (episode.closed, episode.outcome) == (True, "time")
    assert [s.action[1] for s in episode.steps] == [number / 1e6 for number in range(40)]
    assert (len(episode.kept), thread.progress.dropped) == (30, 10)
    assert [mark.step for mark in episode.marks] == [39]


def test_a_full_episode_goes_on_in_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writer, "FULL_BYTES", 2000)
    reports: list[tuple[str, str]] = []
    answers: list[str] = []
    thread = EpisodeThread(tmp_path, HEADER, lambda *report: reports.append(report))
    for number in range(40):
        made, jpeg = step(number)
        assert thread.add(made, jpeg if number % 3 == 0 else None)
        thread.edit(Mark(text=str(number)), answers.append)
    thread.end("time")
    assert thread.join(WITHIN_S)
    episodes = [read_episode(path) for path in episodes_of(tmp_path)]
    assert len(episodes) > 3
    assert reports == [("begun", "")] * len(episodes) + [("ended", "")]
    assert [e.outcome for e in episodes] == ["continued"] * (len(episodes) - 1) + ["time"]
    assert [e.header.notes.get("continues") for e in episodes[1:]] == [
        e.path.name for e in episodes[:-1]
    ]
    numbers = [round(s.action[1] * 1e6) for e in episodes for s in e.steps]
    assert numbers == list(range(40))
    seen = [e.jpeg(s) for e in episodes for s in e.steps]
    assert seen == [step(number - number % 3)[1] for number in range(40)]
    assert set(answers) == {""}
    assert [len(e.marks) for e in episodes] == [len(e.steps) for e in episodes]


@pytest.mark.parametrize("bytes_each", [0, 1 << 20])
def test_a_slow_disk_ends_the_episode_and_keeps_its_steps(tmp_path: Path, bytes_each: int) -> None:
    busy = EpisodeThread(tmp_path, HEADER, lambda *_: None)
    reports: list[tuple[str, str]] = []
    thread = EpisodeThread(tmp_path, HEADER, lambda *report: reports.append(report), after=busy)
    taken = 0
    large = b"\xff\xd8" + bytes(bytes_each)
    while thread.add(step(taken)[0], large):
        taken += 1
        assert taken < 10_000
    busy.end()
    assert thread.join(WITHIN_S)
    assert reports == [("begun", ""), ("ended", "")]
    episode = read_episode(tmp_path / thread.progress.episode)
    assert episode.outcome == DISK_TOO_SLOW
    assert len(episode.steps) == taken == (15 if bytes_each else 256)


def test_an_error_of_the_disk_is_reported(tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("in the way")
    reports: list[tuple[str, str]] = []
    thread = EpisodeThread(tmp_path / "kept", HEADER, lambda *report: reports.append(report))
    assert thread.join(WITHIN_S)
    ((what, trouble),) = reports
    assert (what, thread.progress.episode) == ("ended", "")
    assert "Cannot write" in trouble


_WRITES_FOR_EVER = """
import sys
from pathlib import Path
from tests.robot.daemon.test_recorder import HEADER, step
from shapechanger.robot.daemon.recorder import EpisodeThread

thread, number = EpisodeThread(Path(sys.argv[1]), HEADER, lambda *_: None), 0
while True:
    if thread.progress.steps >= number - 100:
        thread.add(*step(number))
        number += 1
    if number % 20 == 0:
        print(thread.progress.steps, flush=True)
"""


def test_an_episode_of_a_killed_daemon_can_be_repaired(tmp_path: Path) -> None:
    rng = random.Random(5)
    for number in range(2):
        folder = tmp_path / str(number)
        writing = subprocess.Popen(
            [sys.executable, "-c", _WRITES_FOR_EVER, str(folder)], stdout=subprocess.PIPE, text=True
        )
        assert writing.stdout is not None
        enough, reported = rng.randrange(1, 400), 0
        until_s = time.monotonic() + WITHIN_S
        while reported < enough and time.monotonic() < until_s:
            reported = int(writing.stdout.readline())
        os.kill(writing.pid, signal.SIGKILL)
        reported = max([reported, *(int(line) for line in writing.stdout.read().split("\n")[:-1])])
        writing.wait()
        writing.stdout.close()
        (path,) = episodes_of(folder)
        repair(path)
        episode = read_episode(path)
        assert reported >= enough
        assert len(episode.steps) >= reported
        assert [s.index for s in episode.steps] == list(range(len(episode.steps)))
        assert all(episode.jpeg(s) == picture(s.index % 5) for s in episode.steps)


ADA, NET = ClientIdentity(1, "Ada", "person"), ClientIdentity(2, "net", "program")


def seen(seq: int, at_ns: int, **changes: Any) -> Observation:
    """Build an observation sent to a client."""
    fields: dict[str, Any] = {
        "seq": seq,
        "captured_ns": at_ns,
        "state_ns": at_ns,
        "sent_ns": at_ns,
        "frame": None,
        "frame_seq": 0,
        "state": (float(at_ns),),
        "sources": {},
        "action_applied": (0.25,),
        "applied_seq": None,
        "applied_ns": None,
        "command_ns": None,
        "stop_reason": "",
        "armed": True,
        "emergency": False,
        "emergencies": 0,
        "holder": "",
        "mine": True,
    }
    return Observation(**(fields | changes))


def frame(seq: int) -> NumberedFrame:
    """Build a frame that encodes its number."""
    return NumberedFrame(seq, Frame(b"jpeg %d" % seq, seq))


class Built:
    """A builder, and the steps that it has written with their frames."""

    def __init__(self) -> None:
        self.written: list[tuple[Step, bytes | None]] = []
        self.builder = StepBuilder(
            [(-1.0, 1.0)], lambda *step: self.written.append(step), lambda: 7
        )


@pytest.fixture
def built() -> Built:
    """A new builder."""
    return Built()


def test_the_next_observation_brings_the_applied_outputs(built: Built) -> None:
    built.builder.observed(1, seen(1, 100, suggested=(0.9,)), frame(1))
    built.builder.decided(ADA, 1, (0.5,), 110)
    assert built.written == []
    built.builder.observed(1, seen(2, 120, stop_reason="A bump."), frame(2))
    built.builder.complete()
    ((step, jpeg),) = built.written
    assert jpeg == b"jpeg 1"
    assert (step.action, step.applied, step.wanted) == ((0.5,), (0.25,), (0.9,))
    assert (step.captured_ns, step.decided_ns, step.wall_ns) == (100, 110, 7)
    assert (step.driver, step.state, step.stop_reason) == ("person", (100.0,), "A bump.")


def test_the_later_of_two_decisions_counts(built: Built) -> None:
    built.builder.observed(1, seen(1, 100), None)
    built.builder.decided(ADA, 1, (0.5,), 110)
    built.builder.decided(ADA, 1, (0.0,), 115)
    built.builder.complete()
    ((step, _),) = built.written
    assert (step.action, step.decided_ns, step.applied) == ((0.0,), 115, None)


def test_a_command_for_an_unknown_observation_is_skipped(built: Built) -> None:
    built.builder.observed(1, seen(1, 100), None)
    for who, answers in ((ADA, 2), (NET, 1)):
        built.builder.decided(who, answers, (0.5,), 110)
    built.builder.forget(1)
    built.builder.decided(ADA, 1, (0.5,), 110)
    built.builder.complete()
    assert built.written == []


def test_a_client_without_control_does_not_complete_applied_outputs(built: Built) -> None:
    built.builder.observed(2, seen(1, 100), None)
    built.builder.decided(NET, 1, (0.5,), 110)
    built.builder.observed(2, seen(2, 120, mine=False), None)
    ((step, _),) = built.written
    assert step.applied is None


@given(
    events=st.lists(
        st.tuples(st.booleans(), st.sampled_from((ADA, NET)), st.integers(0, 4)), max_size=60
    )
)
def test_times_increase_and_no_frame_repeats(
    events: list[tuple[bool, ClientIdentity, int]],
) -> None:
    built = Built()
    newest = {ADA.session: 0, NET.session: 0}
    for now_ns, (looks, who, back) in enumerate(events):
        if looks:
            newest[who.session] += 1
            picture = frame(1 + now_ns // 3)  # Each picture is seen a few times.
            sent = seen(newest[who.session], picture.seq)
            built.builder.observed(who.session, sent, picture)
        else:
            built.builder.decided(who, newest[who.session] - back, (0.5,), now_ns)
    built.builder.complete()
    for times in ("captured_ns", "decided_ns"):
        found = [getattr(step, times) for step, _ in built.written]
        assert found == sorted(found)
    pictures = [jpeg for _, jpeg in built.written if jpeg is not None]
    assert len(pictures) == len(set(pictures))
    shown = b""
    for step, jpeg in built.written:
        shown = jpeg or shown
        assert shown == b"jpeg %d" % step.captured_ns  # Its own, or the one before it.
