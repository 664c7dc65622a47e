"""Write typings/mujoco: type stubs for MuJoCo's bindings, which ship none.

Run it after a change of MuJoCo's version, and commit what it writes:

    .venv/bin/python scripts/generate_stubs.py

pybind11-stubgen reads the signatures out of the compiled modules; what it cannot know is put right
here. The stubs promise no more than the bindings keep, with one exception. What is None only where
nothing fits, such as the parent of the world or a body looked up by a wrong name, is `X | Any`:
both `body.parent.name` and `body.parent is None` pass, and the caller decides which one is due.
"""

from __future__ import annotations

import ast
import importlib
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
_HEADER: Final = f'''\
"""Generated from mujoco {mujoco.__version__} by scripts/generate_stubs.py; do not edit."""

'''

# What pybind11-stubgen prints where any number will do.
_INT: Final = "typing.SupportsInt | typing.SupportsIndex"
_FLOAT: Final = "typing.SupportsFloat | typing.SupportsIndex"
_ARRAY_LIKE: Final = "numpy.typing.ArrayLike"

# The element type of each list that a spec or a body gives.
_PLURALS: Final = {
    "actuators": "MjsActuator",
    "bodies": "MjsBody",
    "cameras": "MjsCamera",
    "equalities": "MjsEquality",
    "excludes": "MjsExclude",
    "flexes": "MjsFlex",
    "frames": "MjsFrame",
    "geoms": "MjsGeom",
    "hfields": "MjsHField",
    "joints": "MjsJoint",
    "keys": "MjsKey",
    "lights": "MjsLight",
    "materials": "MjsMaterial",
    "meshes": "MjsMesh",
    "numerics": "MjsNumeric",
    "pairs": "MjsPair",
    "plugins": "MjsPlugin",
    "sensors": "MjsSensor",
    "sites": "MjsSite",
    "skins": "MjsSkin",
    "tendons": "MjsTendon",
    "texts": "MjsText",
    "textures": "MjsTexture",
    "tuples": "MjsTuple",
}
# Where the name of a model's or data's accessor is not that of the view it gives.
_VIEWS: Final = {
    "cam": "Camera",
    "eq": "Equality",
    "jnt": "Joint",
    "key": "Keyframe",
    "mat": "Material",
    "ten": "Tendon",
    "tex": "Texture",
}
# Return types that the bindings leave open, or give as a bare container.
_RETURNS: Final = {
    "MjSpec.compile": "mujoco._structs.MjModel",
    "MjSpec.recompile": "tuple[mujoco._structs.MjModel, mujoco._structs.MjData]",
    "MjByteVec.__getitem__": "int",
    "MjByteVec.__iter__": "collections.abc.Iterator[int]",
    "MjsSkin.vertid": "list[list[int]]",
    "MjsSkin.vertweight": "list[list[float]]",
    "MjModel.bind": "typing.Any",  # What it gives has the attributes of what it was given.
    "MjData.bind": "typing.Any",
    "MjvScene.camera": "builtins.tuple[MjvGLCamera, ...]",
    "MjvScene.geoms": "builtins.tuple[MjvGeom, ...]",
    "MjvScene.lights": "builtins.tuple[MjvLight, ...]",
    "mj_id2name": "str | typing.Any",
}
# Parameters that the bindings leave open.
_PARAMETERS: Final = {
    "MjSpec.attach.frame": "MjsFrame | str | None",
    "MjSpec.attach.site": "MjsSite | str | None",
    "MjSpec.copy_back.model": "mujoco._structs.MjModel",
    "MjSpec.recompile.d": "mujoco._structs.MjData",
    "MjSpec.recompile.m": "mujoco._structs.MjModel",
    "MjByteVec.__init__.arg0": "int",
    "MjByteVec.__setitem__.arg1": "int",
    "MjData.bind.specs": "mujoco.MjStruct | collections.abc.Sequence[mujoco.MjStruct]",
    "MjModel.bind.specs": "mujoco.MjStruct | collections.abc.Sequence[mujoco.MjStruct]",
    "MjModel.from_binary_path.vfs": "mujoco._specs.MjVfs | None",
    "MjModel.from_xml_path.vfs": "mujoco._specs.MjVfs | None",
    "MjModel.from_xml_string.vfs": "mujoco._specs.MjVfs | None",
}
# Set on their classes by mujoco/__init__.py, which makes them look like static methods.
_METHODS_IN_PYTHON: Final = ("MjData.bind", "MjModel.bind", "MjSpec.to_zip")
_ATTRIBUTES: Final = {
    "MjModel.stat": "MjStatistic",
    "MjSpec.assets": "dict[str, bytes]",
}
# The bare containers that are left.
_CONTAINERS: Final = {
    "dict": "dict[str, typing.Any]",
    "list": "list[typing.Any]",
    "tuple": "builtins.tuple[typing.Any, ...]",
}

_PACKAGE: Final = """\
import typing

import numpy

from mujoco import _specs
from mujoco._callbacks import *
from mujoco._constants import *
from mujoco._enums import *
from mujoco._errors import *
from mujoco._functions import *
from mujoco._render import *
from mujoco._specs import *
from mujoco._structs import *
from mujoco.rendering.classic.gl_context import GLContext as GLContext
from mujoco.rendering.classic.renderer import Renderer as Renderer

__version__: str
HEADERS_DIR: str
PLUGINS_DIR: str
PLUGIN_HANDLES: list[typing.Any]
MJTNUM_DTYPE: type[numpy.float64]

MjStruct: typing.TypeAlias = (
    {struct}
)

def to_zip(spec: _specs.MjSpec, file: str | typing.IO[bytes]) -> None: ...
def from_zip(file: str | typing.IO[bytes]) -> _specs.MjSpec: ...
"""
_ERRORS: Final = """\
__all__ = ["FatalError", "UnexpectedError"]

class FatalError(Exception): ...
class UnexpectedError(Exception): ...
"""
_RENDERER: Final = """\
import types
import typing

import numpy.typing

from mujoco._enums import mjtFontScale
from mujoco._structs import MjData, MjModel, MjvCamera, MjvOption, MjvScene

class Renderer:
    def __init__(
        self,
        model: MjModel,
        height: int = 240,
        width: int = 320,
        max_geom: int = 10000,
        font_scale: mjtFontScale = ...,
    ) -> None: ...
    @property
    def model(self) -> MjModel: ...
    @property
    def scene(self) -> MjvScene: ...
    @property
    def height(self) -> int: ...
    @property
    def width(self) -> int: ...
    def enable_depth_rendering(self) -> None: ...
    def disable_depth_rendering(self) -> None: ...
    def enable_segmentation_rendering(self) -> None: ...
    def disable_segmentation_rendering(self) -> None: ...
    def render(
        self, *, out: numpy.typing.NDArray[typing.Any] | None = None
    ) -> numpy.typing.NDArray[typing.Any]: ...
    def update_scene(
        self,
        data: MjData,
        camera: int | str | MjvCamera = -1,
        scene_option: MjvOption | None = None,
    ) -> None: ...
    def close(self) -> None: ...
    def __enter__(self) -> typing.Self: ...
    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_value: BaseException | None,
        traceback: types.TracebackType | None,
    ) -> None: ...
    def __del__(self) -> None: ...
"""
_GL_CONTEXT: Final = """\
class GLContext:
    def __init__(self, max_width: int, max_height: int) -> None: ...
    def make_current(self) -> None: ...
    def free(self) -> None: ...
    def __del__(self) -> None: ...
"""
_ROLLOUT: Final = """\
import collections.abc
import types
import typing

import numpy
import numpy.typing

from mujoco._structs import MjData, MjModel

_Arrays: typing.TypeAlias = tuple[
    numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]
]

class Rollout:
    def __init__(self, *, nthread: int | None = None) -> None: ...
    def __enter__(self) -> typing.Self: ...
    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_val: BaseException | None,
        exc_tb: types.TracebackType | None,
    ) -> None: ...
    def close(self) -> None: ...
    def rollout(
        self,
        model: MjModel | collections.abc.Sequence[MjModel],
        data: MjData | collections.abc.Sequence[MjData],
        initial_state: numpy.typing.ArrayLike,
        control: numpy.typing.ArrayLike | None = None,
        *,
        control_spec: int = ...,
        skip_checks: bool = False,
        nstep: int | None = None,
        initial_warmstart: numpy.typing.ArrayLike | None = None,
        state: numpy.typing.ArrayLike | None = None,
        sensordata: numpy.typing.ArrayLike | None = None,
        chunk_size: int | None = None,
    ) -> _Arrays: ...

def rollout(
    model: MjModel | collections.abc.Sequence[MjModel],
    data: MjData | collections.abc.Sequence[MjData],
    initial_state: numpy.typing.ArrayLike,
    control: numpy.typing.ArrayLike | None = None,
    *,
    control_spec: int = ...,
    skip_checks: bool = False,
    nstep: int | None = None,
    initial_warmstart: numpy.typing.ArrayLike | None = None,
    state: numpy.typing.ArrayLike | None = None,
    sensordata: numpy.typing.ArrayLike | None = None,
    chunk_size: int | None = None,
    persistent_pool: bool = False,
) -> _Arrays: ...
def shutdown_persistent_pool() -> None: ...
"""


class _Corrector(ast.NodeTransformer):
    """Puts right what pybind11-stubgen could not know."""

    def __init__(self, module: str) -> None:
        self._module = module
        self._keeps_docs = module == "_functions"  # Elsewhere they only list the parameters again.
        self._class: list[str] = []
        self._getter = ""  # Type of the property whose setter may come next.

    def visit_Module(self, node: ast.Module) -> ast.Module:
        body = [self.visit(statement) for statement in node.body]
        node.body = [
            statement
            for statement in body
            if statement is not None and not _is_future(statement) and not _is_private(statement)
        ]
        if self._module == "_enums":
            _share_methods(node)
        return node

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.ClassDef:
        self._class.append(node.name)
        body = [statement for statement in node.body if not _is_private(statement)]
        node.body = [self.visit(statement) for statement in _without_doc(body)] or [_ellipsis()]
        self._class.pop()
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AnnAssign:
        name = ast.unparse(node.target)
        if name == "__all__":
            node.value = _public(node.value)
            return node
        known = _ATTRIBUTES.get(self._path(name))
        node.annotation = _parse(known) if known else self._simplified(node.annotation)
        if isinstance(node.value, ast.Tuple) and ast.unparse(node.annotation).endswith(
            "[Any, ...]"
        ):
            node.annotation = _parse("builtins.tuple[typing.Any, ...]")
        node.value = None
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        path = self._path(node.name)
        if path in _METHODS_IN_PYTHON:
            node.decorator_list = []
            node.args.args[0] = ast.arg("self")
        if node.name == "bind_scalar":
            node.args.defaults = []  # They say None, which the bindings refuse.
        self._correct_parameters(node, path)
        node.returns = _parse(self._returned(node, path))
        if any(ast.unparse(d) == "property" for d in node.decorator_list):
            self._getter = ast.unparse(node.returns)
        doc = ast.get_docstring(node)
        node.body = [_ellipsis()]
        if doc and self._keeps_docs:
            node.body = [ast.Expr(ast.Constant(doc))]
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
            known = _PARAMETERS.get(f"{path}.{parameter.arg}")
            if known:
                text = known
            elif parameter.annotation is None:
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
        owner = self._class[-1] if self._class else ""
        if text == "list[typing.Any]" and node.name in _PLURALS:
            return f"list[{_PLURALS[node.name]}]"
        if text == "list[typing.Any]" and node.name == "find_all":
            return "list[typing.Any]"
        if owner in ("MjModel", "MjData"):
            if node.name == "bind_scalar":
                kind = ast.unparse(node.args.args[1].annotation or _ellipsis().value)
                kind = kind.split(" ")[0].removeprefix("mujoco._specs.Mjs")
                kind = {"HField": "Hfield", "Key": "Keyframe"}.get(kind, kind)
                return f"_{owner}{kind}Views"
            if text == "typing.Any" and len(node.args.args) == 2:
                kind = _VIEWS.get(node.name, node.name.capitalize())
                return f"_{owner}{kind}Views"
        is_lookup = owner == "MjSpec" and ast.unparse(node.args).endswith("arg0: str")
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
    """Write the stubs, and say how large they are."""
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
    files = {f"{name}.pyi": _corrected(name, raw[name]) for name in _MODULES}
    struct = "\n    | ".join(f"_specs.{kind}" for kind in sorted(_PLURALS.values()))
    files["__init__.pyi"] = _PACKAGE.format(struct=struct)
    files["_errors.pyi"] = _ERRORS
    files["rollout.pyi"] = _ROLLOUT
    files["rendering/__init__.pyi"] = files["rendering/classic/__init__.pyi"] = ""
    files["rendering/classic/renderer.pyi"] = _RENDERER
    files["rendering/classic/gl_context.pyi"] = _GL_CONTEXT
    for name, text in files.items():
        path = target / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(_HEADER + text)
    _format(target)
    _require_complete(target)
    size = sum(path.stat().st_size for path in target.rglob("*.pyi"))
    print(f"{target.relative_to(_ROOT)}: {len(files)} files, {size / 1024:.0f} KiB")


def _corrected(module: str, text: str) -> str:
    """The text of one stub file, put right."""
    lines = (_keyword_only_after_default(line) for line in text.splitlines())
    # An attribute called `global` is no Python; the bindings have `global_` too.
    kept = [line for line in lines if not line.startswith("    global: ")]
    tree = _Corrector(module).visit(ast.parse("\n".join(kept)))
    # Those that are not needed go when the files are formatted.
    imports = ("builtins", "typing", "mujoco", "mujoco._specs")
    tree.body[:0] = [ast.Import([ast.alias(name)]) for name in imports]
    return ast.unparse(ast.fix_missing_locations(tree)) + "\n"


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


def _share_methods(tree: ast.Module) -> None:
    """Move the methods that all enums have into one base class, in place."""
    enums = [statement for statement in tree.body if isinstance(statement, ast.ClassDef)]
    shared = {text for text in _method_texts(enums[0])}
    for enum in enums:
        if set(_method_texts(enum)) != shared:
            raise SystemExit(f"{enum.name} has other methods than {enums[0].name}.")
    base = ast.parse("class _Enum:\n    pass").body[0]
    assert isinstance(base, ast.ClassDef)
    base.body = _once([ast.parse(text).body[0] for text in dict.fromkeys(_method_texts(enums[0]))])
    for enum in enums:
        enum.bases = [_parse("_Enum")]
        enum.body = [s for s in enum.body if not isinstance(s, ast.FunctionDef)]
    tree.body.insert(tree.body.index(enums[0]), base)


def _once(methods: list[ast.stmt]) -> list[ast.stmt]:
    """Take the decorator off a method that has become the only one of its name."""
    names = [m.name for m in methods if isinstance(m, ast.FunctionDef)]
    for method in methods:
        if isinstance(method, ast.FunctionDef) and names.count(method.name) == 1:
            method.decorator_list = [
                d for d in method.decorator_list if ast.unparse(d) != "typing.overload"
            ]
    return methods


def _method_texts(enum: ast.ClassDef) -> list[str]:
    return [ast.unparse(s) for s in enum.body if isinstance(s, ast.FunctionDef)]


def _require_complete(target: Path) -> None:
    """Stop if a public name of the package, or a member of the classes written by hand, is missing.

    Raises:
        SystemExit: If so.
    """
    text = "".join(path.read_text() for path in sorted(target.rglob("*.pyi")))
    own = [name for name in dir(mujoco) if re.match(r"mj|Mj|set_|get_|[A-Z]+_|Renderer|GL", name)]
    renderer = importlib.import_module("mujoco.rendering.classic.renderer").Renderer
    rollout = importlib.import_module("mujoco.rollout").Rollout
    own += [name for name in (*vars(renderer), *vars(rollout)) if not name.startswith("_")]
    missing = [name for name in own if not re.search(rf"\b{name}\b", text)]
    if missing:
        raise SystemExit(f"These are missing from the stubs: {', '.join(missing)}.")


def _format(target: Path) -> None:
    """Break the lines, so that a change of version reads well as a diff."""
    ruff = [sys.executable, "-m", "ruff"]
    rules = "F401,I001,PYI032,UP"  # Unused imports and stale spellings.
    options = ["--isolated", "--target-version=py311", "--line-length=100"]
    for command in (
        ["check", "--quiet", "--exit-zero", f"--select={rules}", "--fix", "--unsafe-fixes"],
        ["format", "--quiet"],
    ):
        files = [str(path) for path in target.rglob("_[a-z]*.pyi")]
        files = [file for file in files if not file.endswith("__init__.pyi")]
        subprocess.run([*ruff, command[0], *options, *command[1:], *files], check=True)


def _public(names: ast.expr | None) -> ast.expr | None:
    """`__all__` without what is private."""
    if isinstance(names, ast.List):
        names.elts = [
            n
            for n in names.elts
            if isinstance(n, ast.Constant) and not str(n.value).startswith("_")
        ]
    return names


def _is_private(statement: ast.stmt) -> bool:
    """Whether a statement defines what begins with one underscore, and is no class of the views."""
    if isinstance(statement, ast.FunctionDef):
        name = statement.name
    elif isinstance(statement, ast.AnnAssign):
        name = ast.unparse(statement.target)
    else:
        return False
    is_mark = isinstance(statement, ast.AnnAssign) and name == "__hash__"  # "Not hashable."
    return is_mark or (name.startswith("_") and not name.startswith("__"))


def _is_future(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.ImportFrom) and statement.module == "__future__"


def _without_doc(body: list[ast.stmt]) -> list[ast.stmt]:
    first = body[0] if body else None
    has_doc = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    return body[1:] if has_doc else body


def _short(default: ast.expr) -> ast.expr:
    """A default as it is, or `...` where it is more than a plain value."""
    return default if isinstance(default, ast.Constant | ast.UnaryOp) else ast.Constant(...)


def _ellipsis() -> ast.Expr:
    return ast.Expr(ast.Constant(...))


def _parse(annotation: str) -> ast.expr:
    return ast.parse(annotation, mode="eval").body


if __name__ == "__main__":
    main()
