"""Rules and their arithmetic, and names with the characters of globs."""

from __future__ import annotations

import math

import pytest

from shapechanger.errors import MapError
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap, Copy, Hold, Zero
from shapechanger.transfer.body_map.rules import expand_template


@pytest.mark.parametrize("scale", [0.0, math.nan, math.inf])
def test_an_invalid_scale_is_refused(scale: float) -> None:
    with pytest.raises(MapError, match="'hip/angle' must be finite and not zero"):
        Copy("hip/angle", scale)
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


def _layout(*names: str) -> Layout:
    return Layout(tuple(Feature(name, "1", -1.0, 1.0) for name in names))


MOTOR = _layout("motor")


@pytest.mark.parametrize(
    ("source", "target", "rules", "expected"),
    [
        # `leg[12]` names one feature; `leg1` and `leg2` get the default rule.
        (
            ("leg[12]", "leg1", "leg2", "tail*", "tail_2", "same"),
            ("same",),
            {"leg[12]": Hold(0.5), "tail*": Hold(0.25)},
            (Hold(0.5), Zero(), Zero(), Hold(0.25), Zero(), Copy("same")),
        ),
        # A target feature named `eye*` is copied literally.
        (
            ("left/eye", "same"),
            ("eye*", "same"),
            {"left/*": "copy eye*"},
            (Copy("eye*"), Copy("same")),
        ),
        # As in `fnmatch`: `[]` and `[!]` stand for themselves, `[]]` and `[!a]` for a character.
        (
            ("a[]_1", "b[!]_2", "c]_3", "d]_4", "same"),
            ("x1", "x2", "y]3", "y]4", "same"),
            {"a[]_*": "copy x*", "b[!]_*": "copy x*", "c[]]_*": "copy y**", "d[!a]_*": "copy y**"},
            (Copy("x1"), Copy("x2"), Copy("y]3"), Copy("y]4"), Copy("same")),
        ),
    ],
)
def test_an_exact_name_is_not_a_glob(
    source: tuple[str, ...], target: tuple[str, ...], rules: dict[str, object], expected: object
) -> None:
    built = BodyMap.between(_layout(*source), _layout(*target), MOTOR, MOTOR, rules=rules)
    assert tuple(entry.rule for entry in built.observation) == expected


def test_a_mirror_prefers_exact_names_to_globs() -> None:
    """`leg?` and `arm*` are elements; `legs` and `arms` stay in place."""
    layout = _layout("leg?/angle", "legs/angle", "arm*/angle", "arms/angle")
    found = BodyMap.mirror(layout, MOTOR, swap={"leg?": "arm*"}, flip=["leg?", "arm*"])
    assert [entry.rule for entry in found.observation] == [
        Copy("arm*/angle", -1.0),
        Copy("legs/angle"),
        Copy("leg?/angle", -1.0),
        Copy("arms/angle"),
    ]
