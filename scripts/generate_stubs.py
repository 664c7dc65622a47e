"""Generate type stubs in typings/mujoco, because MuJoCo's bindings ship none.

`make check` runs this after each installation. pybind11-stubgen reads the signatures of compiled
modules, and `_CORRECTIONS` add types that it cannot infer; stubs of MuJoCo's Python modules are
written by hand. Results that are rarely None, such as the parent of the world, have the type
`X | Any`, so that both `body.parent.name` and `body.parent is None` pass.
"""

import re
import subprocess
import sys
from pathlib import Path
from typing import Final

import mujoco

_TYPINGS: Final = Path(__file__).resolve().parents[1] / "typings"
_PARTS: Final = ("callbacks", "constants", "enums", "functions", "render", "specs", "structs")
_NUMBER: Final = r"typing\.Supports(?:Int|Float) \| typing\.SupportsIndex"
_ELEMENTS: Final = {
    name.removeprefix("Mjs").lower(): name for name in dir(mujoco) if name.startswith("Mjs")
}

_CORRECTIONS: Final = (
    # An attribute `global` is a syntax error in Python; the bindings also have `global_`.
    (r"^    global: .*\n", ""),
    (
        r"^import typing$",
        "import builtins\nimport mujoco._specs\nimport numpy.typing\nimport typing",
    ),
    # Array arguments accept lists, except those that the bindings write into.
    (r'typing\.Annotated\[([^"\n]*), "\[[^"]*\]", "flags\.writeable"[^]\n]*\]', r"\1"),
    (r'(: )typing\.Annotated\[numpy\.typing\.[^"\n]*, "\[[^"]*\]"\]', r"\1numpy.typing.ArrayLike"),
    (r'typing\.Annotated\[([^"\n]*), "[^\n"]*"\]', r"\1"),
    (rf"collections\.abc\.Sequence\[{_NUMBER}\]", "numpy.typing.ArrayLike"),
    (r"(\.setter\n    def \w+\(self, arg1: )typing\.Any\)", r"\1numpy.typing.ArrayLike)"),
    # Without the following, pyright reports unknown types.
    (r"(: |-> )dict\b(?!\[)", r"\1dict[str, typing.Any]"),
    (r"(: |-> |\[)tuple\b(?!\[)", r"\1builtins.tuple[typing.Any, ...]"),
    (r"(def compile\(.*\) -> )typing\.Any", r"\1mujoco._structs.MjModel"),
    (r"(?<=def mj_id2name)(\(.*\) -> )str", r"\1str | typing.Any"),
    (r"\bmjs(\w+)_\b", r"mujoco._specs.Mjs\1"),
    (r"(-> |: )\.\.\.(?=[:,)])", r"\1typing.Any"),
    (r"\*\*kwargs\)", "**kwargs: typing.Any)"),
    (r"(: (?:Mj|numpy)[\w.]*) = None", r"\1 | None = None"),
    (
        r"(def (?:parent|first_\w+|next_\w+|find_(?:child|default))\(.*\) -> Mjs\w+):",
        r"\1 | typing.Any:",
    ),
    (r"(    def \w+\(self, arg0: str\) -> Mjs\w+):", r"\1 | typing.Any:"),
)


def _corrected(text: str) -> str:
    """Return the text of a stub with the corrections and with typed lists of elements."""
    for pattern, correction in _CORRECTIONS:
        text = re.sub(pattern, correction, text, flags=re.MULTILINE)
    for element, kind in _ELEMENTS.items():
        stem = f"{element[:-1]}(?:y|ies)" if element.endswith("y") else f"{element}(?:e?s)?"
        text = re.sub(rf"(def {stem}\(self\) -> )list:", rf"\1list[{kind}]:", text)
    return re.sub(r"-> list:", "-> list[typing.Any]:", text)


def main() -> None:
    """Write the stubs."""
    command = [sys.executable, "-m", "pybind11_stubgen", "--ignore-all-errors"]
    command += ["--numpy-array-use-type-var", "-o", str(_TYPINGS)]
    command += [f"mujoco._{part}" for part in _PARTS]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    for part in _PARTS:
        path = _TYPINGS / "mujoco" / f"_{part}.pyi"
        path.write_text(_corrected(path.read_text()))


if __name__ == "__main__":
    main()
