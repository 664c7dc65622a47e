"""Repairs: a crash costs at most the step being written. Merges copy only whole episodes."""

import json
import os
import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.demos.episodes import (
    Drop,
    EpisodeMark,
    edit,
    episodes_of,
    merge,
    read_episode,
    repair,
)
from shapechanger.errors import BrokenEpisode, DemosError
from tests.demos.episodes.making import picture, recorded


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
    assert repair(path) == f"kept {whole} steps, nothing was wrong"


@settings(max_examples=40)
@given(place=st.integers(0, 10_000), bit=st.integers(0, 7))
def test_one_flipped_bit_costs_one_step(
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
    """Marks and edits are lines, and not steps."""
    path = recorded(tmp_path)
    edit(path, EpisodeMark(1, "a door"))
    edit(path, Drop(2, 3, "bad"))
    before = {p: p.read_bytes() for p in path.rglob("*") if p.is_file()}
    assert repair(path) == "kept 5 steps, nothing was wrong"
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
    with pytest.raises(BrokenEpisode, match=f"shapechanger demos repair {path}"):  # noqa: PT012
        episode = read_episode(path)
        episode.jpeg(episode.steps[2])
    assert re.search("^kept 4 steps, moved a line aside, because its image 000002", repair(path))
    read = read_episode(path)
    assert [s.index for s in read.steps] == [0, 1, 3, 4]
    assert [mark.text for mark in read.marks] == ["a door"]


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
    # An episode is recognized after its steps were judged; nothing is copied then.
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
