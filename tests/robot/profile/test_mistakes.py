"""Each mistake in a profile gives one sentence: file, line, problem and alternatives."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import ProfileError
from shapechanger.robot.profile import shipped_profiles
from tests.robot.profile.texts import EVERYTHING, changed, read

# Text to replace in EVERYTHING, its replacement, and part of the message; then the start of the
# reported line, unless that is the first line of the replacement.
MISTAKES = [
    # Unknown tables and keys.
    ("[limits]", "[limit]", "no table or key 'limit' (did you mean 'limits'?); there are: act"),
    (
        "# A rover",
        'colour = "red" #',
        "no table or key 'colour'; there are: action, camera",
        'colour = "red" # with one of everything.',
    ),
    (
        "arming =",
        "armimg =",
        "[limits] has no key 'armimg' (did you mean 'arming'?); there are",
        'armimg = "anyone"',
    ),
    ("enable = 26", "enabel = 26", "[output.drive] has no key 'enabel' (did you mean 'enable'?)"),
    ("enable = 26", "left_us = 1000", "'left_us' belongs to the driver servo, not to [output."),
    ("enable = 26", "channel = 3", "belongs to the pulse source pca9685 and sysfs, not to"),
    ("trigger = 23", "a = 5\ntrigger = 23", "'a' belongs to the driver encoder, not to"),
    ("flip = true", 'path = "x"', "'path' belongs to the driver file and pipe, not to [camera]"),
    # Wrong and missing values.
    ('body = "car"', "body = { a = 1 }", "that can be printed, not a table"),
    ('name = "rover"', "name = 5", "name of [robot] must be a text of 1 to 64 characters that"),
    ('name = "rover"', 'name = " "', "must be a text of 1 to 64 characters that can be printed"),
    ('name = "rover"', 'name = "a\\u0007"', "that can be printed, not the text"),
    (
        'name = "rover"',
        f'name = "{"r" * 65}"',
        "not the text 'rrrrrrrrrrrrrrrr",
        'name = "rrrrrrrrrrrrrrrrrrrrrrrrrrrrrrrr',
    ),
    (
        'name = "rover"\n',
        "",
        "[robot] lacks the key 'name', a text of 1 to 64 characters",
        "[robot]",
    ),
    ("control_hz = 25", 'control_hz = "25 Hz"', "a number from 1 to 100 (hertz), not the text"),
    ("control_hz = 25", "control_hz = nan", "from 1 to 100 (hertz), not nan"),
    ("control_hz = 25", "control_hz = 0.5", "from 1 to 100 (hertz), not 0.5"),
    ("control_hz = 25", "control_hz = 2026-11-03", "not the date 2026-11-03"),
    ("control_hz = 25", "control_hz = 12:00:00", "not the time 12:00:00"),
    (
        "control_hz = 25",
        f"control_hz = {'9' * 400}",
        "not a number too large to write",
        "control_hz = 9",
    ),
    (
        "2026-11-03",
        "2026-11-03T12:00:00",
        "must be a date, such as 2026-11-03, not the",
        "calibrated = 2026-11-03T12:00:00",
    ),
    ("propels = true", 'propels = "yes"', "propels of [action.throttle] must be true or false"),
    (
        'levels = "three"',
        'levels = "thre"',
        "one of 'any', 'three', not 'thre' (did you mean 'three'?)",
    ),
    ('levels = "three"', "levels = 3", "must be one of 'any', 'three', not 3"),
    ("seconds = 0.5", "seconds = true", "seconds of [[reset]] number 2 must be a number above"),
    ("size = [128, 128]", "size = [128]", "[width, height] in pixels, each an even number from"),
    (
        "size = [128, 128]",
        "size = [128, 127]",
        "each an even number from 16 to 1920, not a list of 2",
    ),
    ("size = [128, 128]", "size = [128, 4000]", "each an even number from 16 to 1920"),
    ("size = [128, 128]", "size = 128", "size of [camera] must be [width, height] in pixels"),
    ("mix.throttle = 0.5", 'mix = "throttle"', "must be a table of numbers from -10 to 10 by"),
    (
        "mix = { arm = 1.0 }",
        "mix = { arm = true }",
        "by name of action, and the one of arm is true",
    ),
    ("mix = { arm = 1.0 }", "mix = { arm = nan }", "and the one of arm is nan"),
    ("[stop]", "[[stop]]", "[stop] must be a table, not a list of 1"),
    (
        "[sensor.chip]\n",
        "[sensor]\nchip = 5\n[sensor.chop]\n",
        "[sensor.chip] must be a table",
        "chip = 5",
    ),
    (
        "[[reset]]\nvalues = { throttle = -0.4 }\nseconds = 1\n\n[[reset]]\nseconds = 0.5\n"
        "[reset.values]\narm = 0.5\n",
        "[reset]\nseconds = 1\n",
        "written [[reset]], with two",
    ),
    # Missing and wrong units.
    ("stop_distance_m", "stop_distance", "write 'stop_distance_m' (metres)", "stop_distance = 0.3"),
    (
        "stop_distance_m",
        "stop_distance_cm",
        "lacks its unit or has another one: write",
        "stop_distance_cm = 0.3",
    ),
    ("slew_per_s", "slew", "'slew' of [action.throttle] lacks its unit", "slew = 2"),
    ("left_us", "left", "write 'left_us' (microseconds)", "left = 2000"),
    ("wheel_m", "wheel", "write 'wheel_m' (metres)", "wheel = 0.21"),
    ("control_hz", "control", "write 'control_hz' (hertz)", "control = 25"),
    # Pins.
    ("enable = 26", "enable = 28", 'a BCM pin from 0 to 27, such as 22, "GPIO22" or "BOARD15"'),
    ("enable = 26", "enable = -2", ", or -1 for none, not -2"),
    ("enable = 26", "enable = true", "enable of [output.drive] must be a BCM pin"),
    ("enable = 26", 'enable = "BOARD6"', "or -1 for none, and BOARD6 is ground"),
    ("enable = 26", 'enable = "BOARD17"', "and BOARD17 is 3.3 V"),
    ("enable = 26", 'enable = "BOARD41"', "the header has the places 1 to 40"),
    ("enable = 26", 'enable = "GPIO28"', "a BCM pin from 0 to 27"),
    ("enable = 26", 'enable = "P1"', "a BCM pin from 0 to 27"),
    ("a = 16", "a = -1", "a of [sensor.wheel] must be a BCM pin from 0 to 27"),
    ("12,  # Left.", "99,", 'or "BOARD15", not 99', "pins = ["),
    ('pins = [\n    12,  # Left.\n    "GPIO13",\n]', "pins = []", "not an empty list"),
    (
        "enable = 26",
        "enable = 22",
        "GPIO22 is used twice: by forward of [output.drive] (line 24) and by enable of [outp",
    ),
    (
        "echo = 24",
        'echo = "BOARD13"',
        "GPIO27 is used twice: by backward of [output.drive] (line 25) and by echo of [sens",
    ),
    (
        '"GPIO13"',
        "12",
        "by pins of [sensor.bumper] (line 67) and by pins of [sensor.bumper]",
        "pins = [",
    ),
    ("pin = 19", "pin = 5", "by phase of [output.brush] (line 53) and by pin of [enable]"),
    ("pin = 21", "pin = 19", "by pin of [enable] (line 116) and by pin of [emergency_button]"),
    ("pin = 21", "pin = 25", "GPIO25 is used twice: by output_enable of [output.arm] (line 42)"),
    ("pin = 21", "pin = 3", "GPIO3 is used twice: by bus of [output.steer] (line 29) and by"),
    ("phase = 5", "phase = 2", "GPIO2 is used twice: by bus of [output.steer] (line 29) and"),
    # Channels, buses and chips.
    ("channel = 1\n", "channel = 0\n", "channel 0 of the PCA9685 at 0x40 of I2C bus 1 is used"),
    (
        "address = 0x41",
        "",
        "address 0x40 of I2C bus 1 is used twice: by address of [output.ste",
        "[sensor.pack]",
    ),
    (
        "channel = 1\n",
        "channel = 1\nhz = 60\n",
        "has one hz for all its channels, 50 or 60",
        "hz = 60",
    ),
    (
        "channel = 0\nleft_us",
        "channel = 0\noutput_enable = 7\nleft_us",
        "one output_enable for",
        "output_enable = 25",
    ),
    (
        "mix = { arm = 1.0 }",
        'mix = { arm = 1.0 }\n[output.x]\ndriver = "esc"\nover = "sysfs"\nchannel = 0\n'
        "mix = { throttle = 1.0 }",
        "channel 0 of PWM chip 0 is used twice",
        "channel = 0",
    ),
    # Drivers.
    ('"hbridge"', '"hbrigde"', "not 'hbrigde' (did you mean 'hbridge'?)", 'driver = "hbrigde"'),
    (
        'driver = "hbridge"\n',
        "",
        "[output.drive] lacks the key 'driver', one of 'hbridge'",
        "[output.drive]",
    ),
    ('"encoder"', '"coder"', "not 'coder' (did you mean 'encoder'?)", 'driver = "coder"'),
    ('"v4l2"', '"v4l"', "'pattern', not 'v4l' (did you mean 'v4l2'?)", 'driver = "v4l"'),
    ('over = "sysfs"', 'over = "gpiozero"', "in steps of 200 µs, and 1.4 ms out of a neutral of"),
    (
        '"hbridge"',
        '"gpiozero.Servo"',
        "cannot be 'gpiozero.Servo': gpiozero makes the pulses",
        'driver = "gpiozero.Servo"',
    ),
    (
        'over = "sysfs"\n',
        "",
        "lacks the key 'over', one of 'pca9685', 'lgpio', 'sysfs'",
        "[output.pump]",
    ),
    (
        'over = "sysfs"\nchannel = 0',
        'over = "lgpio"',
        "lacks the key 'pin', a BCM pin",
        "[output.pump]",
    ),
    # Invalid actions.
    (
        "low = -0.5",
        "low = 0.5\nhigh = 0.5",
        "of [action.throttle] must be above low, which is 0.5, not 0.5",
        "high = 0.5",
    ),
    (
        "low = -0.5",
        "one_sided = true\nlow = -0.5",
        "must be 0 to 1, because it is one-sided",
        "low = -0.5",
    ),
    ("low = -0.5", "low = -1.5", "low of [action.throttle] must be a number from -1 to 1"),
    ("rest = 0.25", "rest = 0.25\nhigh = 0.2", "rest of [action.arm] must lie between low and"),
    ("low = -0.5", "rest = 0.1", "rest of [action.throttle] must be 0, because it propels"),
    (
        "slew_per_s = 2",
        "slew_down_per_s = 2",
        "[action.throttle] cannot have slew_down_per_s, because it propels: a stop is immediate",
    ),
    ("slew_per_s = 2", "slew_per_s = 0", "must be a number above 0 (per second), not 0"),
    ("slew_per_s = 2", "slew_per_s = nan", "must be a number above 0 (per second), not nan"),
    (
        "slew_per_s = 2",
        f"slew_per_s = 1{'0' * 400}",
        "not a number too large to write",
        "slew_per_s = 100000000000000000000000000",
    ),
    ('levels = "three"', "threshold = 0", "must be a number above 0 and up to 1, not 0"),
    ('unit = "deg"\n', "", "gain of [action.arm] needs a unit, such as unit = 'deg'", "gain = 90"),
    ("[action.arm]", '[action."left arm"]', "the name 'left arm' must begin with a letter"),
    ("[action.arm]", "[action.7]", "the name '7' must begin with a letter and have at most 32"),
    # Invalid outputs.
    ("mix = { arm = 1.0 }", "mix = {}", "is empty, so nothing moves it; there are: steering, th"),
    (
        "mix = { arm = 1.0 }\n",
        "",
        "[output.arm] lacks the key 'mix', a table of numbers from",
        "[output.arm]",
    ),
    (
        "mix = { arm = 1.0 }",
        "mix = { amr = 1.0 }",
        "names no action: 'amr' (did you mean 'arm'?); there are: arm",
    ),
    ("mix = { arm = 1.0 }", "mix = { arm = 0.0 }", "the weight of 'arm' in mix of [output."),
    ("[output.drive]", "[action.wave]\n[output.drive]", "[action.wave] moves nothing: no mix of"),
    ('part = "wheels"', 'part = "wheel"', "not 'wheel' (did you mean 'wheels'?)"),
    ("mix = { throttle = 1 }", "mix = { arm = 1 }", "moves the wheels, so an action in its mix"),
    ("enable = 26", "offset = 0.1", "is at 0.1 when its actions rest, and must be at 0 then"),
    (
        "mix = { throttle = 1 }",
        "mix = { throttle = 1, arm = 1 }",
        "is at 0.25 when its actions rest",
        "[output.drive]",
    ),
    (
        "mix.throttle = 0.5",
        "mix.arm = 0.5",
        "[output.pump] is at 0.125 when its actions rest",
        "[output.pump]",
    ),
    (
        "right_us = 1000",
        "right_us = 1500",
        "centre_us of [output.steer] must lie between left_us",
        "[output.steer]",
    ),
    ("right_us = 1000", "right_us = 400", "must be a whole number from 500 to 2500 (microseconds)"),
    (
        "right_us = 1000",
        "right_us = 1e3",
        "whole number from 500 to 2500 (microseconds), not 1000.0",
    ),
    (
        'over = "sysfs"',
        'over = "sysfs"\nhz = 400\nforward_us = 2500',
        "no time for a pulse of",
        "hz = 400",
    ),
    ("start = 0.1", "start = 0.5\nfull = 0.5", "start of [output.brush] must be below full"),
    # Stops, limits and others.
    ("deadline_ms = 200", "deadline_ms = 1001", "from 20 to 1000 (milliseconds), not 1001"),
    ("deadline_ms = 200", "deadline_ms = 19", "from 20 to 1000 (milliseconds), not 19"),
    ("deadline_ms = 200", "deadline_ms = 39", "must be at least 40 ms, the time from one command"),
    ("deadline_ms = 200", "camera_stale_ms = 99", "at least 100 ms, the time of two pictures at"),
    ("deadline_ms = 200", "camera_stale_ms = 0", "from 50 to 5000 (milliseconds), not 0"),
    ("flip = true", "fps = 3", "camera_stale_ms of [limits] must be at least 667 ms", "[limits]"),
    (
        '[camera]\ndriver = "v4l2"\nsize = [128, 128]\nflip = true\n\n[limits]',
        "[limits]\ncamera_stale_ms = 500",
        "camera_stale_ms of [limits] needs a [camera]",
        "camera_stale_ms = 500",
    ),
    (
        '[sensor.pack]\ndriver = "ina219"\naddress = 0x41\n',
        "",
        "low_battery_v of [limits] needs a sensor that measures battery, such as one with the",
        "low_battery_v = 6.6",
    ),
    ("velocity = 2", "collision = 10", "collision of [reward] must be a number from -1e+06 to 0"),
    (
        "throttle = -0.4",
        "throttle = -0.6",
        "throttle of [[reset]] number 1 must be -0.5 to 1",
        "values = { throttle = -0.6 }",
    ),
    (
        "throttle = -0.4",
        "thrott = -0.4",
        "no action: 'thrott' (did you mean 'throttle'?); there are",
        "values = { thrott = -0.4 }",
    ),
    (
        "arm = 0.5\n",
        "arm = 2\n",
        "values of [[reset]] number 2 must be a table of numbers from",
        "[reset.values]",
    ),
    ("hold_ms = 50", "hold_ms = 10", "must be a whole number from 30 to 1000 (milliseconds)"),
    # Invalid TOML.
    (
        'name = "rover"',
        'name = "rover',
        "this is not valid TOML: illegal character '\\n' at column 14",
    ),
    ('name = "rover"', "name = rover", "this is not valid TOML: invalid value at column 8"),
    ("[stop]", "[limits]", "this is not valid TOML: cannot declare ('limits',) twice at column 8"),
    ("", "[end", "this is not valid TOML: expected ']' at the end of a table declaration"),
    ("", f"x = {'9' * 5000}", "a number has too many digits", "x = 9"),
]


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake[1][:40])
def test_mistake_is_named(mistake: tuple[str, ...]) -> None:
    """The error gives the line of the mistake and how to fix it."""
    old, new, words, *begins = mistake
    begin = begins[0] if begins else new.split("\n")[0]
    text = changed(old, new)
    with pytest.raises(ProfileError) as caught:
        read(text)
    match = re.fullmatch(r"rover\.toml, line ([0-9]+): (.*)\.", str(caught.value))
    assert match is not None
    assert text.split("\n")[int(match[1]) - 1].startswith(begin)
    assert words in match[2]


@given(
    cut=st.integers(0, len(EVERYTHING)),
    length=st.integers(0, 12),
    put=st.sampled_from(
        ["", "0", "-1", "nan", "[", "]", "{}", '"', "=", "\n", ".", "x", "true", "é"]
    ),
)
def test_any_edit_gives_a_profile_or_one_sentence(cut: int, length: int, put: str) -> None:
    message = ""
    try:
        read(EVERYTHING[:cut] + put + EVERYTHING[cut + length :])
    except ProfileError as error:
        message = str(error)
    assert re.fullmatch(r"|rover\.toml, line [0-9]+: [^\n]*\.", message)


def test_nested_too_deeply() -> None:
    """Deep nesting raises ProfileError, not RecursionError."""
    with pytest.raises(
        ProfileError, match=r"rover\.toml is not a profile: it is nested too deeply\."
    ):
        read("x = " + "[" * 5000)


def test_a_missing_table_is_named() -> None:
    """A robot needs a name and at least one action, and tables of the right type."""
    with pytest.raises(ProfileError, match=r"line 1: \[robot\] lacks the key 'name'"):
        read("")
    with pytest.raises(ProfileError, match="line 1: a robot needs an action"):
        read('[robot]\nname = "x"\nbody = "y"\n')
    with pytest.raises(ProfileError, match=r"\[output\] must be a table"):
        read('output = 3\n[robot]\nname = "x"\nbody = "y"\n[action.a]\n')
    with pytest.raises(ProfileError, match=r"\[\[reset\]\] number 1 must be a table, not true"):
        read("reset = [true]\n" + EVERYTHING.split("[[reset]]", maxsplit=1)[0])


def test_too_many_actions() -> None:
    """A robot has at most 64 actions."""
    actions = "".join(f"[action.a{i}]\n" for i in range(65))
    with pytest.raises(ProfileError, match="a robot has at most 64 actions, not 65"):
        read('[robot]\nname = "x"\nbody = "y"\n' + actions)


@pytest.mark.parametrize("key", ["hold_ms", "ramp_ms"])
def test_a_stop_may_not_let_the_robot_drive_on(key: str) -> None:
    """A stop must not hold a propelling output, such as a track that mixes in steering."""
    tank = shipped_profiles()["tank"].read_text() + f"\n[stop]\n{key} = 100\n"
    read(tank)
    with pytest.raises(ProfileError, match=rf"{key} of \[stop\] would keep \[output.left\] driv"):
        read(tank.replace("propels = true", "", 1))
