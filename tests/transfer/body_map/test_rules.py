"""The four rules, their text and their arithmetic."""

from __future__ import annotations

import math

import pytest

from shapechanger.errors import MapError
from shapechanger.transfer.body_map.rules import (
    Copy,
    Hold,
    expand_template,
)


@pytest.mark.parametrize("scale", [0.0, math.nan, math.inf])
def test_an_invalid_scale_is_refused(scale: float) -> None:
    with pytest.raises(MapError, match="'hip/angle' must be finite and not zero"):
        Copy("hip/angle", scale)


def test_a_non_finite_constant_is_refused() -> None:
    with pytest.raises(MapError, match="must be finite, got nan"):
        Hold(math.nan)


@pytest.mark.parametrize(
    ("template", "pattern", "name", "result"),
    [
        ("ankle_1/motor", "foot_*/motor", "foot_2/motor", "ankle_1/motor"),
        ("ankle_*/motor", "foot_*/motor", "foot_2/motor", "ankle_2/motor"),
        ("ankle_*/motor", "foot_?/motor", "foot_2/motor", "ankle_2/motor"),
        ("ankle_*/motor", "foot_[12]/motor", "foot_2/motor", "ankle_2/motor"),
        ("ankle_*/motor", "foot_[!34]/motor", "foot_2/motor", "ankle_2/motor"),
        ("*/a_*", "*_*", "b.c_d", "b.c/a_d"),
    ],
)
def test_stars_take_the_matched_text(template: str, pattern: str, name: str, result: str) -> None:
    assert expand_template(template, pattern, name) == result


@pytest.mark.parametrize("pattern", ["foot_2/motor", "*_*/motor"])
def test_the_number_of_stars_must_match(pattern: str) -> None:
    """A template with more or fewer stars than wildcards is refused."""
    with pytest.raises(MapError, match="must have a star for each wildcard"):
        expand_template("ankle_*/motor", pattern, "foot_2/motor")
