# Written by hand: the part of gpiozero 2.0.1.post3 that Shapechanger uses, from its source.

from typing import Any

from gpiozero.pins.pi import PiFactory, PiPin

class LGPIOFactory(PiFactory):
    _handle: int | None
    def __init__(self, chip: int | None = None) -> None: ...

class LGPIOPin(PiPin):
    _pwm: tuple[float, int] | None
    def __init__(self, factory: Any, info: Any) -> None: ...
