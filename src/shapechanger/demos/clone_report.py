"""The report of a cloned policy: one HTML file, and its numbers as JSON."""

# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from shapechanger.demos.cloning.evaluation import Bin, EvaluationResult, named
from shapechanger.files import write_atomic, write_json
from shapechanger.policy import PolicyCard
from shapechanger.reports.charts import BLUE, GREEN, GREY, ORANGE, PINK, SQUARE, WIDE, svg_chart
from shapechanger.reports.page import png_uri, render, svg_uri

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from shapechanger.demos.cloning.clone import Clone
    from shapechanger.demos.cloning.learn import Training
    from shapechanger.demos.dataset import Dataset

_MAX_SCATTERS: Final = 4
_MAGNIFICATION: Final = 3


def write_report(
    page: Path,
    name: str,
    policy: Clone,
    data: Dataset,
    evaluation: EvaluationResult,
    training: Training | None,
    data_note: str,
) -> Path:
    """Write the report, and its numbers as JSON next to it.

    Args:
        page: The file of the report.
        name: Name of the policy.
        policy: The policy.
        data: The steps that it was evaluated on, which `evaluation.worst` indexes.
        evaluation: Its evaluation.
        training: How it was trained; None if unknown.
        data_note: A sentence on the steps that it was evaluated on.

    Returns:
        The file of the numbers.

    Raises:
        MissingExtra: If matplotlib or Jinja2 is not installed.
        OutputError: If a file cannot be written.
    """
    card, net = policy.card, policy.net
    by_class = evaluation.head == "class"
    ahead = outlook(card)
    html = render(
        Path(__file__).with_name("clone.html"),
        title=name,
        verdict=(
            f"The policy chose the driver's action on {evaluation.accuracy:.1%} of the steps; "
            "always choosing the driver's most frequent action is right on "
            f"{evaluation.majority_baseline:.1%}. {data_note}"
        ),
        cards=_cards(evaluation),
        outlook=ahead,
        evaluation=evaluation,
        errors=[
            (number, f"{error:.4g}")
            for number, error in zip(evaluation.numbers, evaluation.errors, strict=False)
        ],
        calibration=svg_uri(calibration_chart(evaluation.calibration)) if by_class else "",
        calibration_error=f"{evaluation.ece or 0.0:.3f}",
        scatters=[
            (number, svg_uri(scatter_chart(evaluation, place)))
            for place, number in enumerate(evaluation.numbers[:_MAX_SCATTERS])
            if not by_class
        ],
        frames=_worst(policy, data, evaluation),
        training=training,
        training_chart="" if training is None else svg_uri(training_chart(training)),
        card=card,
        observes=_observes(policy),
        outputs=", ".join(net.class_names or (card.action.names if card.action else ())),
    )
    write_atomic(page, html.encode())
    numbers = page.with_suffix(".json")
    found = {"evaluation": evaluation, "training": training, "policy": card, "outlook": ahead}
    write_json(numbers, found)
    return numbers


def _cards(evaluation: EvaluationResult) -> list[tuple[str, str]]:
    shown = [("Accuracy", f"{evaluation.accuracy:.3f}"), ("Macro-F1", f"{evaluation.macro_f1:.3f}")]
    if evaluation.ece is not None:
        shown.append(("Calibration error", f"{evaluation.ece:.3f}"))
    else:
        shown.append((f"Within {evaluation.tolerance:g}", f"{evaluation.within:.3f}"))
    return [*shown, ("Most frequent action", f"{evaluation.majority_baseline:.3f}")]


def _worst(policy: Clone, data: Dataset, evaluation: EvaluationResult) -> list[dict[str, Any]]:
    """The steps with the largest errors: what the driver did, and what the policy did."""
    chosen = list(evaluation.worst)
    pictures = None if data.pictures is None else data.pictures[chosen]
    states = None if data.states is None else data.states[chosen]
    outputs = policy.outputs(pictures, states)
    actions = policy.predict_many(pictures, states)
    frames: list[dict[str, Any]] = []
    for i, step in enumerate(chosen):
        if policy.net.classes:
            driver = named(data.actions[step], data.action_layout)
            did = f"{policy.net.class_names[int(outputs[i].argmax())]} ({outputs[i].max():.0%})"
        else:
            driver = ", ".join(f"{value:.2f}" for value in data.actions[step])
            did = ", ".join(f"{value:.2f}" for value in actions[i])
        source = ""
        if pictures is not None:
            large = pictures[i].repeat(_MAGNIFICATION, axis=0).repeat(_MAGNIFICATION, axis=1)
            source = png_uri(large)
        # The last folder identifies the recording; a whole path would hide the rest.
        file = data.files[step].split("/")[-1]
        frames.append(
            {"source": source, "caption": f"{file}: the driver did {driver}, the policy {did}"}
        )
    return frames


def _observes(policy: Clone) -> str:
    net, layout = policy.net, policy.card.observation
    parts: list[str] = []
    if net.eyes != "none":
        parts.append(f"images of {net.framing.width} x {net.framing.height}, by {net.eyes}")
    if layout is not None:
        parts.append(", ".join(name for name in layout.names if name not in net.unseen))
    return "; ".join(parts)


# Collisions per 100 m in unseen corridors, of clones of a car's simulated expert, keyed by the
# minutes of demonstrations: mean of all clones, and the worst of three seeds, or None. Measured
# over 9 km each by `python -m benchmarks.run corrections`.
EXPERT: Final = {2: (3.52, 5.89), 4: (1.06, 1.63), 10: (0.84, None)}
# The same after half of the minutes were corrections of a clone's own driving.
CORRECTED: Final = {4: 0.91, 20: 0.38}
_MINUTE_S: Final = 60.0


def outlook(card: PolicyCard) -> str:
    """Return sentences on the collisions to expect of a cloned driver, and on the next step.

    Returns:
        "" if the policy does not steer by images, or its card has no `learned_s`. The rates were
        measured with a car in corridors; no other clones were measured in this way.
    """
    learned_s = card.data.get("learned_s", 0.0)
    names = () if card.action is None else card.action.names
    steers = "steering" in names or {"left", "right"} <= set(names)
    known = isinstance(learned_s, int | float) and math.isfinite(learned_s) and learned_s > 0.0
    if not (steers and known) or card.clone is None or card.clone.eyes == "none":
        return ""
    minutes = round(learned_s / _MINUTE_S, 1)
    rates = {
        length: f"{rate:.1f}" + (f" ({worst:.1f} for the worst of 3 seeds)" if worst else "")
        for length, (rate, worst) in EXPERT.items()
    }
    less = [length for length in EXPERT if length <= minutes]
    more = [length for length in EXPERT if length > minutes]
    if not less:
        expected = f"more than {rates[more[0]]} collisions"
    elif not more:
        expected = f"about {rates[less[-1]]} collisions or fewer"
    else:
        expected = f"{EXPERT[more[0]][0]:.1f} to {rates[less[-1]]} collisions"
    length = next((length for length in CORRECTED if length > minutes), max(CORRECTED))
    # The rate of the shortest length is too high to aim at.
    longer = next((length for length in more if length > min(EXPERT)), None)
    record = (
        ""
        if longer is None
        else (f"record more ({EXPERT[longer][0]:.1f} per 100 m after {longer} minutes), or ")
    )
    return (
        f"It learned from {minutes:.1f} minutes of driving, so expect {expected} per 100 m where "
        "it has not driven. These rates were measured with clones of a car's simulated expert in "
        "corridors (docs/cloning.md); clones of a person who drives by keys collide more often. "
        f"Next: {record}let it drive and correct it (`demos record ENV --driver POLICY "
        "--corrected-by expert`, or take over at the console of a robot), merge, and train again: "
        f"{CORRECTED[length]:.1f} per 100 m after {length // 2} minutes of driving and "
        f"{length // 2} of corrections."
    )


_MEMBER_COLOURS: Final = (BLUE, ORANGE, GREEN, PINK, GREY)


def calibration_chart(bins: tuple[Bin, ...]) -> str:
    """Plot accuracy over confidence; each point is labelled with its number of steps."""

    def draw(_: Figure, axes: Axes) -> None:
        axes.plot([0, 1], [0, 1], color="#777777", linestyle="--", linewidth=1.0)
        sure, right = [b.confidence for b in bins], [b.accuracy for b in bins]
        axes.plot(sure, right, color=BLUE, marker="o", linewidth=1.5)
        for one in bins:
            axes.annotate(
                str(one.steps), (one.confidence, one.accuracy), (4, -12), textcoords="offset points"
            )
        axes.set_xlim(0, 1)
        axes.set_ylim(0, 1.05)
        axes.set_xlabel("confidence")
        axes.set_ylabel("accuracy")

    return svg_chart(SQUARE, draw)


def scatter_chart(evaluation: EvaluationResult, place: int) -> str:
    """Plot one number of each action: the policy's over the driver's."""

    def draw(_: Figure, axes: Axes) -> None:
        wanted = [row[place] for row in evaluation.target]
        done = [row[place] for row in evaluation.predicted]
        low, high = min(*wanted, *done), max(*wanted, *done)
        axes.plot([low, high], [low, high], color="#777777", linestyle="--", linewidth=1.0)
        axes.scatter(wanted, done, s=9, alpha=0.35, color=BLUE, linewidths=0, rasterized=True)
        axes.set_xlabel("driver")
        axes.set_ylabel("policy")

    return svg_chart(SQUARE, draw)


def training_chart(training: Training) -> str:
    """Plot the training loss (dashed) and the held-out loss (solid) of each network."""

    def draw(_: Figure, axes: Axes) -> None:
        members = sorted({check.member for check in training.checks})
        for member in members:
            colour = _MEMBER_COLOURS[member % len(_MEMBER_COLOURS)]
            own = [check for check in training.checks if check.member == member]
            steps = [check.step for check in own]
            axes.plot(steps, [c.loss for c in own], color=colour, linestyle="--", linewidth=0.9)
            axes.plot(steps, [c.error for c in own], color=colour, linewidth=1.6)
            for check in own:
                if check.step == training.best_steps[member]:
                    axes.plot([check.step], [check.error], color=colour, marker="o")
        axes.set_xlabel("steps of training")
        axes.set_ylabel("loss")

    return svg_chart(WIDE, draw)
