"""Comparisons that the documentation states, computed from the published runs."""

import json
import re
from typing import Any

import numpy as np
import pytest
from scipy import stats

from shapechanger.transfer.metrics.intervals import probability_of_improvement
from tests.claims.test_published_numbers import ROOT, page, rows

RESULTS = ROOT / "benchmarks" / "results"
SPLITS = ("interpolation", "extrapolation", "composition")


def load(name):
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))


def words(name):
    """Return the text of a page with single spaces."""
    return " ".join(page(name).split())


def in_rows(pattern, file, name="") -> Any:
    """Return the number of each match in the rows with a name, or its numbers if several."""
    text = "\n".join(text for row, text in rows(file) if name in row)
    text = re.sub(r"(?<=\d),(?=\d{3})", "", text)
    found = np.array(re.findall(pattern, text), float)
    assert found.size, pattern
    return found.tolist()


def span(values, factor=1, digits=0):
    """Return the range of some numbers as the pages write it."""
    return " to ".join(f"{factor * one(values):.{digits}f}" for one in (min, max))


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
    assert all(interval in words("atlas") for interval in found.values())


def test_scratch_with_the_steps_of_the_source_is_ahead_in_seven_pairs(pairs):
    long = {pair.split("-to-")[0]: runs["source"] for pair, runs in pairs.items()}
    intervals = [
        difference(at_the_end(long[pair.split("-to-")[1]]), at_the_end(runs["fine-tune"]))
        for pair, runs in pairs.items()
    ]
    assert sum(low > 0.0 for _, low, _ in intervals) == 7
    assert sum(high < 0.0 for _, _, high in intervals) == 1
    assert "ahead of fine-tuning in 7 of the 12 pairs of ants, and behind in 1" in words("atlas")


def test_differences_between_limbs_and_padding_equal_the_runs():
    runs = load("generalist-runs")
    for split in runs[0]["splits"]:
        ours, theirs = (
            [np.mean(run["splits"][split]) for run in runs if run["network"] == network]
            for network in ("limbs", "padded")
        )
        mean, low, high = difference(ours, theirs)
        assert f"{mean:+.3f} [{low:+.3f}, {high:+.3f}]" in words("many-bodies"), split


def test_the_atlas_compares_methods_as_the_runs_do(pairs):
    def above(arm, among):
        """Return the probability that a run ends above a fine-tuned one on the same pair."""
        ends, tuned = (
            [np.array(at_the_end(pairs[pair][one])) for pair in among] for one in (arm, "fine-tune")
        )
        chance = probability_of_improvement(ends, tuned, rng=np.random.default_rng(0))
        return f"{chance.value:.2f} [{chance.low:.2f}, {chance.high:.2f}]"

    def with_evolution(among, best):
        """Return in how many pairs evolution has the best of the three means, or the worst."""
        arms = ("fine-tune", "frozen-trunk", "evolution")
        ends = [[np.mean(at_the_end(pairs[pair][arm])) for arm in arms] for pair in among]
        return sum(one[2] == best(one) for one in ends)

    extended = [pair for pair in pairs if "ExtendedAnt" in pair]
    others = [pair for pair in pairs if "ExtendedAnt" not in pair]
    text = words("atlas")
    row = [above(arm, pairs) for arm in ("scratch", "frozen-trunk", "evolution")]
    row[0] = row[0].split()[0]
    assert "| **probability to end above fine-tune** | {} | | {} | {} |".format(*row) in text
    assert f"is {above('evolution', extended)}" in text
    assert f"probability of {above('evolution', others)}" in text
    assert (with_evolution(extended, min), with_evolution(others, max)) == (5, 4)
    assert re.search("worst mean in five.*best mean in four", text)


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
        return span(at_the_end(runs["source"]), digits=1)

    text = words("atlas")
    both = (at_the_end(pairs["ExtendedAnt-to-Ant"][arm]) for arm in ("fine-tune", "scratch"))
    assert "a difference of {:.2f} [{:+.2f}, {:+.2f}]".format(*difference(*both)) in text
    assert f"walk at {ends('ExtendedAnt')} m/s" in text
    assert f"{ends('AmputatedAnt')} m/s and at {ends('BigAnt')}, the ant's at {ends('Ant')}" in text
    speeds = [np.mean(run["values"]) for run in pairs["Ant-to-BigAnt"]["zero-shot"]]
    assert f"{span(speeds, digits=2)} over seeds" in text
    assert f"an ant alone walks at {ends('Ant')} m/s" in words("many-bodies")


def test_the_atlas_states_when_runs_with_a_replay_buffer_balance():
    (runs,) = load("atlas-replay-runs").values()
    scratch, tuned = (
        [run["steps"][int(np.argmax(np.array(run["values"]) >= 950.0))] for run in runs[arm]]
        for arm in ("scratch", "fine-tune")
    )
    assert f"only after {min(scratch):,} to {max(scratch):,} steps" in words("atlas")
    assert set(tuned) == {4_000}
    assert "balances after 4,000 steps with every seed" in words("atlas")


def test_the_share_of_speed_that_policies_of_limbs_keep(pairs):
    runs = load("generalist-runs")
    text = words("many-bodies")
    kept, speeds = {}, {}
    for network in ("limbs", "padded"):
        mine = [run for run in runs if run["network"] == network]
        speed = {key: np.mean([run["splits"][key] for run in mine]) for key in mine[0]["splits"]}
        speed["extended"] = np.mean([run["extended"] for run in mine])
        kept[network] = {key: f"{100 * one / speed['train']:.0f}" for key, one in speed.items()}
        speeds[network] = speed
    ours = [kept["limbs"][key] for key in SPLITS]
    assert (
        "in the training bodies it keeps {} % in interpolation, {} % in extrapolation "
        "and {} % in composition".format(*ours)
        in text
    )
    theirs = [kept["padded"][key] for key in SPLITS]
    assert "padded policies keep {}, {} and {} %".format(*theirs) in text
    rows = {row["name"]: float(row["value"].split()[0]) for row in load("generalist-gpu")["rows"]}
    gpu = {name.split(": ")[0].removeprefix("32 ants, "): one for name, one in rows.items()}
    share = [f"{100 * gpu[key] / gpu['train']:.0f}" for key in (*SPLITS, "ExtendedAnt, zero-shot")]
    before = [*ours, kept["limbs"]["extended"]]
    both = [one for two in zip(share, before, strict=True) for one in two]
    expected = (
        "in the training bodies it keeps {} % in interpolation ({} % with 32 ants), "
        "{} % in extrapolation ({} %), "
        "{} % in compositions ({} %), and {} % with 12 joints ({} %)"
    )
    assert expected.format(*both) in text
    ant, extended = (
        np.mean(at_the_end(pairs[pair]["source"]))
        for pair in ("Ant-to-BigAnt", "ExtendedAnt-to-Ant")
    )
    reached = [f"{100 * speeds['limbs'][key] / ant:.0f}" for key in ("train", *SPLITS)]
    assert (
        "plain ant, {:.2f} m/s in the mean, policies of limbs reach {} % in the training bodies, "
        "{} % in interpolation, {} % in extrapolation and {} % in composition. In the "
        "`ExtendedAnt`, they reach {:.0f} % of its own specialists' {:.2f} m/s".format(
            ant, *reached, 100 * speeds["limbs"]["extended"] / extended, extended
        )
        in text
    )
    padded = sorted(np.mean(run["splits"]["train"]) for run in runs if run["network"] == "padded")
    one = max(run["extended"] for run in runs if run["network"] == "limbs")
    assert f"walks well, at {one:.2f} m/s" in text
    others = span(padded[:-1], digits=2)
    assert f"{padded[-1]:.2f} m/s in its training bodies, the others {others}, so" in text


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
    assert f"| **interquartile mean of the score** | {row} |" in page("atlas")


def test_ranges_and_counts_follow_from_the_rows():
    """Shares, ranges and counts that are in no row themselves."""
    sizes = [one / two for one, two in in_rows(r"([\d.]+) MB in \w+ of ([\d.]+)", "exchange-video")]
    assert f"has {span(sizes, 100)} % of the bytes" in words("exchange")

    *stiffness, last, a, b, c, d, friction, _, _ = in_rows(r"rithm ([\d.]+)", "finger-identify")
    text = words("identify")
    assert f"off by {span(stiffness, 100)} %, the end joint by {100 * last:.0f} %" in text
    assert f"0.99 to 1.02 in the mean; single fingers off by {span([a, b, c, d], 100)} %" in text
    assert f"0.93; single fingers off by {100 * friction:.0f} %" in text

    (steps,) = in_rows(r"ants .*: steps ([\d,]+)", "gpu-generalist")
    (seconds,) = in_rows(r"([\d,]+) s with", "gpu-generalist")
    assert f"learned from {steps / seconds // 1000:.0f},000 steps per second" in words("gpu")

    reach = next(text for name, text in rows("finger-gap") if "comes to from rest, against" in name)
    shares = [int(one) for one in re.findall(r"(\d+)%", reach.partition("fingers: ")[2])]
    weak = "two fingers, seeds {} and {}:".format(*sorted(np.argsort(shares)[:2]))
    assert weak in words("finger")

    (low,) = in_rows(r"score \+[\d.]+ \[([-+\d.]+),", "demo")
    assert low > 0.0
    assert "fine-tuning is ahead of training from scratch" in words("README.md")


def test_comparisons_of_vehicles_follow_from_the_rows():
    text = words("vehicles")
    studies = "vehicles-waypoint-studies"
    returns = in_rows(r"rehearsal over scratch after \d+ s ([-\d.]+) to ([-\d.]+)", studies)
    assert [ours > scratch for ours, scratch in returns] == 24 * [True]
    assert "Rehearsal is ahead in the mean on all twelve pairs" in text
    pattern = r"rehearsal over scratch after 15 s ([-\d.]+) to .*zero-shot ([-\d.]+)"
    raised = [ours / zero - 1 for ours, zero in in_rows(pattern, studies, "BoatWaypoint-to")]
    assert f"raise its return by {span(raised, 100)} %" in text
    gains = in_rows(r"reward gain ([-+\d.]+) \[([-+\d.]+), ([-+\d.]+)\]", "vehicles-pairs")
    assert [low < 0.0 < high for _, low, high in gains] == 12 * [True]
    least, most = (one(gain for gain, _, _ in gains) for one in (min, max))
    assert f"gains lie between {least:+.1f} and {most:+.2f} scores, and none of" in text
