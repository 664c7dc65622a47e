"""Mutation tests of the files that a robot's safety and a study's numbers depend on.

mutmut changes one operator, number or name of a function at a time, and runs the tests that call
the function; a mutant is killed if one of them fails. `make mutants` runs all of them, some hours
on two cores; `ONLY="guard metrics" make mutants` runs some. Results are kept in `mutants/`, so
that mutants of unchanged functions need not run again.

Mutants are not counted if they only change the text of an error, a type for checkers, or `strict`
of `zip`. Mutants in `equivalent_mutants.toml`, which are equivalent to the original for the reasons
given there, are not counted either.
"""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Final, cast

from benchmarks.row import Row, asked

MODULES: Final = {
    "guard": "robot/guard",
    "link": "robot/link",
    "limits": "contract/limits",
    "library": "robot/daemon/library",
    "process": "robot/daemon/process:GuardLink",  # The rest runs in its own process.
    "waypoints": "vehicles/waypoints",
    "body_map": "transfer/body_map",
    "transplant": "transfer/transplant",
    "metrics": "transfer/metrics",
    "episodes": "demos/episodes",
    "vector": "envs/vector",
    "edits": "morphology/edits",
    "certificate": "morphology/certificate",
}
_RENDERS: Final = "vehicles/waypoints:WaypointView"  # Its tests need a renderer.
_Function = ast.FunctionDef | ast.AsyncFunctionDef
_FOLDER: Final = Path("mutants")
_SRC: Final = _FOLDER / "src" / "shapechanger"
_EQUIVALENT: Final = Path(__file__).with_name("equivalent_mutants.toml")
_PAGE: Final = Path("docs", "mutants.md")
_ALIVE: Final = (0, 5, 33)  # Exit codes: no test failed, or none calls the function.
_TARGET: Final = 0.95
_INTRODUCTION: Final = """# Mutants

[Mutation tests](https://en.wikipedia.org/wiki/Mutation_testing) of the files that a robot's safety
and a study's numbers depend on: `make mutants` changes one place of a function at a time, and a
mutant is killed if a test fails. Changes of only the text of an error, of types for checkers and of
`strict` of `zip` are not counted, and
[equivalent mutants](../benchmarks/equivalent_mutants.toml), which no test could notice, are listed
with their reasons. `waypoints` is without `WaypointView`, whose tests need a renderer, and
`process` is only the link to the guard. The survivors follow the table, each with the line that it
changed. Each row is from the last complete run of its module.
"""


def mutants() -> Iterator[Row]:
    """Yield the share of killed mutants of each module, and write the page of the survivors.

    The row of a module that did not run completely has the numbers that the page shows.
    """
    chosen = asked("module", MODULES)
    patterns = [
        f"shapechanger.{MODULES[name].replace('/', '.').replace(':', '.*')}*" for name in chosen
    ]
    children = str(os.cpu_count() or 1)
    command = [sys.executable, "-m", "mutmut", "run", "--max-children", children, *patterns]
    shutil.rmtree(_FOLDER / "tests", ignore_errors=True)  # mutmut keeps tests that were deleted.
    run = subprocess.run(command, check=False, capture_output=True, text=True)
    if run.returncode:
        last = (run.stdout + run.stderr)[-2000:]
        raise RuntimeError(f"mutmut stopped with {run.returncode}: {last}")
    equivalent = {
        (one["function"], one["line"]) for one in tomllib.loads(_EQUIVALENT.read_text())["mutant"]
    }
    before = _PAGE.read_text(encoding="utf-8")
    page = [_INTRODUCTION, "| module | killed | survived | equivalent |\n| --- | --- | --- | --- |"]
    survivors: list[str] = []
    for name, place in MODULES.items():
        counts: Counter[str] = Counter()
        found: list[str] = []
        for path in _metas(place.partition(":")[0]) if name in chosen else ():
            for function, line, status in _judged(path, equivalent):
                if function.startswith(place) and not function.startswith(_RENDERS):
                    counts[status] += 1
                    if status == "survived":
                        found.append(f"- `{function}`: `{line}`")
        ran = ""
        if counts["did not run"] or not counts["killed"] + counts["survived"]:
            numbers = re.search(rf"^\| {name} \| (\d+) of .* \| (\d+) \| (\d+) \|$", before, re.M)
            if numbers is None:
                continue
            killed, alive, equal = map(int, numbers.groups())
            found = re.findall(rf"^- `{place}.*$", before, re.M)
            ran = ", from an earlier run"
        else:
            killed, alive, equal = counts["killed"], counts["survived"], counts["equivalent"]
        survivors += found
        share = killed / (killed + alive)
        page.append(f"| {name} | {killed} of {killed + alive} ({share:.1%}) | {alive} | {equal} |")
        yield Row(
            f"mutants of {name}: killed",
            f"{share:.1%}",
            f"{killed} of {killed + alive}; {equal} equivalent{ran}",
            f">= {_TARGET:.0%}",
            share >= _TARGET,
        )
    page += ["\n## Survivors\n", *survivors] if survivors else []
    _PAGE.write_text("\n".join(page) + "\n", encoding="utf-8")


def _metas(place: str) -> list[Path]:
    """Return the results of a file without its suffix, or of all files of a folder."""
    return [*_SRC.glob(f"{place}.py.meta"), *sorted((_SRC / place).rglob("*.py.meta"))]


def _judged(path: Path, equivalent: set[tuple[str, str]]) -> Iterator[tuple[str, str, str]]:
    """Yield function, changed line and status of each mutant of a file."""
    source = ast.parse(path.with_suffix("").read_text(encoding="utf-8"))
    functions = {n.name: n for n in ast.walk(source) if isinstance(n, _Function)}
    for key, code in json.loads(path.read_text())["exit_code_by_key"].items():
        mangled = key.rpartition(".")[2]
        original = functions[mangled.rpartition("__mutmut_")[0] + "__mutmut_orig"]
        mutant = functions[mangled]
        module = path.relative_to(_SRC).with_suffix("").with_suffix("").as_posix()
        function = f"{module}:{_plain(mangled)}"
        line = _changed(original, mutant)
        if code is None:
            status = "did not run"
        elif code not in _ALIVE:
            status = "killed"
        elif (function, line) in equivalent:
            status = "equivalent"
        else:
            status = "survived"
        if code is not None and _noticeable(original) == _noticeable(mutant):
            status = "not counted"
        yield function, line, status


def _plain(mangled: str) -> str:
    """Return the name of a function as in its source, such as `Rules.tick`."""
    name = mangled.rpartition("__mutmut_")[0].removeprefix("x")
    return name.removeprefix("ǁ").replace("ǁ", ".") if name.startswith("ǁ") else name[1:]


def _changed(original: _Function, mutant: _Function) -> str:
    """Return the first line of a mutant that differs from the original's."""
    before, after = (
        "\n".join(ast.unparse(one) for one in function.body).splitlines()
        for function in (original, mutant)
    )
    lines = (new.strip() for old, new in zip(before, after, strict=False) if old != new)
    return next(lines, "")


def _noticeable(function: _Function) -> str:
    """Return the body of a function without the parts that tests need not check."""
    body = ast.parse("\n".join(ast.unparse(one) for one in function.body))
    return ast.dump(_Noticeable().visit(body))


class _Noticeable(ast.NodeTransformer):
    """Remove the texts of errors, types for checkers, and `strict` of `zip`."""

    def visit_Raise(self, node: ast.Raise) -> ast.Raise:
        for text in (one for one in ast.walk(node) if isinstance(one, ast.Constant)):
            if isinstance(text.value, str):
                text.value = ""
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AnnAssign:
        node.annotation = ast.Constant("")
        return cast("ast.AnnAssign", self.generic_visit(node))

    def visit_Call(self, node: ast.Call) -> ast.AST:
        if ast.unparse(node.func) == "cast":
            return self.visit(node.args[-1])
        node.keywords = [one for one in node.keywords if one.arg != "strict"]  # Of `zip`.
        return self.generic_visit(node)
