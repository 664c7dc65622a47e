"""The table of header pins against gpiozero's."""

from __future__ import annotations

from gpiozero.pins.data import PLUS_J8

from shapechanger.robot.drivers.pins import BCM_OF_BOARD, bcm


def test_the_header_matches_gpiozero() -> None:
    """Each place on the header has the BCM number that gpiozero gives it."""
    pins: dict[int, dict[str, str]] = PLUS_J8[2]
    theirs = {
        place: int(names["gpio"].removeprefix("GPIO"))
        for place, names in pins.items()
        if "gpio" in names
    }
    assert theirs == BCM_OF_BOARD


def test_the_pins_of_2017() -> None:
    """Places 15/13 and 11/7 of the 2017 car are BCM 22/27 and 17/4."""
    assert [bcm(f"BOARD{n}") for n in (15, 13, 11, 7)] == [22, 27, 17, 4]
    assert bcm("GPIO22") == bcm(22) == 22
