"""The report of a cloned policy: one HTML file, and its numbers as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from shapechanger.demos.cloning.judge import Judgement, named
from shapechanger.demos.cloning.learn import Training
from shapechanger.demos.cloning.outlook import outlook
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.files import write_json
from shapechanger.reports.page import png_uri, render, svg_uri

if TYPE_CHECKING:
    from shapechanger.demos.dataset import Dataset

_MAX_SCATTERS: Final = 4
_MAGNIFICATION: Final = 3


def write_numbers(
    path: Path, policy: CameraPolicy, judgement: Judgement, training: Training | None
) -> None:
    """Write the report's numbers as JSON.

    Args:
        path: The file.
        policy: The policy.
        judgement: Its evaluation.
        training: How it was trained; None if unknown.

    Raises:
        OutputError: If it cannot be written.
    """
    write_json(
        path,
        {
            "judgement": judgement,
            "training": training,
            "policy": policy.card,
            "outlook": outlook(policy.card),
        },
    )


def clone_html(
    name: str,
    policy: CameraPolicy,
    data: Dataset,
    judgement: Judgement,
    training: Training | None,
    data_note: str,
) -> str:
    """Render the report.

    Args:
        name: Name of the policy.
        policy: The policy.
        data: The steps that it was evaluated on, which `judgement.worst` indexes.
        judgement: Its evaluation.
        training: How it was trained; None if unknown.
        data_note: A sentence on the steps that it was evaluated on.

    Raises:
        MissingExtra: If matplotlib or Jinja2 is not installed.
    """
    from shapechanger.reports.clone_charts import calibration_chart, scatter_chart, training_chart

    card = policy.card
    by_class = judgement.head == "class"
    return render(
        "clone.html",
        title=name,
        verdict=_verdict(judgement, data_note),
        cards=_cards(judgement),
        outlook=outlook(policy.card),
        judgement=judgement,
        errors=[
            (number, f"{error:.4g}")
            for number, error in zip(judgement.numbers, judgement.errors, strict=False)
        ],
        calibration=svg_uri(calibration_chart(judgement.calibration)) if by_class else "",
        calibration_error=f"{judgement.ece or 0.0:.3f}",
        scatters=[
            (number, svg_uri(scatter_chart(judgement, place)))
            for place, number in enumerate(judgement.numbers[:_MAX_SCATTERS])
            if not by_class
        ],
        frames=_worst(policy, data, judgement),
        training=training,
        training_chart="" if training is None else svg_uri(training_chart(training)),
        card=card,
        observes=_observes(policy),
        outputs=", ".join(
            card.class_names or (card.action_layout.names if card.action_layout else ())
        ),
        weights=sum(p.numel() for p in policy.network.parameters()),
    )


def _verdict(judgement: Judgement, data_note: str) -> str:
    return (
        f"The policy chose the driver's action on {judgement.accuracy:.1%} of the steps; always "
        f"choosing the driver's most frequent action is right on {judgement.always:.1%}. "
        f"{data_note}"
    )


def _cards(judgement: Judgement) -> list[tuple[str, str]]:
    shown = [("Accuracy", f"{judgement.accuracy:.3f}"), ("Macro-F1", f"{judgement.macro_f1:.3f}")]
    if judgement.ece is not None:
        shown.append(("Calibration error", f"{judgement.ece:.3f}"))
    else:
        shown.append((f"Within {judgement.tolerance:g}", f"{judgement.within:.3f}"))
    return [*shown, ("Most frequent action", f"{judgement.always:.3f}")]


def _worst(policy: CameraPolicy, data: Dataset, judgement: Judgement) -> list[dict[str, Any]]:
    """The steps with the largest errors: what the driver did, and what the policy did."""
    chosen = list(judgement.worst)
    pictures = None if data.pictures is None else data.pictures[chosen]
    states = None if data.states is None else data.states[chosen]
    outputs = policy.outputs(pictures, states)
    actions = policy.predict_many(pictures, states)
    frames: list[dict[str, Any]] = []
    for i, step in enumerate(chosen):
        if policy.card.classes:
            driver = named(data.actions[step], data.action_layout)
            did = f"{policy.card.class_names[int(outputs[i].argmax())]} ({outputs[i].max():.0%})"
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


def _observes(policy: CameraPolicy) -> str:
    card = policy.card
    parts: list[str] = []
    if card.eyes != "none":
        parts.append(f"pictures of {card.framing.width} x {card.framing.height}, by {card.eyes}")
    if card.state_layout is not None:
        parts.append(", ".join(n for n in card.state_layout.names if n not in card.unseen))
    return "; ".join(parts)
