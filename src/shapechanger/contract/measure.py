"""Task performance metrics, in addition to the return."""

from __future__ import annotations

from typing import Final, Literal

import msgspec


class Measure(msgspec.Struct, frozen=True):
    """A number of an episode, larger is better.

    The return often includes a reward for survival: an ant that stands still earns 1,000. A measure
    quantifies only skill. Envs declare their measures as the attribute `measures`; the first one is
    the default of a study.

    Attributes:
        name: Name, such as "forward speed".
        unit: Unit; "1" for a pure number.
        key: Key of the step's `info` that it is read from; empty for the return.
        over: "episode": the sum over the episode divided by the env's time limit, so that an
            episode that ends early counts as standing still for the rest; "end": the last value.
    """

    name: str
    unit: str
    key: str = ""
    over: Literal["episode", "end"] = "end"


RETURN: Final = Measure("return", "1")
FORWARD_SPEED: Final = Measure("forward speed", "m/s", "x_velocity", "episode")
SUCCESS: Final = Measure("success", "1", "is_success")
