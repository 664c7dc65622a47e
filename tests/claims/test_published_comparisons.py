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
    expected = ["Ant-to-BigAnt", "AmputatedAnt-to-ExtendedAnt"]
    assert list(found) == expected[: 1 if arm == "frozen-trunk" else 2]
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


def test_differences_between_limbs_and_padding_equal_the_runs():
    runs = load("generalist-runs")
    text = " ".join(MANY_BODIES.split())
    for split in runs[0]["splits"]:
        ours, theirs = (
            [np.mean(run["splits"][split]) for run in runs if run["network"] == network]
            for network in ("limbs", "padded")
        )
        mean, low, high = difference(ours, theirs)
        assert f"{mean:+.3f} [{low:+.3f}, {high:+.3f}]" in text, split


def test_the_atlas_compares_methods_as_the_runs_do(pairs):
    def above(arm, among):
        """Return the probability that a run ends above a fine-tuned one on the same pair."""
        wins = [
            np.mean(
                np.greater.outer(at_the_end(pairs[pair][arm]), at_the_end(pairs[pair]["fine-tune"]))
            )
            for pair in among
        ]
        return f"{np.mean(wins):.2f}"

    extended = [pair for pair in pairs if "ExtendedAnt" in pair]
    others = [pair for pair in pairs if "ExtendedAnt" not in pair]
    text = " ".join(ATLAS.split())
    row = [above(arm, pairs) for arm in ("scratch", "frozen-trunk", "evolution")]
    assert (
        "| **probability to end above fine-tune** | {} | | {} [0.40, 0.61] | {} [".format(*row)
        in text
    )
    assert f"is {above('evolution', extended)} [0.15, 0.39]" in text
    assert f"probability of {above('evolution', others)} [0.44, 0.74]" in text


def test_from_a_body_that_walks_every_fine_tuned_run_ends_ahead(pairs):
    walking = {pair: runs for pair, runs in pairs.items() if not pair.startswith("ExtendedAnt")}
    early = 0
    for runs in walking.values():
        scratch = at_the_end(runs["scratch"])
        assert min(at_the_end(runs["fine-tune"])) > max(scratch)
        curve = np.mean([run["values"] for run in runs["fine-tune"]], axis=0)
        early += int(np.argmax(curve >= np.mean(scratch))) <= (len(curve) - 1) // 2
    assert (len(walking), early) == (9, 8)


def test_the_atlas_states_the_speeds_of_sources_and_of_zero_shot_big_ants(pairs):
    def ends(source):
        runs = next(runs for pair, runs in pairs.items() if pair.startswith(f"{source}-to"))
        return " to ".join(f"{one(at_the_end(runs['source'])):.1f}" for one in (min, max))

    text = " ".join(ATLAS.split())
    assert f"walk at {ends('ExtendedAnt')} m/s" in text
    assert f"{ends('AmputatedAnt')} m/s and at {ends('BigAnt')}, the ant's at {ends('Ant')}" in text
    speeds = [np.mean(run["values"]) for run in pairs["Ant-to-BigAnt"]["zero-shot"]]
    assert f"{min(speeds):.2f} to {max(speeds):.2f} over seeds" in text


def test_the_share_of_speed_that_policies_of_limbs_keep():
    runs = load("generalist-runs")
    text = " ".join(MANY_BODIES.split())
    kept = {}
    for network in ("limbs", "padded"):
        mine = [run for run in runs if run["network"] == network]
        speed = {key: np.mean([run["splits"][key] for run in mine]) for key in mine[0]["splits"]}
        speed["extended"] = np.mean([run["extended"] for run in mine])
        kept[network] = {key: f"{100 * one / speed['train']:.0f}" for key, one in speed.items()}
    ours = [kept["limbs"][key] for key in ("interpolation", "extrapolation", "composition")]
    assert (
        "keeps {} % of its speed in the training bodies in interpolation, {} % in extrapolation "
        "and {} % in composition".format(*ours)
        in text
    )
    theirs = [kept["padded"][key] for key in ("interpolation", "extrapolation", "composition")]
    assert "padded policies keep {}, {} and {} %".format(*theirs) in text
    rows = {row["name"]: float(row["value"].split()[0]) for row in load("generalist-gpu")["rows"]}
    gpu = {name.split(": ")[0].removeprefix("32 ants, "): one for name, one in rows.items()}
    share = [
        f"{100 * gpu[key] / gpu['train']:.0f}"
        for key in ("interpolation", "extrapolation", "composition", "ExtendedAnt, zero-shot")
    ]
    before = [*ours, kept["limbs"]["extended"]]
    both = [one for two in zip(share, before, strict=True) for one in two]
    expected = (
        "keeps {} % of its speed in the training bodies in interpolation ({} % with 32 ants), "
        "{} % in extrapolation ({} %), "
        "{} % in compositions ({} %), and {} % with 12 joints ({} %)"
    )
    assert expected.format(*both) in text


def test_the_atlas_pools_scores_as_the_runs_do(pairs):
    """A score of 0 is the best of random, idle and untrained policies, 1 the reference's end."""
    folder = ROOT / "src" / "shapechanger" / "transfer" / "references"
    references = json.loads((folder / "references.json").read_text(encoding="utf-8"))

    def scores(pair, arm):
        runs = pairs[pair]
        target = references[f"shapechanger/{pair.split('-to-')[1]}-v1"]
        zero = max(
            np.mean([run["values"] for run in runs[arm]]) for arm in ("random", "zero-action")
        )
        zero = max(zero, np.mean([run["values"][0] for run in runs["scratch"]]))
        one = np.mean(target["ends"]["forward speed"])
        return (np.array(at_the_end(runs[arm])) - zero) / (one - zero)

    means = [
        stats.trim_mean(np.concatenate([scores(pair, arm) for pair in pairs]), 0.25)
        for arm in ("scratch", "fine-tune", "frozen-trunk", "evolution")
    ]
    row = " | ".join(f"{mean:.2g}" for mean in means)
    assert f"| **interquartile mean of the score** | {row} |" in ATLAS
