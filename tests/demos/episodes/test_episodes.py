"""Episode writer and reader: round trips, and refusals."""

import dataclasses
import errno
import json
import math
import os
import re
import threading
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.demos.episodes import (
    Drop,
    EpisodeMark,
    EpisodeWriter,
    Keep,
    Step,
    edit,
    episode_at,
    episodes_of,
    read_episode,
    read_outline,
    repair,
)
from shapechanger.demos.episodes.records import (
    encode_line,
)
from shapechanger.errors import DemosError, OutputError, UnknownName
from tests.demos.episodes.making import header, picture, recorded, step

_NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
_FINITE = st.floats(allow_nan=False, allow_infinity=False)
_NS = st.none() | st.integers(0, 2**62)
_STEPS = st.builds(
    Step,
    action=st.tuples(_FINITE, _FINITE),
    driver=st.sampled_from(["person", "policy", "expert", "program"]),
    applied=st.none() | st.tuples(_NUMBERS, _NUMBERS),
    wanted=st.none() | st.tuples(_NUMBERS, _NUMBERS),
    state=st.tuples(_NUMBERS, _NUMBERS),
    wall_ns=_NS,
    reward=st.none() | _NUMBERS,
    terms=st.dictionaries(st.text(max_size=5), _NUMBERS, max_size=3),
    terminated=st.booleans(),
    truncated=st.booleans(),
    stop_reason=st.text(max_size=20),
)


def _content(one: Step) -> str:
    """Return all given values of a step as text, so that NaN equals NaN."""
    text = one.stop_reason.encode(errors="replace").decode()
    return repr(msgspec.structs.replace(one, index=0, picture=None, stop_reason=text))


@settings(max_examples=40)
@given(steps=st.lists(_STEPS, max_size=5), new=st.lists(st.booleans(), min_size=5, max_size=5))
def test_episodes_round_trip(
    steps: list[Step], new: list[bool], tmp_path_factory: pytest.TempPathFactory
) -> None:
    """All numbers, NaN, infinities, texts and frames are kept."""
    recording = tmp_path_factory.mktemp("recording")
    pictures: list[bytes | None] = []
    with EpisodeWriter.create(recording, header(), spare_bytes=0) as writer:
        for number, one in enumerate(steps):
            jpeg = picture(number) if new[number] else None
            writer.add(one, jpeg)
            pictures.append(jpeg or (pictures[-1] if pictures else None))
    read = read_episode(writer.path)
    assert [_content(s) for s in read.steps] == [_content(s) for s in steps]
    assert [read.jpeg(s) for s in read.steps] == pictures
    assert read.closed


def test_headers_round_trip(tmp_path: Path) -> None:
    """The writer adds the start time and the version."""
    given_header = header(robot="Café", env="x/Car-v1", env_kwargs={"put_back": True}, seed=3)
    now = datetime(2026, 11, 21, 10, 30, 5, tzinfo=UTC)
    recording = tmp_path / "new" / "data"
    begun = recording / f".20261121T103005Z.{os.getpid()}" / "frames"
    begun.mkdir(parents=True)  # Left behind by an earlier attempt.
    with EpisodeWriter.create(recording, given_header, spare_bytes=0, now=now) as writer:
        pass
    read = read_episode(writer.path).header
    assert dataclasses.replace(read, created="", version="") == given_header
    assert (read.created, read.version) == (
        "2026-11-21T10:30:05.000+00:00",
        version("shapechanger"),
    )
    assert writer.path.name == "20261121T103005Z-0001"
    for created, stored in ((None, r"20.*\.[0-9]{3}\+00:00"), ("", "")):
        folder = tmp_path / "another" / str(created)
        with EpisodeWriter.create(folder, header(), spare_bytes=0, created=created) as other:
            pass
        assert re.fullmatch(stored, read_episode(other.path).header.created)
    file = writer.path / "episode.json"
    text = file.read_text(encoding="utf-8")
    assert text.startswith('{\n "')
    assert '"Café"' in text
    file.write_text(file.read_text().replace('"format": 1', '"format": 2'))
    with pytest.raises(DemosError, match=r"has format 2, but this version .* reads format 1"):
        read_episode(writer.path)


def test_an_episode_that_is_being_recorded_can_be_read(tmp_path: Path) -> None:
    writer = EpisodeWriter.create(tmp_path, header(), spare_bytes=0)
    writer.add(step(0), picture())
    read = read_episode(writer.path)
    assert len(read.steps) == 1
    assert not read.closed
    writer.close("collision")
    writer.close()
    assert read_episode(writer.path).outcome == "collision"
    closed = json.loads((writer.path / "episode.json").read_text())["closed"]
    assert closed == {"steps": 1, "outcome": "collision"}
    with pytest.raises(DemosError, match="is closed"):
        writer.add(step())


_TIMES_S = st.lists(st.floats(0.0, 3.0), min_size=1, max_size=12).map(sorted)


@settings(max_examples=60)
@given(
    times_s=_TIMES_S,
    began_ns=st.sampled_from([0, 10**9, 1_700_000_000 * 10**9]),
    undone=st.lists(st.floats(0.0, 1e300, exclude_min=True), min_size=1, max_size=3),
    has_clock=st.booleans(),
    bad_s=st.sampled_from([-0.0, -1e-300, math.nan, math.inf]),
)
def test_undo_excludes_the_newest_seconds(
    *,
    times_s: list[float],
    began_ns: int,
    undone: list[float],
    has_clock: bool,
    bad_s: float,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    times_ns = [began_ns + round(1e9 * at_s) for at_s in times_s]
    if not has_clock:  # Steps of 1/20 s.
        times_ns = [50_000_000 * number for number in range(len(times_s))]
    recording = tmp_path_factory.mktemp("recording")
    with EpisodeWriter.create(recording, header(), spare_bytes=0) as writer:
        for number, at_ns in enumerate(times_ns):
            one = msgspec.structs.replace(step(number), decided_ns=None)
            writer.add(msgspec.structs.replace(one, captured_ns=at_ns if has_clock else None))
        with pytest.raises(DemosError, match=rf"must be positive and finite, got {bad_s}\."):
            writer.undo(bad_s)
        kept = list(enumerate(times_ns))
        for seconds in undone:
            before = len(kept)
            kept = [one for one in kept if kept[-1][1] - one[1] >= 1e9 * seconds]
            assert writer.undo(seconds) == before - len(kept)
            assert (before == 0) or len(kept) < before
    assert [one.index for one in read_episode(writer.path).kept] == [index for index, _ in kept]


def test_images_are_flushed_before_the_lines_that_name_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An image that is missing or fails does not keep the others from the disk."""
    flushed: list[str] = []

    def fsync(fd: int) -> None:
        flushed.append(Path(f"/proc/self/fd/{fd}").readlink().name)
        if flushed[-1] in ("000002.jpg", "steps.jsonl"):
            raise OSError(errno.EIO, "Input/output error")

    with EpisodeWriter.create(tmp_path, header(), spare_bytes=0) as writer:
        monkeypatch.setattr("shapechanger.demos.episodes.writer.os.fsync", fsync)
        for number in (0, 0, 1, 2, 3):
            writer.add(step(number), picture(number))
        (writer.path / "frames" / "000003.jpg").unlink()
    images = ["000000.jpg", "000002.jpg", "000004.jpg"]
    assert [name for name in flushed if name.endswith("jpg")] == images
    assert flushed.index("steps.jsonl", flushed.index(images[-1])) > 0


def test_dropped_steps_can_be_kept_again(tmp_path: Path) -> None:
    """Each edit is a line at the end."""
    path = recorded(tmp_path)
    before = (path / "steps.jsonl").read_bytes()
    for line in (Drop(1, 3, "bad"), Keep(2, 2), EpisodeMark(4, "a door")):
        edit(path, line)
    read = read_episode(path)
    assert [s.index for s in read.kept] == [0, 2, 4]
    assert (read.excluded, read.marks) == ({1: "bad", 3: "bad"}, (EpisodeMark(4, "a door"),))
    after = (path / "steps.jsonl").read_bytes()
    assert after.startswith(before)
    assert after.count(b"\n") == before.count(b"\n") + 3
    with pytest.raises(DemosError, match="has the steps 0 to 4, and not 3 to 5"):
        edit(path, Drop(3, 5, "bad"))


@pytest.mark.parametrize(
    ("change", "jpeg", "reason"),
    [
        ({"action": (1.0,)}, None, "its action has 1 values, but the layout has 2"),
        ({"action": (math.nan, 0.0)}, None, "its action is"),
        ({"wanted": (1.0, 2.0, 3.0)}, None, "its wanted has 3 values"),
        ({"state": ()}, None, "its state has 0 values, but the layout has 2"),
        ({"driver": "robot"}, None, "driver"),
        ({"captured_ns": -1}, None, "time runs backwards"),
        ({}, b"GIF89a", r"recorded: its image is not a JPEG\."),
        ({}, b"\xff\xd8" + bytes(1 << 24), "16777216"),
    ],
)
def test_an_invalid_step_is_refused(
    tmp_path: Path, change: dict[str, object], jpeg: bytes | None, reason: str
) -> None:
    with EpisodeWriter.create(tmp_path, header(), spare_bytes=0) as writer:
        writer.add(step(0))
        with pytest.raises(DemosError, match=f"Step 1 of .* cannot be .*{reason}"):
            writer.add(step(1, **change), jpeg)
        writer.add(step(1))
    assert len(read_episode(writer.path).steps) == 2
    assert not list((writer.path / "frames").iterdir())


@pytest.mark.parametrize(
    "change",
    [
        {"control_hz": 1e-4},
        {"control_hz": math.nan},
        {"clock": "sundial"},
        {"image_size": (0, 4)},
        {"robot": 3},
    ],
)
def test_an_invalid_header_is_refused(tmp_path: Path, change: dict[str, object]) -> None:
    """An invalid header, and a disk that is nearly full, are refused."""
    with pytest.raises(DemosError, match=f"The header is invalid: .*{next(iter(change))}"):
        EpisodeWriter.create(tmp_path / "data", header(**change), spare_bytes=0)
    assert not (tmp_path / "data").exists()
    with pytest.raises(OutputError, match="MB of the disk are free"):
        EpisodeWriter.create(tmp_path, header(), spare_bytes=1 << 60)
    assert not list(tmp_path.iterdir())


def test_two_recorders_do_not_share_a_folder(tmp_path: Path) -> None:
    with EpisodeWriter.create(tmp_path, header(), spare_bytes=0) as writer:
        with pytest.raises(DemosError, match="is in use by another recorder"):
            EpisodeWriter.create(tmp_path, header(), spare_bytes=0)
        writer.add(step())
        for change in (lambda: edit(writer.path, Drop(0, 0, "bad")), lambda: repair(writer.path)):
            with pytest.raises(DemosError, match="is being recorded at this moment"):
                change()
    EpisodeWriter.create(tmp_path, header(), spare_bytes=0).close()


def test_an_invalid_recording_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "empty").mkdir()
    for name, reason in [
        ("gone", "There is no recording"),
        ("file", "is a file"),
        ("empty", "There is no episode in"),
    ]:
        with pytest.raises(DemosError, match=reason):
            episodes_of(tmp_path / name)
    with pytest.raises(DemosError, match="is not an episode"):
        read_episode(tmp_path / "empty")
    with pytest.raises(DemosError, match="There is no recording"):
        episode_at(tmp_path / "gone" / "far")
    path = recorded(tmp_path / "data")
    (tmp_path / "data" / ".part").mkdir()
    (tmp_path / "data" / ".part" / "episode.json").touch()
    (tmp_path / "data" / "notes").mkdir()
    assert episodes_of(tmp_path / "data") == (path,)
    assert episode_at(tmp_path / "data") == episode_at(path) == read_episode(path)
    with pytest.raises(UnknownName, match=rf"No episode matches '{path.name}x'\. Did you mean"):
        episode_at(path.with_name(f"{path.name}x"))
    with EpisodeWriter.create(tmp_path / "data", header(), spare_bytes=0) as writer:
        pass
    with pytest.raises(DemosError, match=f"data has 2 episodes: name one of them, such as {path}"):
        episode_at(tmp_path / "data")
    for use in (episode_at, lambda empty: edit(empty, EpisodeMark(0))):
        with pytest.raises(DemosError, match=f"{writer.path} has no steps"):
            use(writer.path)
    (path / "episode.json").unlink()
    assert episodes_of(path) == (path,)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"[1]", "it is not a JSON object"),
        (b"[" * 100_000, ".*recursion.*"),
        (b"{", ".*"),
        (None, "Is a directory"),
    ],
)
def test_a_damaged_header_is_refused(tmp_path: Path, content: bytes | None, reason: str) -> None:
    path = recorded(tmp_path)
    file = path / "episode.json"
    fields = json.loads(file.read_text())
    file.write_text(json.dumps(fields | {"closed": {}}))
    assert (read_episode(path).closed, read_episode(path).outcome) == (True, "")
    file.unlink()
    if content is None:
        file.mkdir()
    else:
        file.write_bytes(content)
    with pytest.raises(DemosError, match=rf"^{file} cannot be read: {reason}(?<!\.)\.$"):
        read_episode(path)


def test_durations_are_the_times_between_steps(tmp_path: Path) -> None:
    """A step before a pause, or before or after an unknown time, lasts one period."""
    times_s = [0.0, 0.05, 0.12, None, 1.0, 2.4, 4.0]
    with EpisodeWriter.create(tmp_path, header(), spare_bytes=0) as writer:
        for number, at_s in enumerate(times_s):
            at_ns = None if at_s is None else round(1e9 * at_s)
            writer.add(step(number, captured_ns=None, decided_ns=at_ns))
    read = read_episode(writer.path)
    assert read.durations_s == (0.05, 0.07, 0.05, 0.05, 1.4, 0.05, 0.05)
    assert read.gaps_s == [0.05, 0.07, 1.4, 1.6]
    assert read.seconds == math.fsum(read.durations_s)


def test_an_outline_leaves_out_incomplete_lines(tmp_path: Path) -> None:
    path = recorded(tmp_path, 3)
    edit(path, EpisodeMark(1, "a door"))
    cut_off = encode_line(EpisodeMark(2, "cut off"))[:-1]
    with (path / "steps.jsonl").open("ab") as file:
        file.write(b'nonsense\n{"kind":"mark","step":0,"text":"\xff"}\n' + cut_off)
    outline = read_outline(path)
    assert (outline.path, outline.durations_s) == (path, (0.05,) * 3)
    assert [(one.index, one.driver, one.action) for one in outline.steps] == [
        (number, "program", ()) for number in range(3)
    ]
    assert outline.marks == (EpisodeMark(1, "a door"),)


def test_a_recording_continues_in_another_episode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same disk space stays free, the newest image is kept, and the seed is not repeated."""
    usage = SimpleNamespace(free=10)
    monkeypatch.setattr("shapechanger.demos.episodes.writer.shutil.disk_usage", lambda _: usage)
    head = header(seed=3, notes={"place": "hall"})
    writer = EpisodeWriter.create(tmp_path, head, spare_bytes=10)
    writer.add(step(0), picture())
    with writer.continued() as after:
        after.add(step(1))
    read = read_episode(after.path)
    assert read_episode(writer.path).outcome == "continued"
    assert (read.header.seed, read.header.robot) == (None, "car")
    assert read.header.notes == {"place": "hall", "continues": writer.path.name}
    assert read.jpeg(read.steps[0]) == picture()
    usage.free, more = 5 << 20, r"only 5 MB of the disk are free, and at least 6 MB must stay free"
    with pytest.raises(OutputError, match=more):
        EpisodeWriter.create(tmp_path, head, spare_bytes=6 << 20)


def test_the_disk_is_checked_every_twenty_steps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An image that equals the newest one is stored once."""
    checked: list[int] = []
    with EpisodeWriter.create(tmp_path, header(), spare_bytes=0) as writer:
        monkeypatch.setattr(
            "shapechanger.demos.episodes.writer._require_space",
            lambda *_: checked.append(writer.steps),
        )
        for number in range(45):
            writer.add(step(number), picture() if number % 2 == 0 else None)
    assert checked == [0, 20, 40]
    assert len(list((writer.path / "frames").iterdir())) == 1


def test_marks_and_undone_steps_are_counted(tmp_path: Path) -> None:
    with EpisodeWriter.create(tmp_path, header(), spare_bytes=0) as writer:
        with pytest.raises(DemosError, match="There is no step yet that could be marked"):
            writer.mark()
        for number in range(5):
            writer.add(step(20 * number))  # One a second.
        writer.mark()
        writer.mark("again")
        assert [writer.undo(1.0), writer.undo(1.5)] == [1, 2]
        assert (writer.steps, writer.marks, writer.dropped) == (5, 2, 3)
    read = read_episode(writer.path)
    assert read.drops == (Drop(4, 4, "undo"), Drop(2, 4, "undo"))
    assert read.marks == (EpisodeMark(4), EpisodeMark(4, "again"))


def test_the_disk_is_written_during_the_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flushed = threading.Event()
    monkeypatch.setattr("shapechanger.demos.episodes.writer._SYNC_PERIOD_S", 0.01)
    with EpisodeWriter.create(tmp_path, header(), spare_bytes=0):
        monkeypatch.setattr("shapechanger.demos.episodes.writer.os.fsync", lambda _: flushed.set())
        assert flushed.wait(20.0)
        (syncer,) = (each for each in threading.enumerate() if each.name == "episode sync")
        assert syncer.daemon  # A program that does not close its episode can still exit.
