"""A crash at any time costs at most the step being written."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.demos.episodes import read_episode, repair
from shapechanger.errors import BrokenEpisode
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

    done = repair(path)

    assert done.kept == whole
    episode = read_episode(path)
    assert [s.index for s in episode.steps] == list(range(whole))
    assert all(episode.jpeg(s) == picture(s.index) for s in episode.steps)
    assert (episode.closed, episode.outcome) == (True, "cut off")
    torn = content[:cut].rpartition(b"\n")[2]
    assert (path / "lost" / "steps.jsonl").read_bytes() == torn if torn else not done.lost
    assert done.pictures == 5 - whole


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
    assert repair(path).kept >= 3
    assert len(read_episode(path).steps) >= 3


def test_repairing_an_intact_episode_changes_nothing(tmp_path: Path) -> None:
    path = recorded(tmp_path)
    before = {p: p.read_bytes() for p in path.rglob("*") if p.is_file()}
    assert not repair(path).changed
    assert {p: p.read_bytes() for p in path.rglob("*") if p.is_file()} == before


def test_images_without_a_step_are_all_kept(tmp_path: Path) -> None:
    path = recorded(tmp_path, close=False)
    for size in (20, 30):
        (path / "frames" / "000005.jpg").write_bytes(picture(5)[:size])
        assert repair(path).pictures == 1
    lost = path / "lost"
    assert (lost / "000005.jpg").read_bytes() == picture(5)[:20]
    assert (lost / "000005-0001.jpg").read_bytes() == picture(5)[:30]


def test_a_step_without_its_picture_does_not_count(tmp_path: Path) -> None:
    path = recorded(tmp_path)
    (path / "frames" / "000002.jpg").unlink()
    done = repair(path)
    assert done.kept == 4
    assert "000002.jpg is missing" in done.lost[0]
    assert [s.index for s in read_episode(path).steps] == [0, 1, 3, 4]
