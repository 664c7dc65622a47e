"""Comparisons that the documentation states, computed from the published runs."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "benchmarks" / "results"
ATLAS = (ROOT / "docs" / "atlas.md").read_text(encoding="utf-8")
MANY_BODIES = (ROOT / "docs" / "many-bodies.md").read_text(encoding="utf-8")


def load(name):
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))


def difference(ours, theirs):
    """Return the difference of means with Welch's 95 % interval."""
    interval = stats.ttest_ind(ours, theirs, equal_var=False).confidence_interval()
    return np.mean(ours) - np.mean(theirs), interval.low, interval.high


def at_the_end(runs):
    return [np.mean(run["values"][-3:]) for run in runs]


@pytest.fixture(scope="module")
def pairs():
    return load("atlas-ants-runs")


@pytest.mark.parametrize("arm", ["frozen-trunk", "evolution"])
def test_the_atlas_names_each_pair_whose_interval_excludes_zero(pairs, arm):
    found = {}
    for pair, runs in pairs.items():
        _, low, high = difference(at_the_end(runs[arm]), at_the_end(runs["fine-tune"]))
        if low > 0.0 or high < 0.0:
            found[pair] = f"[{low:+.2f}, {high:+.2f}]"
    expected = {
        "frozen-trunk": ["Ant-to-BigAnt"],
        "evolution": ["Ant-to-BigAnt", "AmputatedAnt-to-ExtendedAnt"],
    }
    assert list(found) == expected[arm]
    text = " ".join(ATLAS.split())
    assert all(interval in text for interval in found.values())


def test_scratch_with_the_steps_of_the_source_is_ahead_in_seven_pairs(pairs):
    long = {pair.split("-to-")[0]: runs["source"] for pair, runs in pairs.items()}
    intervals = [
        difference(at_the_end(long[pair.split("-to-")[1]]), at_the_end(runs["fine-tune"]))
        for pair, runs in pairs.items()
    ]
    assert sum(low > 0.0 for _, low, _ in intervals) == 7
    assert sum(high < 0.0 for _, _, high in intervals) == 1
    assert "ahead of\nfine-tuning in 7 of the 12 pairs of ants, and behind in 1" in ATLAS


def test_differences_between_limbs_and_padding_are_those_of_the_runs():
    runs = load("generalist-runs")
    text = " ".join(MANY_BODIES.split())
    for split in runs[0]["splits"]:
        ours, theirs = (
            [np.mean(run["splits"][split]) for run in runs if run["network"] == network]
            for network in ("limbs", "padded")
        )
        mean, low, high = difference(ours, theirs)
        assert f"{mean:+.3f} [{low:+.3f}, {high:+.3f}]" in text, split
