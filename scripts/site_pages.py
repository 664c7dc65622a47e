"""Pages of the site that are made from the code: environments, wiring, and the API reference."""

from __future__ import annotations

import ast
import importlib
import inspect
import io
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final, cast

import gymnasium as gym

import shapechanger
from scripts.wiring_diagrams import draw_wiring, part_list, pin_table
from shapechanger.contract.env_ref import EnvRef, layouts_of
from shapechanger.envs.catalogue import (
    CATALOGUE,
    FINGER_ENVS,
    NAMESPACE,
    ODRL_ENVS,
    OWN_ROBOT,
    RANGES_ENVS,
    VEHICLE_ENVS,
    WAYPOINT_ENVS,
)
from shapechanger.errors import EmptyShift, RenderError
from shapechanger.layout import Feature, Layout
from shapechanger.robot.profile import load_profile, shipped_profiles

SRC: Final = Path(shapechanger.__file__).parents[1]


@dataclass(frozen=True)
class SitePage:
    """A page that is made from the code.

    Attributes:
        path: Its path in the site's sources, such as `environments/Ant.md`.
        title: Its title in the navigation.
        content: Its Markdown.
        pictures: Its other files, keyed by their paths in the site's sources.
        notes: What is missing on it, in sentences.
    """

    path: str
    title: str
    content: str
    pictures: dict[str, bytes] = field(default_factory=dict[str, bytes])
    notes: tuple[str, ...] = ()


# Environments

_SIZE: Final = 480, 360
_QUALITY: Final = 80
_MOST_ROWS: Final = 40  # Longer tables are folded.


def environment_pages() -> list[SitePage]:
    """Return a page for each env that `import shapechanger` registers, and their index.

    The bodies of ODRL share a page.
    """
    registered = [env_id for env_id in gym.registry if env_id.startswith(f"{NAMESPACE}/")]
    ids = [env_id for env_id in registered if env_id not in ODRL_ENVS]
    pages = [environment_page(env_id) for env_id in ids]
    rows = [
        (_thumbnail(page), f"[`{env_id}`]({page.title}.md)", _summary(env_id))
        for env_id, page in zip(ids, pages, strict=True)
    ]
    rows.append(("", "[ODRL](ODRL.md)", f"{len(ODRL_ENVS)} ids: published bodies of four runners"))
    index = [
        "# Environments",
        "`import shapechanger` registers these ids with Gymnasium. Their pages are made from the "
        "registry, the docstrings, the layouts, the certificates and the models of this version.",
        _table(("picture", "id", "body"), rows),
    ]
    first = SitePage("environments/index.md", "Environments", "\n\n".join(index))
    return [first, *pages, _odrl_page()]


def _odrl_page() -> SitePage:
    """Return the page of the bodies of ODRL, with each body's changes."""
    rows: list[tuple[str, ...]] = []
    for env_id, entry in ODRL_ENVS.items():
        edits = _loaded(entry.entry_point).family.body(entry.body)
        rows.append((f"`{env_id}`", ", ".join(f"`{edit}`" for edit in edits) or "none: a source"))
    parts = [
        "# ODRL",
        "The sources and the targets of ODRL's locomotion tasks, as ids. Their models equal the "
        "published ones; [rewards and observations](../own-bodies.md) are our runners'.",
        _table(("id", "edits of its family"), rows),
    ]
    return SitePage("environments/ODRL.md", "ODRL", "\n\n".join(parts))


def _thumbnail(page: SitePage) -> str:
    """Return a small image that leads to a page; "" for a page without one."""
    shape = "{ width=96 height=72 loading=lazy }"
    return f"[![{page.title}]({page.title}.jpg){shape}]({page.title}.md)" if page.pictures else ""


def environment_page(env_id: str) -> SitePage:
    """Return the page of an env: registry, docstring, layouts, certificate and image.

    Raises:
        RenderError: If nothing renders on CI, where nothing may be missing.
    """
    short, spec = _short(env_id), gym.registry[env_id]
    entry_point = cast("str", spec.entry_point)
    kind = _loaded(entry_point)
    parts = [f"# {short}", f"`{env_id}`: {_summary(env_id)}."]
    pictures: dict[str, bytes] = {}
    notes: list[str] = []
    # Their layouts come from a robot or a file.
    has_layouts = not short.startswith("Remote") and env_id != OWN_ROBOT
    env = EnvRef(env_id).make() if has_layouts else None
    if env is not None and hasattr(env.unwrapped, "picture"):
        try:
            pictures[f"environments/{short}.jpg"] = _picture(env)
            parts.append(f"![{short} at the start of an episode]({short}.jpg)")
        except RenderError as error:
            notes.append(_missing(f"The page of {env_id} has no picture", error))
    parts.append(_table(("property", "value"), _facts(env_id, spec, entry_point)))
    parts += [_docstring(kind), _class_link(entry_point)]
    if env is None:
        parts.append(
            f"The layouts follow from the robot's {'file' if env_id == OWN_ROBOT else 'profile'}: "
            "`env.unwrapped.observation_layout` has them after `gym.make`."
        )
    else:
        observation, action = layouts_of(env)
        parts += ["## Actions in full", _layout_table(action)]
        parts += ["## Observations in full", _layout_table(observation)]
        try:
            parts.append(_certificate(env_id, env))
        except RenderError as error:  # Vehicles are compared by what their cameras see, too.
            notes.append(_missing(f"The page of {env_id} has no certificate", error))
        env.close()
    content = "\n\n".join(part for part in parts if part)
    return SitePage(f"environments/{short}.md", short, content, pictures, tuple(notes))


def _short(env_id: str) -> str:
    return env_id.removeprefix(f"{NAMESPACE}/").removesuffix("-v1")


def _summary(env_id: str) -> str:
    """Return the one-line description of an env."""
    if env_id in CATALOGUE:
        return CATALOGUE[env_id].summary
    for envs in (VEHICLE_ENVS, RANGES_ENVS, WAYPOINT_ENVS):
        if env_id in envs:
            vehicle, summary = envs[env_id]
            return f"{vehicle}: {summary}"
    if env_id in FINGER_ENVS:
        return FINGER_ENVS[env_id].summary
    first = (
        inspect.getdoc(_loaded(cast("str", gym.registry[env_id].entry_point))) or ""
    ).partition("\n")
    return first[0][0].lower() + first[0][1:].rstrip(".")


def _loaded(entry_point: str) -> Any:
    module, _, name = entry_point.partition(":")
    return getattr(importlib.import_module(module), name)


def _facts(env_id: str, spec: Any, entry_point: str) -> list[tuple[str, str]]:
    rows = [("made by", f'`gym.make("{env_id}")`')]
    if spec.kwargs:
        given = ", ".join(f"{name}={value!r}" for name, value in spec.kwargs.items())
        rows.append(("with", f"`{given}`"))
    steps = spec.max_episode_steps
    rows.append(("time limit", f"{steps:,} steps" if steps else "none"))
    if spec.reward_threshold is not None:
        rows.append(("solved at a return of", f"{spec.reward_threshold:,.0f}"))
    if env_id in CATALOGUE:
        rows.append(("family", CATALOGUE[env_id].family))
        rows.append(("learner", f"`{CATALOGUE[env_id].learner}`"))
    elif env_id in FINGER_ENVS:
        rows.append(("learner", f"`{FINGER_ENVS[env_id].learner}`"))
    return rows


def _missing(what: str, error: RenderError) -> str:
    """Return a note of undrawable images; on CI, where nothing may be missing, raise."""
    if os.environ.get("CI") == "true":
        raise error
    return f"{what}: {error}"


def _picture(env: gym.Env[Any, Any]) -> bytes:
    """Draw the env at the start of an episode, as JPEG.

    Raises:
        RenderError: If nothing renders here.
    """
    import imageio.v3 as iio

    env.reset(seed=0)
    frame = cast("Any", env.unwrapped).picture(*_SIZE)
    buffer = io.BytesIO()
    iio.imwrite(buffer, frame, extension=".jpg", quality=_QUALITY)
    return buffer.getvalue()


def _docstring(kind: Any) -> str:
    """Return the docstring of an env as Markdown, with its arguments as a table."""
    import griffe

    from scripts.site_docstrings import fenced

    parts: list[str] = []
    doc = griffe.Docstring(fenced(inspect.getdoc(kind) or ""))
    for section in griffe.parse_google(doc, warnings=False):
        if section.kind is griffe.DocstringSectionKind.text:
            parts.append(cast("str", section.value).replace("\n## ", "\n### "))
        elif section.kind is griffe.DocstringSectionKind.parameters:
            rows = [(f"`{one.name}`", _cell(one.description)) for one in section.value]
            parts += ["### Arguments", _table(("argument", "meaning"), rows)]
        elif section.kind is griffe.DocstringSectionKind.raises:
            rows = [(f"`{one.annotation}`", _cell(one.description)) for one in section.value]
            parts += ["### Errors", _table(("error", "raised"), rows)]
    return "\n\n".join(parts)


def _class_link(entry_point: str) -> str:
    module, _, name = entry_point.partition(":")
    return f"Class: [`{module}.{name}`][{module}.{name}]."


def _layout_table(layout: Layout) -> str:
    """Return a table of a layout, folded if it is long."""
    rows: list[tuple[str, ...]] = []
    place = 0
    for feature in layout.features:
        last = place + feature.size - 1
        rows.append((f"{place}" if last == place else f"{place} to {last}", *_described(feature)))
        place = last + 1
    table = _table(("place", "name", "unit", "low", "high", "part"), rows)
    if len(rows) <= _MOST_ROWS:
        return table
    indented = "\n".join(f"    {line}" for line in table.splitlines())
    return f'??? note "{layout.size:,} numbers"\n\n{indented}'


def _described(feature: Feature) -> tuple[str, ...]:
    name = f"`{feature.name}`"
    if feature.shape:
        name += f", shape {feature.shape}"
    unit = feature.unit
    if feature.gain_unit:
        unit += f" (1 is {feature.gain:g} {feature.gain_unit})"
    part = feature.element
    return (
        name,
        unit,
        _bound(feature.low),
        _bound(feature.high),
        f"{part.kind} `{part.name}`" if part else "",
    )


def _bound(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else ("∞" if value > 0 else "-∞")


def _certificate(env_id: str, env: gym.Env[Any, Any]) -> str:
    """Return the section on the differences of an env from the first of its kind.

    Raises:
        RenderError: If an env needs its camera, and nothing renders here.
    """
    source, words = _compared(env_id)
    if source is None:
        return f"## Certificate\n\n{words}"
    with source.make() as other:
        try:
            proven = str(cast("Any", other.unwrapped).certify_shift(other, env))
        except EmptyShift as error:
            proven = str(error)
    return f"## Certificate\n\n{words}\n\n```text\n{proven}\n```"


def _compared(env_id: str) -> tuple[EnvRef | None, str]:
    """Return the env that another is compared with, and why."""
    name = _short(env_id)
    if env_id in CATALOGUE:
        family = CATALOGUE[env_id].family
        first = f"{NAMESPACE}/{family}-v1"
        if env_id != first:
            return EnvRef(first), _command(family, name)
        heavier = '[{"edit":"mass","element":"*","scale":1.2}]'
        return (
            EnvRef(env_id, {"body": heavier}),
            "The unedited body of its family. Changes from a body of 1.2 times its mass "
            f"(`shapechanger envs compare {name} {name} --source-body '{heavier}'`):",
        )
    if env_id in VEHICLE_ENVS and name != "Car":
        return EnvRef(f"{NAMESPACE}/Car-v1"), _command("Car", name)
    for suffix in ("Ranges", "Waypoint"):
        if name.endswith(suffix):
            vehicle = name.removesuffix(suffix)
            return None, f"It has the body of [{vehicle}]({vehicle}.md), which has a certificate."
    if name == "FingerTrack":
        return None, "It has the body of [Finger](Finger.md); only the task differs."
    others = "" if name != "Car" else " [Tank](Tank.md), [Truck](Truck.md) and [Boat](Boat.md)"
    if others:
        return None, f"The certificates of{others} compare them with it."
    return (
        None,
        "`shapechanger finger export` writes its model; [the finger](../finger.md) has its "
        "parameters.",
    )


def _command(source: str, target: str) -> str:
    return f"Changes from {source} (`shapechanger envs compare {source} {target}`):"


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
        about = _about(path)
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


def _about(path: Path) -> str:
    """Return the comment at the head of a profile."""
    lines: list[str] = []
    for line in path.read_text().splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.removeprefix("#").strip())
    return " ".join(lines)


# The API reference

MODULES: Final = (
    "shapechanger.layout",
    "shapechanger.errors",
    "shapechanger.contract.testing",
    "shapechanger.demos.dataset",
    "shapechanger.demos.recording",
    "shapechanger.envs.ant",
    "shapechanger.envs.own",
    "shapechanger.envs.pendulum",
    "shapechanger.envs.reshapable",
    "shapechanger.envs.runners",
    "shapechanger.finger.anatomy",
    "shapechanger.finger.parameters",
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
def public_packages() -> dict[str, tuple[str, ...]]:
    """Return the names that each package exports, by the package."""
    found: dict[str, tuple[str, ...]] = {}
    for path in sorted(SRC.rglob("__init__.py")):
        package = ".".join(path.parent.relative_to(SRC).parts)
        names = _exported(path)
        if names and not any(f"{package}.".startswith(f"{one}.") for one in HIDDEN):
            found[package] = names
    return found


def _exported(path: Path) -> tuple[str, ...]:
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return tuple(ast.literal_eval(node.value))
    return ()


def api_pages() -> list[SitePage]:
    """Return a page for each public package and module, and their index."""
    homes = _homes()
    names = sorted((*public_packages(), *MODULES))
    rows = [(f"[`{name}`]({name}.md)", _first_line(name)) for name in names]
    index = [
        "# API reference",
        "Every name that a package exports, with shapes, units and errors. The names of "
        "`shapechanger` itself are imported on first use.",
        _table(("package", "contents"), rows),
    ]
    pages = [_api_page(name, homes) for name in names]
    return [SitePage("api/index.md", "API", "\n\n".join(index)), *pages]


def _homes() -> dict[tuple[str, str], str]:
    """Return the package or module whose page describes each exported name, by its definition.

    A name that several packages export is described by the innermost one.
    """
    homes: dict[tuple[str, str], str] = {}
    for package, names in sorted(public_packages().items(), key=lambda one: one[0].count(".")):
        for name in names:
            homes[_defined(package, name)] = package
    for module in MODULES:
        for definition in homes:
            if definition[0] == module:
                homes[definition] = module
    return homes


def _defined(package: str, name: str) -> tuple[str, str]:
    """Return the module that defines an exported name, and its name there."""
    value = getattr(importlib.import_module(package), name)
    module = getattr(value, "__module__", None)
    if module is not None and module.startswith("shapechanger") and hasattr(value, "__qualname__"):
        return module, value.__qualname__
    for node in ast.walk(ast.parse((SRC / package.replace(".", "/") / "__init__.py").read_text())):
        if isinstance(node, ast.ImportFrom) and any(one.name == name for one in node.names):
            return node.module or package, name
    return package, name


def _api_page(name: str, homes: dict[tuple[str, str], str]) -> SitePage:
    path = f"api/{name}.md"
    options = ["options:", "  show_root_heading: false", "  show_root_toc_entry: false"]
    elsewhere: list[str] = []
    if name in MODULES:
        members = _public_members(name)
    else:
        members = []
        for exported in public_packages()[name]:
            definition = _defined(name, exported)
            if homes[definition] == name:
                members.append(exported)
            else:
                elsewhere.append(
                    f"[`{exported}`][{reference_path(homes[definition], definition[1])}]"
                )
    options.append(f"  members: [{', '.join(members)}]")
    parts = [f"# `{name}`", "\n".join([f"::: {name}", *(f"    {line}" for line in options)])]
    # A module hides what it defines under its own name.
    parts += [
        f"::: {reference_path(name, one)}"
        for one in members
        if reference_path(name, one).endswith(f".{one}.{one}")
    ]
    if elsewhere:
        parts += ["## Re-exported", ", ".join(elsewhere) + "."]
    return SitePage(path, _listed(name), "\n\n".join(parts))


def _listed(name: str) -> str:
    """Return how the navigation lists a package."""
    return name.removeprefix("shapechanger.")


def reference_path(package: str, name: str) -> str:
    """Return the path by which the reference knows an exported name."""
    module = SRC / package.replace(".", "/") / f"{name}.py"
    return f"{package}.{name}.{name}" if module.exists() else f"{package}.{name}"


def _public_members(module: str) -> list[str]:
    """Return the public names that a module defines, in order."""
    tree = ast.parse((SRC / f"{module.replace('.', '/')}.py").read_text())
    return list(_names(tree.body))


def _names(body: list[ast.stmt]) -> Iterator[str]:
    for node in body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
            yield node.name
        elif isinstance(node, ast.AnnAssign | ast.Assign):
            targets = [node.target] if isinstance(node, ast.AnnAssign) else node.targets
            yield from (
                one.id
                for one in targets
                if isinstance(one, ast.Name) and not one.id.startswith("_")
            )


def _first_line(module: str) -> str:
    doc = importlib.import_module(module).__doc__ or ""
    return _cell(doc.partition("\n\n")[0])
