"""Hooks of MkDocs for the site, which `make docs` builds: pages from the code, and clips.

Files of the site have the same paths as in the repository, so that relative links work in both,
such as `../CONTRIBUTING.md` in `docs/atlas.md`. Comments such as `<!-- keys: profile limits -->`
are replaced by tables of the keys of profiles and messages.
"""

import html
import json
import posixpath
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from inspect import cleandoc, formatannotation
from pathlib import Path
from typing import Any, Final, get_type_hints

import griffe
import msgspec
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from msgspec import inspect

from scripts.site_pages import api_pages, environment_pages, wiring_pages
from scripts.wiring_diagrams import table
from shapechanger.contract.pages import Page
from shapechanger.robot.drivers.chip import Keys
from shapechanger.robot.drivers.pins import Pin
from shapechanger.robot.link.messages import ClientMessage, RobotMessage
from shapechanger.robot.profile.profile import QUANTITIES, RobotTable
from shapechanger.robot.profile.read import DRIVERS, GIVEN, TABLES
from shapechanger.robot.profile.toml import fields_of, permitted

ROOT: Final = Path(__file__).resolve().parents[1]
_DOCS: Final = "docs/"
_ALWAYS: Final = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md")
"""Files outside `docs` that the navigation names."""

_LINK: Final = re.compile(r"\]\(([^)\s#]+)")
# Text that only the site shows, because it links to pages that no code host has.
_ONLY_HERE: Final = re.compile(r"<!-- site: (.*?) -->", re.DOTALL)
# An image that leads to a clip: code hosts show no clips inside a page.
_CLIP: Final = re.compile(r"\[!\[([^\]]*)\]\(([^)\s]+)\)\]\(([^)\s]+\.webm)\)")
_PLAYER: Final = (
    '<video controls loop muted playsinline preload="none" aria-label="{}" poster="{}" src="{}">'
    "</video>"
)
_SEARCH: Final = '<div class="md-search" data-md-component="search" role="dialog"'
_EXAMPLE: Final = re.compile(r"(?:^>>> .*\n?(?:^(?!$).*\n?)*)+", re.MULTILINE)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages from the code, the home page, and the files that pages link to."""

    def add(path: str, **source: Any) -> None:
        file = File.generated(config, path, **source)
        file.dest_uri = file.dest_uri.removeprefix(_DOCS)
        files.append(file)

    for file in [*files]:
        if file.src_dir == config.docs_dir:
            files.remove(file)
            add(_DOCS + file.src_uri, abs_src_path=file.abs_src_path)
    pages = [file.src_uri for file in files.documentation_pages()]
    found = [*pages, *_ALWAYS]
    for path in found:  # The list grows by the files that its pages link to.
        if path not in pages:
            add(path, abs_src_path=str(ROOT / path))
        if path.endswith(".md"):
            links = _LINK.findall((ROOT / path).read_text())
            targets = {posixpath.normpath(posixpath.join(path, "..", link)) for link in links}
            found += [one for one in targets if one not in found and (ROOT / one).is_file()]
    sections: dict[str, list[str]] = {}
    for made in (environment_pages(), wiring_pages(), api_pages()):
        for path, content in made.items():
            add(_DOCS + path, content=content)
        index, *others = (_DOCS + path for path in made if path.endswith(".md"))
        sections[index] = [index, *others]
    config.nav = _extended(config.nav, sections)
    return files


def _extended(nav: Any, sections: dict[str, list[str]]) -> Any:
    """Return the navigation with the pages of each section after its index."""
    if isinstance(nav, dict):
        return {title: _extended(part, sections) for title, part in nav.items()}
    if isinstance(nav, list):
        return sections.get(str(nav[0])) or [_extended(part, sections) for part in nav]
    return nav


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Add the tables of keys and the players of clips to a page."""
    markdown = _ONLY_HERE.sub(r"\1", with_keys(markdown))
    return _CLIP.sub(lambda match: _PLAYER.format(*map(html.escape, match.groups())), markdown)


def on_post_page(output: str, **_: Any) -> str:
    """Name the theme's search dialog for screen readers."""
    return output.replace(_SEARCH, f'{_SEARCH} aria-label="Search"', 1)


class FencedExamples(griffe.Extension):
    """Show inherited sections of pages, and fence examples; in Markdown `>>>` would quote them."""

    def on_instance(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite the docstring of an object that Griffe has read."""
        if obj.docstring is not None:
            loaded: Any = getattr(sys.modules.get(obj.module.path), obj.name, None)
            inherits = isinstance(loaded, type) and issubclass(loaded, Page)
            text = cleandoc(loaded.__doc__ or "") if inherits else obj.docstring.value
            obj.docstring.value = _EXAMPLE.sub(lambda m: f"```pycon\n{m[0].rstrip()}\n```\n", text)


_MARK: Final = re.compile(r"^<!-- keys: (\w+) (\w+) -->$", re.MULTILINE)
_HEAD: Final = ("Key", "Values", "Default", "Meaning")


def with_keys(markdown: str) -> str:
    """Return a page in which tables of keys replace their comments."""
    made = {"profile": _profile_table, "messages": _messages}
    return _MARK.sub(lambda mark: "\n\n".join(filter(None, made[mark[1]](mark[2]))), markdown)


def _profile_table(name: str) -> Iterator[str]:
    """Yield the keys of a table of a profile, and those of each driver that it may name."""
    chosen = DRIVERS.get(name, {})
    yield _keys(TABLES[name], chosen)
    for choosing, chips in chosen.items():
        for driver, chip in chips.items():
            yield f'#### `{choosing} = "{driver}"`'
            yield _documented(chip.keys)[0] if chip.keys is not Keys else "It has no more keys."
            quantities = [
                f"`{quantity}` ({unit})" if unit != "1" else f"`{quantity}`"
                for quantity, (unit, _, _, measures) in QUANTITIES.items()
                if measures == getattr(chip, "measures", "")
            ]
            yield f"It measures {', '.join(quantities)}." if quantities else ""
            yield _keys([chip.keys], chosen)
            if rows := getattr(chip, "rows", None):
                yield f"Keys of each table `[{name}.NAME.JOINT]`:"
                yield _keys([rows], {})


def _keys(kinds: Iterable[type], options: Mapping[str, Iterable[str]]) -> str:
    """Return a table of the keys of some types; `options` has the values of keys for chips."""
    rows: list[tuple[str, ...]] = []
    for kind in kinds:
        meanings = _documented(kind)[1]
        for name, field in fields_of(kind).items():
            if name not in GIVEN or kind is RobotTable:
                names = tuple(options.get(name, ()))
                values = permitted(inspect.LiteralType(names) if names else field.type)
                values = values.replace(Pin.description, "a pin").replace("'", '"')
                # A profile cannot contain None, so the table does not explain it.
                meaning = re.sub(r"; None [^.;]*", "", meanings.get(name, ""))
                rows.append((f"`{name}`", values, _default(name, field), meaning))
    return table(_HEAD, rows) if rows else ""


def _messages(side: str) -> Iterator[str]:
    """Yield the messages of one side, the client's or the robot's, with Python's types."""
    for kind in {"client": ClientMessage, "robot": RobotMessage}[side].__subclasses__():
        summary, meanings = _documented(kind)
        yield f"#### `{kind.__struct_config__.tag}`"
        yield summary
        rows: list[tuple[str, ...]] = []
        types = get_type_hints(kind)
        for name, field in fields_of(kind).items():
            values = re.sub(r"\b[a-z]+\.", "", formatannotation(types[name])).replace(" | ", " or ")
            rows.append((f"`{name}`", values, _default(name, field), meanings.get(name, "")))
        yield table(_HEAD, rows) if rows else ""


def _default(name: str, field: inspect.Field) -> str:
    """Return a default as a cell; empty for a required key."""
    value: Any = field.default
    if value in (None, msgspec.NODEFAULT, "", b"", ()):
        return "none" if value is None else ""
    if name in ("address", "mux"):
        return hex(value)
    return f"{value:.9g}" if isinstance(value, float) else json.dumps(value)


def _documented(kind: type) -> tuple[str, dict[str, str]]:
    """Return the text of a class's docstring, and the meanings of its attributes by name."""
    summary, meanings = "", {}
    for base in reversed(kind.__mro__):
        doc = griffe.Docstring(cleandoc(base.__doc__ or ""))
        sections = griffe.parse_google(doc, warnings=False)
        summary = " ".join(one.value for one in sections if one.kind.value == "text")
        for section in sections:
            if section.kind.value == "attributes":
                meanings |= {one.name: one.description for one in section.value}
    return " ".join(summary.split()), meanings
