"""Recording with a daemon on real sockets."""

from pathlib import Path

import pytest

from shapechanger.demos.episodes import EpisodeHeader, EpisodeWriter, Step, read_episode
from shapechanger.robot.link import messages as link
from tests.robot.daemon.plans import ACTIONS, picture
from tests.robot.daemon.running import Client, Running, until

pytestmark = [pytest.mark.realtime, pytest.mark.plan(recordings="kept", arming="anyone")]

HEADER = EpisodeHeader(action_layout=ACTIONS)


async def recording(client: Client, on: bool = True) -> link.RecorderState:
    await client.send(link.Record(on=on, name="corridor"))
    while True:
        state = await client.expect(link.RecorderState)
        if state.recording == on and state.episode:
            return state


async def drive(robot: Running, client: Client, first: int, count: int) -> list[link.Observation]:
    """Send `count` commands; each answers an observation with a new frame."""
    seen: list[link.Observation] = []
    for seq in range(first, first + count):
        robot.show()
        await until(lambda: robot.daemon._hub.frame is not None, "there is an image")
        answered = await client.observe()
        seen.append(answered)
        await client.send(
            link.Command(seq=seq, answers=answered.seq, values=(0.1, seq / 100), scale=0.5)
        )
        await client.expect(link.Observation)
    return seen


def only(folder: Path) -> Path:
    (episode,) = (path for path in folder.iterdir() if not path.name.startswith("."))
    return episode


@pytest.mark.plan(deadline_ms=60_000)
async def test_a_step_pairs_an_observation_and_its_command(robot: Running, tmp_path: Path) -> None:
    """Steps are recorded whenever the robot is armed, also after a change of control."""
    async with robot.client(role="person", name="Grace") as person, robot.client() as program:
        await program.obtain()
        began = await recording(person)
        assert (began.steps, began.dropped, began.text) == (0, 0, "")
        await drive(robot, program, 1, 2)
        await robot.arm(program)
        await until(lambda: robot.daemon._hub.state.armed, "the daemon's state is armed")
        seen = await drive(robot, program, 3, 9)
        await person.obtain()
        suggestion = await program.observe()
        await program.send(link.Suggest(seq=9, answers=suggestion.seq, values=(-1.0, 5.0)))
        assert (await program.expect(link.Observation)).suggested == (-1.0, 5.0)
        seen += await drive(robot, person, 12, 1)
        assert (seen[-1].holder_role, seen[-1].mine) == ("person", True)
        await person.send(link.Mark(text="a corner\n"))
        while (state := await person.expect(link.RecorderState)).marks == 0:
            pass
        assert state.steps == 10
        ended = await recording(person, on=False)
        assert (ended.steps, ended.marks, ended.episode) == (10, 1, began.episode)
    await robot.end()
    episode = read_episode(only(tmp_path / "kept"))
    assert (episode.closed, episode.outcome) == (True, "")
    header = episode.header
    assert (header.robot, header.body, header.clock) == ("test car", "car", "real")
    assert (header.driver, header.image_size) == ("program 2", (160, 120))
    assert header.notes == {"name": "corridor", "recorded_by": "Grace"}
    assert (header.camera_pitch_deg, header.camera_fovy_deg) == (3.0, 48.8)
    assert [mark.text for mark in episode.marks] == ["a corner"]
    assert [step.driver for step in episode.steps] == ["program"] * 9 + ["person"]
    assert [step.wanted for step in episode.steps] == [None] * 9 + [(-1.0, 5.0)]
    for number, (step, observation) in enumerate(zip(episode.steps, seen, strict=True), 3):
        assert step.action == step.applied == (0.05, 0.5 * (number / 100))
        assert step.captured_ns == observation.captured_ns
        assert step.decided_ns > observation.sent_ns  # type: ignore[operator]
        assert episode.jpeg(step) in {picture(n) for n in range(1, 13)}
    assert len({step.frame for step in episode.steps}) > 5


async def test_only_persons_record_and_judge(robot: Running, tmp_path: Path) -> None:
    judge = link.Judge(episode="x", first=0, last=0)
    async with robot.client() as program:
        for request in (
            link.Record(on=True),
            link.Record(on=False),
            link.Mark(),
            link.Undo(),
            judge,
        ):
            await program.send(request)
            assert "Only a person" in (await program.expect(link.Refused)).reason
        await program.send(link.Browse())
        assert (await program.expect(link.Recordings)) == link.Recordings(episodes=())
    await robot.end()
    assert not (tmp_path / "kept").exists()


async def test_a_failing_disk_ends_the_recording_but_not_the_driving(
    robot: Running, tmp_path: Path
) -> None:
    """A new recording can be started; its episode is closed when the daemon ends."""
    async with robot.client(role="person") as person:
        await robot.armed(person)
        await recording(person)
        await drive(robot, person, 1, 2)
        frames = only(tmp_path / "kept") / "frames"
        frames.rename(frames.with_name("elsewhere"))
        seq = 3
        while robot.daemon._hub.recorder.on:
            await drive(robot, person, seq, 1)
            seq += 1
        states = [m for m in person.received if isinstance(m, link.RecorderState)]
        while not states[-1].text:
            states.append(await person.expect(link.RecorderState))
        assert "Cannot write" in states[-1].text
        assert not states[-1].recording
        assert (await person.drive(seq)).applied_seq == seq
        frames.parent.rename(tmp_path / "failed")
        await recording(person)  # A new recording starts.
        await drive(robot, person, seq + 1, 4)
        await robot.end()
    episode = read_episode(only(tmp_path / "kept"))
    assert (episode.closed, episode.outcome, len(episode.steps)) == (True, "", 4)


async def test_recordings_cannot_share_a_folder_and_end_with_the_last_person(
    robot: Running, tmp_path: Path
) -> None:
    async with robot.client() as program:
        async with robot.client(role="person") as one, robot.client(role="person") as two:
            with EpisodeWriter.create(tmp_path / "kept", HEADER):
                await one.send(link.Record(on=True))
                assert "in use by another recorder" in (await one.expect(link.Refused)).reason
            await recording(one)
            await two.send(link.Record(on=True))
            assert "recorded already" in (await two.expect(link.Refused)).reason
            async with robot.client(role="person") as late:
                assert (await late.expect(link.RecorderState)).recording
        while "last person" not in (state := await program.expect(link.RecorderState)).text:
            pass
        assert not state.recording
    await robot.end()
    outcomes = [read_episode(path).outcome for path in (tmp_path / "kept").glob("2*")]
    assert any("last person" in outcome for outcome in outcomes)


async def test_requests_about_recordings_are_one_at_a_time(robot: Running, tmp_path: Path) -> None:
    with EpisodeWriter.create(tmp_path / "kept", HEADER) as writer:
        for number in range(200):
            writer.add(Step(action=(0.0, 0.5), driver="person"), picture(number))
    async with robot.client() as program:
        for _ in range(40):
            await program.send(link.Fetch(episode=writer.path.name))
        assert "one request" in (await program.expect(link.Refused)).reason
        await program.send(link.Ping(token=1))
        await program.expect(link.Pong)
        pieces = [m for m in program.received if isinstance(m, link.Piece)]
        assert all(0 < len(link.encode(piece)) < link.MAX_PIECE + 100_000 for piece in pieces)
        assert len(pieces) < 40


@pytest.mark.plan(secured=True)
async def test_a_client_that_only_listens_gets_all_events(robot: Running, key: bytes) -> None:
    async with robot.client(key) as program:
        for number in range(6):
            robot.daemon._hub.event("news", str(number))
            while (received := await program.expect(link.Event)).name != "news":
                pass
            assert received.text == str(number)
