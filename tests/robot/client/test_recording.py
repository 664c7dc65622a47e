"""The client's methods for recordings and suggestions, with the real daemon."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from shapechanger.demos.episodes import read_episode
from shapechanger.errors import LinkError, RobotRefused
from shapechanger.robot.client.client import RobotClient
from tests.robot.client.robot import eventually
from tests.robot.client.test_real_daemon import Served

pytestmark = pytest.mark.realtime

Connect = Callable[..., RobotClient]


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    """A robot that keeps recordings."""
    kept = str(tmp_path / "kept")
    with Served(tmp_path, monkeypatch, recordings=kept, deadline_ms=60_000).serving() as served:
        served.sense()
        yield served


def drive(client: RobotClient, steps: int) -> None:
    """Send commands."""
    seen = client.ask()
    for _ in range(steps):
        seen = client.exchange((0.0, 0.5), seen)


def test_a_person_records_marks_and_undoes(robot: Served, tmp_path: Path) -> None:
    with RobotClient.connect(robot.known, role="person", name="Ada") as client:
        assert client.welcome.can_record
        assert client.recorder is None
        client.take()
        client.arm()
        began = client.record(name="corridor")
        assert (began.recording, began.steps) == (True, 0)
        drive(client, 6)
        assert client.mark("here").marks == 1
        assert client.mark("and here").marks == 2
        assert client.undo(3_600.0).dropped == 6
        with pytest.raises(RobotRefused, match="nothing to undo"):
            client.undo()
        drive(client, 2)
        ended = client.record(on=False)
        assert (ended.recording, ended.steps, ended.dropped) == (False, 8, 6)
        assert client.recorder == ended
        (summary,) = client.browse().episodes
        assert (summary.id, summary.steps, summary.kept) == (ended.episode, 8, 2)
        assert client.judge(summary.id, 0, 5, keep=True).kept == 8
        piece = client.fetch(summary.id)
        path = tmp_path / "kept" / summary.id
        assert "".join(f"{line}\n" for line in piece.lines) == (path / "steps.jsonl").read_text()
        assert client.fetch(summary.id, first=piece.total).lines == ()
    assert len(read_episode(path).kept) == 8


def test_refused_requests_leave_the_link_up(robot: Served) -> None:
    with RobotClient.connect(robot.known, role="person") as client:
        for invalid in (
            lambda: client.record(name="x" * 65),
            lambda: client.undo(0.0),
            lambda: client.undo(float("nan")),
            lambda: client.fetch("../../etc"),
            lambda: client.fetch("x", first=-1),
            lambda: client.browse("/"),
            lambda: client.judge("x", -1, 0, keep=True),
        ):
            with pytest.raises(LinkError, match="Not a valid message"):
                invalid()
        for refused, why in (
            (lambda: client.record(on=False), "Nothing is being recorded"),
            (client.mark, "Nothing is being recorded"),
            (lambda: client.fetch("nothing"), "no episode"),
            (lambda: client.judge("nothing", 0, 1, keep=False), "no episode"),
        ):
            with pytest.raises(RobotRefused, match=why):
                refused()
        assert client.browse().episodes == ()
        assert client.alive


def test_a_program_suggests_while_a_person_drives(robot: Served) -> None:
    with (
        RobotClient.connect(robot.known, role="person", name="Ada") as person,
        RobotClient.connect(robot.known, name="net") as program,
    ):
        person.take()
        person.arm()
        drive(person, 2)
        seen = program.ask()
        assert (seen.message.holder, seen.message.holder_role) == ("Ada", "person")
        assert seen.message.commanded == (0.0, 0.5)
        program.suggest((0.25, 1.0), answers=seen.message.seq)
        shown = program.observation(seen.message.seq)
        assert (shown.message.suggested, shown.message.suggested_by) == ((0.25, 1.0), "net")
        assert person.ask().message.suggested == (0.25, 1.0)
        wrong = program.suggest((0.25,), answers=shown.message.seq)
        eventually(lambda: "2 values" in program.refusal(wrong))
        mine = person.suggest((0.0, 0.0), answers=person.ask().message.seq)
        eventually(lambda: "You have control" in person.refusal(mine))
