"""Pages of the site that are made from the code: environments, wiring, and the API reference."""

from __future__ import annotations

import importlib
import inspect
import io
import os
from dataclasses import dataclass, field
from functools import cache
from itertools import groupby, takewhile
from pathlib import Path
from typing import Any, Final, cast

import gymnasium as gym

import shapechanger
from scripts.wiring_diagrams import draw_wiring, part_list, pin_table
from shapechanger.contract.env_ref import EnvRef, layouts_of
from shapechanger.envs.catalogue import (
    CATALOGUE,
    NAMESPACE,
    ODRL_ENVS,
    OWN_ROBOT,
    VEHICLE_ENVS,
    summaries,
)
from shapechanger.errors import EmptyShift, RenderError
from shapechanger.layout import Feature, Layout
from shapechanger.robot.profile import load_profile, shipped_profiles

SRC: Final = Path(shapechanger.__file__).parents[1]


@dataclass(frozen=True)
class SitePage:
    """A page that is made from the code; its paths are those in the site's sources."""

    path: str  # Such as `environments/Ant.md`.
    title: str  # In the navigation.
    content: str  # Its Markdown.
    pictures: dict[str, bytes] = field(default_factory=dict[str, bytes])  # Keyed by path.
    notes: tuple[str, ...] = ()  # What is missing on it, in sentences.


# Environments

_SIZE: Final = 480, 360
_QUALITY: Final = 80
_FEWEST: Final = 3  # Features of one kind that become one row.


def environment_pages() -> list[SitePage]:
    """Return a page for each env that `import shapechanger` registers, and their index.

    The bodies of ODRL share a page.
    """
    registered = [env_id for env_id in gym.registry if env_id.startswith(f"{NAMESPACE}/")]
    pages = {one: environment_page(one) for one in registered if one not in ODRL_ENVS}
    rows: list[tuple[str, ...]] = []
    for env_id, page in pages.items():
        shown = f"![{page.title}]({page.title}.jpg){{ width=96 height=72 loading=lazy }}"
        picture = f"[{shown}]({page.title}.md)" if page.pictures else ""
        rows.append((picture, f"[`{env_id}`]({page.title}.md)", _summary(env_id)))
    rows.append(("", "[ODRL](ODRL.md)", f"{len(ODRL_ENVS)} ids: published bodies of four runners"))
    index = [
        "# Environments",
        "`import shapechanger` registers these ids with Gymnasium. Their pages are made from the "
        "registry, the docstrings, the certificates and the models of this version; "
        "`shapechanger envs show ENV` prints the name, unit and range of each number.",
        _table(("picture", "id", "body"), rows),
    ]
    bodies: list[tuple[str, ...]] = []
    for env_id, entry in ODRL_ENVS.items():
        edits = _loaded(entry.entry_point).family.body(entry.body)
        changes = ", ".join(f"`{edit}`" for edit in edits) or "none: a source"
        bodies.append((f"`{env_id}`", changes))
    odrl = [
        "# ODRL",
        "The sources and the targets of ODRL's locomotion tasks, as ids. Their models equal the "
        "published ones; [rewards and observations](../own-bodies.md) are our runners'.",
        _table(("id", "edits of its family"), bodies),
    ]
    return [
        SitePage("environments/index.md", "Environments", "\n\n".join(index)),
        *pages.values(),
        SitePage("environments/ODRL.md", "ODRL", "\n\n".join(odrl)),
    ]


def environment_page(env_id: str) -> SitePage:
    """Return the page of an env: registry, docstring, certificate and image.

    Raises:
        RenderError: If nothing renders on CI, where nothing may be missing.
    """
    short, spec = _short(env_id), gym.registry[env_id]
    module, _, name = cast("str", spec.entry_point).partition(":")
    parts = [f"# {short}", f"`{env_id}`: {_summary(env_id)}."]
    docstring = _docstring(_loaded(f"{module}:{name}"))
    tables: list[str] = []
    certificate = ""
    pictures: dict[str, bytes] = {}
    notes: list[str] = []
    # The others need a robot or a file.
    if not short.startswith("Remote") and env_id != OWN_ROBOT:
        env = EnvRef(env_id).make()
        if "| Num" not in docstring:
            for layout, title in zip(layouts_of(env), ("Observation", "Action"), strict=True):
                tables += [f"### {title}s by number", layout_table(layout, title)]
        try:
            # Vehicles are compared by what their cameras see, too.
            certificate = _certificate(env_id, env)
            if hasattr(env.unwrapped, "picture"):
                pictures[f"environments/{short}.jpg"] = _picture(env)
                parts.append(f"![{short} at the start of an episode]({short}.jpg)")
        except RenderError as error:
            if os.environ.get("CI") == "true":
                raise
            notes.append(f"The page of {env_id} has no picture: {error}")
        env.close()
    steps, threshold = spec.max_episode_steps, spec.reward_threshold
    given = ", ".join(f"{name}={value!r}" for name, value in spec.kwargs.items())
    facts = {
        "made by": f'`gym.make("{env_id}")`',
        "with": f"`{given}`" if given else "",
        "time limit": f"{steps:,} steps" if steps else "none",
        "solved at a return of": "" if threshold is None else f"{threshold:,.0f}",
        "class": f"[`{module}.{name}`][{module}.{name}]",
    }
    parts.append(_table(("property", "value"), [row for row in facts.items() if row[1]]))
    parts += [docstring, *tables, certificate]
    content = "\n\n".join(part for part in parts if part)
    return SitePage(f"environments/{short}.md", short, content, pictures, tuple(notes))


def _kind_of(feature: Feature) -> tuple[str, str, str, str]:
    """Return the name without the element, the bounds and the unit; the units of a block differ."""
    _, _, kind = feature.name.partition("/")
    kind, _, part = kind.partition("/")
    unit = "" if part else feature.unit
    return kind or feature.name, f"{feature.low:.4g}", f"{feature.high:.4g}", unit


def layout_table(layout: Layout, title: str) -> str:
    """Return the table of a layout; consecutive observations of one kind share a row.

    Args:
        layout: The layout.
        title: "Action" or "Observation".
    """
    rows: list[tuple[str, ...]] = [("Num", title, "Min", "Max", "Unit")]
    first = 0
    for (kind, low, high, _), group in groupby(layout, _kind_of):
        features = list(group)
        is_block = title == "Observation" and len(features) >= _FEWEST
        for few in [features] if is_block else [[feature] for feature in features]:
            size = sum(feature.size for feature in few)
            place = str(first) if size == 1 else f"{first}-{first + size - 1}"
            suffix = "/*" if few[0].name.count("/") > 1 else ""
            name = f"`*/{kind}{suffix}`" if is_block else f"`{few[0].name}`"
            rows.append((place, name, low, high, ", ".join(dict.fromkeys(f.unit for f in few))))
            first += size
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rows.insert(1, tuple("-" * width for width in widths))
    return "\n".join(
        f"| {' | '.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))} |"
        for row in rows
    )


def _short(env_id: str) -> str:
    return env_id.removeprefix(f"{NAMESPACE}/").removesuffix("-v1")


def _summary(env_id: str) -> str:
    """Return the line of the catalogue, or else the first one of the docstring."""
    if env_id in (known := summaries()):
        return known[env_id]
    first, _, _ = (inspect.getdoc(_loaded(str(gym.registry[env_id].entry_point))) or "").partition(
        "\n"
    )
    return first[0].lower() + first[1:].rstrip(".")


def _loaded(entry_point: str) -> Any:
    module, _, name = entry_point.partition(":")
    return getattr(importlib.import_module(module), name)


def _picture(env: gym.Env[Any, Any]) -> bytes:
    """Draw the env at the start of an episode, as JPEG.

    Raises:
        RenderError: If nothing renders here.
    """
    import imageio.v3 as iio

    env.reset(seed=0)
    buffer = io.BytesIO()
    frame = cast("Any", env.unwrapped).picture(*_SIZE)
    iio.imwrite(buffer, frame, extension=".jpg", quality=_QUALITY)
    return buffer.getvalue()


def _docstring(kind: Any) -> str:
    """Return the docstring of an env as Markdown, with its arguments and errors as tables."""
    import griffe

    from scripts.site_docstrings import fenced

    doc = griffe.Docstring(fenced(inspect.getdoc(kind) or ""))
    parts: list[str] = []
    for section in griffe.parse_google(doc, warnings=False):
        match section.kind.value:
            case "text":
                parts.append(section.value.replace("\n## ", "\n### "))
            case "parameters":
                rows = [(f"`{one.name}`", _cell(one.description)) for one in section.value]
                parts += ["### Arguments", _table(("argument", "meaning"), rows)]
            case "raises":
                rows = [(f"`{one.annotation}`", _cell(one.description)) for one in section.value]
                parts += ["### Errors", _table(("error", "raised"), rows)]
            case _:
                pass
    return "\n\n".join(parts)


def _certificate(env_id: str, env: gym.Env[Any, Any]) -> str:
    """Return the section on the differences of an env from the first of its kind, if it has one.

    Raises:
        RenderError: If an env needs its camera, and nothing renders here.
    """
    first = CATALOGUE[env_id].family if env_id in CATALOGUE else "Car"
    if env_id not in {*CATALOGUE, *VEHICLE_ENVS} or _short(env_id) == first:
        return ""
    with EnvRef(f"{NAMESPACE}/{first}-v1").make() as other:
        try:
            proven = str(cast("Any", other.unwrapped).certify_shift(other, env))
        except EmptyShift as error:
            proven = str(error)
    command = f"shapechanger envs compare {first} {_short(env_id)}"
    return f"## Certificate\n\nChanges from {first} (`{command}`):\n\n```text\n{proven}\n```"


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _cell(text: str) -> str:
    """Return text as the cell of a table."""
    return " ".join(text.split()).replace("|", r"\|")


# Wiring


def wiring_pages() -> list[SitePage]:
    """Return a page with a diagram, pins and parts for each shipped profile, and their index."""
    pages: list[SitePage] = []
    rows: list[tuple[str, ...]] = []
    for name, path in shipped_profiles().items():
        profile = load_profile(path)
        comment = takewhile(lambda line: line.startswith("#"), path.read_text().splitlines())
        about = " ".join(line.removeprefix("#").strip() for line in comment)
        rows.append((f"[`{name}`]({name}.md)", _cell(about)))
        parts = [
            "---\nhide:\n  - toc\n---",  # Room for the diagram.
            f"# Wiring of the `{name}` profile",
            about,
            "Drawn from the shipped profile. Read [what must be wired](../hardware.md"
            "#safety-what-must-be-wired) before you connect a motor; the circuit follows data "
            "sheets and has not been built.",
            f'<div class="diagram">\n{draw_wiring(profile, name)}\n</div>',
            "## Pins",
            pin_table(profile),
            "## Parts",
            part_list(profile),
            "## Profile",
            f"`shapechanger robot init {name}` writes it:",
            f"```toml\n{path.read_text().rstrip()}\n```",
        ]
        pages.append(SitePage(f"wiring/{name}.md", name, "\n\n".join(parts)))
    index = [
        "# Diagrams and parts",
        "A diagram, the pins and the parts of each profile that ships, made from the profiles of "
        "this version. [Hardware](../hardware.md) says how to build it, and "
        "[profiles](../profiles.md) what each key means.",
        _table(("profile", "robot"), rows),
    ]
    return [SitePage("wiring/index.md", "Diagrams and parts", "\n\n".join(index)), *pages]


# The API reference

MODULES: Final = (
    "shapechanger.layout",
    "shapechanger.errors",
    "shapechanger.policy",
    "shapechanger.contract.testing",
    "shapechanger.demos.dataset",
    "shapechanger.demos.recording",
    "shapechanger.envs.ant",
    "shapechanger.envs.humanoid",
    "shapechanger.envs.make_vec",
    "shapechanger.envs.own",
    "shapechanger.envs.pendulum",
    "shapechanger.envs.reshapable",
    "shapechanger.envs.runners",
    "shapechanger.finger.anatomy",
    "shapechanger.finger.parameters",
    "shapechanger.finger.paths",
    "shapechanger.finger.reach",
    "shapechanger.finger.remote",
    "shapechanger.finger.track",
    "shapechanger.robot.client.env",
    "shapechanger.vehicles.remote.waypoints",
    "shapechanger.robot.client.client",
    "shapechanger.robot.client.known_robots",
    "shapechanger.robot.link.messages",
    "shapechanger.transfer.study",
    "shapechanger.transfer.learners.policy_file",
    "shapechanger.robot.twin.operator",
    "shapechanger.robot.twin.robot",
)
"""Modules of the reference besides the packages: they hold public names that no package exports."""

HIDDEN: Final = ("shapechanger.cli", "shapechanger.robot.console")
"""Packages that are programs: `shapechanger --help` documents the first one."""


@cache
def public_names() -> dict[str, tuple[str, ...]]:
    """Return the names of each page of the reference, which a package exports or a module has."""
    found: dict[str, tuple[str, ...]] = {}
    for path in SRC.glob("shapechanger/**/__init__.py"):
        package = ".".join(path.parent.relative_to(SRC).parts)
        if not any(f"{package}.".startswith(f"{one}.") for one in HIDDEN):
            exported = getattr(importlib.import_module(package), "__all__", ())
            found |= {package: tuple(exported)} if exported else {}
    for module in MODULES:
        has = vars(importlib.import_module(module))
        known = has.get("__annotations__", {})
        found[module] = tuple(
            name
            for name, value in has.items()
            if not name.startswith("_")
            and (name in known or getattr(value, "__module__", "") == module)
        )
    return dict(sorted(found.items()))


def api_pages() -> list[SitePage]:
    """Return a page for each public package and module, and their index.

    The innermost page that has a name describes it, and the others link to it.
    """
    described: dict[tuple[str, int], str] = {}
    pages: list[SitePage] = []
    for page, names in sorted(public_names().items(), key=lambda one: -one[0].count(".")):
        members: list[str] = []
        links: list[str] = []
        module = importlib.import_module(page)
        for name in names:
            key = name, id(getattr(module, name))
            if key in described:
                links.append(f"[`{name}`][{described[key]}]")
            else:
                members.append(name)
                described[key] = reference_path(page, name)
        options = ["show_root_heading: false", "show_root_toc_entry: false"]
        options.append(f"members: [{', '.join(members)}]")
        lines = [f"::: {page}", "    options:", *(f"      {option}" for option in options)]
        parts = [f"# `{page}`", "\n".join(lines)]
        # A module hides what it defines under its own name.
        paths = [(name, reference_path(page, name)) for name in members]
        parts += [f"::: {path}" for name, path in paths if path.endswith(f".{name}.{name}")]
        parts += ["## Re-exported", ", ".join(links) + "."] if links else []
        title = page.removeprefix("shapechanger.")
        pages.append(SitePage(f"api/{page}.md", title, "\n\n".join(parts)))
    pages.sort(key=lambda page: page.path)
    rows = [(f"[`{one}`]({one}.md)", _first_line(one)) for one in public_names()]
    index = [
        "# API reference",
        "Every name that a package exports, with shapes, units and errors. The names of "
        "`shapechanger` itself are imported on first use.",
        _table(("package", "contents"), rows),
    ]
    return [SitePage("api/index.md", "API", "\n\n".join(index)), *pages]


def reference_path(package: str, name: str) -> str:
    """Return the path by which the reference knows an exported name."""
    module = SRC / package.replace(".", "/") / f"{name}.py"
    return f"{package}.{name}.{name}" if module.exists() else f"{package}.{name}"


def _first_line(module: str) -> str:
    return _cell((importlib.import_module(module).__doc__ or "").partition("\n\n")[0])
