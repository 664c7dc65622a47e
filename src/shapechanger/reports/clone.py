"""The report of a cloned policy: one page that needs no other file, and the numbers as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from shapechanger.demos.cloning.judge import Judgement
from shapechanger.demos.cloning.learn import Training
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.reports.charts import calibration, learning, points
from shapechanger.reports.page import (
    Html,
    element,
    joined,
    page_text,
    pairs,
    paragraph,
    png_uri,
    pre,
    svg_uri,
    table,
    text,
)
from shapechanger.transfer.files import write_atomic, write_json

if TYPE_CHECKING:
    from shapechanger.demos.dataset import Dataset

__all__ = ["write_clone_report", "write_numbers"]

_STYLE: Final = """
.frames { display: grid; grid-template-columns: repeat(auto-fit, minmax(11rem, 1fr)); gap: 1rem; }
.frames img { image-rendering: auto; background: #eee; }
.half { max-width: 34rem; }
.right { background: #e3f1ea; }
"""
_TWO_DIMENSIONS: Final = 4


def write_numbers(
    path: Path, policy: CameraPolicy, judgement: Judgement, training: Training | None
) -> None:
    """Write what the report says as JSON.

    Raises:
        OutputError: If it cannot be written.
    """
    write_json(
        path,
        {
            "judgement": judgement,
            "training": None
            if training is None
            else {
                "checks": training.checks,
                "best_steps": training.steps,
                "learned": training.learned,
                "mirrored": training.mirrored,
                "mirror_note": training.mirror_note,
                "seconds": training.seconds,
            },
            "policy": policy.card,
        },
    )


def write_clone_report(
    path: Path,
    name: str,
    policy: CameraPolicy,
    data: Dataset,
    judgement: Judgement,
    training: Training | None,
    told: str,
) -> None:
    """Write the page.

    Args:
        path: The file.
        name: What the policy is called.
        policy: The policy.
        data: What it was judged on, with the steps that `judgement.worst` counts.
        judgement: How good it was.
        training: How it was trained; None where that is not known.
        told: What it was judged on, in a sentence.

    Raises:
        MissingExtra: If matplotlib is not installed.
        OutputError: If it cannot be written.
    """
    sections = [
        ("confusion", "What the driver did, and what the policy did", _confusion(judgement)),
        ("calibration", *_calibration(judgement)),
        ("worst", "Where it was most wrong", _worst(policy, data, judgement)),
    ]
    if training is not None:
        sections.append(("learning", "Learning curve", _learning(training)))
    sections.append(("policy", "The policy", _policy(policy, training)))
    body = joined(
        (
            element(
                "header",
                paragraph("Cloned policy", class_="kind"),
                element("h1", text(name)),
                paragraph(_verdict(judgement, told), class_="verdict"),
                element("div", *_cards(judgement), class_="cards"),
            ),
            element(
                "main",
                *(
                    element("section", element("h2", text(heading)), content, id=place)
                    for place, heading, content in sections
                ),
            ),
        )
    )
    page = page_text(name, body, _STYLE)
    write_atomic(path, page.encode())


def _verdict(judgement: Judgement, told: str) -> str:
    better = judgement.accuracy - judgement.always
    than = (
        f"{abs(better):.1%} of the steps {'more' if better > 0 else 'less'} than always doing what "
        "the driver did most"
        if better
        else "exactly as often as always doing what the driver did most"
    )
    return f"It did what the driver did on {judgement.accuracy:.1%} of the steps, {than}. {told}"


def _cards(judgement: Judgement) -> list[Html]:
    shown = [("Accuracy", f"{judgement.accuracy:.3f}"), ("Macro-F1", f"{judgement.macro_f1:.3f}")]
    if judgement.ece is not None:
        shown.append(("Calibration error", f"{judgement.ece:.3f}"))
    else:
        shown.append((f"Within {judgement.tolerance:g}", f"{judgement.within:.3f}"))
    shown.append(("Always the same", f"{judgement.always:.3f}"))
    return [
        element(
            "div",
            paragraph(label, class_="label"),
            paragraph(value, class_="value"),
            class_="card",
        )
        for label, value in shown
    ]


def _confusion(judgement: Judgement) -> Html:
    rows = [
        [
            text(name),
            *(_count(value, i == j) for j, value in enumerate(row)),
            text(str(sum(row))),
        ]
        for i, (name, row) in enumerate(zip(judgement.classes, judgement.confusion, strict=True))
    ]
    header = ["driver", *(f"policy: {name}" for name in judgement.classes), "steps"]
    counted = table("Steps by what the driver did and what the policy did", header, rows)
    if judgement.head == "class":
        return counted
    errors = [
        [text(name), text(f"{error:.4g}")]
        for name, error in zip(judgement.numbers, judgement.errors, strict=False)
    ]
    note = paragraph(
        "Each number is in the lower, the middle or the upper third of its range: that is what "
        "accuracy, macro-F1 and this table are about.",
        class_="note",
    )
    return joined((counted, note, table("Mean absolute errors", ["number", "error"], errors)))


def _count(value: int, right: bool) -> Html:
    return element("span", text(str(value)), class_="right" if right and value else "number")


def _calibration(judgement: Judgement) -> tuple[str, Html]:
    """The heading and what is below it."""
    if judgement.head == "class":
        picture = svg_uri(calibration(judgement.calibration))
        caption = "How often it was right, by how sure it was; the numbers count steps"
        note = (
            f"On the line it is as sure as it is right. The mean distance from it is "
            f"{judgement.ece or 0.0:.3f}."
        )
        drawn = element("div", _figure(picture, caption), class_="pair half")
        return "Is it as sure as it is right?", joined((drawn, paragraph(note, class_="note")))
    drawn = [
        _figure(
            svg_uri(points(judgement, place)), f"{name}: done over wanted", f"{name}: each step"
        )
        for place, name in enumerate(judgement.numbers[:_TWO_DIMENSIONS])
    ]
    return "What it does, over what the driver did", element("div", *drawn, class_="pair")


def _worst(policy: CameraPolicy, data: Dataset, judgement: Judgement) -> Html:
    chosen = list(judgement.worst)
    pictures = None if data.pictures is None else data.pictures[chosen]
    states = None if data.states is None else data.states[chosen]
    out = policy.outputs(pictures, states)
    done = policy.predict_many(pictures, states)
    shown: list[Html] = []
    for i, step in enumerate(chosen):
        if policy.card.classes:
            did = f"{policy.card.class_names[int(out[i].argmax())]} ({out[i].max():.0%} sure)"
        else:
            did = ", ".join(f"{value:.2f}" for value in done[i])
        # The last folder says which recording it is; a whole path would hide the rest.
        place = data.files[step].split("/")[-1]
        told = f"{place}: the driver did {_did(policy, data, step)}, the policy {did}"
        if pictures is None:
            shown.append(element("figure", element("figcaption", text(told))))
        else:
            shown.append(_figure(png_uri(pictures[i].repeat(3, axis=0).repeat(3, axis=1)), told))
    note = "As the policy sees them." if pictures is not None else "It sees no pictures."
    return joined((paragraph(note, class_="note"), element("div", *shown, class_="frames")))


def _did(policy: CameraPolicy, data: Dataset, step: int) -> str:
    from shapechanger.demos.cloning.judge import named

    if policy.card.classes:
        return named(data.actions[step], data.action_layout)
    return ", ".join(f"{value:.2f}" for value in data.actions[step])


def _learning(training: Training) -> Html:
    caption = (
        "Loss on what is learned from (with augmentation, dashed), and on the stretch of time that "
        "each network does not learn from and stops by (solid); a dot is what was kept"
    )
    return _figure(svg_uri(learning(training)), caption, caption)


def _policy(policy: CameraPolicy, training: Training | None) -> Html:
    card = policy.card
    actions = card.action_layout
    items = [
        ("Perceives", text(_perceives(policy))),
        ("Decides", text(", ".join(card.class_names or (actions.names if actions else ())))),
        ("Networks", text(f"{card.members}, whose outputs are averaged")),
        ("Weights", text(f"{sum(p.numel() for p in policy.network.parameters()):,}")),
    ]
    if training is not None:
        items += [
            ("Learned from", text(f"{training.learned} steps in {training.seconds:.0f} s")),
            ("Mirror", text(training.mirror_note)),
        ]
    items += [("Seed", text(", ".join(map(str, card.seeds)))), ("Command", pre(card.command))]
    return pairs([*items, ("Version", text(f"Shapechanger {card.version}"))])


def _perceives(policy: CameraPolicy) -> str:
    card = policy.card
    parts: list[str] = []
    if card.eyes != "none":
        parts.append(f"pictures of {card.framing.width} x {card.framing.height}, by {card.eyes}")
    if card.state_layout is not None:
        parts.append(", ".join(n for n in card.state_layout.names if n not in card.unseen))
    return "; ".join(parts)


def _figure(source: str, caption: str, alternative: str = "") -> Html:
    image = Html(f'<img src="{text(source)}" alt="{text(alternative or caption)}">')
    return element("figure", image, element("figcaption", text(caption)))
