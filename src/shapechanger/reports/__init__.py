"""Reports as self-contained HTML files: of studies, demonstrations, clones and fingers."""

from __future__ import annotations

__all__: list[str] = []
