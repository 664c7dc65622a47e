"""Transfer between bodies: suites of studies with intervals.

The studies take hours and resume from `results/`. `SEEDS` sets the number of runs per arm, and
`ONLY` names the studies to run, separated by spaces. The values of every run are
written to `benchmarks/results/`, next to the rows, and images to `docs/pictures/`.
"""

from __future__ import annotations

import os
import shutil
from itertools import combinations
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray
from playwright.sync_api import sync_playwright

from benchmarks.row import Row
from shapechanger.cli.suite import SuiteRun
from shapechanger.envs.suite_file import load_suite, suite_tasks
from shapechanger.errors import StudyError
from shapechanger.files import read_json, write_json
from shapechanger.transfer.metrics.intervals import estimate_difference, probability_of_improvement
from shapechanger.transfer.metrics.measures import jumpstart, total_reward_gain
from shapechanger.transfer.plan import SOURCE, Run
from shapechanger.transfer.report.curves import sweep_chart
from shapechanger.transfer.report.verdict import direction, estimate_text, finals, gain_over_scratch
from shapechanger.transfer.runs import RunResult, learner_of
from shapechanger.transfer.study import STUDY_FILE, Study

RESULTS: Final = Path(__file__).parent / "results"
PICTURES: Final = Path(__file__).parents[1] / "docs" / "pictures"
# Index of the limb that is shortened in the Amputated Ant.
_DAMAGED: Final = 3


def ants() -> list[Row]:
    """Measure the twelve ordered pairs of the four ants."""
    studies = _suite("ants")
    if len(studies) > 1:
        _matrix_picture(studies, PICTURES / "ants-matrix.png")
    return _rows(studies) + _method_rows(studies)


def pendulums() -> list[Row]:
    """Measure the six ordered pairs of the three pendulums."""
    return _rows(_suite("pendulums"))


def methods() -> list[Row]:
    """Measure each method on one pair of ants: forward speed during and after training."""
    return _by_method("methods")


def replay() -> list[Row]:
    """Measure the methods for learners with a replay buffer on one pair of poles."""
    return _by_method("replay")


def _by_method(suite: str) -> list[Row]:
    """Run a suite and compare each arm with scratch."""
    rows: list[Row] = []
    for name, study in _suite(suite).items():
        plan = study.plan
        scratch = study.curves("scratch")
        unit = "" if plan.unit == "1" else f" {plan.unit}"
        for arm in plan.arms:
            if arm == "scratch":
                continue
            curves = study.curves(arm)
            trained = curves.n_evals > 1
            gain = (total_reward_gain if trained else jumpstart)(curves, scratch)
            rows.append(
                Row(
                    f"{name}: {plan.measure} of {arm} over that of scratch, "
                    + ("mean over the budget" if trained else "at the start"),
                    f"{estimate_text(gain, signed=True)}{unit}",
                    f"{plan.seeds} seeds; from {curves.returns[:, 0].mean():.2f} to "
                    f"{finals(study, arm).mean():.2f}{unit}; scratch to "
                    f"{finals(study, 'scratch').mean():.2f}{unit}",
                    "none: whatever comes out",
                    True,
                )
            )
    return rows


def shank() -> list[Row]:
    """Measure the transfer to ants with shanks of 0.5 to 2.5 times the length."""
    studies = _suite("shank")
    suite = load_suite("shank")
    if suite.sweep is not None:
        names = (name for name, _ in suite_tasks(suite))
        values = dict(zip(names, suite.sweep.values, strict=True))
        picture = sweep_chart(
            {values[one]: s for one, s in studies.items()}, "factor of the length of the shanks"
        )
        (PICTURES / "shank-sweep.svg").write_text(picture)
    return _rows(studies)


def controls() -> list[Row]:
    """Compare scratch with scratch: how often an interval shows a false effect."""
    rows: list[Row] = []
    by_target = {name.partition("-to-")[2]: s for name, s in _finished("pendulums").items()}
    for target, study in by_target.items():
        heights = study.curves("scratch").auc()  # The statistic that total reward gain compares.
        half = heights.size // 2
        shown = total = 0
        for chosen in combinations(range(heights.size), half):
            ours, theirs = heights[list(chosen)], np.delete(heights, chosen)[:half]
            shown += direction(estimate_difference(ours, theirs)) != "unclear"
            total += 1
        rate = shown / total
        rows.append(
            Row(
                f"scratch against scratch on {target}: intervals that exclude 0",
                f"{100.0 * rate:.1f} %",
                f"all {total} splits of {heights.size} runs; they overlap, so the rate is rough",
                "about 5 %",
                rate <= 0.1,
            )
        )
    return rows


def claims() -> list[Row]:
    """Measure the three claims of the 2017 paper."""
    pendulum = _finished("pendulums")["InvertedPendulum-to-BigInvertedPendulum"]
    balanced = [_first_reaching(run, 950.0) for run in pendulum.of("scratch")]
    learned = [seconds for seconds in balanced if seconds is not None]
    found = _finished("ants")
    big, cut = found["Ant-to-BigAnt"], found["AmputatedAnt-to-Ant"]
    kept = finals(big, "zero-shot").mean() / finals(big, "fine-tune").mean()
    shares = _power_shares(cut, Path("results", "ants", "AmputatedAnt-to-Ant"))
    whole = _power_shares(big, Path("results", "ants", "Ant-to-BigAnt"))
    return [
        Row(
            "a pendulum is learned in minutes: BigInvertedPendulum from scratch to 950 of 1000",
            f"{np.median(learned):.0f} s" if learned else "never",
            f"{len(learned)} of {len(balanced)} seeds; median, evaluations included",
            "minutes",
            len(learned) == len(balanced) and float(np.median(learned)) < 300.0,
        ),
        Row(
            "the Ant's policy is near the Big Ant's: zero-shot over fine-tuned forward speed",
            f"{100.0 * kept:.0f} %",
            f"{finals(big, 'zero-shot').mean():.2f} of {finals(big, 'fine-tune').mean():.2f} m/s, "
            f"{big.plan.seeds} seeds",
            "none: whatever comes out",
            True,
        ),
        Row(
            "the Amputated Ant's policy ignores the damaged limb: its share of mechanical power",
            f"{100.0 * shares[:, _DAMAGED].mean():.0f} %",
            "by limb of AmputatedAnt "
            + ", ".join(f"{100.0 * share:.0f}" for share in shares.mean(axis=0))
            + "; of Ant "
            + ", ".join(f"{100.0 * share:.0f}" for share in whole.mean(axis=0))
            + " %",
            "< 25 %, a quarter",
            float(shares[:, _DAMAGED].mean()) < 0.25,
        ),
    ]


def pages() -> list[Row]:
    """Measure the size and the loading time of the pages of all suites in `results`."""
    rows: list[Row] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"))
        for path in sorted(Path("results").glob("*/index.html")):
            page = browser.new_page()
            page.goto(path.resolve().as_uri(), wait_until="load")
            loaded_s = page.evaluate("performance.getEntriesByType('navigation')[0].loadEventEnd")
            rows.append(
                Row(
                    f"page of the suite {path.parent.name}: size and time until it is loaded",
                    f"{path.stat().st_size / 1e6:.1f} MB, {loaded_s / 1e3:.2f} s",
                    f"{page.locator('.gain').count()} pairs, film strips included; Chromium",
                    "under 10 MB and 2 s",
                    path.stat().st_size < 10e6 and loaded_s < 2e3,
                )
            )
            page.close()
        browser.close()
    return rows


def _first_reaching(run: RunResult, level: float) -> float | None:
    """Estimate the seconds until an evaluation of a run reaches `level`; None if none does."""
    for evaluation in run.curve:
        if evaluation.mean_return >= level:
            return run.wall_s * evaluation.steps / run.curve[-1].steps
    return None


def _power_shares(study: Study, folder: Path) -> NDArray[np.float64]:
    """Return the share of mechanical power per limb of the source policies, shape (seeds, 4)."""
    plan = study.plan
    learner = learner_of(plan.learner, plan.settings)
    shares: list[NDArray[np.float64]] = []
    for index in range(plan.seeds):
        act = learner.load(Run(SOURCE, index).policy_file(folder)).act
        env: Any = plan.task.source.make()
        data, model = env.unwrapped.data, env.unwrapped.model
        limbs = [int(model.actuator(i).name.rpartition("_")[2]) - 1 for i in range(model.nu)]
        spent = np.zeros(4)
        observation, _ = env.reset(seed=0)
        over = False
        while not over:
            observation, _, terminated, truncated, _ = env.step(act(observation[None])[0])
            power = np.abs(data.actuator_force * data.actuator_velocity)
            np.add.at(spent, limbs, power)
            over = terminated or truncated
        env.close()
        shares.append(spent / spent.sum())
    return np.array(shares)


def _suite(name: str) -> dict[str, Study]:
    """Run the missing studies of a suite, write the values of its runs, and return its studies."""
    suite, out = load_suite(name), Path("results", name)
    seeds = int(os.environ.get("SEEDS", suite.seeds))
    SuiteRun(name=name, seeds=seeds, out=out, only=tuple(os.environ.get("ONLY", "").split())).run()
    studies = _finished(name)
    write_json(RESULTS / f"atlas-{name}-runs.json", {one: _runs(s) for one, s in studies.items()})
    return studies


def _finished(name: str) -> dict[str, Study]:
    """Return the finished studies of a suite, in its order."""
    out = Path("results", name)
    studies = {
        one: read_json(out / one / STUDY_FILE, Study, f"delete {out / one}")
        for one, _ in suite_tasks(load_suite(name))
        if (out / one / STUDY_FILE).exists()
    }
    if not studies:
        raise StudyError(f"No study in {out} has ended: run the suite {name} first.")
    return studies


def _runs(study: Study) -> dict[str, Any]:
    """Return the measure of every run at every evaluation."""
    kinds = dict.fromkeys(run.run.kind for run in study.runs)
    found: dict[str, Any] = {"measure": study.plan.measure, "unit": study.plan.unit}
    for kind in kinds:
        found[kind] = [
            {
                "seed": run.seed,
                "steps": [evaluation.steps for evaluation in run.curve],
                "values": [round(e.value(study.plan.measure), 4) for e in run.curve],
                "returns": [round(e.mean_return, 2) for e in run.curve],
            }
            for run in study.of(kind)
        ]
    return found


def _rows(studies: dict[str, Study]) -> list[Row]:
    rows: list[Row] = []
    for name, study in studies.items():
        plan = study.plan
        unit = "" if plan.unit == "1" else f" {plan.unit}"
        ends = ", ".join(f"{arm} {finals(study, arm).mean():.3g}" for arm in plan.arms)
        rows.append(
            Row(
                f"{name}: {plan.measure} of fine-tune over that of scratch, mean over the budget",
                f"{estimate_text(gain_over_scratch(study, 'fine-tune'), signed=True)}{unit}",
                f"{plan.seeds} seeds; at the end: {ends}{unit}",
                "none: whatever comes out",
                True,
            )
        )
    found = [direction(gain_over_scratch(study, "fine-tune")) for study in studies.values()]
    rows.append(
        Row(
            "studies in which fine-tune is ahead of scratch, and behind",
            f"{found.count('up')} and {found.count('down')} of {len(studies)}",
            "95 % intervals over seeds",
            "none: whatever comes out",
            True,
        )
    )
    return rows


def _method_rows(studies: dict[str, Study]) -> list[Row]:
    """Return how often each method ends above fine-tuning, over all pairs."""
    baseline = [finals(study, "fine-tune") for study in studies.values()]
    rows: list[Row] = []
    for arm in next(iter(studies.values())).plan.arms:
        if arm in {"scratch", "zero-shot", "fine-tune"}:
            continue
        ends = [finals(study, arm) for study in studies.values()]
        chance = probability_of_improvement(ends, baseline, rng=np.random.default_rng(0))
        above = sum(end.mean() > base.mean() for end, base in zip(ends, baseline, strict=True))
        rows.append(
            Row(
                f"probability that {arm} ends above fine-tune, over all pairs",
                estimate_text(chance),
                f"its mean is above in {above} of {len(studies)}; 0.5 means no difference",
                "none: whatever comes out",
                True,
            )
        )
    return rows


def _matrix_picture(studies: dict[str, Study], path: Path) -> None:
    """Draw the gains as a heat map, sources in rows and targets in columns."""
    names = [str(env) for env in load_suite("ants").envs]
    gains = np.full((len(names), len(names)), np.nan)
    figure = Figure(figsize=(7.2, 4.0), layout="constrained")
    axes = figure.subplots()
    for name, study in studies.items():
        source, _, target = name.partition("-to-")
        row, column = names.index(source), names.index(target)
        gain = gain_over_scratch(study, "fine-tune")
        gains[row, column] = gain.value
        ends = {arm: float(finals(study, arm).mean()) for arm in study.plan.arms}
        axes.text(
            column,
            row,
            f"{ends['scratch']:.2f} → {ends['fine-tune']:.2f} m/s\n"
            f"{estimate_text(gain, signed=True)}\nzero-shot {ends['zero-shot']:z.2f}",
            ha="center",
            va="center",
            fontsize=8,
        )
    for row, column in np.argwhere(np.isnan(gains)).tolist():
        words = "same body" if row == column else "not run yet"
        axes.text(column, row, words, ha="center", va="center", fontsize=8, color="#8c959f")
    widest = float(np.nanmax(np.abs(gains)))
    colours = LinearSegmentedColormap.from_list("gain", ["#e8a27c", "#ffffff", "#7fb8dc"])
    axes.imshow(gains, cmap=colours, vmin=-widest, vmax=widest, aspect="auto")
    axes.set_xticks(range(len(names)), names)
    axes.set_yticks(range(len(names)), names)
    axes.xaxis.tick_top()
    axes.set_xlabel("target", fontsize=9)
    axes.xaxis.set_label_position("top")
    axes.set_ylabel("source", fontsize=9)
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    figure.savefig(path, dpi=130)
