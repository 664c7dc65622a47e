"""What is in a recording, in numbers."""

from __future__ import annotations

from shapechanger.demos.statistics.episodes import EpisodeSummary, summary
from shapechanger.demos.statistics.spread import Spread, spread

__all__ = ["EpisodeSummary", "Spread", "spread", "summary"]
