"""Measure the coverage of three intervals of a ratio, for the table of docs/statistics.md.

.venv/bin/python -m benchmarks.interval_coverage
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from shapechanger.transfer.metrics.intervals import estimate_ratio

Array = NDArray[np.float64]

N_RESAMPLES = 2000
# True mean scores of the two arms.
ARM, SCRATCH = 0.8, 0.5


class Case(NamedTuple):
    """One kind of study, simulated many times.

    Attributes:
        data: Distribution of the areas under the learning curves of single seeds.
        spread: Standard deviation, in percent of the mean (of `SCRATCH` if `data` is "headroom").
        n_seeds: Seeds in each of the two arms.
    """

    data: str
    spread: int
    n_seeds: int


class Measured(NamedTuple):
    """Result of one method over all studies of a case.

    Attributes:
        coverage: Share of studies whose interval contains the true value, or is missing.
        width: Median width; a missing interval has infinite width.
    """

    coverage: float
    width: float


CASES = [
    *(
        Case(data, spread, n_seeds)
        for data in ("normal", "lognormal", "bounded", "headroom")
        for spread in (5, 20, 40)
        for n_seeds in (5, 10)
    ),
    Case("normal", 20, 3),
    Case("ceiling", 40, 5),
    Case("ceiling", 40, 10),
    Case("failures", 10, 5),
    Case("failures", 10, 10),
]


def draw(case: Case, trials: int, rng: np.random.Generator) -> tuple[Array, Array, float]:
    """Return both arms of many studies, each of shape (trials, n_seeds), and the true ratio."""
    shape = (trials, case.n_seeds)
    spread = case.spread / 100.0

    def bounded(mean: float, deviation: float) -> Array:
        size = mean * (1.0 - mean) / deviation**2 - 1.0
        return rng.beta(mean * size, (1.0 - mean) * size, shape)

    def lognormal(mean: float) -> Array:
        square = np.log1p(spread**2)
        return rng.lognormal(np.log(mean) - square / 2.0, np.sqrt(square), shape)

    def failures(mean: float) -> Array:
        """Return areas, each of which is a tenth of the mean with a probability of 0.2."""
        failed = rng.random(shape) < 0.2
        return np.where(failed, 0.1 * mean, rng.normal(mean, spread * mean, shape))

    match case.data:
        case "headroom" | "ceiling":
            own = case.data == "ceiling"
            arms, scratches = (
                1.0 - bounded(mean, spread * (mean if own else SCRATCH)) for mean in (ARM, SCRATCH)
            )
            return arms, scratches, (1.0 - ARM) / (1.0 - SCRATCH)
        case "bounded":
            arms, scratches = (bounded(mean, spread * mean) for mean in (ARM, SCRATCH))
        case "lognormal":
            arms, scratches = lognormal(ARM), lognormal(SCRATCH)
        case "failures":
            arms, scratches = failures(ARM), failures(SCRATCH)
        case _:
            arms, scratches = (rng.normal(mean, spread * mean, shape) for mean in (ARM, SCRATCH))
    return arms, scratches, ARM / SCRATCH


def quotient(arms: Array, scratches: Array, axis: int) -> Array:
    """Return the ratio of the means."""
    return np.asarray(arms.mean(axis=axis) / scratches.mean(axis=axis))


def bca(arms: Array, scratches: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return intervals of the bias-corrected and accelerated bootstrap (Efron, JASA 82, 1987)."""
    interval = stats.bootstrap(
        (arms, scratches),
        quotient,
        n_resamples=N_RESAMPLES,
        batch=50,
        axis=-1,
        method="BCa",
        rng=rng,
    ).confidence_interval
    return np.asarray(interval.low), np.asarray(interval.high)


def studentised(arms: Array, scratches: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the intervals of the package; NaN if there is no interval."""
    estimates = [
        estimate_ratio(a, b, least=1e-9, too_small="-", rng=rng, n_resamples=N_RESAMPLES)
        for a, b in zip(arms, scratches, strict=True)
    ]
    # NumPy makes NaN of None.
    low = np.array([estimate.low for estimate in estimates], dtype=np.float64)
    return low, np.array([estimate.high for estimate in estimates], dtype=np.float64)


def fieller(arms: Array, scratches: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the bounds of all r with |x - r y| <= t · sqrt(v_x + r² v_y).

    Fieller, JRSS B 16, 1954, with Welch's degrees of freedom; NaN if the set is not an interval.
    """
    n, m = arms.shape[1], scratches.shape[1]
    x, y = arms.mean(axis=1), scratches.mean(axis=1)
    v_x, v_y = arms.var(axis=1, ddof=1) / n, scratches.var(axis=1, ddof=1) / m
    v_ry = (x / y) ** 2 * v_y
    freedom = (v_x + v_ry) ** 2 / (v_x**2 / (n - 1) + v_ry**2 / (m - 1))
    t = np.asarray(stats.t.ppf(0.975, freedom))
    a, b, c = y**2 - t**2 * v_y, x * y, x**2 - t**2 * v_x
    root = np.sqrt(np.maximum(b**2 - a * c, 0.0))
    bounded = np.where(a > 0.0, a, np.nan)
    return (b - root) / bounded, (b + root) / bounded


METHODS: dict[str, Callable[[Array, Array, np.random.Generator], tuple[Array, Array]]] = {
    "BCa": bca,
    "studentised": studentised,
    "Fieller": fieller,
}


def measure(case: Case, trials: int, seed: int) -> dict[str, Measured]:
    """Measure every method on the same studies."""
    rng = np.random.default_rng(seed)
    arms, scratches, truth = draw(case, trials, rng)
    measured: dict[str, Measured] = {}
    for name, method in METHODS.items():
        low, high = method(arms, scratches, rng)
        missed = (truth < low) | (truth > high)  # NaN counts as covered.
        width = np.where(np.isnan(high - low), np.inf, high - low)
        measured[name] = Measured(1.0 - float(missed.mean()), float(np.median(width)))
    return measured


def row(case: Case, measured: dict[str, Measured]) -> str:
    """Return a row of the table in docs/statistics.md."""
    cells = (f"{100 * m.coverage:.1f} · {m.width:.2f}" for m in measured.values())
    return f"| {case.data} | {case.spread} | {case.n_seeds} | {' | '.join(cells)} |"


if __name__ == "__main__":
    for each in CASES:
        print(row(each, measure(each, trials=4000, seed=0)), flush=True)
