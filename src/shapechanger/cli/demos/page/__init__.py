"""One page that shows a recording, and needs no other file."""

from __future__ import annotations

from shapechanger.cli.demos.page.page import recording_html

__all__ = ["recording_html"]
