"""A robot that is served on this machine, made known to whoever drives it from here."""

from __future__ import annotations

from shapechanger.errors import LinkError, UnknownName
from shapechanger.link.address import is_loopback, parse_address
from shapechanger.remote.known_robots import KnownRobot, check_name, known_names, recall, remember

__all__ = ["can_be_known", "make_known"]


def make_known(robot: KnownRobot) -> str:
    """Remember a robot of this machine, unless another one bears its name.

    Args:
        robot: The robot, as it is reached from here.

    Returns:
        What was done, in a sentence.

    Raises:
        OutputError: If it cannot be written down.
    """
    name = robot.name
    drives = f"`shapechanger robot drive {name}` drives it from here"
    if name not in known_names():
        remember(robot)
        return f"Known here as {name}: {drives}."
    try:
        known = recall(name)
    except (LinkError, UnknownName) as error:
        return f"It is not made known here: {error}"
    if (known.key, known.fingerprint) != (robot.key, robot.fingerprint):
        return (
            f"Another robot is known here as {name}, at {known.address}, and stays known: "
            f"`shapechanger robot forget {name}` makes room for this one."
        )
    before, now = parse_address(known.address), parse_address(robot.address)
    if before == now:
        return f"Known here as {name}: {drives}."
    if not is_loopback(before.host):
        return f"Known here as {name} at {before}, which stays; this one is at {now}."
    remember(robot)
    return f"Known here as {name}, now at {now} and no more at {before}: {drives}."


def can_be_known(name: str) -> bool:
    """Whether a robot can be remembered under a name."""
    try:
        check_name(name)
    except LinkError:
        return False
    return True
