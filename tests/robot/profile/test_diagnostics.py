"""Each mistake in a profile gives one sentence: file, line, problem and alternatives."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import inspect

from shapechanger.errors import ProfileError
from shapechanger.robot.profile import shipped_profiles
from shapechanger.robot.profile.toml import permitted
from tests.robot.profile.texts import EVERYTHING, changed, read

# Text to replace in EVERYTHING, its replacement, and part of the message; then part of the reported
# line, unless that is the first line of the replacement.
_TABLE = r"""
[limits] -> [limit] -> no table or key 'limit' (did you mean 'limits'?); there are: act
arming = -> armimg = -> [limits] has no key 'armimg' (did you mean 'arming'?); there are
enable = 26 -> left_us = 1000 -> 'left_us' belongs to driver = 'servo', not to [output.
enable = 26 -> channel = 3 -> belongs to over = 'pca9685' or 'sysfs'
flip = true -> path = "x" -> belongs to driver = 'file' or 'pipe', not to [camera]
body = "car" -> body = { a = 1 } -> can be printed, not {'a': 1}
name = "rover" -> name = "a\u0007" -> can be printed, not 'a\x07'
name = "rover"\n ->  -> [robot] lacks the key 'name', a text of 1 to 64 characters -> [robot]
control_hz = 25 -> control_hz = "25 Hz" -> a number from 1 to 100, not '25 Hz'
2026-11-03 -> 2026-11-03T12:00:00 -> must be a date, such as 2026-11-03, not
levels = "three" -> levels = "thre" -> one of 'any', 'three', not 'thre' (did you mean 'three'?)
seconds = 0.5 -> seconds = true -> seconds of [[reset]] number 2 must be a number above
size = [128, 128] -> size = [128, 127] -> even number from 16 to 1920, not [128, 127]
mix.throttle = 0.5 -> mix = "throttle" -> must be a table of numbers from -10 to 10, ke
[stop] -> [[stop]] -> [stop] must be a table, not [{
[sensor.chip]\n -> [sensor]\nchip = 5\n[sensor.chop]\n -> [sensor.chip] must be a table -> chip = 5
enable = 26 -> enable = 28 -> a BCM pin from 0 to 27, such as 22, "GPIO22" or "BOARD15"
enable = 26 -> enable = -2 -> , or -1 for none, not -2
enable = 26 -> enable = "BOARD6" -> or -1 for none, and BOARD6 is ground
enable = 26 -> enable = "BOARD41" -> the header has the places 1 to 40
a = 16 -> a = -1 -> a of [sensor.wheel] must be a BCM pin from 0 to 27
enable = 26 -> enable = 22 -> twice: by forward of [output.drive] (line 24) and by
"GPIO13" -> 12 -> by pins of [sensor.bumper] (line 67) and by pins of [sensor.bumper] -> pins = [
pin = 21 -> pin = 19 -> by pin of [enable] (line 116) and by pin of [emergency_button]
pin = 21 -> pin = 3 -> GPIO3 is used twice: by bus of [output.steer] (line 29) and by
channel = 1\n -> channel = 0\n -> channel 0 of the PCA9685 at 0x40 of I2C bus 1 is used
address = 0x41 ->  -> address 0x40 of I2C bus 1 is used -> [sensor.pack]
channel = 1\n -> channel = 1\nhz = 60\n -> has one hz for all its channels, 50 or 60 -> hz = 60
driver = "hbridge"\n ->  -> lacks the key 'driver', one of -> [output.drive]
over = "sysfs"\n ->  -> lacks the key 'over', one of 'pca9685', 'lgpio', 'sysfs' -> [output.pump]
over = "sysfs"\nchannel = 0 -> over = "lgpio" -> lacks the key 'pin', a BCM pin -> [output.pump]
low = -0.5 -> low = 0.5\nhigh = 0.5 -> must be above low, which is 0.5 -> high = 0.5
low = -0.5 -> one_sided = true\nlow = -0.5 -> must be 0 to 1, because it is one-sided -> low = -0.5
rest = 0.25 -> rest = 0.25\nhigh = 0.2 -> rest of [action.arm] must lie between low and
low = -0.5 -> rest = 0.1 -> rest of [action.throttle] must be 0, because it propels
slew_per_s = 2 -> slew_down_per_s = 2 -> must be left out, because it propels: a stop is immediate
unit = "deg"\n ->  -> gain of [action.arm] needs a unit, such as unit = 'deg' -> gain = 90
[action.arm] -> [action."left arm"] -> the name 'left arm' must begin with a letter
mix = { arm = 1.0 } -> mix = {} -> is empty, so no action moves it; there are: steering, th
mix = { arm = 1.0 } -> mix = { amr = 1.0 } -> no action: 'amr' (did you mean 'arm'?)
mix = { arm = 1.0 } -> mix = { arm = 0.0 } -> has the weight 0 for 'arm': leave it out
[output.drive] -> [action.wave]\n[output.drive] -> [action.wave] moves nothing: no mix names it
mix = { throttle = 1 } -> mix = { arm = 1 } -> propels = true, because it moves the wheels
enable = 26 -> offset = -0.1 -> is at -0.1 when its actions rest, and must be at 0 then
right_us = 1000 -> right_us = 1500 -> must lie between left_us -> [output.steer]
over = "sysfs" -> over = "sysfs"\nhz = 400\nforward_us = 2500 -> no time for a pulse of -> hz = 400
start = 0.1 -> start = 0.5\nfull = 0.5 -> start of [output.brush] must be below full
deadline_ms = 200 -> deadline_ms = 39 -> must be at least 40 ms, the time from one command
deadline_ms = 200 -> camera_stale_ms = 0 -> must be at least 100 ms
flip = true -> fps = 3 -> camera_stale_ms of [limits] must be at least 667 ms -> [limits]
throttle = -0.4 -> throttle = -0.6 -> must be -0.5 to 1 for throttle
throttle = -0.4 -> thrott = -0.4 -> no action: 'thrott' (did you mean
arm = 0.5\n -> arm = 2\n -> [[reset]] number 2 must be a table of numbers -> [reset.values]
name = "rover" -> name = "rover -> this is not valid TOML: illegal character
left_us = 2000 -> output_enable = 7\nleft_us = 2000 -> one output_enable for -> output_enable = 25
[sensor.pack]\ndriver = "ina219"\naddress = 0x41\n ->  -> that measures battery -> low_battery_v = 6
[stop] -> [limits] -> this is not valid TOML: cannot declare ('limits',) twice at column 8
"""
MISTAKES = [
    *(row.replace(r"\n", "\n").split(" -> ") for row in _TABLE.strip("\n").split("\n")),
    (
        "[[reset]]\nvalues = { throttle = -0.4 }\nseconds = 1\n\n[[reset]]\nseconds = 0.5\n"
        "[reset.values]\narm = 0.5\n",
        "[reset]\nseconds = 1\n",
        "written [[reset]], with two",
    ),
    (
        "mix = { arm = 1.0 }",
        'mix = { arm = 1.0 }\n[output.x]\ndriver = "esc"\nover = "sysfs"\nchannel = 0\n'
        "mix = { throttle = 1.0 }",
        "channel 0 of PWM chip 0 is used twice",
        "channel = 0",
    ),
    (
        '[camera]\ndriver = "v4l2"\nsize = [128, 128]\nflip = true\n\n[limits]',
        "[limits]\ncamera_stale_ms = 500",
        "needs a [camera]",
        "camera_stale_ms = 500",
    ),
    ('name = "rover"', f'name = "{"r" * 65}"', "not 'rrrrrrrrrrrr...", "rrrrr"),
    ("control_hz = 25", f"control_hz = 0x{'9' * 9999}", "too large to write", "control_hz = 0x"),
]


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake[1][:40])
def test_the_error_names_line_and_mistake(mistake: tuple[str, ...]) -> None:
    old, new, message, *part = mistake
    text = changed(old, new)
    with pytest.raises(ProfileError) as caught:
        read(text)
    match = re.fullmatch(r"rover\.toml, line ([0-9]+): (.*)\.", str(caught.value))
    assert match is not None
    assert (part or new.split("\n"))[0] in text.split("\n")[int(match[1]) - 1]
    assert message in match[2]


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


_BARE = '[robot]\nname = "x"\nbody = "y"\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"line 1: \[robot\] lacks the key 'name'"),
        (_BARE, "line 1: a robot needs an action"),
        (f"output = 3\n{_BARE}[action.a]\n", r"\[output\] must be a table"),
        (
            "reset = [true]\n" + EVERYTHING.split("[[reset]]", maxsplit=1)[0],
            r"\[\[reset\]\] number 1 must be a table, not true",
        ),
        (
            _BARE + "".join(f"[action.a{i}]\n" for i in range(65)),
            r"\[action\] must have at most 64 tables, not 65",
        ),
        ("x = " + "[" * 5000, r"rover\.toml is not a profile: it is nested too deep"),
        (f"x = {'9' * 5000}", r"rover\.toml is not a profile: it is nested too deep"),
    ],
    ids=["empty", "bare", "output", "reset", "actions", "nested", "digits"],
)
def test_incomplete_and_unreadable_texts_are_refused(text: str, message: str) -> None:
    with pytest.raises(ProfileError, match=message):
        read(text)


@pytest.mark.parametrize("key", ["hold_ms", "ramp_ms"])
def test_a_stop_must_not_keep_the_robot_driving(key: str) -> None:
    """A stop holds only actions that do not propel; none may move a propelling output (a track)."""
    tank = shipped_profiles()["tank"].read_text() + f"\n[stop]\n{key} = 100\n"
    read(tank)
    with pytest.raises(ProfileError, match=rf"{key} of \[stop\] would keep \[output.left\] driv"):
        read(tank.replace("propels = true", "", 1))


def test_a_key_without_a_description_names_its_type() -> None:
    """A chip of another package may declare a key without a description."""
    assert permitted(inspect.type_info(list[int])) == "a list"
