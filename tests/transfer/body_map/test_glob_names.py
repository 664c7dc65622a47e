"""Feature names with the characters of globs."""

from __future__ import annotations

from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap, Copy, Hold, Zero


def _layout(*names: str) -> Layout:
    return Layout(tuple(Feature(name, "1", -1.0, 1.0) for name in names))


MOTOR = _layout("motor")


def test_an_exact_name_is_not_a_glob() -> None:
    """`leg[12]` names one feature; `leg1` and `leg2` get the default rule."""
    source = _layout("leg[12]", "leg1", "leg2", "tail*", "tail_2", "same")
    built = BodyMap.between(
        source,
        _layout("same"),
        MOTOR,
        MOTOR,
        rules={"leg[12]": Hold(0.5), "tail*": Hold(0.25)},
    )
    assert [entry.rule for entry in built.observation] == [
        Hold(0.5),
        Zero(),
        Zero(),
        Hold(0.25),
        Zero(),
        Copy("same"),
    ]


def test_an_exact_copied_name_is_not_a_template() -> None:
    """A target feature named `eye*` is copied literally."""
    built = BodyMap.between(
        _layout("left/eye", "same"),
        _layout("eye*", "same"),
        MOTOR,
        MOTOR,
        rules={"left/*": "copy eye*"},
    )
    assert built.observation[0].rule == Copy("eye*")


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


def test_brackets_without_characters_are_no_wildcard() -> None:
    """As in `fnmatch`: `[]` and `[!]` stand for themselves, `[]]` and `[!a]` for a character."""
    source = _layout("a[]_1", "b[!]_2", "c]_3", "d]_4", "same")
    built = BodyMap.between(
        source,
        _layout("x1", "x2", "y]3", "y]4", "same"),
        MOTOR,
        MOTOR,
        rules={
            "a[]_*": "copy x*",
            "b[!]_*": "copy x*",
            "c[]]_*": "copy y**",
            "d[!a]_*": "copy y**",
        },
    )
    assert [entry.rule for entry in built.observation[:-1]] == [
        Copy("x1"),
        Copy("x2"),
        Copy("y]3"),
        Copy("y]4"),
    ]
