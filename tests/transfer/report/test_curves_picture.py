"""Drawings of learning curves."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from shapechanger.transfer.report.curves import learning_curves
from shapechanger.transfer.study import Study
from tests.transfer.report.studies import make_study, rising


def same(level: float, seeds: int = 5) -> np.ndarray:
    """Return curves without spread."""
    return np.full((seeds, 11), level)


STUDIES = {
    "ten seeds": make_study(scratch=rising(0.0, 1000.0, 3000.0, seeds=10)),
    "two seeds": make_study(scratch=rising(-9e5, -1e5, 3e3, seeds=2)),
    "huge": make_study(
        scratch=rising(0.0, 1e29, 3e3, noise=1e27), fine_tune=rising(1e28, 1e29, 1e3, noise=1e27)
    ),
    "flat": make_study(
        scratch=same(0.0), fine_tune=same(0.0), zero_shot=same(0.0)[:, :1], random=same(0.0)[:, :1]
    ),
    "zero-shot only": make_study(arms=("scratch", "zero-shot")),
    "long source": make_study(source_steps=51_200, given=True),
    "no source steps": make_study(source_steps=0),
}


def test_drawings_are_reproducible(study: Study) -> None:
    """Equal studies give equal bytes, without a date."""
    drawing = learning_curves(study, "target")["target"]
    assert drawing == learning_curves(study, "target")["target"]
    assert "<dc:date>" not in drawing
    assert "<metadata>" not in drawing


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_can_be_drawn(name: str) -> None:
    """Drawings are well-formed SVG with a viewBox, and no warning is raised."""
    drawn = learning_curves(STUDIES[name], "target", "total")
    assert drawn["target"] != drawn["total"] or name == "no source steps"
    for drawing in drawn.values():
        root = ET.fromstring(drawing)
        assert root.tag.endswith("svg")
        assert "viewBox" in root.attrib
