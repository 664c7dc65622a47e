"""Write the generated part of typings/mujoco: MuJoCo's bindings ship no type stubs.

`make check` runs it after each installation. pybind11-stubgen reads the signatures out of the
compiled modules, and this script corrects what it cannot know; the modules of MuJoCo that are
Python have stubs written by hand next to the generated ones. The stubs promise no more than the
bindings keep, with one exception. A result that is None only where nothing fits, such as the parent
of the world or a body looked up by a wrong name, is `X | Any`: both `body.parent.name` and
`body.parent is None` pass, and the caller decides which one is due.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

import mujoco

_ROOT: Final = Path(__file__).resolve().parents[1]
_MODULES: Final = (
    "_callbacks",
    "_constants",
    "_enums",
    "_functions",
    "_render",
    "_specs",
    "_structs",
)
# What pybind11-stubgen prints where any number will do.
_INT: Final = "typing.SupportsInt | typing.SupportsIndex"
_FLOAT: Final = "typing.SupportsFloat | typing.SupportsIndex"
_ARRAY_LIKE: Final = "numpy.typing.ArrayLike"

# Return types that the bindings leave open.
_RETURNS: Final = {
    "MjSpec.compile": "mujoco._structs.MjModel",
    "mj_id2name": "str | typing.Any",
}
# The bare containers that are left.
_CONTAINERS: Final = {
    "dict": "dict[str, typing.Any]",
    "list": "list[typing.Any]",
    "tuple": "builtins.tuple[typing.Any, ...]",
}


def _plural(name: str) -> str:
    if name.endswith("y"):
        return f"{name[:-1]}ies"
    return name + ("es" if name.endswith(("sh", "x")) else "s")


# The element type of each list that a spec or a body gives, such as `bodies`.
_LISTS: Final = {
    _plural(name.removeprefix("Mjs").lower()): f"list[{name}]"
    for name in dir(mujoco)
    if name.startswith("Mjs")
}


class _Corrector(ast.NodeTransformer):
    """Puts right what pybind11-stubgen could not know."""

    def __init__(self) -> None:
        self._class: list[str] = []
        self._getter = ""  # Type of the property whose setter may come next.

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.ClassDef:
        self._class.append(node.name)
        # The bindings mark what is compared by value as "not hashable", which it is not.
        body = [one for one in node.body if not ast.unparse(one).startswith("__hash__:")]
        node.body = [self.visit(statement) for statement in body] or [_ellipsis()]
        self._class.pop()
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AnnAssign:
        name = ast.unparse(node.target)
        if name == "__all__":
            return node
        node.annotation = self._simplified(node.annotation)
        if isinstance(node.value, ast.Tuple) and ast.unparse(node.annotation).endswith(
            "[Any, ...]"
        ):
            node.annotation = _parse("builtins.tuple[typing.Any, ...]")
        node.value = None
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        path = self._path(node.name)
        self._correct_parameters(node, path)
        node.returns = _parse(self._returned(node, path))
        if any(ast.unparse(d) == "property" for d in node.decorator_list):
            self._getter = ast.unparse(node.returns)
        node.body = [_ellipsis()]
        return node

    def _path(self, name: str) -> str:
        return ".".join([*self._class, name])

    def _correct_parameters(self, node: ast.FunctionDef, path: str) -> None:
        is_setter = any(ast.unparse(d).endswith(".setter") for d in node.decorator_list)
        arguments = node.args
        plain = [*arguments.posonlyargs, *arguments.args]
        defaults = [None] * (len(plain) - len(arguments.defaults)) + list(arguments.defaults)
        pairs = [
            *zip(plain, defaults, strict=True),
            *zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True),
        ]
        for parameter, default in pairs:
            if parameter.arg == "self":
                continue
            if parameter.annotation is None:
                text = "typing.Any"
            else:
                text = ast.unparse(self._simplified(parameter.annotation, is_parameter=True))
            if is_setter and text == "typing.Any" and "NDArray" in self._getter:
                text = _ARRAY_LIKE
            optional = isinstance(default, ast.Constant) and default.value is None
            if optional and "None" not in text and text != "typing.Any":
                text = f"{text} | None"
            if "__eq__" in path or "__ne__" in path:
                text = "object"
            parameter.annotation = _parse(text)
        if arguments.kwarg and arguments.kwarg.annotation is None:
            arguments.kwarg.annotation = _parse("typing.Any")
        arguments.defaults = [_short(default) for default in arguments.defaults]

    def _returned(self, node: ast.FunctionDef, path: str) -> str:
        if path in _RETURNS:
            return _RETURNS[path]
        if node.returns is None:
            return "typing.Any"
        text = ast.unparse(self._simplified(node.returns))
        if text == "list[typing.Any]":
            return _LISTS.get(node.name, text)
        is_lookup = self._class == ["MjSpec"] and ast.unparse(node.args).endswith("arg0: str")
        is_neighbour = node.name.startswith(("first_", "next_", "find_child", "find_default"))
        may_be_none = is_lookup or is_neighbour or node.name == "parent"
        if may_be_none and text.startswith("Mjs") and not node.name.startswith("add_"):
            return f"{text} | typing.Any"
        return text

    def _simplified(self, annotation: ast.expr, *, is_parameter: bool = False) -> ast.expr:
        return _Simplifier(is_parameter=is_parameter).visit(annotation)


class _Simplifier(ast.NodeTransformer):
    """Makes one annotation as wide as the bindings are, and legible."""

    def __init__(self, *, is_parameter: bool) -> None:
        self._is_parameter = is_parameter

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        whole = ast.unparse(node)
        if whole.startswith("typing.Annotated"):
            assert isinstance(node.slice, ast.Tuple)
            inner = node.slice.elts[0]
            text = ast.unparse(inner)
            is_output = "writeable" in whole
            if self._is_parameter and not is_output and text.startswith("numpy.typing"):
                return _parse(_ARRAY_LIKE)  # The bindings convert lists too.
            return self.visit(inner)
        if whole in (f"collections.abc.Sequence[{_FLOAT}]", f"collections.abc.Sequence[{_INT}]"):
            return _parse(_ARRAY_LIKE)  # An array is no Sequence, but the bindings take it.
        if isinstance(node.value, ast.Attribute) and node.value.attr in ("ndarray", "dtype"):
            return node
        node.slice = self.visit(node.slice)
        return node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id in _CONTAINERS:
            return _parse(_CONTAINERS[node.id])
        spec = re.fullmatch(r"mjs(\w+)_", node.id)
        if spec:
            return _parse(f"mujoco._specs.Mjs{spec[1]}")
        return node

    def visit_Constant(self, node: ast.Constant) -> ast.expr:
        return _parse("typing.Any") if node.value is ... else node


def main() -> None:
    """Write the stubs."""
    target = _ROOT / "typings" / "mujoco"
    with tempfile.TemporaryDirectory() as folder:
        modules = [f"mujoco.{name}" for name in _MODULES]
        subprocess.run(
            [
                *(sys.executable, "-m", "pybind11_stubgen", "--ignore-all-errors"),
                *("--numpy-array-use-type-var", "-o", folder, *modules),
            ],
            check=True,
            stderr=subprocess.DEVNULL,
        )
        raw = {name: (Path(folder) / "mujoco" / f"{name}.pyi").read_text() for name in _MODULES}
    for name, text in raw.items():
        (target / f"{name}.pyi").write_text(_corrected(text))


def _corrected(text: str) -> str:
    """The text of one stub file, put right."""
    lines = (_keyword_only_after_default(line) for line in text.splitlines())
    # An attribute called `global` is no Python; the bindings have `global_` too.
    kept = [line for line in lines if not line.startswith("    global: ")]
    tree = _Corrector().visit(ast.parse("\n".join(kept)))
    future = "from __future__ import annotations\n"
    imports = ("builtins", "collections.abc", "typing", "numpy.typing", "mujoco._specs")
    lines = [f"import {name}" for name in imports]
    return "\n".join([*lines, ast.unparse(ast.fix_missing_locations(tree)).replace(future, ""), ""])


def _keyword_only_after_default(line: str) -> str:
    """Put a star where a parameter without a default follows one with a default.

    C++ allows that, Python does not; such a parameter can only be given by its name.
    """
    match = re.fullmatch(r"(\s*def \w+\()(.*)(\) -> .*)", line)
    if not match:
        return line
    parameters = re.split(r", (?=\w+: |\*)", match[2])
    with_default = [i for i, p in enumerate(parameters) if " = " in p]
    if with_default and "*" not in parameters:
        late = [
            i
            for i, p in enumerate(parameters)
            if i > with_default[0] and " = " not in p and ":" in p
        ]
        if late:
            parameters.insert(late[0], "*")
    return match[1] + ", ".join(parameters) + match[3]


def _short(default: ast.expr) -> ast.expr:
    """A default as it is, or `...` for more than a plain value."""
    return default if isinstance(default, ast.Constant | ast.UnaryOp) else ast.Constant(...)


def _ellipsis() -> ast.Expr:
    return ast.Expr(ast.Constant(...))


def _parse(annotation: str) -> ast.expr:
    return ast.parse(annotation, mode="eval").body


if __name__ == "__main__":
    main()
