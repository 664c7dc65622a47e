"""Rules for imports between packages, and for modules."""

import ast
import importlib
import importlib.util
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

pytestmark = pytest.mark.sources

_SRC = Path(__file__).resolve().parents[1] / "src"
_HARDWARE = frozenset({"aiohttp", "gpiozero", "lgpio", "picamera2", "serial", "smbus2", "zeroconf"})
_HEAVY = frozenset({"cv2", "matplotlib", "mujoco", "ray", "stable_baselines3", "torch"})
_SIMULATORS = frozenset({"mujoco", "glfw", "OpenGL"})
_NEEDS_LGPIO = "shapechanger.robot.drivers.lgpio_pins"


@dataclass(frozen=True, slots=True)
class _Rule:
    """Imports that a package is allowed, at the top of a file or inside a function.

    Attributes:
        ours: Packages of Shapechanger besides itself.
        theirs: External packages besides the standard library; None for any.
        never: Forbidden packages, external or of the standard library.
    """

    ours: frozenset[str]
    theirs: frozenset[str] | None = None
    never: frozenset[str] = frozenset()


def _names(text: str) -> frozenset[str]:
    return frozenset(text.split())


_RULES = {
    # Shared by the workstation and the robot.
    "errors": _Rule(_names("layout link"), _names("numpy msgspec")),
    "layout": _Rule(_names("errors link"), _names("numpy msgspec")),
    "link": _Rule(_names("errors layout"), _names("numpy msgspec")),
    "files": _Rule(_names("errors"), _names("msgspec")),
    # Versions of the user's own files and robots; models are looked into only where there are some.
    "own_modules": _Rule(frozenset(), frozenset()),
    "identity": _Rule(_names("own_modules morphology"), _names("gymnasium msgspec")),
    "tensor_file": _Rule(_names("errors"), _names("numpy msgspec safetensors")),
    # Selection of the OpenGL library.
    "rendering": _Rule(_names("errors")),
    # Models and edits: no environment, no reward, no robot.
    "morphology": _Rule(_names("errors layout own_modules"), _names("numpy msgspec mujoco")),
    "bodies": _Rule(_names("errors layout morphology"), never=_HARDWARE | {"torch"}),
    # Courses, their scenes, and the expert that drives them with a vehicle.
    "worlds": _Rule(_names("errors rendering bodies"), never=_HARDWARE | {"torch", "gymnasium"}),
    # Rewards and endings: no model file.
    "tasks": _Rule(_names("errors layout contract"), _names("numpy msgspec scipy")),
    # Envs join bodies and tasks. A vehicle's env runs the whole robot in one process, and the
    # remote ones reach it over the link.
    "envs": _Rule(
        _names("errors layout contract rendering morphology bodies tasks")
        | _names("link robot remote twin worlds identify envs.warp"),
        never=_HARDWARE | {"torch"},
    ),
    # Worlds on a device are imported only when asked for: their results are tensors.
    "envs.warp": _Rule(_names("errors layout morphology bodies tasks envs"), never=_HARDWARE),
    # Transfer does not distinguish simulators from robots. Cloning is one of its learners.
    "transfer": _Rule(
        _names("contract errors files identity layout own_modules demos shapechanger tensor_file"),
        never=_HARDWARE | _SIMULATORS,
    ),
    "reports": _Rule(
        _names("contract errors files layout transfer demos identify bodies"),
        never=_HARDWARE | _SIMULATORS,
    ),
    # The exam for third-party envs.
    "contract": _Rule(_names("errors layout identity"), never=_HARDWARE | _SIMULATORS),
    # Runs on the robot. From `demos` it uses the writer of episodes, which needs no other package.
    "robot": _Rule(_names("errors layout link demos"), never=_HEAVY | {"gymnasium"}),
    "remote": _Rule(_names("errors layout link tasks"), never=_HEAVY),
    "twin": _Rule(_names("errors layout link robot remote morphology bodies tasks worlds")),
    # Observations and actions, not sockets or pins.
    "teleop": _Rule(_names("errors layout demos"), never=_HARDWARE | _HEAVY | {"socket"}),
    "demos": _Rule(
        _names("errors files identity layout tensor_file"),
        never=_HARDWARE | _SIMULATORS | {"socket"},
    ),
    # Files in a repository of the Hugging Face Hub; what they hold is others' business.
    "hub": _Rule(_names("errors"), _names("huggingface_hub")),
    # The command line composes everything, and nothing imports it.
    "cli": _Rule(
        _names("errors files layout link morphology bodies tasks envs transfer robot remote twin")
        | _names(
            "teleop demos reports contract shapechanger rendering worlds identify identity hub"
        )
        | _names("contract own_modules")
    ),
    "identify": _Rule(
        _names("errors layout morphology bodies tasks"),
        _names("mujoco scipy numpy msgspec"),
    ),
    # The package registers the ids; other names are imported on first use.
    "shapechanger": _Rule(
        _names("errors layout contract envs demos identify morphology remote transfer"),
        _names("gymnasium numpy msgspec"),
    ),
}


def _modules() -> Iterator[tuple[str, Path]]:
    """Yield the dotted name of every module below src, with its file."""
    for path in sorted(_SRC.rglob("*.py")):
        parts = path.relative_to(_SRC).with_suffix("").parts
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


_MODULES = dict(_modules())


def _package(module: str) -> str:
    """Return the key of the rule for a module, such as `envs` for `shapechanger.envs.ant`."""
    parts = module.split(".")
    if len(parts) == 1:
        return parts[0]
    if parts[1:3] == ["envs", "warp"]:
        return "envs.warp"
    return "cli" if parts[1] == "__main__" else parts[1]


def _imported(module: str, path: Path) -> Iterator[str]:
    """Yield the dotted name of everything that a file imports, anywhere in the file."""
    is_package = path.name == "__init__.py"
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            source = node.module or ""
            if node.level:
                parents = module.split(".")[: None if is_package else -1]
                base = parents[: len(parents) + 1 - node.level]
                source = ".".join([*base, *filter(None, [node.module])])
            for alias in node.names:
                whole = f"{source}.{alias.name}"
                yield whole if whole in _MODULES else source


def _violations(module: str) -> Iterator[str]:
    """Yield the imports of a module that the rule of its package forbids."""
    package = _package(module)
    rule = _RULES[package]  # A new package needs a rule first.
    for name in _imported(module, _MODULES[module]):
        top = name.split(".")[0]
        if top == "shapechanger":
            if _package(name) not in rule.ours | {package}:
                yield f"{module} imports {name}"
        elif top in rule.never or (
            rule.theirs is not None
            and top not in sys.stdlib_module_names
            and top not in rule.theirs
        ):
            yield f"{module} imports {name}"


def test_imports_obey_the_rules_of_the_packages() -> None:
    """Each package imports only what its rule allows."""
    assert [line for module in _MODULES for line in _violations(module)] == []


def _top_level_imports(module: str, path: Path) -> Iterator[str]:
    """Yield the modules that importing `module` loads, by its top-level statements."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if whole in _MODULES else node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def _cycles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Return the strongly connected components of more than one node."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in graph[node]:
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            part = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(part) > 1:
                found.append(sorted(part))

    for node in graph:
        if node not in index:
            visit(node)
    return found


def test_no_import_cycles() -> None:
    """Neither modules nor top-level packages import each other in a circle."""
    modules = {
        module: {name for name in _top_level_imports(module, path) if name in _MODULES} - {module}
        for module, path in _MODULES.items()
    }
    assert _cycles(modules) == []
    packages: dict[str, set[str]] = {}
    for module, names in modules.items():
        known = packages.setdefault(_package(module), set())
        known |= {_package(name) for name in names} - {_package(module)}
    assert _cycles(packages) == []


def test_public_classes_have_distinct_names() -> None:
    """No two public classes share a name."""
    places: dict[str, list[str]] = {}
    for module, path in _MODULES.items():
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(module)
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def test_no_file_is_longer_than_600_lines() -> None:
    """No module has more than 600 lines."""
    lengths = {module: path.read_text().count("\n") for module, path in _MODULES.items()}
    assert {module: count for module, count in lengths.items() if count > 600} == {}


@pytest.mark.parametrize(
    ("package", "forbidden"),
    [
        ("shapechanger", _HEAVY | _SIMULATORS | {"tyro", "rich", "scipy", "tensorboard"}),
        ("shapechanger.transfer", _SIMULATORS | {"matplotlib"}),
        ("shapechanger.link", _HEAVY | _SIMULATORS),
        ("shapechanger.robot", _HEAVY | _SIMULATORS),
    ],
)
def test_import_loads_no_heavy_packages(package: str, forbidden: frozenset[str]) -> None:
    """Importing a package loads no simulator and no other heavy package."""
    script = f"import sys, {package}; print(*sys.modules)"
    run = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True, cwd=_SRC
    )
    assert not forbidden & set(run.stdout.split())


def test_exported_names_exist_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only packages have `__all__`, and its names exist and are unique."""
    monkeypatch.chdir(tmp_path)  # lgpio creates a named pipe in the working directory.
    wrong: list[str] = []
    for module in _MODULES:
        if any(part.startswith("_") for part in module.split(".")):
            continue
        if module == _NEEDS_LGPIO and importlib.util.find_spec("lgpio") is None:
            continue  # lgpio has no wheel for this Python or system.
        imported = importlib.import_module(module)
        exported: list[str] = getattr(imported, "__all__", [])
        if exported and _MODULES[module].name != "__init__.py":
            wrong.append(f"{module}: `__all__` belongs in packages")
        wrong += [f"{module}.{name}" for name in exported if not hasattr(imported, name)]
        wrong += [f"{module}: {name} twice" for name in set(exported) if exported.count(name) > 1]
    assert wrong == []


def test_every_folder_is_a_package() -> None:
    """Every folder has an `__init__.py`; others would escape these checks."""
    folders = {path.parent for path in _MODULES.values()}
    assert [folder for folder in folders if not (folder / "__init__.py").exists()] == []


def test_nothing_is_called_utils() -> None:
    """No module has a name without meaning, such as `utils`."""
    names = {part for module in _MODULES for part in module.split(".")}
    assert not names & {"common", "helpers", "misc", "util", "utils"}
