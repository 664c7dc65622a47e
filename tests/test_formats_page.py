"""docs/formats.md names every field of the formats; its examples run in test_docs.py."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any, Final

import pytest

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.episodes.records import StepPicture
from shapechanger.layout import Feature, Layout
from shapechanger.policy import PolicyCard
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.plan import Plan
from shapechanger.transfer.runs import RunResult
from shapechanger.transfer.study import Study

PAGE: Final = (Path(__file__).parents[1] / "docs" / "formats.md").read_text()


def section(title: str) -> set[str]:
    """Return the words in inline code of a section."""
    text = PAGE.partition(f"\n## {title}\n")[2].partition("\n## ")[0]
    return set(re.findall(r"`(\w+)`", re.sub(r"```.*?```", "", text, flags=re.DOTALL)))


@pytest.mark.parametrize(
    ("title", "kind"),
    [
        ("Layouts", Feature),
        ("Demonstrations", EpisodeHeader),
        ("Policies", PolicyCard),
        ("Studies", Evaluation),
        ("Studies", RunResult),
        ("Studies", Plan),
        ("Studies", Study),
    ],
)
def test_the_page_names_every_field(title: str, kind: Any) -> None:
    """A section has each field of the object that is written."""
    struct = getattr(kind, "__struct_fields__", None)
    fields = set(struct or [field.name for field in dataclasses.fields(kind)])
    assert fields <= section(title)


def test_the_page_names_every_key_of_a_step() -> None:
    """The table of steps has each key that a step can have, and no other."""
    numbers = (0.5,)
    step = Step(
        action=numbers,
        driver="policy",
        applied=numbers,
        wanted=numbers,
        state=numbers,
        captured_ns=1,
        decided_ns=2,
        wall_ns=3,
        reward=1.0,
        terms={"one": 1.0},
        terminated=True,
        truncated=True,
        stop_reason="It is late.",
        index=0,
        picture=StepPicture("000000.jpg", 1, "00000000"),
    )
    table = PAGE.partition("| key of a step | meaning |\n|---|---|\n")[2].partition("\n\n")[0]
    first = [row.split("|")[1] for row in table.splitlines()]
    assert set(re.findall(r"`(\w+)`", " ".join(first))) == set(step.to_json()) - {"kind"}


def test_layouts_are_written_as_the_page_says() -> None:
    """Infinite bounds are left out, and other defaults as well."""
    text = Layout((Feature("hip/angle", "rad", low=-1.0),)).to_json()
    assert text == '{"features":[{"name":"hip/angle","unit":"rad","low":-1.0}]}'
