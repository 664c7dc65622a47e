"""`shapechanger robot fetch`: exact copies, resumed after interruptions."""

import json
import random
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from shapechanger.cli import main
from shapechanger.demos.episodes import (
    Drop,
    EpisodeHeader,
    EpisodeWriter,
    Keep,
    Step,
    edit,
    episodes_of,
    read_episode,
    repair,
)
from shapechanger.errors import DemosError
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.known_robots import KnownRobot, remember
from shapechanger.robot.client.recordings import fetch_episode
from tests.demos.exchange.small import snapshot
from tests.robot.client.test_real_daemon import Served
from tests.robot.daemon.plans import ACTIONS, picture

pytestmark = pytest.mark.realtime

HEADER = EpisodeHeader(action_layout=ACTIONS, driver="Ada")


@pytest.fixture
def there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The recordings folder of a robot known as car."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    kept = tmp_path / "robot" / "kept"
    with Served(tmp_path / "robot", monkeypatch, recordings=str(kept)).serving() as served:
        known = served.known
        remember(KnownRobot("car", known.address, known.key, known.fingerprint))
        yield kept


@pytest.fixture
def robot(there: Path) -> Iterator[RobotClient]:
    from shapechanger.robot.client.known_robots import recall

    with RobotClient.connect(recall("car"), frames=False) as client:
        yield client


def record(folder: Path, count: int = 40) -> Path:
    with EpisodeWriter.create(folder, HEADER) as writer:
        for number in range(count):
            jpeg = picture(number) if number % 3 != 2 else None
            writer.add(Step(action=(0.0, number / count), driver="person"), jpeg)
        writer.mark("é ☃")
    return writer.path


def test_fetching_copies_exactly_and_later_only_new_data(
    there: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, data = record(there), tmp_path / "here"
    fetch = ["robot", "fetch", "car", "--out", str(data)]
    main(fetch)
    assert "40 steps kept of 40, 41 lines downloaded" in capsys.readouterr().out
    assert snapshot(data / first.name) == snapshot(first)
    edit(first, Drop(0, 9, "bad"))
    second = record(there, 3)
    main(fetch)
    output = capsys.readouterr().out
    assert "30 steps kept of 40, 1 lines downloaded" in output
    assert "3 steps kept of 3, 4 lines downloaded" in output
    main([*fetch, "--episodes", second.name])
    assert capsys.readouterr().out == f"{second.name}: 3 steps kept of 3, no new lines\n"
    assert [path.name for path in episodes_of(data)] == [first.name, second.name]
    for path in (first, second):
        assert snapshot(data / path.name) == snapshot(path)
    assert len(read_episode(data / first.name).kept) == 30


def test_an_interrupted_fetch_resumes(there: Path, robot: RobotClient, tmp_path: Path) -> None:
    """The transfer may end at any byte of lines or frames; incomplete episodes are not listed."""
    rng = random.Random(3)
    episode = record(there)
    lines = (episode / "steps.jsonl").read_bytes()
    for number, cut in enumerate(
        [0, 1, len(lines), *(rng.randrange(len(lines)) for _ in range(9))]
    ):
        data = tmp_path / str(number)
        part = data / f".{episode.name}.fetching"
        (part / "frames").mkdir(parents=True)
        (part / "steps.jsonl").write_bytes(lines[:cut])
        # Frames are written before their line, and the last frame may be incomplete.
        whole = lines[:cut].count(b"\n")
        for frame in sorted((episode / "frames").iterdir()):
            if int(frame.stem) < whole:
                (part / "frames" / frame.name).write_bytes(frame.read_bytes())
        (part / "frames" / f"{whole:06d}.jpg").write_bytes(b"\xff\xd8")
        stray = whole % 3 == 2 or whole >= 40
        with pytest.raises(DemosError, match="no episode"):
            episodes_of(data)
        fetch_episode(robot, episode.name, data)
        came = snapshot(data / episode.name)
        if stray:
            del came[f"frames/{whole:06d}.jpg"]
        assert came == snapshot(episode)
        assert not part.exists()


@pytest.mark.parametrize("seed", range(4))
def test_edits_on_robot_and_workstation_are_kept(
    there: Path, robot: RobotClient, tmp_path: Path, seed: int
) -> None:
    """No edit of either side is lost; edits on the workstation take precedence."""
    rng = random.Random(seed)
    episode, data = record(there, 12), tmp_path / "here"
    local = data / episode.name
    fetch_episode(robot, episode.name, data)
    mine: list[bytes] = []
    for _ in range(8):
        side = rng.choice([episode, local])
        first = rng.randrange(12)
        edit(side, rng.choice([Drop, Keep])(first, rng.randrange(first, 12), "bad"))
        if side is local:
            mine.append((local / "steps.jsonl").read_bytes().splitlines(True)[-1])
        if rng.random() < 0.5:
            fetch_episode(robot, episode.name, data)
    fetch_episode(robot, episode.name, data)
    theirs = (episode / "steps.jsonl").read_bytes().splitlines(True)
    lines = (local / "steps.jsonl").read_bytes().splitlines(True)
    assert lines[: len(theirs)] == theirs
    assert Counter(mine) - Counter(lines) == Counter()
    assert len(read_episode(local).steps) == 12
    before = snapshot(local)
    assert fetch_episode(robot, episode.name, data)[0] == 0
    assert snapshot(local) == before


def test_a_repaired_copy_is_kept(there: Path, robot: RobotClient, tmp_path: Path) -> None:
    """The robot's episode is incomplete, and the copy on the workstation was closed by a repair."""
    header = json.loads((path := record(there, 6) / "episode.json").read_text())
    path.write_text(json.dumps(header | {"closed": None}))
    episode, data = path.parent, tmp_path / "here"
    fetch_episode(robot, episode.name, data)
    repair(data / episode.name)
    before = snapshot(data)
    fetch_episode(robot, episode.name, data)
    assert snapshot(data) == before


def test_an_episode_with_other_steps_is_not_overwritten(
    there: Path, robot: RobotClient, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, data = record(there, 4), tmp_path / "here"
    fetch_episode(robot, first.name, data)
    steps = first / "steps.jsonl"
    steps.write_bytes(b"".join(steps.read_bytes().splitlines(True)[:3]))
    second = record(there, 2)
    before = snapshot(data / first.name)
    with pytest.raises(SystemExit) as ended:
        main(["robot", "fetch", "car", "--out", str(data)])
    assert ended.value.code == 1
    output = capsys.readouterr()
    assert "has other steps than" in output.err
    assert "`--out` with another folder" in output.err
    assert second.name in output.out
    assert snapshot(data / first.name) == before
    assert snapshot(data / second.name) == snapshot(second)


@pytest.mark.parametrize("damage", ["line", "picture", "missing"])
def test_damaged_episodes_are_not_fetched(
    there: Path, robot: RobotClient, tmp_path: Path, damage: str
) -> None:
    """The fetch fails, and its incomplete copy does not count as an episode."""
    episode = record(there, 9)
    frame = episode / "frames" / "000003.jpg"
    if damage == "line":
        steps = episode / "steps.jsonl"
        steps.write_bytes(steps.read_bytes().replace(b'"step":3', b'"step":5', 1))
    elif damage == "picture":
        frame.write_bytes(frame.read_bytes()[:-3] + b"abc")
    else:
        frame.unlink()
    with pytest.raises((DemosError, LookupError, ConnectionError), match=r"damaged|Cannot read"):
        fetch_episode(robot, episode.name, tmp_path / "here")
    with pytest.raises(DemosError, match="no episode"):
        episodes_of(tmp_path / "here")
