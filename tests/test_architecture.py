"""The direction of imports: who may know whom, and what loads what."""

import ast
import importlib
import importlib.util
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

_SRC = Path(__file__).resolve().parents[1] / "src"
_HARDWARE = frozenset({"aiohttp", "gpiozero", "lgpio", "picamera2", "serial", "smbus2", "zeroconf"})
_HEAVY = frozenset({"cv2", "matplotlib", "mujoco", "ray", "stable_baselines3", "torch"})
_SIMULATORS = frozenset({"mujoco", "glfw", "OpenGL"})
_NEED_LGPIO = frozenset(
    f"shapechanger.robot.drivers.{name}" for name in ("lgpio_pins", "lgpio_servo")
)


@dataclass(frozen=True, slots=True)
class _Rule:
    """What one package may import, at the top of a file or inside a function.

    Attributes:
        ours: Packages of Shapechanger besides itself.
        theirs: Packages of others besides the standard library; None for any.
        never: Packages of others, or of the standard library, that it must not know.
    """

    ours: frozenset[str]
    theirs: frozenset[str] | None = None
    never: frozenset[str] = frozenset()


def _names(text: str) -> frozenset[str]:
    return frozenset(text.split())


# Packages that do not exist yet are here already, so that they are born under their rule.
_RULES = {
    # The words that both sides share, on a workstation and on a Pi.
    "errors": _Rule(_names("layout link"), _names("numpy msgspec")),
    # Pages of reports, whatever they report.
    "pages": _Rule(_names("errors"), _names("numpy matplotlib")),
    # Which OpenGL draws here.
    "headless": _Rule(_names("errors")),
    "layout": _Rule(_names("errors link"), _names("numpy msgspec")),
    "link": _Rule(_names("errors layout"), _names("numpy msgspec")),
    # Bodies: no environment, no reward, no robot.
    "morphology": _Rule(_names("errors layout"), _names("numpy msgspec mujoco")),
    # Of `worlds` they know how a pose is written down.
    "embodiments": _Rule(_names("errors layout morphology worlds"), never=_HARDWARE | {"torch"}),
    # Places to drive in, and a vehicle in one of them.
    "worlds": _Rule(
        _names("errors headless embodiments"), never=_HARDWARE | {"torch", "gymnasium"}
    ),
    # Rewards and endings: no model file.
    "tasks": _Rule(_names("errors layout"), _names("numpy msgspec")),
    # Only the envs join bodies and tasks. A vehicle's env is its whole robot in one process, and a
    # finger's tells what the finger is like.
    "envs": _Rule(
        _names("errors layout headless morphology embodiments tasks")
        | _names("link robot remote twin worlds identify"),
        never=_HARDWARE | {"torch"},
    ),
    # Transfer cannot tell a simulator from a car. It writes our version into what it leaves behind,
    # and cloning is one of its learners.
    "transfer": _Rule(
        _names("errors layout demos pages shapechanger"), never=_HARDWARE | _SIMULATORS
    ),
    # The exam for anybody's env, simulated or real.
    "testing": _Rule(_names("errors layout transfer"), never=_HARDWARE | _SIMULATORS),
    # The robot's side: of `demos` it knows the writer of episodes, which needs nothing.
    "robot": _Rule(_names("errors layout link demos"), never=_HEAVY | {"gymnasium"}),
    "remote": _Rule(_names("errors layout link tasks"), never=_HEAVY),
    # One that is served is reached as every robot is.
    "twin": _Rule(_names("errors layout link robot remote morphology embodiments tasks worlds")),
    # Observations and actions, not sockets or pins.
    "teleop": _Rule(_names("errors layout demos"), never=_HARDWARE | _HEAVY | {"socket"}),
    "demos": _Rule(_names("errors layout"), never=_HARDWARE | _SIMULATORS | {"socket"}),
    # It composes what must not know each other, and nobody imports it.
    "cli": _Rule(
        _names("errors layout link morphology embodiments tasks envs transfer robot remote twin")
        | _names("teleop demos pages testing shapechanger headless worlds identify")
    ),
    # What a finger is like, from a log; whoever has written it.
    "identify": _Rule(
        _names("errors layout morphology embodiments tasks pages"),
        _names("mujoco scipy numpy msgspec"),
    ),
    # The package itself registers the ids.
    "shapechanger": _Rule(_names("errors layout envs"), _names("gymnasium numpy msgspec")),
}


def _modules() -> Iterator[tuple[str, Path]]:
    """The dotted name of every module below src, with its file."""
    for path in sorted(_SRC.rglob("*.py")):
        parts = path.relative_to(_SRC).with_suffix("").parts
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


_MODULES = dict(_modules())


def _package(module: str) -> str:
    """The key of the rule for a module: `shapechanger.envs.ant` obeys that of `envs`."""
    parts = module.split(".")
    if len(parts) == 1:
        return parts[0]
    return "cli" if parts[1] == "__main__" else parts[1]


def _imported(module: str, path: Path) -> Iterator[str]:
    """The dotted name of everything that a file imports, wherever in the file."""
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


@pytest.mark.parametrize("module", _MODULES)
def test_imports_obey_the_rule_of_the_package(module: str) -> None:
    """Who knows too much cannot be reused, tested or run on a Pi."""
    package = _package(module)
    rule = _RULES[package]  # A new package needs a rule first.
    for name in _imported(module, _MODULES[module]):
        top = name.split(".")[0]
        if top == "shapechanger":
            assert _package(name) in rule.ours | {package}, f"{module} imports {name}"
            continue
        assert top not in rule.never, f"{module} imports {name}"
        if rule.theirs is not None and top not in sys.stdlib_module_names:
            assert top in rule.theirs, f"{module} imports {name}"


@pytest.mark.parametrize(
    ("package", "forbidden"),
    [
        ("shapechanger", _HEAVY | _SIMULATORS | {"tyro", "rich", "scipy", "tensorboard"}),
        ("shapechanger.transfer", _SIMULATORS | {"matplotlib"}),
        ("shapechanger.link", _HEAVY | _SIMULATORS),
        ("shapechanger.robot", _HEAVY | _SIMULATORS),
    ],
)
def test_import_stays_light(package: str, forbidden: frozenset[str]) -> None:
    """Who wants a layout, a metric or two motors must not wait for a simulator."""
    if package not in _MODULES:
        pytest.skip(f"{package} does not exist yet.")
    script = f"import sys, {package}; print(*sys.modules)"
    run = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True, cwd=_SRC
    )
    assert not forbidden & set(run.stdout.split())


@pytest.mark.parametrize(
    "module", [m for m in _MODULES if not any(part.startswith("_") for part in m.split("."))]
)
def test_modules_export_what_they_say(
    module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`__all__` is there, names what exists, and names nothing twice."""
    if module in _NEED_LGPIO and importlib.util.find_spec("lgpio") is None:
        pytest.skip("lgpio is not installed: it has no wheel for this Python or system.")
    monkeypatch.chdir(tmp_path)  # lgpio makes a named pipe in the working directory.
    imported = importlib.import_module(module)
    exported: list[str] = imported.__all__
    assert [name for name in exported if not hasattr(imported, name)] == []
    assert len(set(exported)) == len(exported)


def test_every_folder_is_a_package() -> None:
    """A folder without an `__init__.py` would be left out of every check here."""
    folders = {path.parent for path in _MODULES.values()}
    assert [folder for folder in folders if not (folder / "__init__.py").exists()] == []


def test_nothing_is_called_utils() -> None:
    """A module is named after the one idea it holds."""
    names = {part for module in _MODULES for part in module.split(".")}
    assert not names & {"common", "helpers", "misc", "util", "utils"}
