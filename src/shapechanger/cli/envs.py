"""`shapechanger envs`: list, show, compare, check and draw environments."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, cast

import tyro
from rich.table import Table
from rich.text import Text

from shapechanger.cli.console import plain_console, print_table, say
from shapechanger.cli.env_arguments import Body, asked, opened, options_of
from shapechanger.contract.env_ref import layouts_of
from shapechanger.contract.testing import examine
from shapechanger.envs.catalogue import ODRL_ENVS, env_ref, summaries
from shapechanger.errors import StudyError
from shapechanger.layout import Layout
from shapechanger.reports.films import write_picture


@dataclass(frozen=True, kw_only=True)
class Envs:
    """List the envs, show the numbers and units of one, compare two, check or draw one."""

    env: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="[ENV]")] = ""
    """Id of the env, such as BigAnt or shapechanger/BigAnt-v1; all envs are listed if not given."""
    other: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="[OTHER]")] = ""
    """Id of another env; the changes from ENV to it are listed."""
    body: Body = ""
    options: str = ""
    """More arguments of the env as JSON, such as '{"frame_skip": 4}'."""
    other_body: Body = ""
    other_options: str = ""
    """More arguments of the other env as JSON."""
    check: bool = False
    """Check that the env satisfies the contract that learners rely on."""
    picture: Path | None = None
    """A PNG file to write with an image of the env's body in its start pose."""
    width: int = 640
    """Width of the image in pixels."""
    height: int = 480
    """Height of the image in pixels."""
    odrl: bool = False
    """List the envs of ODRL instead, each in its own row."""

    def run(self) -> None:
        if not self.env:
            if self.body or self.options or self.check or self.picture:
                raise StudyError("Name an env, such as `shapechanger envs Ant`.")
            _list(odrl=self.odrl)
            return
        if not self.other and (self.other_body or self.other_options):
            raise StudyError("--other-body and --other-options need a second env: name it too.")
        ref = env_ref(self.env, self.body).having(options_of(self.options, "--options"))
        if self.check:
            for question in examine(ref.make):
                plain_console().print(Text.assemble(("kept", "green"), f"  {question}"))
        with opened(ref) as env:
            if self.picture is not None:
                write_picture(asked(env, "picture")(self.width, self.height), self.picture)
                say(f"wrote {self.picture}")
            if self.other:
                to = env_ref(self.other, self.other_body)
                with opened(to.having(options_of(self.other_options, "--other-options"))) as other:
                    asked(other, "certify_shift")
                    say(str(asked(env, "certify_shift")(env, other)))
            elif self.picture is None and not self.check:
                observation, action = layouts_of(env)
                print_table(_layout_table("action", action))
                print_table(_layout_table("observation", observation))
                for name, unit in (
                    ("standing_height", "m"),
                    ("healthy_z_range", "m"),
                    ("body", ""),
                ):
                    value = getattr(env.unwrapped, name, None)
                    if value is not None and value != ():
                        say(f"{name.replace('_', ' ')}: {_in_words(value)} {unit}".rstrip())


def _list(*, odrl: bool) -> None:
    table = Table("id", "family" if odrl else "body", box=None, pad_edge=False)
    if odrl:
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
        f"{targets} targets of ODRL and their {robots} sources: `envs --odrl`",
    )
    print_table(table)


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
