"""Identity of an env, a method or a learner: hashes of the robot's model and of the user's files.

A name, such as an id, a path or `module:Name`, stays the same if its file is edited. Identities
distinguish such versions, so that runs of different versions are never averaged and a policy is
never used with another robot by mistake.

A module is custom if it is not in the standard library, in a folder of installed packages, or in
Shapechanger. Custom modules that it imports are part of the identity too.
"""

from __future__ import annotations

import ast
import hashlib
import os
import re
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final, cast

import msgspec

from shapechanger.registry import MODELS

if TYPE_CHECKING:
    import gymnasium as gym

# Files of models, which are not hashed because the fingerprint of the compiled model covers them.
_MODEL_FILES: Final = (".xml", ".mjcf", ".urdf")
_NAMED: Final = re.compile(r"([A-Za-z_]\w*(?:\.\w+)*):[A-Za-z_]\S*")
_INSTALLED: Final = frozenset(("site-packages", "dist-packages"))
_NOT_OWN: Final = (
    *(Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "platstdlib")),
    Path(__file__).resolve().parent,
)
# In a worker process, the script of the parent has the second name.
_SCRIPTS: Final = ("__main__", "__mp_main__")
_GUARD: Final = "__name__ == '__main__'"


class Identity(msgspec.Struct, frozen=True, omit_defaults=True):
    """Version of an env, a method or a learner.

    Attributes:
        model: Fingerprint of the compiled model, see `shapechanger.morphology.certificate`; empty
            without a model.
        sensed: Fingerprint of parts of the model that do not affect motion but may be observed:
            sensors, keyframes, sites and, if frames are observed, all visible parts.
        files: The first 16 hex digits of the SHA-256 of each custom file, keyed by its path below
            the folder that it is imported from, or by its name.
    """

    model: str = ""
    sensed: str = ""
    files: dict[str, str] = {}

    def changes_to(self, other: Identity) -> str:
        """Describe how a newer version differs; empty if it is the same.

        Models are compared only if both identities have a model.
        """

        def changed(part: str, old: str, new: str) -> Iterator[str]:
            if old and new and old != new:
                yield f"{part} has changed from {old} to {new}"
            elif old != new:
                yield f"{part} is gone (was {old})" if old else f"{part} is new ({new})"

        found: list[str] = []
        if self.model and other.model:
            found += changed("its model", self.model, other.model)
            if not found:
                found += changed("the observed part of its model", self.sensed, other.sensed)
                found = [f"{text}, but its motion is the same" for text in found]
        for name in sorted(self.files.keys() | other.files.keys()):
            found += changed(name, self.files.get(name, ""), other.files.get(name, ""))
        return ", and ".join(found)


def identify_env(env: gym.Env[Any, Any], env_id: str = "") -> Identity:
    """Return the identity of a wrapped env, whose id may name a module, as `module:id`."""
    arguments: dict[str, Any] = {} if env.spec is None else dict(env.spec.kwargs)
    names = modules_of_env(env, env_id)
    model = getattr(env.unwrapped, "model", None)
    moved, sensed = "", ""
    # The class is compared by name, so that MuJoCo is not imported for envs without it.
    compiled = (type(model).__module__.partition(".")[0], type(model).__name__)
    if is_mujoco := compiled == ("mujoco", "MjModel"):
        sees = _sees(env.observation_space)
        moved, sensed = MODELS.load("mujoco").fingerprints(model, drawn=sees)
    files = own_modules(names) | dict(_files(arguments, _MODEL_FILES if is_mujoco else ()))
    return Identity(moved, sensed, files)


def identify_code(names: Iterable[str], *objects: Any) -> Identity:
    """Return the identity of a part without a model: the hashes of its custom modules.

    The modules define `objects`, or are named in `names`, such as `my_methods:warm-start`.
    """
    return Identity(files=own_modules({*named_modules(names), *modules_of(*objects)}))


def _files(arguments: Mapping[str, Any], without: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield name and hash of each file that an argument names, such as a robot's profile."""
    for text in filter(None, texts_in(arguments)):
        for place in (text, f"{text}.toml"):  # `my-car` is short for my-car.toml.
            # Unlike `Path.is_file`, this is false for texts that are too long for a path, such as
            # the JSON of a body.
            if os.path.isfile(place) and not place.endswith(without):
                content = b"\n".join(Path(place).read_bytes().splitlines())
                yield Path(place).name, _hash_of(content)


def _hash_of(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _sees(space: gym.Space[Any]) -> bool:
    """Return whether observations contain images: arrays of uint8 with two or more axes."""
    inner: Any = getattr(space, "spaces", None)
    if inner is not None:
        return any(map(_sees, getattr(inner, "values", lambda: inner)()))
    return len(space.shape or ()) >= 2 and str(space.dtype) == "uint8"


def own_modules(names: Iterable[str]) -> dict[str, str]:
    """Return the hashes of custom modules among `names`, and of custom modules that they import.

    The hashes are the first 16 hex digits of the SHA-256 of each source, keyed by its path below
    the folder that it is imported from, such as `tasks/jump.py`. Comments are hashed; line ends and
    the block `if __name__ == "__main__":` are not.
    """
    found: dict[str, str] = {}
    waiting, seen = list(names), {""}
    while waiting:
        name = waiting.pop()
        if name in seen or name.partition(".")[0] == "shapechanger":
            continue
        seen.add(name)
        waiting.append(name.rpartition(".")[0])
        file = _file_of(name)
        if file is None or not _is_own(file):
            continue
        # A script that was run with `python -m` has the name of its module.
        spec = getattr(sys.modules.get(name), "__spec__", None)
        dotted = str(getattr(spec, "name", "")) if name in _SCRIPTS else name
        package = dotted if file.stem == "__init__" else dotted.rpartition(".")[0]
        source = file.read_bytes()
        if file.suffix == ".py":
            source, imported = _read(source, package)
            waiting += imported
        # Add the modules that define this module's attributes, however it imported them.
        values = vars(sys.modules[name]).values() if name in sys.modules else ()
        used = [each for each in [*values] if isinstance(each, ModuleType) or callable(each)]
        waiting += modules_of(*used) - {*_SCRIPTS}
        depth = len(package.split(".")) if package else 0
        key = Path(*file.parts[-1 - depth :]).as_posix()
        found[key] = _hash_of(source)
    return dict(sorted(found.items()))


def modules_of(*objects: Any) -> set[str]:
    """Return the names of the modules that define the objects, their classes and all bases."""
    found: set[str] = set()
    for each in objects:
        if isinstance(each, ModuleType):
            found.add(each.__name__)
            continue
        kind: Any = each if isinstance(each, type) else type(each)
        modules = [getattr(one, "__module__", None) for one in (each, *kind.__mro__)]
        found.update(module for module in modules if isinstance(module, str))
    return found


def modules_of_env(env: Any, env_id: str = "") -> set[str]:
    """Return the names of the modules that define an env: wrappers, body, task and measures."""
    spec: Any = getattr(env, "spec", None)
    arguments: dict[str, Any] = {} if spec is None else dict(spec.kwargs)
    entry: Any = None if spec is None else spec.entry_point
    parts: list[Any] = [env, entry]
    while env is not (inner := getattr(env, "unwrapped", env)):
        env = env.env
        parts.append(env)
    rig = getattr(getattr(inner, "family", None), "rig", ())
    parts += [getattr(inner, "task", None), *getattr(inner, "measures", ())]
    parts += [*getattr(inner, "body", ()), *rig, *arguments.values()]
    return modules_of(*parts) | {*named_modules([env_id, *texts_in([entry, arguments])])}


def _is_own(path: Path) -> bool:
    return not _INSTALLED & {*path.parts} and not any(map(path.is_relative_to, _NOT_OWN))


def _file_of(name: str) -> Path | None:
    """Return the file of an imported module or of a custom one; None if it has no file."""
    file = getattr(sys.modules.get(name), "__file__", None)
    if name not in sys.modules:
        # Unlike `importlib.util.find_spec`, this does not import the parent packages.
        folders, parts = [place for place in sys.path if _is_own(Path(place).resolve())], name
        for end in [*(m.start() for m in re.finditer(r"\.", name)), len(name)]:
            spec = PathFinder.find_spec(parts[:end], folders)
            if spec is None:
                return None
            folders, file = list(spec.submodule_search_locations or ()), spec.origin
    return None if file is None else Path(file).resolve()


def _read(source: bytes, package: str) -> tuple[bytes, list[str]]:
    """Return a source without its block for scripts, and the names that it may import."""
    lines = source.removeprefix(b"\xef\xbb\xbf").splitlines()
    try:
        tree = ast.parse(b"\n".join(lines))
    except (SyntaxError, ValueError):
        return b"\n".join(lines), []
    imported: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".") if node.level and package else []
            parents = parents[: len(parents) + 1 - node.level]
            base = ".".join([*parents, *([node.module] if node.module else [])])
            imported += [base, *(f"{base}.{alias.name}".lstrip(".") for alias in node.names)]
    for node in reversed(tree.body):
        if isinstance(node, ast.If) and not node.orelse and ast.unparse(node.test) == _GUARD:
            del lines[node.lineno - 1 : node.end_lineno]
    return b"\n".join(lines), imported


def texts_in(value: Any) -> Iterator[str]:
    """Yield all texts in arguments, at any depth."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping | list | tuple):
        inner = cast("Any", value)
        for each in inner.values() if isinstance(value, Mapping) else inner:
            yield from texts_in(each)


def named_modules(texts: Iterable[str]) -> Iterator[str]:
    """Yield `module` for each text of the form `module:Name`."""
    for text in texts:
        if found := _NAMED.fullmatch(text):
            yield found[1]
