"""Rules for modules; the contracts of imports are in pyproject.toml (`lint-imports`)."""

import ast
import importlib
import importlib.util
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytestmark = pytest.mark.sources

_SRC = Path(__file__).resolve().parents[1] / "src"
_HEAVY = frozenset({"cv2", "matplotlib", "mujoco", "ray", "stable_baselines3", "torch"})
_SIMULATORS = frozenset({"mujoco", "glfw", "OpenGL"})
_NEEDS_LGPIO = "shapechanger.robot.lgpio_pins"


def _modules() -> Iterator[tuple[str, Path]]:
    """Yield the dotted name of every module below src, with its file."""
    for path in sorted(_SRC.rglob("*.py")):
        parts = path.relative_to(_SRC).with_suffix("").parts
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


_MODULES = dict(_modules())


def test_public_classes_have_distinct_names() -> None:
    places: dict[str, list[str]] = {}
    for module, path in _MODULES.items():
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(module)
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def test_no_file_is_longer_than_600_lines() -> None:
    lengths = {module: path.read_text().count("\n") for module, path in _MODULES.items()}
    assert {module: count for module, count in lengths.items() if count > 600} == {}


@pytest.mark.parametrize(
    ("package", "forbidden"),
    [
        ("shapechanger", _HEAVY | _SIMULATORS | {"tyro", "rich", "scipy", "tensorboard"}),
        ("shapechanger.transfer", _SIMULATORS | {"matplotlib"}),
        ("shapechanger.robot.link", _HEAVY | _SIMULATORS),
        ("shapechanger.robot", _HEAVY | _SIMULATORS),
    ],
)
def test_import_loads_no_heavy_packages(package: str, forbidden: frozenset[str]) -> None:
    script = f"import sys, {package}; print(*sys.modules)"
    run = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True, cwd=_SRC
    )
    assert not forbidden & set(run.stdout.split())


def test_exported_names_exist_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_imports_inside_functions_are_few_and_have_reasons() -> None:
    """An import of our own modules has a comment, on its line or above it, with the reason."""
    found = 0
    for path in _MODULES.values():
        text = path.read_text()
        lines = text.splitlines()
        for function in ast.walk(ast.parse(text)):
            if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
                for node in ast.walk(function):
                    if isinstance(node, ast.ImportFrom) and "shapechanger" in (node.module or ""):
                        found += 1
                        near = lines[node.lineno - 2 : node.end_lineno]
                        assert any("# " in line for line in near), (path, node.lineno)
    assert 0 < found <= 40


def test_the_picture_of_the_architecture_shows_the_imports() -> None:
    """It omits the imports of `cli`, which imports all, and of the files that all may import."""
    apart = {"cli", "contract", "errors", "files", "identity", "layout", "registry"}
    found: set[tuple[str, str]] = set()
    for path in _SRC.rglob("shapechanger/*/**/*.py"):
        package = path.relative_to(_SRC / "shapechanger").parts[0]
        names = re.findall(r"from shapechanger\.(\w+)", path.read_text())
        found |= {(package, name) for name in names if name != package}
    picture = (_SRC.parent / "CONTRIBUTING.md").read_text()
    drawn = re.findall(r"^ +(\w+) --> (.+)$", picture, re.MULTILINE)
    arrows = {(one, other) for one, others in drawn for other in others.split(" & ")}
    assert {arrow for arrow in arrows if "cli" not in arrow} == {
        arrow for arrow in found if not apart & {*arrow}
    }


def test_no_string_outside_cli_names_its_modules() -> None:
    """`lint-imports` would not see that a program is started by the name of a module of `cli`."""
    found = [
        f"{module}: {node.value!r}"
        for module, path in _MODULES.items()
        if not module.startswith("shapechanger.cli")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant) and "shapechanger.cli" in str(node.value)
    ]
    assert found == []


def test_folders_are_packages_and_no_module_is_called_utils() -> None:
    """Folders without an `__init__.py` would escape these checks."""
    folders = {path.parent for path in _MODULES.values()}
    assert [folder for folder in folders if not (folder / "__init__.py").exists()] == []
    names = {part for module in _MODULES for part in module.split(".")}
    assert not names & {"common", "helpers", "misc", "util", "utils"}
