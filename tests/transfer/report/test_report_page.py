"""Pages of studies and suites: their contents, curves, and no external resources."""

from __future__ import annotations

import base64
import io
import re
import sys
from collections.abc import Mapping
from html.parser import HTMLParser
from itertools import permutations
from typing import TYPE_CHECKING, Any

import imageio.v3 as imageio
import msgspec
import numpy as np
import pytest
from matplotlib.figure import Figure

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import MissingExtra, StudyError
from shapechanger.registry import METHODS
from shapechanger.reports import charts
from shapechanger.transfer.methods.basic import FineTune
from shapechanger.transfer.report.curves import learning_curves, sweep_chart
from shapechanger.transfer.report.study import labels, study_html
from shapechanger.transfer.report.suite import FilmStrip, Sweep, suite_html
from shapechanger.transfer.report.verdict import measure_rows, verdict
from shapechanger.transfer.study import Study
from tests.transfer.report.studies import make_study, rising

if TYPE_CHECKING:
    from playwright.sync_api import Browser

FLAT = rising(-50.0, -50.0, 1e3)
EVIL = "<script>alert(1)</script>&\"'"
VOID = {"meta", "img"}


class Reader(HTMLParser):
    """Words, attributes, headings and tags of a page; every tag must be closed."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self._open: list[str] = []
        self._pieces: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.headings: list[str] = []
        self.tags: list[str] = []
        self.feed(page)
        self.close()
        assert self._open == []
        self.text = " ".join(" ".join(self._pieces).split())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]
        if tag not in VOID:
            self._open.append(tag)
        if tag in {"h1", "h2"}:
            self.headings.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] != "style":
            self._pieces.append(data)
        if self._open and self._open[-1] in {"h1", "h2"}:
            self.headings[-1] += data


def test_the_page_is_self_contained(page: str) -> None:
    read = Reader(page)
    assert {"script", "link", "iframe", "object"}.isdisjoint(read.tags)
    sources = [value for name, value in read.attributes if name in {"src", "href", "srcset"}]
    assert len(sources) == 2
    assert all(source.startswith("data:image/svg+xml;base64,") for source in sources)
    for external in ("url(", "@import", "http://", "https://"):
        assert external not in page


def test_numbers_match_the_table(study: Study, page: str) -> None:
    read = Reader(page)
    assert verdict(study) in read.text
    for row in measure_rows(study):
        assert row.note in read.text
        cells = (row.measure, row.target, row.total, row.unit, row.method)
        assert (" ".join(cells) in read.text) == (row.target != "undefined")


def test_methods_map_and_provenance_are_stated(page: str) -> None:
    """Matched entries of the body map are counted and folded, and others are listed."""
    read = Reader(page)
    for text in (
        "over training seeds, never over episodes",
        "Welch",
        "Taylor & Stone, JMLR 10, 2009",
        "Continual World, NeurIPS 2021",
        "(value - zero) / (one - zero)",
        "zero = 10 is the best value without skill, here random actions",
        "2 of 3 source observations and 1 of 2 target actions",
        "observation: tail/angle zero default",
        "action: leg_2/motor leg_1/motor rule 'leg_2/motor'",
        "does not see: leg_2/angle.",
        "move nothing in the target: tail/motor.",
        "The 3 entries with a partner of the same name",
        "ppo-balance",
        "learning_rate 0.001",
        "shapechanger transfer Ant BigAnt --seeds 5",
        "7, from which the seeds of all runs are drawn",
        "shapechanger 0.1.0, numpy 2.4.0",
        "Linux x86_64",
        "5.4 min for all runs together",
        "fine-tune-4 1004 10,240 11 12.5 s",
        "pole: length 0.6 m -> 1.2 m (x2)",
        "5 trained by the study, one for each seed",
        "scratch 440.3 440.3 zero-shot 200 200",
    ):
        assert text in read.text
    assert read.tags.count("details") == 3


def test_names_are_escaped() -> None:
    study = make_study(
        source=EnvRef("evil/" + EVIL, {"body": EVIL * 9}),
        command=EVIL,
        shift=EVIL,
        terms=("reward_" + EVIL,),
    )
    page = study_html(study, picture_note=EVIL)
    read = Reader(page)
    assert "<script" not in page
    assert "script" not in read.tags
    assert read.text.count("alert(1)") >= 13
    assert read.headings[0].endswith(f", {EVIL * 9} → BigAnt")


@pytest.mark.parametrize(
    ("study", "text"),
    [
        (make_study(given=True), "given, SHA-256 abababab"),
        (make_study(arms=("scratch", "zero-shot")), "Zero-shot against scratch"),
        (make_study(scratch=FLAT, fine_tune=FLAT, zero_shot=FLAT[:, :1]), "There are no scores"),
        (make_study(scratch=rising(-9e6, -1e5, 3e3, seeds=2)), "With 2 seeds"),
        (make_study(scratch=rising(0.0, 1e20, 3e3, seeds=10)), "e19 [8."),
        (make_study(shift=""), "The envs publish no certificate"),
        (make_study(command=""), "called from Python"),
    ],
)
def test_missing_parts_are_stated(study: Study, text: str) -> None:
    """The page states what is missing, and never shows nan, inf or None."""
    read = Reader(study_html(study))
    assert text in read.text
    assert "Reward terms" not in read.text
    assert re.search(r"\b(nan|inf|None|undefined \[)\b", read.text) is None


def test_without_matplotlib_the_extra_is_named(
    study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rows and verdict work without matplotlib; the page raises MissingExtra."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for name in ("reports.charts", "transfer.report.curves"):
        monkeypatch.delitem(sys.modules, f"shapechanger.{name}", raising=False)
        monkeypatch.delattr(f"shapechanger.{name}", raising=False)
    assert measure_rows(study)
    assert verdict(study)
    with pytest.raises(MissingExtra, match=r"shapechanger\[report\]"):
        study_html(study)


LEG = '{"edit": "stretch", "body": "leg", "factor": 0.7}'
EDITS = """[{"edit": "stretch", "body": "shank_*", "factor": 2.12345678901},
{"edit": "mass", "element": "torso", "scale": 2}, {"edit": "gravity", "to": [0.0, 0.0, -5.5]},
{"edit": "split", "body": "leg_1", "name": "toe", "at": 0.25}]"""
EDITED = "shank x2.12345678901, torso mass x2, gravity 0, 0, -5.5, split leg_1 toe at 0.25"


@pytest.mark.parametrize(
    ("env_id", "arguments", "label"),
    [
        ("shapechanger/Hopper-v1", {"body": f"[{LEG}]"}, "Hopper, leg x0.7"),
        ("shapechanger/Ant-v1", {"body": EDITS}, f"Ant, {EDITED}"),
        ("shapechanger/Hopper-v1", {"body": "Tall"}, "Hopper, Tall"),
        ("Hopper-v5", {"frame_skip": 2}, "Hopper-v5, frame skip 2"),
        ("shapechanger/Car-v1", {"lenses": ["night", "blur"]}, "Car, night, blur"),
        ("shapechanger/OwnRobot-v1", {"path": "a/dog.xml", "task": "my:Sit"}, "a/dog.xml, my:Sit"),
    ],
)
def test_labels_are_those_that_a_person_would_give(
    env_id: str, arguments: dict[str, Any], label: str
) -> None:
    """A label has words instead of JSON, and all arguments except flags that the envs share."""
    env, other = EnvRef(env_id, arguments), EnvRef("shapechanger/Ant-v1", {"put_back": True})
    assert labels(env, other) == {str(env): label, str(other): "Ant, put back yes"}
    assert labels(other) == {str(other): "Ant"}


def test_pictures_are_embedded(study: Study) -> None:
    """Both bodies are embedded losslessly, each with a caption and an alternative text."""
    picture = np.random.default_rng(0).integers(0, 256, (6, 8, 3), np.uint8)
    page = study_html(study, (picture, picture[:, ::-1]), "To one scale.")
    found = re.findall(r'src="data:image/png;base64,([^"]+)" alt="([^"]+)"', page)
    names = [f"The body of shapechanger/{name}-v1" for name in ("Ant", "BigAnt")]
    assert [alternative for _, alternative in found] == names
    decoded = imageio.imread(io.BytesIO(base64.b64decode(found[1][0])), extension=".png")
    np.testing.assert_array_equal(decoded, picture[:, ::-1])
    read = Reader(page)
    assert "Source: Ant (3 observations, 2 actions)" in read.text
    assert "To one scale." in read.text


NAMES = ("InvertedPendulum", "BigInvertedPendulum", "SmallInvertedPendulum")
POLES = [EnvRef(f"shapechanger/{name}-v1") for name in NAMES]


@pytest.fixture(scope="module")
def pairs() -> Mapping[str, Study]:
    """Six pairs of three poles; transfer hurts from the second to the first only."""
    studies: dict[str, Study] = {}
    for source, target in permutations(POLES, 2):
        hurts = (source, target) == (POLES[1], POLES[0])
        more = {"fine_tune": rising(-200.0, 100.0, 3000.0, seed=3)} if hurts else {}
        study = make_study(source=source, target=target, **more)
        studies[f"{source.id[13:-3]}-to-{target.id[13:-3]}"] = study
    return studies


@pytest.fixture(scope="module")
def suite_page(pairs: Mapping[str, Study]) -> str:
    return suite_html("poles", pairs, seeds=5)


def test_pairs_and_methods_have_tables(suite_page: str) -> None:
    """Each cell of the matrix, source by target, links to a report; methods have intervals."""
    reader = Reader(suite_page)
    links = [value for name, value in reader.attributes if name == "href"]
    for source, target in permutations(NAMES, 2):
        assert links.count(f"{source}-to-{target}/report.html") == 2
    assert reader.headings[1] == "Fine-tune against scratch"
    for text, times in (("same body", 3), ("all targets", 3), ("baseline", 4)):
        assert reader.text.count(text) == times
    assert "ahead of scratch in 5, behind in 1, and without a clear difference in 0" in reader.text
    assert "SmallInvertedPendulum fine-tune 10" in reader.text
    assert "all targets fine-tune 30" in reader.text


@pytest.mark.parametrize("seeds", [2, 5])
def test_undefined_bootstrap_intervals_are_omitted(seeds: int) -> None:
    """An interval is undefined for two runs, and if all runs of one arm are better."""
    better, worse = rising(900.0, 950.0, 3e3), rising(0.0, 100.0, 3e3, seed=1)
    study = make_study(scratch=worse[:seeds], fine_tune=better[:seeds])
    text = Reader(suite_html("a", {"a": study}, seeds=seeds)).text
    assert "1 (no interval)" in text
    assert "1 [1, 1]" not in text
    assert (text.count("(no interval)") > 2) == (seeds == 2)


@pytest.mark.parametrize(
    ("declared", "looks", "said", "unsaid"),
    [
        (5, (5,), "declares 5 seeds, and every study has them.", "Results were also"),
        (8, (5,), "the studies have 5, so these are interim results", "Results were also"),
        (3, (5,), "The suite declares 3 seeds; the studies have 5.", "interim"),
        (5, (3, 5), "Results were also computed on the way, with 3 seeds", "interim"),
    ],
)
def test_declared_seeds_and_earlier_looks_are_stated(
    declared: int, looks: tuple[int, ...], said: str, unsaid: str
) -> None:
    study = msgspec.structs.replace(make_study(), looks=looks)
    suite_page = suite_html("a", {"a": study}, seeds=declared)
    assert said in suite_page
    assert unsaid not in suite_page


def test_a_sweep_has_a_chart(study: Study) -> None:
    values = {"a": 0.5, "b": 1.5, "c": 2.0}
    sweep = Sweep("factor", values)
    reader = Reader(suite_html("shank", dict.fromkeys(values, study), seeds=5, sweep=sweep))
    assert "Over the targets" in reader.headings
    assert "Fine-tune against scratch" not in reader.headings


def test_strips_are_embedded_and_films_linked(pairs: Mapping[str, Study], suite_page: str) -> None:
    strips = {f"{NAMES[0]}-to-{NAMES[1]}": [FilmStrip("zero-shot: 0.1 m/s", b"\xff\xd8jpeg")]}
    films = dict.fromkeys(strips, "a/film.mp4")
    reader = Reader(suite_html("poles", pairs, seeds=5, strips=strips, films=films))
    assert ("href", "a/film.mp4") in reader.attributes
    assert any(value.startswith("data:image/jpeg") for _, value in reader.attributes)
    assert "zero-shot: 0.1 m/s" in reader.text
    assert "Films" in reader.headings
    assert "Films" not in Reader(suite_page).headings


def test_names_of_a_suite_are_escaped() -> None:
    suite_page = suite_html(EVIL, {EVIL: make_study(command=EVIL)}, seeds=5)
    assert "<script" not in suite_page
    with pytest.raises(StudyError, match="suite none has no finished study"):
        suite_html("none", {}, seeds=5)


LINES = rising(0.0, 1000.0, 3e3, noise=0.0)
TWO = make_study(scratch=LINES[:2])
FEW = "A verdict needs at least 3 seeds: run the same suite again with --seeds 5"


@pytest.mark.parametrize(
    ("studies", "text"),
    [
        ([make_study(scratch=FLAT, fine_tune=FLAT)], "difference in 0; neither learned in 1."),
        ([make_study(scratch=LINES, fine_tune=LINES)], "there is no interval in 1."),
        (
            [make_study(), TWO],
            f"Over 2 studies, fine-tune is ahead of scratch in 1, behind in 0, "
            f"and without a clear difference in 0. {FEW}",
        ),
        ([TWO], f"Suite of transfer studies mine {FEW}"),
        ([make_study(arms=("scratch", "zero-shot"))], "zero-shot is ahead of scratch in 0, beh"),
    ],
)
def test_the_verdict_of_a_suite_counts_by_the_rule_of_studies(
    studies: list[Study], text: str
) -> None:
    named = {f"{i}": study for i, study in enumerate(studies)}
    assert text in Reader(suite_html("mine", named, seeds=5)).text


def test_drawings_are_reproducible(study: Study) -> None:
    """Equal studies give equal bytes, without a date."""
    drawing = learning_curves(study, "target")["target"]
    assert drawing == learning_curves(study, "target")["target"]
    assert "<dc:date>" not in drawing
    assert "<metadata>" not in drawing


OWN = "warm-start-" * 6


@pytest.mark.parametrize(
    "arms", [(), ("prefilled-replay", "off-dynamics", "generalist"), (f"json:{OWN}",)]
)
def test_a_legend_lies_within_its_figure(
    arms: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It lies below the curves, whose height is at least two inches."""
    monkeypatch.setattr(METHODS, "_registered", {OWN: FineTune})
    figures: list[Figure] = []
    monkeypatch.setattr(charts, "Figure", lambda **o: figures.append(Figure(**o)) or figures[-1])
    curves = dict.fromkeys(arms, rising(400.0, 1000.0, 1e3))
    study = make_study(arms=("scratch", "zero-shot", "fine-tune", *arms), **curves)
    learning_curves(study, "target", "total")
    sweep_chart({1.0: study, 2.0: study}, "factor")
    for figure in figures:
        whole, legend = figure.bbox, figure.legends[0].get_window_extent()
        plot = figure.axes[0].get_window_extent()
        assert whole.x0 <= legend.x0 < legend.x1 <= whole.x1
        assert whole.y0 <= legend.y0 < legend.y1 <= plot.y0
        assert plot.height >= 2.0 * figure.dpi


# Left edges of the parts of each cell, pixels, and words that are broken over two lines. Labels are
# not part of the document's text, so the width of their words is measured.
SHOWN = r"""
() => {
  document.querySelectorAll("details").forEach(one => one.open = true);
  const left = one => one.getBoundingClientRect().left;
  const lefts = [...document.querySelectorAll("td[data-label] > *")].map(
    part => left(part) - left(part.parentElement));
  const broken = [], range = document.createRange();
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let text; text = texts.nextNode();)
    for (const word of text.data.matchAll(/[\w.,%+]+/g)) {
      range.setStart(text, word.index);
      range.setEnd(text, word.index + word[0].length);
      if (new Set([...range.getClientRects()].map(one => one.top)).size > 1) broken.push(word[0]);
    }
  const pen = document.createElement("canvas").getContext("2d");
  for (const cell of document.querySelectorAll("td[data-label]")) {
    pen.font = getComputedStyle(cell, "::before").font;
    broken.push(...cell.dataset.label.split(/[ -]/).filter(word =>
      pen.measureText(word).width > parseFloat(getComputedStyle(cell).gridTemplateColumns)));
  }
  return [lefts, broken];
}
"""


@pytest.mark.system
@pytest.mark.parametrize("name", ["page", "suite_page"])
def test_pages_are_whole_on_a_phone(
    chromium: Browser, name: str, request: pytest.FixtureRequest
) -> None:
    """At 390 pixels values are right of their labels, and no word is broken."""
    shown = chromium.new_page(viewport={"width": 390, "height": 844})
    try:
        shown.set_content(request.getfixturevalue(name))
        assert shown.evaluate("document.documentElement.scrollWidth") == 390
        lefts, broken = shown.evaluate(SHOWN)
    finally:
        shown.close()
    assert broken == []
    assert min(lefts) >= 7 * 16
