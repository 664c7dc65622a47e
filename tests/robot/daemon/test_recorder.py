"""Recorder: pairing of commands with observations, and the writer thread."""

import queue
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.demos.episodes import Episode, Step, episodes_of, read_episode, writer
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.client import Client, Sent
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.recorder import DISK_TOO_SLOW, Recorder
from shapechanger.robot.link import messages
from shapechanger.robot.link.messages import Mark, RecorderState
from tests.robot.daemon.fakes import SteppedClock
from tests.robot.daemon.plans import car_plan, picture

pytestmark = pytest.mark.realtime

WITHIN_S = 20.0


def step(number: int) -> tuple[Step, bytes]:
    """Return a step whose values contain `number`, and its frame."""
    at_ns, state = number * 50_000_000, (0.0, 0.0, 0.0)
    made = Step(action=(0.0, number / 1e6), driver="person", state=state, captured_ns=at_ns)
    return made, picture(number % 5)


class Recording:
    """A recorder that records for Ada, and the messages sent to her and to all clients."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.told: list[Any] = []
        self.ada = Client(1, "Ada", "person")
        self._calls: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        plan = car_plan(recordings=str(folder))
        self.recorder = Recorder(plan, self.told.append, self._calls.put)
        self.recorder.begin(self.ada, "corridor", "")

    def add(self, made: Step, jpeg: bytes | None) -> None:
        self.recorder._add(made, jpeg)

    def listen(self, until: Callable[[], object]) -> None:
        """Call the functions of the thread until a condition holds."""
        while not until():
            self._calls.get(timeout=WITHIN_S)()

    def end(self, outcome: str) -> list[Episode]:
        self.recorder.end(outcome)
        episode = self.recorder._episode
        assert episode is not None
        self.listen(lambda: not episode.jobs)
        return [read_episode(path) for path in episodes_of(self.folder)]


def test_a_full_episode_is_continued_in_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writer, "FULL_BYTES", 2000)
    recording = Recording(tmp_path)
    for number in range(40):
        made, jpeg = step(number)
        recording.add(made, jpeg if number % 3 == 0 else None)
        recording.recorder.edit(Mark(text=str(number)), recording.ada)
    episodes = recording.end("time")
    assert len(episodes) > 3
    names = dict.fromkeys(state.episode for state in recording.told)
    assert list(names) == [e.path.name for e in episodes]
    assert [e.outcome for e in episodes] == ["continued"] * (len(episodes) - 1) + ["time"]
    assert [e.header.notes.get("continues") for e in episodes[1:]] == [
        e.path.name for e in episodes[:-1]
    ]
    numbers = [round(s.action[1] * 1e6) for e in episodes for s in e.steps]
    assert numbers == list(range(40))
    seen = [e.jpeg(s) for e in episodes for s in e.steps]
    assert seen == [step(number - number % 3)[1] for number in range(40)]
    assert recording.ada.take() is None
    assert [len(e.marks) for e in episodes] == [len(e.steps) for e in episodes]


@pytest.mark.parametrize(("bytes_each", "fits"), [(0, 255), (1 << 20, 15)])
def test_a_slow_disk_ends_the_episode_and_keeps_its_steps(
    tmp_path: Path, bytes_each: int, fits: int
) -> None:
    recording = Recording(tmp_path)
    large = b"\xff\xd8" + bytes(bytes_each)
    while recording.recorder.on:  # The recorder gets no result from the disk.
        recording.add(step(0)[0], large)
    assert recording.told == [RecorderState(text=DISK_TOO_SLOW)]
    recording.listen(lambda: recording.recorder.state().steps == fits and len(recording.told) == 3)
    (path,) = episodes_of(tmp_path)
    episode = read_episode(path)
    assert (episode.outcome, len(episode.steps)) == (DISK_TOO_SLOW, fits)


ADA, NET = Client(1, "Ada", "person"), Client(2, "net")


HUB = SessionHub(car_plan(), SteppedClock(), lambda order: None)


def seen(seq: int, at_ns: int, **changes: Any) -> messages.Observation:
    fields = {"captured_ns": at_ns, "state": (float(at_ns),), "action_applied": (0.25,)}
    fields |= {"stop_reason": "", "mine": True} | changes
    return msgspec.structs.replace(HUB.observation(ADA, seq, None), **fields)


def frame(seq: int) -> Frame:
    return Frame(b"jpeg %d" % seq, seq)


class Built(Recorder):
    """A recorder that keeps its steps, with their frames, in memory."""

    def __init__(self) -> None:
        super().__init__(car_plan(), lambda message: None, lambda call: call())
        self.on = True
        self.written: list[tuple[Step, bytes | None]] = []

    def _add(self, step: Step, jpeg: bytes | None) -> None:
        self.written.append((step, jpeg))

    def see(
        self, client: Client, observation: messages.Observation, frame: Frame | None = None
    ) -> Sent:
        self.observed(client, observation)
        return Sent(observation, frame)


def test_the_applied_outputs_of_a_step_are_from_the_next_observation() -> None:
    built = Built()
    sent = built.see(ADA, seen(1, 100, suggested=(0.9, 0.0)), frame(1))
    built.decided(ADA, sent, (0.5, 7.0), 110)
    assert built.written == []
    built.see(ADA, seen(2, 120, stop_reason="A bump."), frame(2))
    built._complete()
    ((step, jpeg),) = built.written
    assert jpeg == b"jpeg 1"
    assert (step.action, step.applied, step.wanted) == ((0.5, 1.0), (0.25,), (0.9, 0.0))
    assert (step.captured_ns, step.decided_ns) == (100, 110)
    assert (step.driver, step.state, step.stop_reason) == ("person", (100.0,), "A bump.")


def test_the_later_of_two_decisions_counts() -> None:
    """If the client then loses control, the applied outputs of the step are unknown."""
    built = Built()
    sent = built.see(NET, seen(1, 100))
    built.decided(NET, sent, (0.5, 0.0), 110)
    built.decided(NET, sent, (0.0, 0.0), 115)
    built.see(NET, seen(2, 120, mine=False))
    ((step, _),) = built.written
    assert (step.action, step.decided_ns, step.applied) == ((0.0, 0.0), 115, None)


@given(
    events=st.lists(
        st.tuples(st.booleans(), st.sampled_from((ADA, NET)), st.integers(0, 4)), max_size=60
    )
)
def test_times_never_decrease_and_no_frame_repeats(events: list[tuple[bool, Client, int]]) -> None:
    built = Built()
    sent: dict[Client, list[Sent]] = {ADA: [], NET: []}
    pictures_seen = [frame(number) for number in range(22)]
    for now_ns, (looks, who, back) in enumerate(events):
        if looks:
            picture = pictures_seen[1 + now_ns // 3]  # Several observations have the same image.
            number = len(sent[who]) + 1
            sent[who].append(built.see(who, seen(number, picture.captured_ns), picture))
        elif back < len(sent[who]):
            built.decided(who, sent[who][-1 - back], (0.5, 0.0), now_ns)
    built._complete()
    for times in ("captured_ns", "decided_ns"):
        found = [getattr(step, times) for step, _ in built.written]
        assert found == sorted(found)
    pictures = [jpeg for _, jpeg in built.written if jpeg is not None]
    assert len(pictures) == len(set(pictures))
    shown = b""
    for step, jpeg in built.written:
        shown = jpeg or shown
        assert shown == b"jpeg %d" % step.captured_ns  # Its frame, or the previous frame.
