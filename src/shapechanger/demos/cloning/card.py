"""What a policy says of itself: its card, beside the weights in its file."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any, Final, Literal

import msgspec

from shapechanger.demos.cloning.pictures import CloningError, Framing, PolicyError
from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.layout import Layout

__all__ = ["FORMATS", "CloneCard", "Head"]

FORMATS: Final = (1, 2)
"""Versions of the file that are read: the first holds steering and throttle from a picture only."""

Head = Literal["regression", "class"]
"""Numbers of an action, or one of the actions that were shown."""

# So that a card that lies takes no time before it is found out.
_MOST_MEMBERS: Final = 32
_STEERS: Final = ("steering", "throttle")


class CloneCard(msgspec.Struct, frozen=True, kw_only=True):
    """Where a policy comes from.

    Attributes:
        framing: What it sees.
        channels: Filters of each of its layers.
        features: Numbers between picture and actions.
        seeds: Seeds of the trainings that made it, the last one last.
        steps: Steps of the last training, up to the best policy.
        settings: Settings of the last training.
        data: What it was learned from, in the caller's words.
        command: The command that made it.
        version: Version of Shapechanger.
        format: Of the file.
        eyes: What its first layer sees of a picture; "none" for a policy without eyes.
        nerves: Widths of the layers that its state goes through; () for a policy without a state.
        members: Networks in it, whose answers are averaged.
        head: What comes out.
        classes: The actions that it chooses from, if it does.
        class_names: What they are called.
        action_layout: What the numbers of its actions mean; None for steering and throttle in
            [-1, 1] of any vehicle.
        state_layout: What the numbers of its state mean; None without a state.
        unseen: Names of the numbers of the state that it does not look at.
        low: Actions that an output of -1 stands for; () for -1 each.
        high: Actions that an output of 1 stands for; () for 1 each.
    """

    framing: Framing
    channels: tuple[int, ...]
    features: int
    seeds: tuple[int, ...] = ()
    steps: int = 0
    settings: CloneSettings | None = None
    data: dict[str, Any] = {}
    command: str = ""
    version: str = msgspec.field(default_factory=lambda: version("shapechanger"))
    format: int = 1
    eyes: Literal["colours", "edges", "none"] = "colours"
    nerves: tuple[int, ...] = ()
    members: int = 1
    head: Head = "regression"
    classes: tuple[tuple[float, ...], ...] = ()
    class_names: tuple[str, ...] = ()
    action_layout: Layout | None = None
    state_layout: Layout | None = None
    unseen: tuple[str, ...] = ()
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what describes no network.

        Raises:
            CloningError: If it has layers without filters, no features, or contradicts itself.
        """
        if not self.channels or min(self.features, *self.channels, *self.nerves) < 1:
            raise CloningError("A network has layers, and each has at least one number.")
        if not 1 <= self.members <= _MOST_MEMBERS:
            raise CloningError(f"A policy has 1 to {_MOST_MEMBERS} networks, got {self.members}.")
        if bool(self.nerves) != (self.state_layout is not None):
            raise CloningError("A policy has nerves where it has a state, and only there.")
        if self.eyes == "none" and not self.nerves:
            raise CloningError("A policy that perceives nothing cannot act.")
        if (self.head == "class") != bool(self.classes):
            raise CloningError("A policy that chooses has something to choose from.")
        if any(len(action) != self.action_size for action in self.classes):
            raise CloningError(f"An action of this policy has {self.action_size} numbers.")
        if len(self.class_names) != len(self.classes):
            raise CloningError("Each class has a name.")
        if any(bounds and len(bounds) != self.action_size for bounds in (self.low, self.high)):
            raise CloningError(f"An action of this policy has {self.action_size} bounds.")

    @property
    def action_size(self) -> int:
        """Numbers of an action."""
        return 2 if self.action_layout is None else self.action_layout.size

    @property
    def state_size(self) -> int:
        """Numbers of a state; 0 without one."""
        return 0 if self.state_layout is None else self.state_layout.size

    @property
    def outputs(self) -> int:
        """Numbers that come out of the network."""
        return len(self.classes) or self.action_size

    def require_layouts(self, actions: Layout, state: Layout | None = None) -> None:
        """Refuse a robot, an env or data that speak otherwise than the policy.

        Args:
            actions: The other's layout of the actions.
            state: The other's layout of the state; None if it has none.

        Raises:
            PolicyError: If the policy cannot act there; in one sentence.
        """
        mine = _STEERS if self.action_layout is None else _words(self.action_layout)
        theirs = _words(actions)
        if self.action_layout is None:
            theirs = tuple(word.split(" ")[0] for word in theirs)
        if mine != theirs:
            raise PolicyError(
                f"The policy decides {', '.join(mine)}, and what it is to drive takes "
                f"{', '.join(theirs)}."
            )
        if self.state_layout is None:
            return
        felt = () if state is None else _words(state)
        if _words(self.state_layout) != felt:
            raise PolicyError(
                f"The policy feels {', '.join(_words(self.state_layout))}, and what it is to drive "
                f"gives {', '.join(felt) or 'no state'}."
            )


def _words(layout: Layout) -> tuple[str, ...]:
    """Names with units, and the shape of what is a block."""
    return tuple(f"{f}{f' x {f.shape}' if f.shape else ''}" for f in layout)
