"""`shapechanger envs`: list, show, compare, check and render environments."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, cast

import tyro
from rich.table import Table
from rich.text import Text

from shapechanger.cli.console import plain_console, print_table, say
from shapechanger.cli.env_arguments import Body, EnvId, EnvOptions, asked, opened, options_of
from shapechanger.contract.env_ref import EnvRef, layouts_of
from shapechanger.contract.testing import examine
from shapechanger.envs.catalogue import (
    CATALOGUE,
    FINGER_ENVS,
    ODRL_ENVS,
    OWN_ROBOT,
    RANGES_ENVS,
    VEHICLE_ENVS,
    WAYPOINT_ENVS,
)
from shapechanger.envs.naming import env_ref
from shapechanger.layout import Layout
from shapechanger.reports.films import write_picture


@dataclass(frozen=True)
class ListEnvs:
    """List all envs."""

    odrl: bool = False
    """List the bodies of ODRL one by one, instead of in one row."""

    def run(self) -> None:
        """Print a table of the catalogue."""
        table = Table("id", "body", box=None, pad_edge=False)
        if self.odrl:
            for entry in ODRL_ENVS.values():
                table.add_row(entry.id, entry.family)
            print_table(table)
            return
        for entry in CATALOGUE.values():
            table.add_row(entry.id, entry.summary)
        vehicles = (VEHICLE_ENVS, RANGES_ENVS, WAYPOINT_ENVS)
        for env_id, (vehicle, summary) in (one for envs in vehicles for one in envs.items()):
            table.add_row(env_id, f"{vehicle}: {summary}")
        for env_id, task in FINGER_ENVS.items():
            table.add_row(env_id, task.summary)
        table.add_row(OWN_ROBOT, "your MJCF or URDF file: give FILE or FILE@TASK as ENV")
        robots = len({entry.family for entry in ODRL_ENVS.values()})
        targets = len(ODRL_ENVS) - robots
        table.add_row(
            "shapechanger/odrl-ROBOT-SHIFT-LEVEL-v1",
            f"{targets} targets of ODRL and their {robots} sources: `envs list --odrl`",
        )
        print_table(table)


@dataclass(frozen=True)
class ShowEnv:
    """Show the name, unit and range of each number of an env's observation and action."""

    env: EnvId
    """Id of the env, such as BigAnt or shapechanger/BigAnt-v1."""
    body: Body = ""
    options: EnvOptions = ""

    def run(self) -> None:
        """Print both layouts and the properties of the body."""
        with opened(_env(self.env, self.body, self.options)) as env:
            observation, action = layouts_of(env)
            print_table(_layout_table("action", action))
            print_table(_layout_table("observation", observation))
            for name, unit in (("standing_height", "m"), ("healthy_z_range", "m"), ("body", "")):
                value = getattr(env.unwrapped, name, None)
                if value is not None and value != ():
                    say(f"{name.replace('_', ' ')}: {_in_words(value)} {unit}".rstrip())


@dataclass(frozen=True)
class Compare:
    """Compare two envs: what the shift from one to the other changes."""

    source: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    """Id of the env to come from."""
    target: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TARGET")]
    """Id of the env to go to."""
    source_body: str = ""
    """Another body of the source's family: its name, or edits as JSON."""
    target_body: str = ""
    """Another body of the target's family: its name, or edits as JSON."""
    source_options: str = ""
    """More arguments of the source as JSON, such as '{"frame_skip": 4}'."""
    target_options: str = ""
    """The same of the target."""

    def run(self) -> None:
        """Print the certificate of the shift."""
        with (
            opened(_env(self.source, self.source_body, self.source_options)) as source,
            opened(_env(self.target, self.target_body, self.target_options)) as target,
        ):
            asked(target, "certify_shift")
            certificate = asked(source, "certify_shift")(source, target)
            say(str(certificate))


@dataclass(frozen=True)
class CheckEnv:
    """Check that an env satisfies the contract that learners rely on."""

    env: EnvId
    """Id of the env."""
    body: Body = ""
    options: EnvOptions = ""

    def run(self) -> None:
        """Run the exam on the env."""
        ref = _env(self.env, self.body, self.options)
        for question in examine(ref.make):
            plain_console().print(Text.assemble(("kept", "green"), f"  {question}"))


@dataclass(frozen=True)
class Render:
    """Render an env's body in its start pose."""

    env: EnvId
    """Id of the env."""
    out: Path
    """The image to write, a PNG file."""
    body: Body = ""
    options: EnvOptions = ""
    width: int = 640
    """Width of the image in pixels."""
    height: int = 480
    """Height of the image in pixels."""

    def run(self) -> None:
        """Write the image."""
        with opened(_env(self.env, self.body, self.options)) as env:
            picture = asked(env, "picture")(self.width, self.height)
            write_picture(picture, self.out)
        say(f"wrote {self.out}")


def _env(env_id: str, body: str, options: str) -> EnvRef:
    """Return an env with a body and more arguments."""
    return env_ref(env_id, body).having(options_of(options, "--options"))


def _layout_table(side: str, layout: Layout) -> Table:
    """Format a layout as a table, one row per feature."""
    title = f"{side}: {layout.size} numbers"
    table = Table(
        "#", "name", "unit", "low", "high", "belongs to", title=title, title_justify="left"
    )
    if side == "action":
        table.add_column("1 gives")
    for feature, places in zip(layout, layout.slices.values(), strict=True):
        number = str(places.start) if feature.size == 1 else f"{places.start}..{places.stop - 1}"
        element = feature.element
        row = [
            number,
            feature.name,
            feature.unit,
            f"{feature.low:.4g}",
            f"{feature.high:.4g}",
            f"{element.kind} {element.name}" if element else "",
        ]
        if side == "action":
            row.append(f"{feature.gain:.4g} {feature.gain_unit}".strip())
        table.add_row(*row)
    return table


def _in_words(value: Any) -> str:
    """Format a value: rounded numbers, edits as JSON."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, tuple):
        return ", ".join(_in_words(item) for item in cast("tuple[Any, ...]", value))
    return str(value)
