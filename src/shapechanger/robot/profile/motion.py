"""Checks that the actions and the outputs of a robot make sense together.

Whatever goes wrong, the robot goes to rest: so rest must be a place where nothing drives, and a
stop must reach everything that does.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, Final

from shapechanger.robot.guard.plan import ActionPlan, OutputPlan, StopPlan
from shapechanger.robot.profile.lines import Place
from shapechanger.robot.profile.mistake import Source, called, choice
from shapechanger.robot.profile.schema import ACTION_KEYS, DRIVING_PARTS
from shapechanger.robot.profile.table import read_keys, refuse_unknown_keys

__all__ = ["check_mix", "check_pulses", "check_stop", "read_action"]

_NEARLY_ZERO: Final = 1e-9
_PULSES: Final = {
    "servo": ("left_us", "centre_us", "right_us"),
    "esc": ("backward_us", "neutral_us", "forward_us"),
}
# 1 s in µs; a pulse must end before the next one begins.
_SECOND_US: Final = 1_000_000


def read_action(source: Source, name: str, table: Mapping[str, Any]) -> ActionPlan:
    """One number of a command.

    Raises:
        ProfileError: If a key is unknown or wrong, or if the action cannot rest within its caps.
    """
    place: Place = ("action", name)
    refuse_unknown_keys(source, table, place, [key.name for key in ACTION_KEYS])
    values = read_keys(source, table, place, ACTION_KEYS)
    lowest = 0.0 if values["one_sided"] else -1.0
    low: float = lowest if values["low"] is None else values["low"]
    action = replace(ActionPlan(name), **{**values, "low": low})
    if low < lowest:
        words = f"low of {called(place)} must be 0 to 1, because it is one-sided"
        raise source.mistake((*place, "low"), words)
    if not low < action.high:
        words = f"{called(place)} may only move from low = {low:g} to high = {action.high:g}"
        raise source.mistake((*place, "high"), f"{words}, which is nowhere")
    if not low <= action.rest <= action.high:
        words = f"rest of {called(place)} must lie between low and high, {low:g} to {action.high:g}"
        raise source.mistake((*place, "rest"), words)
    if action.propels and action.rest != 0.0:
        words = f"rest of {called(place)} must be 0, because it propels"
        raise source.mistake((*place, "rest"), words)
    if action.gain != 1.0 and action.unit == "1":
        words = f"gain of {called(place)} needs a unit, such as unit = 'deg'"
        raise source.mistake((*place, "gain"), words)
    return action


def check_pulses(source: Source, output: OutputPlan) -> None:
    """Refuse what an output cannot do with its settings.

    Raises:
        ProfileError: If the middle pulse is not in the middle, if pulses are longer than the time
            between them, or if a motor has nothing between its start and its full speed.
    """
    place: Place = ("output", output.name)
    settings: dict[str, Any] = {**output.settings}
    if "full" in settings:
        if not float(settings["start"]) < float(settings["full"]):
            words = f"start of {called(place)} must be below full, which is {settings['full']:g}"
            raise source.mistake((*place, "start"), words)
        return
    if output.driver not in _PULSES:
        return
    names = _PULSES[output.driver]
    first, middle, last = (int(settings[name]) for name in names)
    low, high = sorted((first, last))
    if not low < middle < high:
        words = f"{names[1]} of {called(place)} must lie between {names[0]} and {names[2]}"
        raise source.mistake((*place, names[1]), f"{words}, {low} and {high}")
    if high * int(settings["hz"]) >= _SECOND_US:
        words = f"hz of {called(place)} leaves no time for a pulse of {high} µs"
        raise source.mistake((*place, "hz"), words)


def check_mix(
    source: Source, actions: Mapping[str, ActionPlan], outputs: Iterable[OutputPlan]
) -> None:
    """Refuse an output or an action that leads nowhere, and a rest at which something drives.

    Raises:
        ProfileError: If a mix names no action or an unknown one; if an action moves nothing; if
            something that drives has no action that propels, or is not at 0 at rest.
    """
    moved: set[str] = set()
    for output in outputs:
        place: Place = ("output", output.name)
        mix: Place = (*place, "mix")
        if not output.mix:
            words = f"mix of {called(place)} is empty, so nothing moves it; {_there_are(actions)}"
            raise source.mistake(mix, words)
        for name, weight in output.mix.items():
            if name not in actions:
                words = f"mix of {called(place)} names no action: {choice(name, actions)}"
                raise source.mistake((*mix, name), words)
            if weight == 0.0:
                words = f"mix of {called(place)} takes nothing of {name!r}: leave it out"
                raise source.mistake((*mix, name), words)
        _check_rest(source, actions, output)
        moved |= output.mix.keys()
    for name in actions:
        if name not in moved:
            words = f"[action.{name}] moves nothing: no mix of an output names it"
            raise source.mistake(("action", name), words)


def check_stop(
    source: Source,
    stop: StopPlan,
    actions: Mapping[str, ActionPlan],
    outputs: Iterable[OutputPlan],
) -> None:
    """Refuse a stop that would let something drive on for a while.

    Raises:
        ProfileError: If the stop holds or ramps, and an action that does not propel is part of
            something that drives.
    """
    if not stop.hold_ms and not stop.ramp_ms:
        return
    for output in outputs:
        if not _drives(actions, output):
            continue
        for name in output.mix:
            if not actions[name].propels:
                which = "hold_ms" if stop.hold_ms else "ramp_ms"
                words = (
                    f"{which} of [stop] would keep {called(('output', output.name))} driving "
                    f"after a stop, because {name!r} moves it and does not propel"
                )
                raise source.mistake(("stop", which), words)


def _check_rest(source: Source, actions: Mapping[str, ActionPlan], output: OutputPlan) -> None:
    place: Place = ("output", output.name)
    propelled = any(actions[name].propels for name in output.mix)
    if output.part in DRIVING_PARTS and not propelled:
        words = (
            f"{called(place)} moves the {output.part}, so an action in its mix must have "
            "propels = true"
        )
        raise source.mistake((*place, "mix"), words)
    at_rest = output.offset + sum(
        weight * actions[name].rest for name, weight in output.mix.items()
    )
    if _drives(actions, output) and abs(at_rest) > _NEARLY_ZERO:
        words = (
            f"{called(place)} would be at {at_rest:g} at rest, and must be at 0 because it drives"
        )
        raise source.mistake((*place, "offset"), words)


def _drives(actions: Mapping[str, ActionPlan], output: OutputPlan) -> bool:
    """Whether an output may make the robot go."""
    return (
        output.driver == "esc"
        or output.part in DRIVING_PARTS
        or any(actions[name].propels for name in output.mix)
    )


def _there_are(actions: Iterable[str]) -> str:
    return f"there are: {', '.join(actions)}"
