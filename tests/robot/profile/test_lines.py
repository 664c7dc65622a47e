"""Line numbers of the keys of a TOML text."""

from __future__ import annotations

import tomllib
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from shapechanger.robot.profile.mistakes import Place, lines_of

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
[t]
'''


def test_lines_of_every_kind_of_statement() -> None:
    """Multi-line strings, arrays and comments neither hide statements nor add any."""
    assert lines_of(TEXT) == {
        ("top",): 2,
        ("a",): 3,
        ("a", "b"): 3,
        ("t",): 6,
        ("t", "quoted name"): 6,
        ("t", "quoted name", "other"): 6,
        ("t", "quoted name", "other", "list"): 7,
        ("t", "quoted name", "other", "c"): 11,
        ("many",): 14,
        ("many", 0): 14,
        ("many", 0, "v"): 15,
        ("many", 0, "deep"): 16,
        ("many", 0, "deep", "w"): 17,
        ("many", 1): 18,
        ("many", 1, "inner"): 19,
        ("many", 1, "inner", 0): 19,
        ("many", 1, "inner", 0, "v"): 20,
    }


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
    """Each key is reported on the line it stands on, and no other keys are reported."""
    text = "".join(
        f"[{table}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()) + "\n"
        for table, keys in tables.items()
    )
    data: dict[str, Any] = tomllib.loads(text)
    lines = text.split("\n")
    found = lines_of(text)
    expected: set[Place] = {(table,) for table in data}
    expected |= {(table, key) for table, keys in data.items() for key in keys}
    assert set(found) == expected
    for place, line in found.items():
        assert lines[line - 1].lstrip("[\"'").startswith(str(place[-1]))


@given(st.text(alphabet="[]{}\"'#=.\\\n a1", max_size=60))
def test_the_scanner_ends_for_any_text(text: str) -> None:
    """The scanner does not hang on invalid TOML."""
    lines_of(text)
