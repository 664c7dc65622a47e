"""The tables and sentences of the documentation listed here agree with the committed results."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final

import pytest

from shapechanger.errors import WorldError
from shapechanger.vehicles.cameras.rectify import CameraGeometry, Rectifier

ROOT: Final = Path(__file__).parents[2]
NUMBER: Final = re.compile(r"(?<![\w.])[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?")
WORDS: Final = "none|one|two|three|four|five|six|seven|eight|nine|ten|eleven|twelve"

RANGES: Final = "src/shapechanger/vehicles/envs/ranges.py"
CLONES: Final = "src/shapechanger/vehicles/envs/clones/README.md"
WORLDS: Final = "vehicles-waypoints-worlds vehicles-waypoints"
STUDIES: Final = "vehicles-waypoint-studies"
KNOWS: Final = "controller that knows the finger:"

# The page or file, the beginning of a table's header, the files with its rows, and the text that
# the names of the rows contain: {0} is the first cell of a line, {1} the header of a column.
TABLES: Final = [
    ("atlas", "from → to | scratch, m/s | zero", "atlas-ants", "{0}:"),
    ("atlas", "from → to | scratch | fine-tune", "atlas-ants", "{0}:"),
    ("atlas", "shanks |", "atlas-shank", "Ant-to-Ant-{0}:"),
    ("atlas", "method | at the start", "atlas-methods", " {0} over"),
    ("atlas", "method | return at the end", "atlas-replay", " {0} over"),
    ("atlas", "from → to | scratch, return", "atlas-pendulums", "{0}:"),
    ("many-bodies", "ants | limbs, m/s", "generalist", "{0}"),
    ("many-bodies", "ants | 32 ants on", "generalist generalist-gpu", "{0}"),
    ("many-bodies", "ant |", "generalist-specialists", "{0}:"),
    ("vehicles", "seed |", "vehicles-students", "seed {0}:"),
    ("vehicles", "from | in the car", "vehicles-waypoints", "waypoints, {0} to {1}:"),
    ("vehicles", "labels |", "vehicles-waypoints-labels", "{0} to {1}:"),
    ("vehicles", " | without the robot", "vehicles-waypoints-robot", ", {0} in the whole robot"),
    ("vehicles", "camera |", "vehicles-waypoints-cameras", "{0}"),
    ("vehicles", "evaluated in the |", WORLDS, "{1} to {0}:"),
    ("vehicles", "from → to | zero-shot | scratch", STUDIES, "{0}: return of z"),
    ("vehicles", "from → to | zero-shot | rehearsal", STUDIES, "{0}:"),
    ("finger", "arm | targets reached | motion of the target", "finger-gap", "{0}"),
    ("finger", "arm | targets reached | motion of the rig", "finger-rig", "{0}"),
    ("cloning", " | ten minutes", "corrections", ""),
    ("cloning", " | accuracy", "cloning-real", "real frames"),
    ("cloning", "clone | no real frame", "cloning-real", "AUC"),
    ("gpu", "what |", "gpu", ""),
    ("src/shapechanger/finger/policies/README.md", "task |", "finger-shipped", ""),
    (CLONES, "vehicle |", "vehicles-clone", "clone, {0}"),
]
# Texts in the names of rows for cells and headers that are worded differently.
SPELLED: Final = {
    "Inverted": "InvertedPendulum",
    "Big": "BigInvertedPendulum",
    "Small": "SmallInvertedPendulum",
    "training bodies": "32 ants, train:",
    "extrapolation": "32 ants, extrapolation:",
    "extrapolation, 32 other ants": "extrapolation, second draw",
    "`ExtendedAnt`, with 12 joints": "ExtendedAnt",
    "the driver's own steering": "by-its-steering",
    "the line": "by-the-path",
    "taught in the yard": "yard-truck",
    "with randomised looks": "yard-random-truck",
    "half in the corridor": "mixed-truck",
    "all in the corridor": "truck",
    "shuffled-map (control)": "shuffled-map",
    "of the training: level, 48.8 degrees, 160 x 120": "camera of training",
    "8 degrees down, 70 degrees, 160 x 120": "camera of 70 degrees, 8 down",
    "module 3: 2 degrees down, 41 degrees, 160 x 90": "camera of module 3",
    "a controller with a model of the finger": KNOWS,
    "model of the rig's motors and delay, but not of the finger": "motors and delay only",
}
# The page, a sentence of it, the file with its row, and the text that the row's name contains.
SENTENCES: Final = [
    ("atlas", "4.8, 5.6 and 7.9 %", "atlas-controls", "scratch against scratch"),
    ("atlas", "a return of 950 after 10 s", "atlas-claims", "a pendulum is learned"),
    ("atlas", "keeps 48 % of the speed", "atlas-claims", "near the Big Ant's"),
    ("atlas", "12 % of its mechanical power", "atlas-claims", "damaged limb"),
    ("atlas", "25 %; the other limbs spend 21 to 36 %", "atlas-claims", "damaged limb"),
    ("cloning", "0.758 instead of 0.741", "cloning-held-out", "held-out fifth"),
    ("cloning", "0.017 (-0.028 to 0.062", "cloning-held-out", "held-out fifth"),
    ("cloning", "5.89, 2.33 and 2.33", "corrections", "3 seeds, cloned"),
    ("cloning", "0.85 times (0.63 to 1.16)", "corrections", "the round against more"),
    ("cloning", "+0.123 [+0.028, +0.219]", "cloning-real", "clone less plain network"),
    ("exchange", "1.8 to 2.3", "exchange-video", ""),
    ("exchange", "37.5 to 40.2 dB", "exchange-video", ""),
    ("finger", "after 307,200, with the same seeds, it reached 85 %", "finger-gap", "identified:"),
    ("finger", "181 of the 187 targets", "finger-gap", "comes to from rest"),
    ("finger", "none of the other 13", "finger-gap", "comes to from rest"),
    ("finger", "within 5 mm of 99 % of the targets", "finger-gap", "some tensions"),
    ("finger", "can end at 94 %", "finger-gap", "comes to from rest, against"),
    ("finger", "policy reaches 20 % on a twin", "finger-rig", "nominal finger"),
    ("finger", "takes 13 minutes a finger", "finger-command", "minutes a finger"),
    ("finger", "53 minutes of runs for the two fingers", "finger-command", "minutes a finger"),
    ("finger", "within 1.7 mm RMS (1.1 to 2.5)", "finger-follow", "identified policy"),
    ("finger", "is 10 mm off", "finger-follow", "shipped policy"),
    ("finger", "9.7 degrees off in the median and 15.7", "finger-physics", "end joint"),
    ("finger", "differ by 0.08 degrees", "finger-physics", "nominal finger"),
    ("finger", "0.44 degrees", "finger-physics", "gap real-like"),
    ("finger-rig", "5.2 to 7.4 ms", "finger-path", "delay"),
    ("finger-rig", "by 1.0 degrees RMS", "finger-path", "with its path"),
    ("finger-rig", "by 4.2 degrees without", "finger-path", "without a path"),
    ("robots", "in 9 of 20 trials", "robot-faults", "no one-shot fitted"),
    ("identify", "13 %; median 0.6 %; below 5 % in 12 of 20", "finger-identify", "largest error"),
    ("identify", "| 96 %", "finger-identify", "hold the truth"),
    ("identify", "2.7 % in the median, 11 % at most", "finger-identify", "hold the truth"),
    (
        "identify",
        "off by 1.0 degrees, noise included; 20 degrees with",
        "finger-identify",
        "held-out",
    ),
    ("identify", "1.00 to 1.15 in the mean", "finger-identify", "stiffness"),
    ("identify", "0.99 to 1.02 in the mean", "finger-identify", "damping"),
    ("identify", "| 0.93;", "finger-identify", "tendon_friction"),
    ("identify", "| 1.35 |", "finger-identify", "command_delay"),
    ("identify", "7 s of one core", "finger-identify", "10 s"),
    ("many-bodies", "100,270,080 steps", "gpu-generalist", "256 ants"),
    ("many-bodies", "394 seconds", "gpu-generalist", "256 ants"),
    ("speed", "an ant steps 1.50 times", "speed", "one Ant-v1 step"),
    ("speed", "32 ants step 1.89 times", "speed-vector", "N=32, 1 thread: SyncVectorEnv"),
    ("speed", "128 ants 2.05 times", "speed-vector", "N=128, 1 thread: SyncVectorEnv"),
    ("speed", "1.30 times as fast as in EnvPool", "speed-vector", "EnvPool"),
    ("speed", "takes 0.88 to 0.90", "speed-vector", "loop on the fast model"),
    ("speed", "1.44 times as many", "finger-speed", "MyoSuite"),
    ("speed", "it takes 9 ms", "speed", "finding the fast model"),
    ("vehicles", "about 173 steps per second", "vehicles-frames", "Car-v1"),
    ("vehicles", "collide 8.6 [4.4, 14.9] times", "vehicles-waypoints", "steering, car"),
    ("vehicles", "11.7 [7.2, 17.8] times", "vehicles-waypoints", "steering, tank"),
    ("vehicles", "[0.0, 1.2] in 100 m", "vehicles-waypoints-remote", ""),
    ("vehicles", "at 1.94 m/s", "vehicles-waypoints-remote", ""),
    ("vehicles", "9.7 [7.2, 12.9]", "vehicles-waypoints-worlds", "harbour-boat to car"),
    ("vehicles", "13.9 [10.9, 17.5]", "vehicles-waypoints-worlds", "harbour-random-boat"),
    ("vehicles", "3.5 [2.1, 5.6]", "vehicles-waypoints-worlds", "mixed-boat"),
    ("vehicles", "4.3 [2.7, 6.5]", "vehicles-waypoints-worlds", " boat to car"),
    ("vehicles", "1.2 [0.4, 2.6] times in the boat", "vehicles-waypoints-worlds", "boat to boat"),
    ("vehicles", "6.7 [4.6, 9.3]", "vehicles-waypoints-worlds", "car to boat"),
    ("vehicles", "0 to 3.6 %", "vehicles-teachers", ""),
    ("vehicles", "At 3 and 6 of these", "vehicles-teachers", ""),
    ("README.md", "policy fails in four of five seeds", "demo", "zero-shot stays below 900"),
    ("atlas", "ahead in six pairs and behind in six", "atlas-ants", "frozen-trunk ends"),
    ("atlas", "ends at 1.87 to 2.41 m/s", "atlas-shank", "Ant-to-Ant"),
    ("finger", "they reach 80 % and 70 % from rest", "finger-gap", "comes to from rest, against"),
    ("finger", "65 % and 75 % with the controller", "finger-gap", KNOWS),
    ("finger", "a model of the finger reaches 91 %", "finger-gap", KNOWS),
    ("many-bodies", "for 32,768 steps, as many as each", "generalist", "8 ants"),
    ("many-bodies", "0.00, 0.00 and 0.01 m/s", "generalist", "8 ants"),
    ("many-bodies", "of limbs move at 0.56, 0.27 and 0.16", "generalist", "8 ants"),
    ("speed", "1,024 ants take 0.85 MB each", "speed-vector", "N=1024"),
    ("studies", "with a return of 653", "references", "of Humanoid"),
    ("vehicles", "without an image takes 2.4 times as long", "vehicles-fast", "car:"),
    (RANGES, "2.4 times as long for the car and the boat", "vehicles-fast", "boat:"),
    (RANGES, "2.3 times for the truck", "vehicles-fast", "truck:"),
    (RANGES, "1.7 times for the tank", "vehicles-fast", "tank:"),
    ("vehicles", "student took 4.5 and 5.4 minutes", "vehicles-students", "teacher"),
    ("vehicles", "0 on none of six pairs after 15 s", STUDIES, "tuning beats scratch after 15 s"),
    ("vehicles", "and on one after 30 s", STUDIES, "tuning beats scratch after 30 s"),
    ("vehicles", "on ten of them after 15 s", STUDIES, "rehearsal beats scratch after 15 s"),
    ("vehicles", "and on eight after 30 s", STUDIES, "rehearsal beats scratch after 30 s"),
    ("vehicles", "to the car its return is -36.6", "vehicles-pairs", "Truck-to-Car"),
    ("vehicles", "On one pair of twelve", "vehicles-pairs", "pairs on which"),
]


def page(name: str) -> str:
    return (ROOT / (name if "." in name else f"docs/{name}.md")).read_text(encoding="utf-8")


def in_digits(text: str) -> str:
    """Return a text in which small numbers are digits, not words."""
    return re.sub(rf"\b({WORDS})\b", lambda word: str(WORDS.split("|").index(word[0])), text)


@cache
def rows(files: str) -> list[tuple[str, str]]:
    """Return the name and the whole text of each row of some files."""
    found: list[tuple[str, str]] = []
    for file in files.split():
        text = (ROOT / "benchmarks" / "results" / f"{file}.json").read_text(encoding="utf-8")
        for row in json.loads(text)["rows"]:
            found.append((row["name"], " ".join(row[key] for key in ("name", "value", "spread"))))
    return found


def unbacked(text: str, files: str, name: str) -> list[str]:
    """Return the numbers of a text that no row with `name` in its name contains, after rounding."""
    found = " ".join(row for row_name, row in rows(files) if name in row_name)
    assert found, f"No row of {files} has {name!r} in its name."
    known = [float(one.replace(",", "")) for one in NUMBER.findall(in_digits(found))]
    lacking: list[str] = []
    for one in NUMBER.findall(text):
        value, digits = float(one.replace(",", "")), len(one.partition(".")[2])
        if one.endswith(",000"):
            digits = -3
        if all(abs(value - other) > 0.5 * 10**-digits + 1e-9 for other in known):
            lacking.append(one)
    return lacking


def spelled(cell: str, files: str) -> str:
    """Return a cell as the names of rows spell it."""
    cell = cell.removeprefix("in the ").strip("* ")
    names = [SPELLED.get(word, word) for word in cell.split(" → ")]
    if "waypoint-studies" in files:
        names = [f"{word.title()}Waypoint" for word in names]
    return "-to-".join(names)


def lines(name: str, header: str) -> Iterator[tuple[str, str, str]]:
    """Yield, for each cell of a table: first cell of its line, header of its column, and text."""
    _, found, text = page(name).partition(
        f"\n| {header.lstrip()}" if header[0] != " " else f"\n|{header}"
    )
    assert found, f"{name}.md has no table {header!r}."
    head, _, *body = (found + text).split("\n\n")[0].strip("\n").split("\n")
    columns = [cell.strip() for cell in head.strip("|").split("|")]
    for line in body:
        first, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        for column, cell in zip(columns[1:], cells, strict=True):
            yield first, column, cell


@pytest.mark.parametrize(("name", "header", "files", "label"), TABLES)
def test_tables(name: str, header: str, files: str, label: str) -> None:
    lacking: list[str] = []
    for first, column, cell in lines(name, header):
        # Other tests check pooled lines and counts of fingers.
        if first.startswith("**") or column.startswith("fingers with"):
            continue
        row = label.format(spelled(first, files), spelled(column, files))
        # A first cell that names no row may state numbers of its own.
        stated = cell if label else f"{first} {cell}"
        lacking += [f"{first}, {column}: {one}" for one in unbacked(stated, files, row)]
    assert lacking == []


@pytest.mark.parametrize(
    ("header", "file"),
    [
        ("arm | targets reached | motion of the target", "finger-gap"),
        ("arm | targets reached | motion of the rig", "finger-rig"),
    ],
)
def test_fingers_below_80_percent_are_counted_and_named(header: str, file: str) -> None:
    for first, column, cell in lines("finger", header):
        if not column.startswith("fingers with"):
            continue
        label = spelled(first, file)
        (text,) = (
            text
            for name, text in rows(file)
            if label in name
            and "fingers: " in text
            and not re.search("after 30|change|hold|comes", name)
        )
        shares = [
            int(one)
            for one in re.findall(r"(\d+)%", text.partition("fingers: ")[2].partition(";")[0])
        ]
        weak = sorted(share for share in shares if share < 80)
        assert cell.startswith(f"{len(shares) - len(weak)} of {len(shares)}"), first
        if len(weak) < len(shares):  # Otherwise all are weak.
            named = [int(one) for one in re.findall(r"\d+", cell.partition(";")[2])]
            assert named == weak, first


@pytest.mark.parametrize(("name", "sentence", "file", "row"), SENTENCES)
def test_sentences(name: str, sentence: str, file: str, row: str) -> None:
    assert sentence in " ".join(page(name).split())
    assert unbacked(in_digits(sentence), file, row) == []


@pytest.mark.parametrize(
    ("size", "fovy_deg", "row"),
    [
        ((160, 120), 48.8, "yes, pitched from -7 to 11 degrees"),
        ((160, 90), 41.0, "yes, pitched from -4 to 7 degrees"),
        ((160, 120), 41.0, "no: it misses 20 %"),
        ((160, 90), 67.0, "| 67 | yes |"),
        ((160, 120), 41.4, "no: it misses 18 %"),
    ],
)
def test_cameras_for_waypoints(size: tuple[int, int], fovy_deg: float, row: str) -> None:
    """The table of docs/profiles.md states which cameras see enough, at which whole pitches."""
    assert row in page("profiles")
    if missed := re.search(r"misses (\d+) %", row):
        with pytest.raises(WorldError, match=rf"misses {missed[1]} %"):
            Rectifier(CameraGeometry(0.0, fovy_deg), size)
        return
    Rectifier(CameraGeometry(0.0, fovy_deg), size)
    if pitches := re.search(r"from (\S+) to (\S+) degrees", row):
        low, high = (float(one) for one in pitches.groups())
        for pitch_deg in (low, high):
            Rectifier(CameraGeometry(pitch_deg, fovy_deg), size)
        for pitch_deg in (low - 1.0, high + 1.0):
            with pytest.raises(WorldError, match="misses"):
                Rectifier(CameraGeometry(pitch_deg, fovy_deg), size)


def test_a_wrong_number_is_found() -> None:
    assert unbacked("1.61 times", "speed", "one Ant-v1 step") == ["1.61"]
