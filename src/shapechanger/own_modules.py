"""Modules of the user's own that an env, a method or a learner needs, with hashes of their sources.

A module counts as the user's own if it lies neither in the standard library nor in a folder of
installed packages, and is not of Shapechanger. What it imports counts with it.
"""

from __future__ import annotations

import ast
import hashlib
import re
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, Final, cast

HASH_DIGITS: Final = 16
"""Length of a hash, in hexadecimal digits of the SHA-256."""

_NAMED: Final = re.compile(r"([A-Za-z_]\w*(?:\.\w+)*):[A-Za-z_]\S*")
_INSTALLED: Final = frozenset(("site-packages", "dist-packages"))
_LIBRARY: Final = tuple(
    Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "platstdlib")
)
_HERE: Final = Path(__file__).resolve().parent
# A worker process knows the script of its parent by the second name.
_SCRIPTS: Final = ("__main__", "__mp_main__")


def own_modules(names: Iterable[str]) -> dict[str, str]:
    """Return the hash of each own module among some modules, and of those that they import.

    Comments count, line ends and the block `if __name__ == "__main__":` do not.

    Args:
        names: Dotted names of modules; those that are not the user's own are skipped.

    Returns:
        The first 16 hex digits of the SHA-256 of each source, by the place of the file below the
        folder that it is imported from, such as `tasks/jump.py`.
    """
    found: dict[str, str] = {}
    waiting, seen = list(names), set[str]()
    folders = _import_folders()
    while waiting:
        name = waiting.pop()
        if name in seen or name.partition(".")[0] == "shapechanger":
            continue
        seen.add(name)
        if (package := name.rpartition(".")[0]) not in seen:
            waiting.append(package)
        file = _file_of(name, folders)
        if file is None or not _is_own(file):
            continue
        folders |= {_folder_of(name, file): None}
        source = file.read_bytes()
        if file.suffix == ".py":
            source, imported = _read(source, _package_of(name, file))
            waiting += imported
        waiting += _used_by(sys.modules.get(name))
        found[_key(name, file)] = hashlib.sha256(source).hexdigest()[:HASH_DIGITS]
    return dict(sorted(found.items()))


def modules_of(*objects: Any) -> set[str]:
    """Return the names of the modules that define some objects, or their classes with all bases."""
    found: set[str] = set()
    for each in objects:
        if isinstance(each, ModuleType):
            found.add(each.__name__)
            continue
        kind: Any = each if isinstance(each, type) else type(each)
        named = (each, *kind.__mro__)
        modules = [getattr(one, "__module__", None) for one in named]
        found.update(module for module in modules if isinstance(module, str))
    return found


def modules_of_env(env: Any, env_id: str = "") -> set[str]:
    """Return the names of the modules that define an env: wrappers, body, task and measures.

    Args:
        env: The env.
        env_id: Its id, which may name a module, as `module:id`.
    """
    spec: Any = getattr(env, "spec", None)
    arguments: dict[str, Any] = {} if spec is None else dict(spec.kwargs)
    found = modules_of(*_layers(env), *_parts(env), *_objects(arguments))
    found.update(named_modules([env_id, *texts_in(arguments)]))
    entry: Any = None if spec is None else spec.entry_point
    found.update(named_modules([entry]) if isinstance(entry, str) else modules_of(entry))
    return found


def _import_folders() -> dict[Path, None]:
    """Return the folders that modules are imported from, without those of installed packages."""
    places = (Path(place or ".").resolve() for place in sys.path)
    return dict.fromkeys(place for place in places if place.is_dir() and _is_own(place))


def _is_own(path: Path) -> bool:
    """Return whether a file or folder is neither installed nor part of Python or Shapechanger."""
    return (
        not _INSTALLED & set(path.parts)
        and not any(path.is_relative_to(library) for library in _LIBRARY)
        and not path.is_relative_to(_HERE)
    )


def _file_of(name: str, folders: Iterable[Path]) -> Path | None:
    """Return the file of a module, which need not have been imported; None without a file."""
    loaded = sys.modules.get(name)
    if loaded is not None:
        file = getattr(loaded, "__file__", None)
        return None if file is None else Path(file).resolve()
    parts = name.split(".")
    for folder in folders:
        for file in (folder.joinpath(*parts, "__init__.py"), folder.joinpath(*parts[:-1])):
            if file.suffix and file.is_file():
                return file
            if (module := file / f"{parts[-1]}.py").is_file():
                return module
    return None


def _spec_name(name: str) -> str:
    """Return the name of a module; that of a script run with `python -m` is its module's."""
    spec = getattr(sys.modules.get(name), "__spec__", None)
    return str(getattr(spec, "name", "")) if name in _SCRIPTS else name


def _package_of(name: str, file: Path) -> str:
    """Return the package that relative imports of a module begin at."""
    known = _spec_name(name)
    return known if file.stem == "__init__" else known.rpartition(".")[0]


def _folder_of(name: str, file: Path) -> Path:
    """Return the folder that a module was imported from."""
    package = _package_of(name, file)
    return file.parents[len(package.split(".")) if package else 0]


def _key(name: str, file: Path) -> str:
    """Return the place of a module's file below the folder that it is imported from."""
    try:
        return file.relative_to(_folder_of(name, file)).as_posix()
    except (ValueError, IndexError):
        return file.name


def _read(source: bytes, package: str) -> tuple[bytes, list[str]]:
    """Return the part of a source that an import runs, and the names that it imports."""
    lines = source.removeprefix(b"\xef\xbb\xbf").splitlines()
    try:
        tree = ast.parse(b"\n".join(lines))
    except (SyntaxError, ValueError):
        return b"\n".join(lines), []
    run = [True] * len(lines)
    for node in tree.body:
        if isinstance(node, ast.If) and not node.orelse and _is_guard(node.test):
            run[node.lineno - 1 : node.end_lineno] = [False] * (
                (node.end_lineno or node.lineno) - node.lineno + 1
            )
    kept = [line for line, runs in zip(lines, run, strict=True) if runs]
    return b"\n".join(kept), list(_imported(tree, package))


def _is_guard(test: ast.expr) -> bool:
    """Return whether a condition is `__name__ == "__main__"`."""
    return ast.unparse(test).replace('"', "'") == "__name__ == '__main__'"


def _imported(tree: ast.Module, package: str) -> Iterator[str]:
    """Yield the names that a module may import, anywhere in its source."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".") if node.level and package else []
            parents = parents[: len(parents) + 1 - node.level] if node.level else []
            base = ".".join([*parents, *([node.module] if node.module else [])])
            yield base
            yield from (f"{base}.{alias.name}" if base else alias.name for alias in node.names)


def _used_by(module: ModuleType | None) -> set[str]:
    """Return the modules of the names of a module, some of which it may import by other means."""
    values = () if module is None else tuple(vars(module).values())
    named = [each for each in values if isinstance(each, ModuleType | type) or callable(each)]
    return modules_of(*named) - {*_SCRIPTS}


def _layers(env: Any) -> Iterator[Any]:
    """Yield an env and what it wraps, from the outermost."""
    yield env
    while env is not getattr(env, "unwrapped", env):
        env = env.env
        yield env


def _parts(env: Any) -> list[Any]:
    """Return what an env is told to do and to be: its task, and the edits of its body."""
    inner: Any = getattr(env, "unwrapped", env)
    family = getattr(inner, "family", None)
    edits = [*getattr(inner, "body", ()), *getattr(family, "rig", ())]
    return [getattr(inner, "task", None), *getattr(inner, "measures", ()), *edits]


def texts_in(value: Any) -> Iterator[str]:
    """Yield all texts in arguments, at any depth."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for each in cast("Mapping[str, Any]", value).values():
            yield from texts_in(each)
    elif isinstance(value, list | tuple):
        for each in cast("list[Any]", value):
            yield from texts_in(each)


def _objects(arguments: Mapping[str, Any]) -> list[Any]:
    """Return the arguments that no JSON can hold, such as a task that is an object."""
    plain = (str, int, float, bool, list, tuple, dict, type(None))
    return [value for value in arguments.values() if not isinstance(value, plain)]


def named_modules(texts: Iterable[str]) -> Iterator[str]:
    """Yield the modules that texts such as `module:Name` name."""
    for text in texts:
        if found := _NAMED.fullmatch(text):
            yield found[1]
