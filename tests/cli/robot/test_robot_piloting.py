"""A policy drives a twin, and a person takes over from the terminal."""

from dataclasses import replace
from pathlib import Path

import pytest

from shapechanger.cli.robot.drive import recorded_to
from shapechanger.demos.episodes import episodes_of, read_episode
from shapechanger.robot.client.known_robots import remember
from shapechanger.robot.link.messages import Observation
from shapechanger.robot.twin.robot import run_robot
from shapechanger.vehicles.envs.demonstrators import CLONES
from tests.cli.robot.typing import Person
from tests.robots import IN_A_ROOM, PATIENT_CAR, write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]


@pytest.mark.gl
def test_a_person_lets_a_policy_drive_and_corrects_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """P starts the policy, a direction key takes over, and both are recorded."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with run_robot(
        write_profile(tmp_path, PATIENT_CAR), arguments=("--world", "corridor")
    ) as robot:
        remember(replace(robot.known, name="car"))
        data = tmp_path / "data"
        command = ("robot", "drive", "car", "--policy", str(CLONES["car"]), "--record", str(data))
        with Person(command, tmp_path) as person:
            read = person.read_until("not armed")
            # The policy does not start by itself.
            read = person.read_until("recording", read)
            person.press("p")
            read = person.read_until("it drives", read)
            read = person.read_until("commanded by car", read)
            with robot.client(role="person", frames=False) as watcher:
                person.wait_for(lambda: watcher.ask().message.action_applied[1] != 0.0)
                person.press("w")
                person.wait_for(lambda: watcher.ask().message.holder_role == "person")
                for _ in range(5):
                    person.press("w")
                    person.wait_for(lambda: _is_corrected(watcher.ask().message))
            person.press("q")
            assert person.end() == 0
        (path,) = episodes_of(data)
        steps = read_episode(path).kept
        assert {step.driver for step in steps} == {"person", "program"}
        corrections = [step for step in steps if step.driver == "person" and step.wanted]
        assert corrections
        assert all(read_episode(path).jpeg(step) for step in steps)


def test_recordings_are_kept_after_a_failure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The error names the command that downloads it; otherwise it is complete here."""
    with (
        run_robot(write_profile(tmp_path, PATIENT_CAR), arguments=IN_A_ROOM) as robot,
        robot.client(role="person") as person,
    ):
        person.take()
        with pytest.raises(KeyboardInterrupt), recorded_to(tmp_path / "lost", person, "car"):
            raise KeyboardInterrupt
        message = " ".join(capsys.readouterr().err.split())
        assert f"`shapechanger robot fetch car --out {tmp_path / 'lost'}` downloads it" in message
        assert not (tmp_path / "lost").exists()
        person.record(on=False)

        with recorded_to(tmp_path / "kept", person, "car"):
            person.arm()
            for _ in range(20):
                person.exchange((0.0, 0.3), person.ask())
        (path,) = episodes_of(tmp_path / "kept")
        episode = read_episode(path)
        assert episode.closed
        assert len(episode.steps) == 20


def _is_corrected(seen: Observation) -> bool:
    """Return whether a person drives while the policy suggests."""
    return seen.commanded[1:] == (0.5,) and bool(seen.suggested)
