"""`shapechanger envs`: list, show, compare, check and render environments."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from rich.table import Table
from rich.text import Text

from shapechanger.cli.console import plain_console, print_table, say
from shapechanger.cli.env_arguments import OneEnv, TwoEnvs, asked, opened
from shapechanger.contract.env_ref import layouts_of
from shapechanger.contract.testing import examine
from shapechanger.envs.catalogue import ODRL_ENVS, summaries
from shapechanger.layout import Layout
from shapechanger.reports.films import write_picture


@dataclass(frozen=True)
class EnvsList:
    """List all envs."""

    odrl: bool = False
    """List each env of ODRL in a separate row."""

    def run(self) -> None:
        table = Table("id", "body", box=None, pad_edge=False)
        if self.odrl:
            for entry in ODRL_ENVS.values():
                table.add_row(entry.id, entry.family)
            print_table(table)
            return
        for env_id, summary in summaries().items():
            table.add_row(env_id, summary)
        robots = len({entry.family for entry in ODRL_ENVS.values()})
        targets = len(ODRL_ENVS) - robots
        table.add_row(
            "shapechanger/odrl-ROBOT-SHIFT-LEVEL-v1",
            f"{targets} targets of ODRL and their {robots} sources: `envs list --odrl`",
        )
        print_table(table)


@dataclass(frozen=True, kw_only=True)
class EnvsShow(OneEnv):
    """Show the name, unit and range of each number of an env's observation and action."""

    def run(self) -> None:
        with opened(self.ref) as env:
            observation, action = layouts_of(env)
            print_table(_layout_table("action", action))
            print_table(_layout_table("observation", observation))
            for name, unit in (("standing_height", "m"), ("healthy_z_range", "m"), ("body", "")):
                value = getattr(env.unwrapped, name, None)
                if value is not None and value != ():
                    say(f"{name.replace('_', ' ')}: {_in_words(value)} {unit}".rstrip())


@dataclass(frozen=True, kw_only=True)
class EnvsCompare(TwoEnvs):
    """Compare two envs, and list the changes from one to the other."""

    def run(self) -> None:
        from_, to = self.refs()
        with opened(from_) as source, opened(to) as target:
            asked(target, "certify_shift")
            say(str(asked(source, "certify_shift")(source, target)))


@dataclass(frozen=True, kw_only=True)
class EnvsCheck(OneEnv):
    """Check that an env satisfies the contract that learners rely on."""

    def run(self) -> None:
        for question in examine(self.ref.make):
            plain_console().print(Text.assemble(("kept", "green"), f"  {question}"))


@dataclass(frozen=True, kw_only=True)
class EnvsRender(OneEnv):
    """Render an env's body in its start pose."""

    out: Path
    """The image to write, a PNG file."""
    width: int = 640
    """Width of the image in pixels."""
    height: int = 480
    """Height of the image in pixels."""

    def run(self) -> None:
        with opened(self.ref) as env:
            write_picture(asked(env, "picture")(self.width, self.height), self.out)
        say(f"wrote {self.out}")


def _layout_table(side: str, layout: Layout) -> Table:
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
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, tuple):
        return ", ".join(_in_words(item) for item in cast("tuple[Any, ...]", value))
    return str(value)
