"""`shapechanger finger identify`: what a finger is like, from a log."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.table import Table

from shapechanger.cli.console import plain_console
from shapechanger.errors import OutputError

if TYPE_CHECKING:
    from shapechanger.identify import IdentifiedFinger

__all__ = ["Identify"]


@dataclass(frozen=True)
class Identify:
    """Find out what a finger is like from a log, with intervals."""

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="LOG")]
    """The log, as `shapechanger finger record` writes it."""
    out: Path | None = None
    """File for the parameters, such as finger.json: what an env of the finger takes as
    `parameters`."""
    report: Path | None = None
    """The page to write; beside the log if not given."""

    def run(self) -> None:
        """Print the parameters, and write them and the page."""
        from shapechanger.identify import identify, load_log
        from shapechanger.reports.finger import finger_html, summary_line
        from shapechanger.transfer.files import make_folder, write_atomic

        page = self.report or self.log.with_name(f"{self.log.stem}.html")
        files = [path for path in (self.out, page) if path is not None]
        for path in files:
            if path.is_dir():
                raise OutputError(f"Cannot write {path}: it is a folder.")
            if path.resolve() == self.log.resolve():
                raise OutputError(f"Cannot write {path}: it is the log.")
        log = load_log(self.log)
        for path in files:
            make_folder(path.parent)
        console, notes = plain_console(), plain_console(stderr=True)
        found = identify(log, lambda words: notes.print(f"{words} …", soft_wrap=True))
        write_atomic(page, finger_html(found, self.log.name).encode())
        if self.out is not None:
            write_atomic(self.out, found.parameters.to_json().encode())
        console.print(_table(found))
        for name, why in found.untold:
            console.print(f"{name} cannot be told: {why}", soft_wrap=True)
        console.print(f"wrote {' and '.join(str(path) for path in files)}", soft_wrap=True)
        console.print(summary_line(found), soft_wrap=True)


def _table(found: IdentifiedFinger) -> Table:
    from shapechanger.reports.finger import interval, label, number

    table = Table("parameter", "identified", "95 % interval", "nominal", box=None, pad_edge=False)
    for e in found.estimates:
        table.add_row(label(e), number(e, e.value), interval(e), number(e, e.nominal))
    return table
