"""Repairs: a crash costs at most the step being written. Merges copy only whole episodes."""

import errno
import json
import os
import re
import shutil
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.demos.episodes import (
    Drop,
    EpisodeMark,
    EpisodeWriter,
    edit,
    episodes_of,
    merge,
    read_episode,
    repair,
)
from shapechanger.demos.episodes.records import lock
from shapechanger.errors import BrokenEpisode, DemosError, OutputError
from tests.demos.episodes.making import header, picture, recorded, step


@settings(max_examples=40)
@given(share=st.floats(0.0, 1.0))
def test_cut_off_at_any_byte(share: float, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = recorded(tmp_path_factory.mktemp("recording"), close=False)
    file = path / "steps.jsonl"
    content = file.read_bytes()
    cut = round(share * len(content))
    file.write_bytes(content[:cut])
    whole = content[:cut].count(b"\n")

    assert repair(path).startswith(f"kept {whole} steps, ")

    episode = read_episode(path)
    assert [s.index for s in episode.steps] == list(range(whole))
    assert all(episode.jpeg(s) == picture(s.index) for s in episode.steps)
    assert (episode.closed, episode.outcome) == (True, "cut off")
    closed = json.loads((path / "episode.json").read_text())["closed"]
    assert closed == {"steps": whole, "outcome": "cut off"}
    lost = {file.name: file.read_bytes() for file in path.glob("lost/*")}
    torn = content[:cut].rpartition(b"\n")[2]
    assert lost.pop("steps.jsonl", b"") == torn
    assert lost == {f"{n:06d}.jpg": picture(n) for n in range(whole, 5)}
    assert repair(path) == f"kept {whole} steps, found no damage"


@settings(max_examples=40)
@given(place=st.integers(0, 10_000), bit=st.integers(0, 7))
def test_one_flipped_bit_costs_at_most_two_steps(
    place: int, bit: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = recorded(tmp_path_factory.mktemp("recording"))
    file = path / "steps.jsonl"
    content = bytearray(file.read_bytes())
    content[place % len(content)] ^= 1 << bit
    file.write_bytes(content)
    with pytest.raises(BrokenEpisode, match="is invalid, because"):
        read_episode(path)
    repair(path)
    assert len(read_episode(path).steps) >= 3


def test_repairing_an_intact_episode_changes_nothing(tmp_path: Path) -> None:
    """Lines that are not steps, such as marks and edits, are not damage."""
    path = recorded(tmp_path)
    edit(path, EpisodeMark(1, "a door"))
    edit(path, Drop(2, 3, "bad"))
    before = {p: p.read_bytes() for p in path.rglob("*") if p.is_file()}
    assert repair(path) == "kept 5 steps, found no damage"
    assert {p: p.read_bytes() for p in path.rglob("*") if p.is_file()} == before


@pytest.mark.parametrize("harm", ["missing", "short", "changed", "a pipe"])
def test_a_damaged_image_is_detected_and_costs_its_step(tmp_path: Path, harm: str) -> None:
    path = recorded(tmp_path)
    edit(path, EpisodeMark(4, "a door"))
    file = path / "frames" / "000002.jpg"
    jpeg = file.read_bytes()
    file.unlink()
    if harm == "a pipe":
        os.mkfifo(file)
    elif harm != "missing":
        file.write_bytes(jpeg[:-1] + b"!" * (harm == "changed"))
    where = "line 3 is invalid, because its image 000002.jpg"
    if harm == "changed":
        where = "its image 000002.jpg was changed, at step 2"
    message = f"{path} is damaged: {where}.*shapechanger demos repair {path}"
    with pytest.raises(BrokenEpisode, match=message):  # noqa: PT012
        episode = read_episode(path)
        episode.jpeg(episode.steps[2])
    assert re.search("^kept 4 steps, moved a line aside, because its image 000002", repair(path))
    read = read_episode(path)
    assert [s.index for s in read.steps] == [0, 1, 3, 4]
    assert [mark.text for mark in read.marks] == ["a door"]


def test_all_repairs_are_reported(tmp_path: Path) -> None:
    path = recorded(tmp_path, close=False)
    lines = (path / "steps.jsonl").read_bytes().splitlines(keepends=True)
    for number in (1, 3):
        lines[number] = lines[number].replace(b"person", b"policy")
    (path / "steps.jsonl").write_bytes(b"".join(lines))
    assert repair(path) == (
        "kept 3 steps, moved a line and 1 more aside, because it is cut off or was changed, "
        "moved aside unused images: 2, closed it"
    )
    assert (path / "lost" / "steps.jsonl").read_bytes() == lines[1] + lines[3]


def test_images_without_a_step_are_all_kept(tmp_path: Path) -> None:
    path = recorded(tmp_path, close=False)
    for size in (20, 30):
        (path / "frames" / "000005.jpg").write_bytes(picture(5)[:size])
        assert "unused images: 1" in repair(path)
    lost = path / "lost"
    assert (lost / "000005.jpg").read_bytes() == picture(5)[:20]
    assert (lost / "000005-0001.jpg").read_bytes() == picture(5)[:30]


def test_episodes_are_merged_unchanged(tmp_path: Path) -> None:
    """Files are equal byte for byte, and names in use get the next number."""
    one, two = recorded(tmp_path / "a"), recorded(tmp_path / "b", 3)
    two = two.rename(two.with_name(one.name))
    done = merge([tmp_path / "a", two], tmp_path / "all")
    first, second = episodes_of(tmp_path / "all")
    assert [first.name, second.name] == [one.name, f"{one.name[:-4]}0002"]
    assert done == [(one, first), (two, second)]
    for source, target in done:
        files, copies = (
            {p.relative_to(path): p.read_bytes() for p in path.rglob("*") if p.is_file()}
            for path in (source, target)
        )
        assert files == copies
    # Excluded steps do not make an episode a new one. If one is refused, none is copied.
    edit(one, Drop(0, 1, "bad"))
    recorded(tmp_path / "c")
    with pytest.raises(DemosError, match="the same episode"):
        merge([tmp_path / "c", one], tmp_path / "all")
    assert len(episodes_of(tmp_path / "all")) == 2


def test_what_cannot_be_merged_is_refused(tmp_path: Path) -> None:
    whole, begun = recorded(tmp_path / "a"), recorded(tmp_path / "b", close=False)
    torn = recorded(tmp_path / "c")
    with (torn / "steps.jsonl").open("ab") as file:
        file.write(b'{"kind":"st')
    for sources, out, reason in (
        ([begun], tmp_path / "all", "demos repair"),
        ([torn], tmp_path / "all", "is damaged"),
        ([], tmp_path / "all", "nothing to merge"),
        ([whole], whole, "is an episode"),
    ):
        with pytest.raises(DemosError, match=reason):
            merge(sources, out)
    assert not (tmp_path / "all").exists()
    (whole / "frames" / "000009.jpg").symlink_to(torn)
    with pytest.raises(DemosError, match=r"000009\.jpg is a link, but an episode has only files"):
        merge([whole], tmp_path / "all")


def test_episodes_without_a_start_time_are_told_apart_by_their_steps(tmp_path: Path) -> None:
    steps = [[], [step()], [step(action=(0.5, 0.2))]]
    for number, added in enumerate(steps):
        folder = tmp_path / str(number)
        with EpisodeWriter.create(folder, header(), spare_bytes=0, created="") as writer:
            for one in added:
                writer.add(one)
    out = tmp_path / "all" / "of them"
    assert len(merge([tmp_path / str(number) for number in range(3)], out)) == 3
    assert [len(read_episode(path).steps) for path in episodes_of(out)] == [0, 1, 1]


def test_a_failed_write_names_the_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, file = recorded(tmp_path / "data"), tmp_path / "file"
    file.touch()

    def fail(*paths: Path) -> None:
        paths[-1].mkdir()
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OutputError, match=f"{file}/all/{path.name}"):
        merge([path], file / "all")
    monkeypatch.setattr("shapechanger.demos.episodes.reader.shutil.copytree", fail)
    with pytest.raises(OutputError, match=f"all/{path.name}.*No space left"):
        merge([path], tmp_path / "all")
    assert not list((tmp_path / "all").iterdir())
    with pytest.raises(OutputError, match="gone/x"):
        lock(tmp_path / "gone" / "x", "busy")
    with pytest.raises(OutputError, match=f"{file}/data"):
        EpisodeWriter.create(file / "data", header(), spare_bytes=0)
    (path / "frames" / "stray.jpg").touch()
    (path / "lost").touch()
    with pytest.raises(OutputError, match=str(path)):
        repair(path)
    monkeypatch.setattr("shapechanger.demos.episodes.reader.append", lambda *_: fail(path / "x"))
    with pytest.raises(OutputError, match=f"{path}/steps.jsonl"):
        edit(path, EpisodeMark(0))
    writer = EpisodeWriter.create(tmp_path / "new", header(), spare_bytes=0)
    shutil.rmtree(writer.path / "frames")
    with pytest.raises(OutputError, match="frames/000000"):
        writer.add(step(), picture())
    writer.path.rename(tmp_path / "moved")
    with pytest.raises(OutputError, match=str(writer.path)):
        writer.add(step())
    (tmp_path / "moved").rename(writer.path)
    writer.close()
