"""Asks whether a robot's wheels are off the ground, before a command moves it."""

from __future__ import annotations

import sys

from shapechanger.errors import RobotError

__all__ = ["ask_for_wheels_up"]


def ask_for_wheels_up() -> None:
    """Ask at the terminal.

    Raises:
        RobotError: If the answer is not yes, or nobody can be asked.
    """
    if not sys.stdin.isatty():
        raise RobotError("The robot will drive: lift its wheels, and say so with --wheels-up.")
    answer = input("The robot will drive. Are its wheels off the ground? [yes/no] ")
    if answer.strip().lower() != "yes":
        raise RobotError("Nothing was moved.")
