"""Paths as users give them: names, settings, files, functions and paths."""

from __future__ import annotations

import inspect
import math
from pathlib import Path as File
from typing import Any

import numpy as np
import pytest

from shapechanger.errors import PathError, UnknownName
from shapechanger.finger.paths import KINDS, as_path, circle, curve_3d, figure_eight, line


def test_every_shape_has_a_name() -> None:
    """A name gives the shape with default settings."""
    shapes = [circle(), figure_eight(), line(), curve_3d()]
    assert [as_path(name) for name in KINDS] == shapes
    assert KINDS == ("circle", "figure-eight", "line", "curve")


@pytest.mark.parametrize(
    ("settings", "path"),
    [
        ({"kind": "circle", "radius": 0.01, "hz": 1.0}, circle(0.01, hz=1.0)),
        ({"kind": "line", "start": [0, 0, 0], "end": [0.1, 0, 0]}, line((0, 0, 0), (0.1, 0, 0))),
        ({"kind": "curve"}, curve_3d()),
    ],
)
def test_settings_are_arguments(settings: dict[str, Any], path: object) -> None:
    """A mapping gives the arguments, as JSON types, and is not modified."""
    before = dict(settings)
    assert as_path(settings) == path
    assert settings == before


@pytest.mark.parametrize("kind", KINDS)
def test_every_argument_is_a_setting(kind: str) -> None:
    """Giving all defaults explicitly changes nothing."""
    function = {"circle": circle, "figure-eight": figure_eight, "line": line, "curve": curve_3d}
    defaults = {n: p.default for n, p in inspect.signature(function[kind]).parameters.items()}
    assert as_path({"kind": kind, **defaults}) == as_path(kind)


def test_a_path_is_returned_unchanged() -> None:
    path = circle()
    assert as_path(path) is path


def test_a_file_is_read(tmp_path: File) -> None:
    """File names are accepted as str or Path, with `.csv` in any case."""
    for name in ("a.csv", "b.CSV"):
        file = tmp_path / name
        file.write_text("t,x,y,z\n0,0,0,0\n0.1,0.01,0,0\n0.2,0.02,0,0\n")
        for given in (file, str(file)):
            np.testing.assert_allclose(as_path(given).at(0.1), [0.01, 0, 0])


def test_a_function_has_no_end() -> None:
    """A function is a path of infinite duration."""
    path = as_path(lambda t: (0.01 * math.sin(t), 0.0, 0.0))
    assert path.duration_s == math.inf
    np.testing.assert_array_equal(path.at(100.0), [0.01 * math.sin(100.0), 0.0, 0.0])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            "figure_eight",
            "No path matches 'figure_eight'. Did you mean 'figure-eight'? There are: circle, "
            "figure-eight, line, curve.",
        ),
        (
            {"kind": "cirle"},
            "No path matches 'cirle'. Did you mean 'circle'? There are: circle, figure-eight, "
            "line, curve.",
        ),
        (
            {"kind": "circle", "raduis": 0.01},
            "No setting of 'circle' matches 'raduis'. Did you mean 'radius'? There are: radius, "
            "centre, hz, normal, phase.",
        ),
        (
            {"kind": "line", 3: 0.01},
            "No setting of 'line' matches '3'. There are: start, end, hz.",
        ),
    ],
)
def test_unknown_names_are_refused(given: Any, message: str) -> None:
    """Errors suggest the nearest shape or setting."""
    with pytest.raises(UnknownName) as caught:
        as_path(given)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"radius": 0.01},
            'A path with settings needs the key "kind", one of circle, figure-eight, line, curve, '
            "got {'radius': 0.01}.",
        ),
        (
            {"kind": "circle", "radius": "wide"},
            "The radius of a circle must be a finite number above 0, got 'wide'.",
        ),
        (File("path.txt"), "A path file must end in .csv, got 'path.txt'."),
        (
            3,
            "A path must be one of circle, figure-eight, line, curve, such a name with settings, a "
            ".csv file or a function of time, got 3.",
        ),
    ],
)
def test_other_objects_are_refused(given: Any, message: str) -> None:
    """The error lists what is accepted."""
    with pytest.raises(PathError) as caught:
        as_path(given)
    assert str(caught.value) == message
