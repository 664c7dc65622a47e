"""Whether commands may move anything: arming, and the latched emergency stop."""

from __future__ import annotations

from shapechanger.robot.guard.words import shortened

__all__ = ["Arming"]


class Arming:
    """Starts disarmed. An emergency stop latches until a person who knows of it arms again.

    Attributes:
        armed: Whether commands move anything.
        emergency: Whether an emergency stop is in force.
        emergencies: How many there were.
        reason: Why nothing may move, in words; empty while armed.
    """

    def __init__(self) -> None:
        self.armed = False
        self.emergency = False
        self.emergencies = 0
        self.reason = "Not armed."

    def arm(self, seen: int, *, person: bool) -> str:
        """Let commands move, and end an emergency stop.

        Args:
            seen: How many emergency stops whoever arms has seen.
            person: Whether a person arms.

        Returns:
            Why not, in words; empty when it is armed now.
        """
        if self.emergency and not person:
            return "Not armed: only a person ends an emergency stop."
        if self.emergency and seen != self.emergencies:
            return (
                f"Not armed: there were {self.emergencies} emergency stops, and whoever armed "
                f"has seen {seen}."
            )
        self.armed, self.emergency, self.reason = True, False, ""
        return ""

    def disarm(self, reason: str) -> None:
        """Let nothing move; the reason of an emergency stop stays."""
        self.armed, reason = False, shortened(reason)
        if not self.emergency:
            self.reason = f"Disarmed: {reason}" if reason else "Disarmed."

    def stop(self, reason: str) -> None:
        """Stop at once, until armed again; each call counts, and the first reason stays."""
        reason = shortened(reason)
        if not self.emergency:
            self.reason = f"Emergency stop: {reason}" if reason else "Emergency stop."
        self.armed, self.emergency = False, True
        self.emergencies += 1
