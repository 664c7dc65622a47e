"""Library of recordings: it sends exact bytes in bounded answers, only from its folder."""

import shutil
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.demos import episodes
from shapechanger.robot.daemon.library import Answer, LineIndex, Question, RecordingLibrary
from shapechanger.robot.link import messages as link
from tests.robot.daemon.plans import ACTIONS, picture

HEADER = episodes.EpisodeHeader(action_layout=ACTIONS, control_hz=10.0, driver="Ada")
Ask = Callable[[Question], Answer]


@pytest.fixture
def ask(tmp_path: Path) -> Iterator[Ask]:
    library = RecordingLibrary(tmp_path, lambda work: work())

    def asked(question: Question) -> Answer:
        answers: list[Answer] = []
        answered = threading.Event()
        library.ask(question, lambda answer: (answers.append(answer), answered.set()))
        assert answered.wait(20.0)
        return answers[0]

    yield asked
    library.close()


def record(folder: Path, count: int, outcome: str = "") -> Path:
    """Record an episode with a new frame at every second step, and a mark."""
    with episodes.EpisodeWriter.create(folder, HEADER) as writer:
        for number in range(count):
            jpeg = picture(number) if number % 2 == 0 else None
            writer.add(episodes.Step(action=(0.0, number / count), driver="person"), jpeg)
            if number == 1:
                writer.mark("é ☃")
        writer.close(outcome)
    return writer.path


def refusal(answer: Answer) -> str:
    assert isinstance(answer, link.Refused)
    return answer.reason


@pytest.mark.parametrize("count", [1, 7, 100_000])
def test_the_pieces_reassemble_the_episode(ask: Ask, tmp_path: Path, count: int) -> None:
    path = record(tmp_path, 60)
    lines, pictures = b"", []
    at, total = 0, 1
    while at < total:
        piece = ask(link.Fetch(episode=path.name, first=at, count=count))
        assert isinstance(piece, link.Piece)
        assert 1 <= len(piece.lines) <= count
        assert (piece.episode, piece.first) == (path.name, at)
        assert all(frame is None or frame for frame in piece.frames)
        assert piece.header.encode() == (path / "episode.json").read_bytes()
        lines += "".join(f"{line}\n" for line in piece.lines).encode()
        pictures += piece.frames
        at, total = at + len(piece.lines), piece.total
    assert lines == (path / "steps.jsonl").read_bytes()
    assert [one for one in dict.fromkeys(pictures) if one] == [picture(n) for n in range(0, 60, 2)]


def test_pieces_are_limited_in_size(ask: Ask, tmp_path: Path) -> None:
    large = b"\xff\xd8" + bytes(link.MAX_PIECE)
    with episodes.EpisodeWriter.create(tmp_path, HEADER) as writer:
        for jpeg in (picture(1), large, picture(2), b"\xff\xd8" + bytes(5 << 20)):
            writer.add(episodes.Step(action=(0.0, 0.0), driver="person"), jpeg)
    name = writer.path.name
    pieces = [ask(link.Fetch(episode=name, first=first)) for first in range(4)]
    assert [len(p.lines) for p in pieces if isinstance(p, link.Piece)] == [1, 1, 1]
    assert f"Line 4 of {writer.path / 'steps.jsonl'} is too large" in refusal(pieces[3])


@pytest.mark.parametrize(("keep", "kept"), [(False, 4), (True, 6)])
def test_a_judgement_is_written_and_the_episode_summarised(
    ask: Ask, tmp_path: Path, keep: bool, kept: int
) -> None:
    path = record(tmp_path, 6)
    answer = ask(link.Judge(episode=path.name, first=1, last=2, keep=keep))
    assert isinstance(answer, link.Recordings)
    assert [(one.id, one.kept) for one in answer.episodes] == [(path.name, kept)]
    line = (path / "steps.jsonl").read_text().splitlines()[-1]
    assert ('"bad"' in line) == (not keep)


@given(
    count=st.integers(0, 40),
    judgements=st.lists(
        st.tuples(st.booleans(), st.integers(0, 39), st.integers(0, 39)), max_size=5
    ),
)
@settings(max_examples=25)
def test_a_summary_agrees_with_the_whole_episode(
    tmp_path_factory: pytest.TempPathFactory, count: int, judgements: list[tuple[bool, int, int]]
) -> None:
    folder = tmp_path_factory.mktemp("kept")
    path = record(folder, count, "time")
    recordings = RecordingLibrary(folder, lambda work: work())
    for good, one, other in [(True, 0, 0), *judgements]:
        first, last = sorted((one, other))
        if last < count:
            episodes.edit(path, (episodes.Keep if good else episodes.Drop)(first, last, "bad"))
        episode, summary = episodes.read_episode(path), recordings.summary(path.name)
        assert (summary.steps, summary.kept) == (len(episode.steps), len(episode.kept))
        assert summary.seconds == episode.seconds
        assert (summary.closed, summary.outcome) == (episode.closed, episode.outcome)
        assert (summary.created, summary.driver) == (episode.header.created, "Ada")


def test_the_list_is_newest_first_and_bounded(ask: Ask, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").touch()
    (tmp_path / "empty").mkdir()
    first = record(tmp_path, 1)
    shutil.copytree(first, tmp_path / ".hidden")
    for number in range(1, link.MAX_EPISODES + 3):
        shutil.copytree(first, tmp_path / f"{first.name[:-4]}{number + 1:04d}")
    names = sorted((path.name for path in tmp_path.glob("2*")), reverse=True)
    before = ""
    for expected in (names[: link.MAX_EPISODES], names[link.MAX_EPISODES :]):
        found = ask(link.Browse(before=before))
        assert isinstance(found, link.Recordings)
        assert [episode.id for episode in found.episodes] == expected
        assert found.more == (before == "")
        before = expected[-1]


def test_episodes_outside_the_folder_are_refused(ask: Ask, tmp_path: Path) -> None:
    elsewhere = record(tmp_path / "elsewhere", 2)
    (tmp_path / "linked").symlink_to(elsewhere)
    for name in ("linked", "elsewhere", f"elsewhere/{elsewhere.name}", "..", ".", ""):
        for question in (link.Fetch(episode=name), link.Judge(episode=name, first=0, last=0)):
            assert "There is no episode" in refusal(ask(question))
    assert ask(link.Browse()) == link.Recordings(episodes=())
    assert len(episodes.read_episode(elsewhere).kept) == 2


def test_damage_is_reported_and_the_rest_is_readable(ask: Ask, tmp_path: Path) -> None:
    path = record(tmp_path, 4)
    with (path / "steps.jsonl").open("ab") as file:
        file.write(b'{"kind":"drop","first":0,"la')
    piece = ask(link.Fetch(episode=path.name))
    assert isinstance(piece, link.Piece)
    assert (piece.total, len(piece.lines)) == (5, 5)
    (path / "frames" / "000002.jpg").unlink()
    assert "000002.jpg" in refusal(ask(link.Fetch(episode=path.name)))
    # A line must not refer to a file outside the episode.
    (tmp_path / "secret.jpg").write_bytes(b"secret")
    secret = '{"kind":"step","step":0,"frame":["../../secret.jpg",6,""]}\n'
    (path / "steps.jsonl").write_text(secret)
    assert f"Line 1 of {path / 'steps.jsonl'} is damaged" in refusal(
        ask(link.Fetch(episode=path.name))
    )
    (path / "episode.json").write_text("{")
    found = ask(link.Browse())
    assert isinstance(found, link.Recordings)
    assert "cannot be read" in found.episodes[0].outcome


_parts = st.lists(st.sampled_from((b"a", b"bb\n", b"\n", b"c\rd\n", b"x" * 70_000)), max_size=12)


@given(parts=_parts, replaced=st.sets(st.integers(0, 11)))
def test_every_complete_line_of_a_growing_file_is_found(
    parts: list[bytes], replaced: set[int]
) -> None:
    """A file is read again after it was replaced by another file, which may be shorter."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "lines"
        path.touch()
        index = LineIndex(path)
        whole = b""
        for number, part in enumerate(parts):
            if number in replaced:
                whole = b""
                path.with_name("other").touch()
                path.with_name("other").replace(path)
            whole += part
            with path.open("ab") as file:
                file.write(part)
            lines = whole.split(b"\n")[:-1]
            for first, count in ((0, 100), (1, 2), (len(lines), 1)):
                read = [line.encode() for line in index.lines(first, count)]
                assert read == lines[first : first + count]
            assert len(index) == len(lines)
