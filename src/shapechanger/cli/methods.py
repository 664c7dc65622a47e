"""`shapechanger methods`: list the transfer methods that a study can compare."""

from __future__ import annotations

from dataclasses import dataclass

from rich.table import Table

from shapechanger.cli.console import print_table
from shapechanger.transfer.methods import load_method, method_names


@dataclass(frozen=True)
class Methods:
    """List the transfer methods that a study can compare: shipped ones and those of plug-ins."""

    def run(self) -> None:
        """Print a table."""
        table = Table("method", "what it does", "source", box=None)
        for name in method_names():
            method = load_method(name)
            about = (type(method).__doc__ or "").strip().partition("\n")[0]
            table.add_row(name, about, method.paper)
        print_table(table)
