"""The report of a cloned policy: one HTML file, and its numbers as JSON."""

# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from shapechanger.demos.cloning.evaluation import Bin, EvaluationResult, named
from shapechanger.files import write_atomic, write_json
from shapechanger.policy import PolicyCard
from shapechanger.reports.charts import BLUE, GREEN, GREY, ORANGE, PINK, SQUARE, WIDE, svg_chart
from shapechanger.reports.page import png_uri, render

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from shapechanger.demos.cloning.clone import Clone
    from shapechanger.demos.cloning.learn import Training
    from shapechanger.demos.dataset import Dataset

_MAX_SCATTERS: Final = 4
_MAGNIFICATION: Final = 3
_DIAGONAL: Final[dict[str, Any]] = {"color": "#777777", "linestyle": "--", "linewidth": 1.0}
_MEMBER_COLOURS: Final = (BLUE, ORANGE, GREEN, PINK, GREY)


def write_report(
    page: Path,
    name: str,
    policy: Clone,
    data: Dataset,
    evaluation: EvaluationResult,
    training: Training | None,
    data_note: str,
) -> Path:
    """Write the report of a policy that was evaluated on `data`, and its numbers as JSON.

    The path of the JSON file, which is next to the page, is returned.
    """
    by_class = evaluation.head == "class"
    numbers = {
        "evaluation": evaluation,
        "training": training,
        "policy": policy.card,
        "outlook": outlook(policy.card),
    }
    html = render(
        Path(__file__).with_name("clone.html"),
        title=name,
        data_note=data_note,
        calibration=calibration_chart(evaluation.calibration) if by_class else "",
        scatters=[
            (number, scatter_chart(evaluation, place))
            for place, number in enumerate(evaluation.numbers[:_MAX_SCATTERS])
            if not by_class
        ],
        frames=_worst(policy, data, evaluation),
        training_chart=training_chart(training) if training else "",
        card=policy.card,
        **numbers,
    )
    write_atomic(page, html.encode())
    write_json(page.with_suffix(".json"), numbers)
    return page.with_suffix(".json")


def _worst(policy: Clone, data: Dataset, evaluation: EvaluationResult) -> list[dict[str, Any]]:
    """Return the actions of the driver and of the policy in the steps with the largest errors."""
    chosen = list(evaluation.worst)
    pictures = None if data.pictures is None else data.pictures[chosen]
    states = None if data.states is None else data.states[chosen]
    outputs, actions = policy.outputs(pictures, states), policy.predict_many(pictures, states)
    frames: list[dict[str, Any]] = []
    for i, step in enumerate(chosen):
        if policy.net.classes:
            driver = named(data.actions[step], data.action_layout)
            did = f"{policy.net.class_names[int(outputs[i].argmax())]} ({outputs[i].max():.0%})"
        else:
            both = (data.actions[step], actions[i])
            driver, did = (", ".join(f"{value:.2f}" for value in action) for action in both)
        source = ""
        if pictures is not None:
            source = png_uri(pictures[i].repeat(_MAGNIFICATION, 0).repeat(_MAGNIFICATION, 1))
        # Show only the last folder, which identifies the recording.
        caption = f"{data.files[step].split('/')[-1]}: the driver did {driver}, the policy {did}"
        frames.append({"source": source, "caption": caption})
    return frames


# Collisions per 100 m in unseen corridors, of clones of a car's simulated expert, by minutes of
# demonstrations: the mean of all clones. Measured over 9 km each by `python -m benchmarks.run
# corrections`.
EXPERT: Final = {2: 3.52, 4: 1.06, 10: 0.84}
# Collisions per 100 m if half of the minutes were corrections of a clone's driving.
CORRECTED: Final = {4: 0.91, 20: 0.38}
_MINUTE_S: Final = 60.0


def outlook(card: PolicyCard) -> str:
    """Return sentences on the collisions to expect of a cloned driver, and on the next step.

    Return "" if the policy does not steer by images, or its card has no `learned_s`. The rates were
    measured with a car in corridors.
    """
    learned_s = card.data.get("learned_s", 0.0)
    names = () if card.action is None else card.action.names
    steers = "steering" in names or {"left", "right"} <= set(names)
    known = isinstance(learned_s, int | float) and math.isfinite(learned_s) and learned_s > 0.0
    if not (steers and known) or card.clone is None or card.clone.eyes == "none":
        return ""
    driven = ", ".join(f"{rate:.1f} after {n}" for n, rate in EXPERT.items())
    corrected = ", ".join(f"{rate:.1f} after {n}" for n, rate in CORRECTED.items())
    return (
        f"It learned from {learned_s / _MINUTE_S:.1f} minutes of driving. In corridors where they "
        "had not driven, clones of a car's simulated expert had these collisions per 100 m after "
        f"so many minutes: {driven} (docs/cloning.md); clones of a person who drives by keys "
        "collide more often. Next: record more, or let it drive and correct it (`demos record ENV "
        "--driver POLICY --corrected-by expert`, or take over at the console of a robot), merge, "
        f"and train again: {corrected} minutes, half of which were corrections."
    )


def calibration_chart(bins: tuple[Bin, ...]) -> str:
    """Plot accuracy against confidence; labels are the numbers of steps."""

    def draw(_: Figure, axes: Axes) -> None:
        axes.plot([0, 1], [0, 1], **_DIAGONAL)
        confidences, accuracies = [b.confidence for b in bins], [b.accuracy for b in bins]
        axes.plot(confidences, accuracies, color=BLUE, marker="o", linewidth=1.5)
        for one in bins:
            at = (one.confidence, one.accuracy)
            axes.annotate(str(one.steps), at, (4, -12), textcoords="offset points")
        axes.set(xlim=(0, 1), ylim=(0, 1.05), xlabel="confidence", ylabel="accuracy")

    return svg_chart(SQUARE, draw)


def scatter_chart(evaluation: EvaluationResult, place: int) -> str:
    """Plot one number of the actions: the policy's against the driver's."""

    def draw(_: Figure, axes: Axes) -> None:
        target, predicted = np.array([evaluation.target, evaluation.predicted])[:, :, place]
        ends = [min(*target, *predicted), max(*target, *predicted)]
        axes.plot(ends, ends, **_DIAGONAL)
        axes.scatter(target, predicted, s=9, alpha=0.35, color=BLUE, linewidths=0, rasterized=True)
        axes.set(xlabel="driver", ylabel="policy")

    return svg_chart(SQUARE, draw)


def training_chart(training: Training) -> str:
    """Plot each network's training loss (dashed), held-out loss (solid) and kept step (dot)."""

    def draw(_: Figure, axes: Axes) -> None:
        for member, best in enumerate(training.best_steps):
            colour = _MEMBER_COLOURS[member % len(_MEMBER_COLOURS)]
            own = {check.step: check for check in training.checks if check.member == member}
            losses, errors = [c.loss for c in own.values()], [c.error for c in own.values()]
            axes.plot([*own], losses, color=colour, linestyle="--", linewidth=0.9)
            axes.plot([*own], errors, color=colour, linewidth=1.6)
            axes.plot([best], [own[best].error], color=colour, marker="o")
        axes.set(xlabel="steps of training", ylabel="loss")

    return svg_chart(WIDE, draw)
