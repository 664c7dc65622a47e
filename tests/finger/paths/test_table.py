"""Paths from CSV files, and the errors for invalid files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path as File

import numpy as np
import pytest

from shapechanger.errors import PathError
from shapechanger.finger.paths import from_csv

GOOD = "t,x,y,z\n0,0.05,0,0\n0.1,0.06,0,0\n0.2,0.07,0.01,0\n0.3,0.08,0.01,0\n"


@pytest.fixture
def write(tmp_path: File) -> Callable[[str], File]:
    """Return a function that writes a text to a CSV file."""

    def put(text: str) -> File:
        file = tmp_path / "path.csv"
        file.write_bytes(text.encode())
        return file

    return put


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        GOOD.replace("\n", "\r\n"),
        GOOD.replace("\n", "\n\n"),
        "\ufeff" + GOOD,
        GOOD.replace(",", " , "),
        "z,t,y,x\n0,0,0,.05\n0,.1,0,6e-2\n0,.2,.01,.07\n0,.3,.01,.08",
        '"t","x","y","z"\n7.5,0.05,0,0\n7.6,0.06,0,0\n7.7,0.07,0.01,0\n7.8,0.08,0.01,0\n',
    ],
    ids=["plain", "CRLF", "empty lines", "BOM", "spaces", "order", "offset and quotes"],
)
def test_formats_of_csv(write: Callable[[str], File], text: str) -> None:
    """Line ends, spaces, quotes, a BOM and the order of columns do not matter."""
    path = from_csv(str(write(text)))
    assert path.period_s is None
    assert path.duration_s == pytest.approx(0.3)
    np.testing.assert_allclose(
        path.at([0.0, 0.1, 0.2, 0.3]),
        [[0.05, 0, 0], [0.06, 0, 0], [0.07, 0.01, 0], [0.08, 0.01, 0]],
        atol=1e-12,
    )


def test_a_path_that_returns_to_its_start_is_closed(write: Callable[[str], File]) -> None:
    """Ends within 0.1 mm of each other close the path; both move to their mean."""
    rows = "t,x,y,z\n0,0.05,0,0\n0.1,0.06,0.01,0\n0.2,0.05,0.02,0\n0.3,{end},0,0\n"
    closed = from_csv(write(rows.format(end=0.05009)))
    assert closed.period_s == pytest.approx(0.3)
    np.testing.assert_allclose(closed.at([0.0, 0.3]), [[0.050045, 0, 0]] * 2, atol=1e-12)
    ending = from_csv(write(rows.format(end=0.05011)))
    assert ending.period_s is None
    np.testing.assert_allclose(ending.at(9.0), [0.05011, 0, 0], atol=1e-12)


def test_three_rows_are_enough(write: Callable[[str], File]) -> None:
    """Three rows suffice, with time steps of up to five times the median."""
    ending = from_csv(write("t,x,y,z\n0,0,0,0\n0.1,0.1,0,0\n0.2,0.2,0,0\n"))
    np.testing.assert_allclose(ending.at(0.15), [0.15, 0, 0], atol=1e-12)
    closed = from_csv(write("t,x,y,z\n0,0,0,0\n0.1,0.1,0,0\n0.6,0,0,0\n"))
    before, after = closed.at([0.6 - 1e-6, 0.6 + 1e-6])
    np.testing.assert_allclose(after - closed.at(0.0), closed.at(0.0) - before, atol=1e-9)


def lines(*rows: str) -> str:
    """Return a CSV text with the usual header."""
    return "\n".join(["t,x,y,z", *rows, ""])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "{file} is empty: the columns are t, x, y and z."),
        ("\n\n", "{file} is empty: the columns are t, x, y and z."),
        (
            "t,x,y\n0,0,0\n",
            "{file}, line 1 names the columns t, x, y: the columns are t, x, y and z.",
        ),
        (
            "0,0,0,0\n1,0,0,0\n",
            "{file}, line 1 names the columns 0, 0, 0, 0: the columns are t, x, y and z.",
        ),
        (
            "t,x,y,z,grip\n",
            "{file}, line 1 names the columns t, x, y, z, grip: the columns are t, x, y and z.",
        ),
        (
            "t,x,x,y,z\n",
            "{file}, line 1 names the columns t, x, x, y, z: the columns are t, x, y and z.",
        ),
        ("t,x,y,z\n", "{file} has too few rows: 0, and a path needs 3."),
        (lines("0,0,0,0", "1,0,0,0"), "{file} has too few rows: 2, and a path needs 3."),
        (
            lines("0,0,0,0", "", "1,0,0"),
            "{file}, line 4 has 3 cells, and there are four columns.",
        ),
        (lines("0,0,zero,0"), "{file}, line 2: y is 'zero', which is not a finite number."),
        (lines("0,0,0,0", "1,,0,0"), "{file}, line 3: x is '', which is not a finite number."),
        (
            lines("0,0,0,0", "1,0,0,nan"),
            "{file}, line 3: z is 'nan', which is not a finite number.",
        ),
        (
            lines("0,0,0,0", "-inf,0,0,0"),
            "{file}, line 3: t is '-inf', which is not a finite number.",
        ),
        (
            lines("0,0,0,0", "0.2,0,0,0", "0.1,0,0,0"),
            "{file}, line 4: time runs backwards, from 0.2 s to 0.1 s.",
        ),
        (
            lines("5,0,0,0", "5.2,0,0,0", "", "5.2,0,0,0"),
            "{file}, line 5: time stands still, from 5.2 s to 5.2 s.",
        ),
        (
            lines("0,0,0,0", "0.1,0,0,0", "0.2,0,0,0", "0.8,0,0,0"),
            "{file}, line 5: the time step of 0.6 s is a gap: the median is 0.1 s, "
            "and 5 times as much is allowed.",
        ),
        (
            lines("0,0,0,0", "0.1,0,0,0", "0.2,0.3,0,0"),
            "{file}, line 4: the point moves 0.3 m in 0.1 s, and no fingertip is faster than "
            "2 m/s; t must be in s, and x, y, z in m.",
        ),
        (
            lines("0,0,-1e308,0", "0.1,0,1e308,0", "0.2,0,0,0"),
            "{file}, line 3: the point moves inf m in 0.1 s, and no fingertip is faster than "
            "2 m/s; t must be in s, and x, y, z in m.",
        ),
        (
            lines('0,0,0,"0'),
            "{file}, line 2, is not valid CSV: unexpected end of data.",
        ),
    ],
)
def test_invalid_files_are_refused(write: Callable[[str], File], text: str, message: str) -> None:
    """The error names the file and the line."""
    file = write(text)
    with pytest.raises(PathError) as caught:
        from_csv(file)
    assert str(caught.value) == message.format(file=file)


def test_unreadable_files_are_refused(tmp_path: File) -> None:
    """A missing file, a folder and binary data raise an error that names the file."""
    missing, noise = tmp_path / "none.csv", tmp_path / "noise.csv"
    noise.write_bytes(b"t,x,y,z\n\xff\xfe\n")
    with pytest.raises(PathError) as caught:
        from_csv(missing)
    assert str(caught.value) == f"{missing} cannot be read: No such file or directory."
    with pytest.raises(PathError) as caught:
        from_csv(noise)
    assert str(caught.value) == f"{noise} is not UTF-8 text: invalid start byte."
    with pytest.raises(PathError, match="cannot be read: "):
        from_csv(tmp_path)
