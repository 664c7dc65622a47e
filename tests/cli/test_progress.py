"""Progress of long studies."""

from __future__ import annotations

import io

from rich.console import Console

from shapechanger.cli.console import StudyProgress


def test_a_terminal_shows_a_bar_with_the_time_left() -> None:
    screen = io.StringIO()
    console = Console(force_terminal=True, file=screen, width=120, legacy_windows=False)
    with StudyProgress({"scratch-0": 100, "scratch-1": 100}, console) as progress:
        progress("scratch-0", 50, False)
        progress("scratch-0", 100, True)
    shown = screen.getvalue()
    assert "1/2 runs" in shown
    assert "━" in shown
    assert "50 %" in shown
    assert "100/200" in shown
    assert "left:" in shown
    assert "\x1b" in shown


def test_without_a_terminal_it_prints_lines() -> None:
    file = io.StringIO()
    with StudyProgress({"[/x]": 100, "b": 300}, Console(file=file, markup=False)) as progress:
        progress("[/x]", 100, True)
    assert file.getvalue().startswith("[/x] ended; 1 of 2 runs, 25 % of the steps")
    assert "\x1b" not in file.getvalue()
