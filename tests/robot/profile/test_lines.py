"""Line numbers of the keys of a TOML text."""

import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.profile.toml import Place, line_of

TEXT = '''\
# [not.a.table]
top = "]["  # Not = this.
a.b = """
x = 1 \\"""
y = 2"""
[t . "quoted name".'other']
list = [ # [
  { k = "}" },
  ']',
]
c = \'\'\'
[u]
\'\'\'
[[many]]
v = 1
[many.deep]
w = 1
[[many]]
[[many.inner]]
v = 2
'''


LINES: dict[Place, int] = {
    ("top",): 2,
    ("a", "b"): 3,
    ("t",): 6,
    ("t", "quoted name", "other"): 6,
    ("t", "quoted name", "other", "list"): 7,
    ("t", "quoted name", "other", "list", 0, "k"): 7,
    ("t", "quoted name", "other", "c"): 11,
    ("many",): 14,
    ("many", 0, "v"): 15,
    ("many", 0, "deep", "w"): 17,
    ("many", 1): 18,
    ("many", 1, "inner"): 19,
    ("many", 1, "inner", 0, "v"): 20,
    ("many", 1, "inner", 0, "missing", "more"): 19,
    ("missing",): 1,
}


@pytest.mark.parametrize(("place", "line"), LINES.items())
def test_multi_line_strings_arrays_and_comments_hide_no_statement(place: Place, line: int) -> None:
    """Statements that look like others in texts and comments keep their lines."""
    assert line_of(TEXT, place) == line


VALUES = st.sampled_from(
    ["1", '"a # b = c"', "'[x]'", "[1, [2], 3]", "{ p = 1, q = '}' }", '[\n"]",\n# ]\n1\n]', "1.5"]
)
NAMES = st.sampled_from(["a", "b", "c-d", '"e f"', "'g.h'"])


@given(
    tables=st.dictionaries(
        NAMES, st.dictionaries(NAMES, VALUES, max_size=4), min_size=1, max_size=4
    )
)
def test_every_key_is_found_on_its_line(tables: dict[str, dict[str, str]]) -> None:
    text = "".join(
        f"[{table}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()) + "\n"
        for table, keys in tables.items()
    )
    data: dict[str, Any] = tomllib.loads(text)
    lines = text.split("\n")
    places: list[Place] = [(table,) for table in data]
    places += [(table, key) for table, keys in data.items() for key in keys]
    for place in places:
        found = lines[line_of(text, place) - 1]
        assert found.lstrip("[\"'").startswith(str(place[-1]))
