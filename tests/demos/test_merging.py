"""Merging recordings."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from shapechanger.demos.episodes import Drop, edit, episodes_of, merge, read_episode
from shapechanger.errors import BrokenEpisode, DemosError
from tests.demos.episodes.making import recorded


def test_episodes_are_copied_unchanged(tmp_path: Path) -> None:
    """Files are equal byte for byte, and names in use get the next number."""
    one, two = recorded(tmp_path / "a"), recorded(tmp_path / "b", 3)
    shutil.move(two, two.with_name(one.name))
    two = two.with_name(one.name)
    done = merge([tmp_path / "a", two], tmp_path / "all")
    first, second = episodes_of(tmp_path / "all")
    assert [first.name, second.name] == [one.name, f"{one.name[:-4]}0002"]
    assert [target for _, target in done] == [first, second]
    for source, target in ((one, first), (two, second)):
        files = sorted(p.relative_to(source) for p in source.rglob("*") if p.is_file())
        assert files == sorted(p.relative_to(target) for p in target.rglob("*") if p.is_file())
        assert all((source / f).read_bytes() == (target / f).read_bytes() for f in files)
    assert len(read_episode(second).steps) == 3


def test_duplicates_are_refused(tmp_path: Path) -> None:
    """An episode is recognized after its steps were judged; nothing is copied then."""
    one = recorded(tmp_path / "a")
    merge([one], tmp_path / "all")
    edit(one, Drop(0, 1, "bad"))
    recorded(tmp_path / "b")
    with pytest.raises(DemosError, match="the same episode"):
        merge([tmp_path / "b", tmp_path / "a"], tmp_path / "all")
    assert len(episodes_of(tmp_path / "all")) == 1


def test_incomplete_episodes_are_refused(tmp_path: Path) -> None:
    begun = recorded(tmp_path / "a", close=False)
    with pytest.raises(DemosError, match="demos repair"):
        merge([begun], tmp_path / "all")
    torn = recorded(tmp_path / "b")
    with (torn / "steps.jsonl").open("ab") as file:
        file.write(b'{"kind":"st')
    with pytest.raises(BrokenEpisode):
        merge([torn], tmp_path / "all")
    assert not (tmp_path / "all").exists()


def test_an_episode_cannot_be_the_target(tmp_path: Path) -> None:
    one, two = recorded(tmp_path / "a"), recorded(tmp_path / "b")
    with pytest.raises(DemosError, match="is an episode"):
        merge([one], two)
    with pytest.raises(DemosError, match="nothing to merge"):
        merge([], tmp_path / "all")
