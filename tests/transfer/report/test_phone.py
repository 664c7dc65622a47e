"""The report page on a phone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# Left edges of the parts of each cell, relative to the cell, pixels.
PARTS = """
() => [...document.querySelectorAll("td[data-label] > *")].map(part =>
  part.getBoundingClientRect().left - part.parentElement.getBoundingClientRect().left)
"""


@pytest.mark.system
def test_values_are_next_to_their_labels_on_a_phone(chromium: Browser, page: str) -> None:
    """At 390 pixels each number and its interval are right of the label, 7 rem wide."""
    shown = chromium.new_page(viewport={"width": 390, "height": 844})
    try:
        shown.set_content(page)
        assert shown.evaluate("document.documentElement.scrollWidth") == 390
        lefts = shown.evaluate(PARTS)
    finally:
        shown.close()
    assert lefts
    assert min(lefts) >= 7 * 16
