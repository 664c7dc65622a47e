"""The page of a suite: matrix, methods, seeds and films."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import permutations
from types import MappingProxyType

import msgspec
import numpy as np
import pytest

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import StudyError
from shapechanger.transfer.report.suite import FilmStrip, Sweep, suite_html
from shapechanger.transfer.study import Study
from tests.transfer.report.studies import make_study, rising
from tests.transfer.report.test_report_page import EVIL, Reader

ANTS = [EnvRef(f"shapechanger/{name}-v1") for name in ("Ant", "BigAnt", "ExtendedAnt")]


@pytest.fixture(scope="module")
def pairs() -> Mapping[str, Study]:
    """Six pairs of three ants; transfer hurts from BigAnt to Ant and helps elsewhere."""
    studies: dict[str, Study] = {}
    for source, target in permutations(ANTS, 2):
        worse = rising(-200.0, 100.0, 3000.0, seed=3)
        study = make_study(source=source, target=target)
        if (source, target) == (ANTS[1], ANTS[0]):
            study = make_study(source=source, target=target, fine_tune=worse)
        studies[f"{source.id[13:-3]}-to-{target.id[13:-3]}"] = study
    return MappingProxyType(studies)


@pytest.fixture(scope="module")
def page(pairs: Mapping[str, Study]) -> str:
    """The page of all six pairs."""
    return suite_html("ants", pairs, seeds=5)


def test_every_pair_has_a_cell(page: str) -> None:
    """Rows are sources and columns targets; each cell links to the report of its study."""
    reader = Reader(page)
    links = [value for name, value in reader.attributes if name == "href"]
    for source, target in permutations(("Ant", "BigAnt", "ExtendedAnt"), 2):
        assert links.count(f"{source}-to-{target}/report.html") == 2
    assert reader.words.count("same body") == 3
    assert "ahead of scratch in 5, behind in 1, and without a clear difference in 0" in reader.words
    assert reader.headings[1] == "Fine-tune against scratch"


def test_methods_are_compared_by_target_and_over_all(page: str) -> None:
    """The page has interquartile means and probabilities of improvement, with intervals."""
    words = Reader(page).words
    assert words.count("all targets") == 3
    assert words.count("baseline") == 4
    assert "ExtendedAnt fine-tune 10" in words
    assert "all targets fine-tune 30" in words


@pytest.mark.parametrize("seeds", [2, 5])
def test_no_interval_that_is_none(seeds: int) -> None:
    """Two runs, or runs that are all better, give no interval of a bootstrap."""
    better, worse = rising(900.0, 950.0, 3e3), rising(0.0, 100.0, 3e3, seed=1)
    study = make_study(scratch=worse[:seeds], fine_tune=better[:seeds])
    words = Reader(suite_html("a", {"a": study}, seeds=seeds)).words
    assert "1 (no interval)" in words
    assert "1 [1, 1]" not in words
    assert (words.count("(no interval)") > 2) == (seeds == 2)


@pytest.mark.parametrize(
    ("declared", "looks", "said", "unsaid"),
    [
        (5, (5,), "declares 5 seeds, and every study has them.", "Results were also"),
        (8, (5,), "the studies have 5, so these are interim results", "Results were also"),
        (3, (5,), "The suite declares 3 seeds; the studies have 5.", "interim"),
        (5, (3, 5), "Results were also computed on the way, with 3 seeds", "interim"),
    ],
)
def test_declared_seeds_and_earlier_looks_are_stated(
    declared: int, looks: tuple[int, ...], said: str, unsaid: str
) -> None:
    study = msgspec.structs.replace(make_study(), looks=looks)
    page = suite_html("a", {"a": study}, seeds=declared)
    assert said in page
    assert unsaid not in page


def test_a_sweep_has_a_chart() -> None:
    studies = {
        f"Ant-{factor:g}": make_study(target=EnvRef("shapechanger/Ant-v1", {"body": str(factor)}))
        for factor in (0.5, 1.5, 2.0)
    }
    values = {name: float(name[4:]) for name in studies}
    reader = Reader(suite_html("shank", studies, seeds=5, sweep=Sweep("factor", values)))
    assert "Over the targets" in reader.headings
    assert "Fine-tune against scratch" not in reader.headings


def test_strips_are_embedded_and_films_linked(pairs: Mapping[str, Study], page: str) -> None:
    strips = {"Ant-to-BigAnt": [FilmStrip("zero-shot: 0.1 m/s", b"\xff\xd8jpeg")]}
    films = {"Ant-to-BigAnt": "a/film.mp4"}
    reader = Reader(suite_html("ants", pairs, seeds=5, strips=strips, films=films))
    assert ("href", "a/film.mp4") in reader.attributes
    assert any(value.startswith("data:image/jpeg") for _, value in reader.attributes)
    assert "zero-shot: 0.1 m/s" in reader.words
    assert "Films" in reader.headings
    assert "Films" not in Reader(page).headings


def test_names_are_escaped() -> None:
    page = suite_html(EVIL, {EVIL: make_study(command=EVIL)}, seeds=5)
    assert "<script" not in page
    with pytest.raises(StudyError, match="suite none has no finished study"):
        suite_html("none", {}, seeds=5)


def test_without_learning_there_are_no_scores() -> None:
    """The table is empty, and the verdict counts the study as showing nothing."""
    flat = rising(0.0, 0.0, 1e3, noise=0.0)
    studies = {
        "a": make_study(
            scratch=flat, fine_tune=flat, zero_shot=flat[:, :1], random=np.zeros((5, 1))
        )
    }
    words = Reader(suite_html("flat", studies, seeds=5)).words
    assert "1 show nothing" in words
