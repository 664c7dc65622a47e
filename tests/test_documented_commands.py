"""Commands that README, docs and examples show, checked by the real parser and not run."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final

import pytest

from benchmarks.run import SUITES
from shapechanger.cli.main import Group, find_command, options_of, parse
from shapechanger.cli.policies import POLICY_FILES
from shapechanger.envs.catalogue import env_ref
from shapechanger.errors import ShapechangerError

ROOT: Final = Path(__file__).parents[1]
PAGES: Final = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "src").rglob("*.md")),
    *sorted((ROOT / "examples").rglob("*.md")),
    *sorted((ROOT / "examples").rglob("*.py")),
]
FOREIGN: Final = {
    *("--cov", "--fps"),
    *("--system-site-packages", "--head", "--port", "--block"),
    *("--robot", "--teleop", "--dataset"),
}
"""Options of other programs that pages name without the program."""

_FENCE: Final = re.compile(r"^( *)```(\w*)\n(.*?)^\1```", re.DOTALL | re.MULTILINE)
_SPAN: Final = re.compile(r"(?<!`)`([^`\n]+(?:\n[^`\n]+)?)`(?!`)")
_PYTHON: Final = ("py", "python")  # Python blocks run in test_docs.py.
_OURS: Final = re.compile(r"(?:^|[\s/;&|])shapechanger (?=[a-z])")
_NO_COMMANDS: Final = {"shapechanger link 1"}  # Part of the message that proves a key.


def _blocks(page: Path) -> list[str]:
    """Return the commands `shapechanger ...` of a page's blocks."""
    text = page.read_text()
    blocks = [body for _, language, body in _FENCE.findall(text) if language not in _PYTHON]
    outside = _FENCE.sub("", text).splitlines()
    # Blocks that are indented instead of fenced, and the comments of scripts.
    blocks += [line for line in outside if line.startswith(("    ", "#")) and "`" not in line]
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    found = ((line, match) for line in lines for match in _OURS.finditer(line))
    return [re.split(r" (?:&&|\||;|>) ", line[match.end() :])[0] for line, match in found]


def spans(page: Path) -> list[str]:
    """Return each inline code of a page, on one line."""
    return [" ".join(span.split()) for span in _SPAN.findall(_FENCE.sub("", page.read_text()))]


@cache
def leaves() -> dict[tuple[str, ...], type]:
    """Return the class of every command, keyed by its names."""
    found: dict[tuple[str, ...], type] = {}

    def walk(words: tuple[str, ...]) -> None:
        kind = find_command(words)[1]
        if isinstance(kind, Group):
            for name in kind.commands:
                walk((*words, name))
        else:
            found[words] = kind

    walk(())
    return found


def refusal(words: list[str]) -> str:
    """Return the error of a command line; "" if it is valid and its envs exist."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            command = parse(words)
        for name in ("env", "other", "source", "target"):
            env_id = getattr(command, name, "")
            is_name = isinstance(env_id, str) and env_id and not env_id.isupper()  # A placeholder.
            if is_name and not env_id.endswith(POLICY_FILES):
                env_ref(env_id)
    except ShapechangerError as error:
        return str(error)
    except SystemExit as stop:
        return "" if stop.code in (None, 0) else said.getvalue()
    return ""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_of_a_page_exist(page: Path) -> None:
    """A command of a block is complete; one of inline code exists, with the options it names."""
    commands = {one: shlex.split(one.replace("…", "X"), comments=True) for one in _blocks(page)}
    assert {one: why for one, words in commands.items() if (why := refusal(words))} == {}
    inline = {span: [*_readings(span)] for span in spans(page) if span not in _NO_COMMANDS}
    assert [span for span, ways in inline.items() if ways and not any(map(_exists, ways))] == []
    known = {name for kind in leaves().values() for name in options_of(kind)}
    named = {re.split(r"[ =.]", span)[0] for span in spans(page) if span.startswith("--")}
    assert named - known - FOREIGN - {"--help"} == set()


def test_there_are_at_most_forty_commands() -> None:
    assert len(leaves()) <= 40


def _exists(words: list[str]) -> bool:
    """Return whether a command and the options that it is given exist."""
    try:
        _, kind = find_command(words)
    except ShapechangerError:
        return False
    known = {"--help"} if isinstance(kind, Group) else {*options_of(kind), "--help"}
    named = {word.partition("=")[0] for word in words if word.startswith("--")}
    return all(name in known or name.replace("--no-", "--", 1) in known for name in named)


def _readings(span: str) -> Iterator[list[str]]:
    """Yield the command lines that a span can mean; none if it is no command."""
    try:
        words = shlex.split(span)
    except ValueError:
        return
    if len(words) > 1 and words[0] == "shapechanger":
        yield words[1:]
    elif len(words) > 1 and words[0] in {path[0] for path in leaves()}:
        yield words
    elif any(word.startswith("--") for word in words[1:]):
        yield from ([*path[:-1], *words] for path in leaves() if path[-1] == words[0])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_other_commands_exist(page: Path) -> None:
    """Targets of make, rows of the benchmarks, scripts and modules exist."""
    code = "\n".join([*(body for _, _, body in _FENCE.findall(page.read_text())), *spans(page)])
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert {*re.findall(r"^make(?: [A-Z]+=\S+)* ([a-z-]+)", code, re.MULTILINE)} <= {*targets}
    rows = " ".join(re.findall(r"python -m benchmarks\.run((?: [a-z-]+)*)", code))
    assert {*rows.split()} <= {*SUITES}
    scripts = re.findall(r"python (\S+\.py)", code) if page.suffix != ".py" else []
    assert [script for script in scripts if not (ROOT / script).exists()] == []
    modules = re.findall(r"python -m (shapechanger[\w.]*)", code)
    assert [module for module in modules if not importlib.util.find_spec(module)] == []


def test_a_wrong_command_is_found() -> None:
    """A command, an option and a value that do not exist are refused; commands are found."""
    assert len(_blocks(ROOT / "docs" / "studies.md")) > 10
    assert len([span for span in spans(ROOT / "docs" / "build.md") if [*_readings(span)]]) > 10
    assert refusal(["suite", "run", "ants"]) == ""
    assert "no-such" in refusal(["suite", "no-such"])
    assert "Antt" in refusal(["transfer", "Ant", "Antt"])
    assert "--sedes" in refusal(["suite", "run", "ants", "--sedes", "3"])
    assert refusal(["suite", "run", "ants", "--seeds", "many"]) != ""
    assert refusal(["robot", "serve"]) != ""  # Its profile is missing.
    assert _exists(["robot", "serve", "--no-announce"])
    assert not _exists(["robot", "serve", "--anounce"])
