"""Study and report shared by the tests of reports."""

from __future__ import annotations

import pytest

from shapechanger.transfer.report.study import study_html
from shapechanger.transfer.study import Study
from tests.transfer.report.studies import make_study


@pytest.fixture(scope="session")
def study() -> Study:
    """A study in which transfer helps."""
    return make_study(terms=("reward_forward", "reward_survive"))


@pytest.fixture(scope="session")
def page(study: Study) -> str:
    return study_html(study, picture_note="No image can be drawn here.")
