"""Hooks of MkDocs for the site: pages made from the code, and links that leave `docs`.

`make docs` builds the site with them. The sources read the same on a code host: a link from
`docs/a.md` to `../CONTRIBUTING.md` leads to that file there, and here to its copy in the site.
"""

from __future__ import annotations

import html
import logging
import posixpath
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from scripts.key_tables import with_keys
from scripts.site_pages import SitePage, api_pages, environment_pages, wiring_pages

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT: Final = Path(__file__).resolve().parents[1]
DOCS: Final = "docs"
HOME: Final = "README.md"
COPIES: Final = "project"
"""Folder of the site for files outside `docs` that pages link to."""

ALWAYS: Final = ("CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md")
"""Files outside `docs` that the navigation names."""

_LOG: Final = logging.getLogger("mkdocs.hooks.shapechanger")
_LINK: Final = re.compile(r"(\]\()([^)\s]+)(\))")
_FENCE: Final = re.compile(r"(^ *```.*?^ *``` *$|^ *~~~.*?^ *~~~ *$)", re.DOTALL | re.MULTILINE)
# Words of a page of docs for the site alone: they link to pages that no code host has.
_ONLY_HERE: Final = re.compile(r"<!-- site: (.*?) -->", re.DOTALL)
_MERMAID: Final = re.compile(r"^```mermaid\n(.*?)^```", re.DOTALL | re.MULTILINE)
# An image that leads to a clip: code hosts show no clips inside a page.
_CLIP: Final = re.compile(r"\[!\[([^\]]*)\]\(([^)\s]+)\)\]\(([^)\s]+\.webm)\)")
_SEARCH: Final = '<div class="md-search" data-md-component="search" role="dialog"'
_SCHEME: Final = re.compile(r"[a-z]+:")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Make the pages from the code, and add them to the navigation."""
    sections = environment_pages(), wiring_pages(), api_pages()
    config.extra["made"] = [page for pages in sections for page in pages]
    for page in config.extra["made"]:
        for note in page.notes:
            _LOG.info(note)
    config.nav = _extended(config.nav, {pages[0].path: pages for pages in sections})
    return config


def _extended(nav: Any, made: dict[str, list[SitePage]]) -> Any:
    """Return the navigation with the pages of each section after its index."""
    if isinstance(nav, str):
        return nav
    if isinstance(nav, dict):
        return {title: _extended(part, made) for title, part in nav.items()}
    entries: list[Any] = []
    for entry in nav:
        entries.append(_extended(entry, made))
        if isinstance(entry, str) and entry in made:
            entries += [{page.title: page.path} for page in made[entry] if page.path != entry]
    return entries


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages from the code, the home page, and the files that pages link to."""
    from mkdocs.structure.files import File

    for page in config.extra["made"]:
        files.append(File.generated(config, page.path, content=page.content))
        for name, content in page.pictures.items():
            files.append(File.generated(config, name, content=content))
    files.append(File.generated(config, "index.md", abs_src_path=str(ROOT / HOME)))
    pages = [f"{DOCS}/{file.src_uri}" for file in files.documentation_pages()]
    seen, waiting = {*pages, HOME}, [*pages, *ALWAYS]
    while waiting:
        origin = waiting.pop()
        if origin not in seen:
            seen.add(origin)
            path = str(ROOT / origin)
            files.append(File.generated(config, in_site(origin), abs_src_path=path))
        if origin.endswith(".md") and (ROOT / origin).is_file():
            linked = links_of((ROOT / origin).read_text(), origin)
            waiting += [one for one in linked - seen if not _in_docs(one)]
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Add the tables of keys to a page, and rewrite its links to files outside `docs`."""
    markdown = _ONLY_HERE.sub(r"\1", _MERMAID.sub(_graph_as_table, with_keys(markdown)))
    return _CLIP.sub(_player, rewritten(markdown, origin_of(page.file.src_uri)))


def _player(match: re.Match[str]) -> str:
    """Return a player for an image that leads to a clip."""
    words, picture, clip = (html.escape(part) for part in match.groups())
    return (
        f'<video controls loop muted playsinline preload="none" poster="{picture}" '
        f'aria-label="{words}" src="{clip}"></video>'
    )


def _graph_as_table(match: re.Match[str]) -> str:
    """Return a graph of Mermaid, which browsers would load from another server, as a table."""
    arrows = [line.split("-->") for line in match[1].splitlines() if "-->" in line]
    rows = [f"| {one.strip()} | {', '.join(others.split('&'))} |" for one, others in arrows]
    return "\n".join(["| from | to |", "|---|---|", *rows])


def on_post_page(output: str, **_: Any) -> str:
    """Name the theme's search dialog for screen readers."""
    return output.replace(_SEARCH, f'{_SEARCH} aria-label="Search"', 1)


def origin_of(src_uri: str) -> str:
    """Return the path in the repository of a page of the site."""
    if src_uri == "index.md":
        return HOME
    if src_uri.startswith(f"{COPIES}/"):
        return src_uri.removeprefix(f"{COPIES}/")
    return f"{DOCS}/{src_uri}"


def in_site(path: str) -> str:
    """Return the path in the site of a file of the repository."""
    if path == HOME:
        return "index.md"
    return path.removeprefix(f"{DOCS}/") if _in_docs(path) else f"{COPIES}/{path}"


def _in_docs(path: str) -> bool:
    return path.startswith(f"{DOCS}/")


def links_of(markdown: str, origin: str) -> set[str]:
    """Return the files that a page, whose path in the repository is `origin`, links to."""
    found = {_target(link[2], origin)[0] for link in _LINK.finditer(_FENCE.sub("", markdown))}
    return {path for path in found if path and (ROOT / path).is_file()}


def rewritten(markdown: str, origin: str) -> str:
    """Return a page of the repository with its links as the site needs them."""
    here = posixpath.dirname(in_site(origin))

    def link(match: re.Match[str]) -> str:
        path, anchor = _target(match[2], origin)
        if not path or not (ROOT / path).is_file():  # MkDocs warns of missing files.
            return match[0]
        return f"{match[1]}{posixpath.relpath(in_site(path), here or '.')}{anchor}{match[3]}"

    # Every second part is a fence.
    parts = _FENCE.split(markdown)
    return "".join(part if at % 2 else _LINK.sub(link, part) for at, part in enumerate(parts))


def _target(link: str, origin: str) -> tuple[str, str]:
    """Return the path in the repository of a link, "" if it leads elsewhere, and its anchor."""
    path, hash_, anchor = link.partition("#")
    if not path or _SCHEME.match(link):
        return "", ""
    return posixpath.normpath(posixpath.join(posixpath.dirname(origin), path)), hash_ + anchor
