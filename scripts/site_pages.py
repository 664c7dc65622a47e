"""Pages of the site that are made from the code: environments, wiring, and the API reference."""

import importlib
import inspect
import logging
import os
from functools import cache
from itertools import takewhile
from pathlib import Path
from typing import Any, Final, cast

import gymnasium as gym
import imageio.v3 as iio

import shapechanger
from scripts.wiring_diagrams import draw_wiring, part_list, pin_table, table
from shapechanger.contract.env_ref import EnvRef
from shapechanger.envs.catalogue import (
    CATALOGUE,
    NAMESPACE,
    ODRL_ENVS,
    OWN_ROBOT,
    VEHICLE_ENVS,
    summaries,
)
from shapechanger.errors import RenderError
from shapechanger.robot.profile import load_profile, shipped_profiles

Pages = dict[str, str | bytes]
"""Markdown and images, keyed by their path in `docs`; the first one is the index of the others."""

SRC: Final = Path(shapechanger.__file__).parents[1]
_LOG: Final = logging.getLogger("mkdocs.hooks.shapechanger")


def _page(*parts: str) -> str:
    return "\n\n".join(part for part in parts if part)


def environment_pages() -> Pages:
    """Return a page for each registered env, one page for all bodies of ODRL, and an index."""
    pages: Pages = {"environments/index.md": ""}
    rows: list[tuple[str, ...]] = []
    for env_id in gym.registry:
        if not env_id.startswith(f"{NAMESPACE}/") or env_id in ODRL_ENVS:
            continue
        short, shown = _short(env_id), ""
        pages[f"environments/{short}.md"], picture = _environment(env_id)
        if picture is not None:
            pages[f"environments/{short}.jpg"] = picture
            image = f"![{short}]({short}.jpg){{ width=96 height=72 loading=lazy }}"
            shown = f"[{image}]({short}.md)"
        rows.append((shown, f"[`{env_id}`]({short}.md)", _summary(env_id)))
    rows.append(("", "[ODRL](ODRL.md)", f"{len(ODRL_ENVS)} ids: published bodies of four runners"))
    pages["environments/index.md"] = _page(
        "# Environments",
        "`import shapechanger` registers these ids with Gymnasium. Their pages are made from the "
        "registry, the docstrings and the models of this version; "
        "`shapechanger envs ENV` prints the name, unit and range of each number.",
        table(("picture", "id", "body"), rows),
    )
    bodies: list[tuple[str, ...]] = []
    for env_id, entry in ODRL_ENVS.items():
        edits = _loaded(str(gym.registry[env_id].entry_point)).family.body(entry.name)
        changes = ", ".join(f"`{edit}`" for edit in edits) or "none: a source"
        bodies.append((f"`{env_id}`", changes))
    pages["environments/ODRL.md"] = _page(
        "# ODRL",
        "The sources and the targets of ODRL's locomotion tasks, as ids. Their models equal the "
        "published ones; [rewards and observations](../own-bodies.md) are our runners'.",
        table(("id", "edits of its family"), bodies),
    )
    return pages


def _environment(env_id: str) -> tuple[str, bytes | None]:
    """Return the page of an env, and a JPEG of its start; None if there is no image."""
    short, spec, picture = _short(env_id), gym.registry[env_id], None
    module, _, name = cast("str", spec.entry_point).partition(":")
    # Other envs need a robot or a file.
    if not short.startswith("Remote") and env_id != OWN_ROBOT:
        with EnvRef(env_id).make() as env:
            try:
                if hasattr(env.unwrapped, "picture"):
                    env.reset(seed=0)
                    frame = cast("Any", env.unwrapped).picture(480, 360)
                    picture = iio.imwrite("<bytes>", frame, extension=".jpg", quality=80)
            except RenderError as error:
                if os.environ.get("CI") == "true":  # There, every page must have its image.
                    raise
                _LOG.info("The page of %s has no picture: %s", env_id, error)
    steps, threshold = spec.max_episode_steps, spec.reward_threshold
    given = ", ".join(f"{name}={value!r}" for name, value in spec.kwargs.items())
    first = CATALOGUE[env_id].family if env_id in CATALOGUE else "Car"
    differs = env_id in {*CATALOGUE, *VEHICLE_ENVS} and short != first
    facts = {
        "made by": f'`gym.make("{env_id}")`',
        "with": f"`{given}`" if given else "",
        "time limit": f"{steps:,} steps" if steps else "none",
        "solved at a return of": "" if threshold is None else f"{threshold:,.0f}",
        f"changes from {first}": f"`shapechanger envs {first} {short}`" if differs else "",
        "class": f"[`{module}.{name}`][{module}.{name}]",
    }
    return _page(
        f"# {short}",
        f"`{env_id}`: {_summary(env_id)}.",
        f"![{short} at the start of an episode]({short}.jpg)" if picture else "",
        table(("property", "value"), [row for row in facts.items() if row[1]]),
        _described(f"{module}.{name}", "members: []", "show_bases: false", "heading_level: 1"),
    ), picture


def _described(path: str, *options: str) -> str:
    """Return the directive by which MkDocs shows the docstrings of an object, without its name."""
    unnamed = ("show_root_heading: false", "show_root_toc_entry: false")
    return "\n      ".join([f"::: {path}\n    options:", *unnamed, *options])


def _short(env_id: str) -> str:
    return env_id.removeprefix(f"{NAMESPACE}/").removesuffix("-v1")


def _summary(env_id: str) -> str:
    """Return the line of the catalogue, or else the first line of the docstring."""
    doc = inspect.getdoc(_loaded(str(gym.registry[env_id].entry_point))) or ""
    first = doc.split("\n")[0].rstrip(".")
    return summaries().get(env_id, first[:1].lower() + first[1:])


def _loaded(entry_point: str) -> Any:
    module, _, name = entry_point.partition(":")
    return getattr(importlib.import_module(module), name)


def wiring_pages() -> Pages:
    """Return a page with a diagram, pins and parts for each shipped profile, and their index."""
    pages: Pages = {"wiring/index.md": ""}
    rows: list[tuple[str, ...]] = []
    for name, path in shipped_profiles().items():
        profile, text = load_profile(path), path.read_text()
        comment = takewhile(lambda line: line.startswith("#"), text.splitlines())
        about = " ".join(line.removeprefix("#").strip() for line in comment)
        rows.append((f"[`{name}`]({name}.md)", about))
        pages[f"wiring/{name}.md"] = _page(
            f"---\ntitle: {name}\nhide: [toc]\n---",  # Room for the diagram.
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
            f"```toml\n{text.rstrip()}\n```",
        )
    pages["wiring/index.md"] = _page(
        "# Diagrams and parts",
        "A diagram, the pins and the parts of each profile that ships, made from the profiles of "
        "this version. [Hardware](../hardware.md) describes how to build it, and "
        "[profiles](../profiles.md) the meaning of each key.",
        table(("profile", "robot"), rows),
    )
    return pages


_MODULES: Final = """
    layout errors policy contract.testing demos.dataset demos.recording envs.ant
    envs.make_vec envs.own envs.pendulum envs.reshapable envs.runners finger.anatomy
    finger.parameters finger.paths finger.reach finger.remote finger.track robot.client.env
    robot.client.client robot.client.known_robots robot.link.messages robot.twin.operator
    robot.twin.robot transfer.learners.policy_file transfer.study vehicles.remote.waypoints
"""
"""Modules of the reference whose public names no package exports."""


@cache
def public_names() -> dict[str, tuple[str, ...]]:
    """Return the public names of each page of the reference, keyed by package or module."""
    found: dict[str, tuple[str, ...]] = {}
    for path in SRC.glob("shapechanger/**/__init__.py"):
        package = ".".join(path.parent.relative_to(SRC).parts)
        exported = getattr(importlib.import_module(package), "__all__", ())
        if exported and package != "shapechanger.cli":  # `--help` documents its commands.
            found[package] = tuple(exported)
    for module in (f"shapechanger.{name}" for name in _MODULES.split()):
        has = vars(importlib.import_module(module))
        own = {name for name, value in has.items() if getattr(value, "__module__", "") == module}
        own |= {*has.get("__annotations__", {})}
        found[module] = tuple(name for name in has if name in own and not name.startswith("_"))
    return dict(sorted(found.items()))


def api_pages() -> Pages:
    """Return a page for each public package and module, and their index.

    The page of the innermost package or module with a name describes it; others link to it.
    """
    rows: list[tuple[str, ...]] = []
    pages: Pages = {"api/index.md": "", **{f"api/{page}.md": "" for page in public_names()}}
    described: dict[tuple[str, int], str] = {}
    for page, names in sorted(public_names().items(), key=lambda one: -one[0].count(".")):
        module = importlib.import_module(page)
        members: dict[str, str] = {}
        links: list[str] = []
        for name in names:
            key = name, id(getattr(module, name))
            if key in described:
                links.append(f"[`{name}`][{described[key]}]")
            else:
                members[name] = described[key] = reference_path(page, name)
        # MkDocs does not describe a member that has the name of its module.
        hidden = [path for name, path in members.items() if path.endswith(f".{name}.{name}")]
        pages[f"api/{page}.md"] = _page(
            f"---\ntitle: {page.removeprefix('shapechanger.')}\n---",
            f"# `{page}`",
            _described(page, f"members: [{', '.join(members)}]"),
            *(f"::: {path}" for path in hidden),
            f"## Re-exported\n\n{', '.join(links)}." if links else "",
        )
        summary, *_ = (module.__doc__ or "").split("\n\n")
        rows.append((page, f"[`{page}`]({page}.md)", summary))
    pages["api/index.md"] = _page(
        "# API reference",
        "The public names of these packages and modules, with shapes, units and errors. The names "
        "of `shapechanger` itself are imported on first use.",
        table(("package", "contents"), [row[1:] for row in sorted(rows)]),
    )
    return pages


def reference_path(package: str, name: str) -> str:
    """Return the path under which the reference describes an exported name."""
    module = SRC / package.replace(".", "/") / f"{name}.py"
    return f"{package}.{name}.{name}" if module.exists() else f"{package}.{name}"
