# Written by hand: the part of gpiozero 2.0.1.post3 that Shapechanger uses, from its source.

from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

from gpiozero.pins import Factory, Pin

class GPIOZeroError(Exception): ...
class BadPinFactory(GPIOZeroError, ImportError): ...
class GPIOPinInUse(GPIOZeroError): ...
class PinInvalidState(GPIOZeroError, ValueError): ...
class PinSetInput(GPIOZeroError, AttributeError): ...

class Device:
    pin_factory: Factory
    def __init__(self, *, pin_factory: Any = None) -> None: ...
    def close(self) -> None: ...
    @property
    def closed(self) -> bool: ...
    def __enter__(self) -> Self: ...
    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_value: BaseException | None,
        exc_tb: TracebackType | None,
    ) -> None: ...

class GPIODevice(Device):
    @property
    def pin(self) -> Pin: ...

class OutputDevice(GPIODevice):
    value: float
    def __init__(
        self,
        pin: int | str | None = None,
        *,
        active_high: bool = True,
        initial_value: bool | None = False,
        pin_factory: Any = None,
    ) -> None: ...
    def on(self) -> None: ...
    def off(self) -> None: ...

class DigitalOutputDevice(OutputDevice): ...

class PWMOutputDevice(OutputDevice):
    frequency: float | None
    def __init__(
        self,
        pin: int | str | None = None,
        *,
        active_high: bool = True,
        initial_value: float = 0,
        frequency: float = 100,
        pin_factory: Any = None,
    ) -> None: ...

class InputDevice(GPIODevice):
    def __init__(
        self,
        pin: int | str | None = None,
        *,
        pull_up: bool | None = False,
        active_state: bool | None = None,
        pin_factory: Any = None,
    ) -> None: ...
    @property
    def value(self) -> int: ...
    @property
    def is_active(self) -> bool: ...

class DigitalInputDevice(InputDevice):
    when_activated: Callable[[], None] | None
    when_deactivated: Callable[[], None] | None
    def __init__(
        self,
        pin: int | str | None = None,
        *,
        pull_up: bool | None = False,
        active_state: bool | None = None,
        bounce_time: float | None = None,
        pin_factory: Any = None,
    ) -> None: ...

class Motor(Device):
    value: float
    forward_device: PWMOutputDevice
    backward_device: PWMOutputDevice
    def __init__(
        self,
        forward: int | str,
        backward: int | str,
        *,
        enable: int | str | None = None,
        pwm: bool = True,
        pin_factory: Any = None,
    ) -> None: ...
    def stop(self) -> None: ...

class PhaseEnableMotor(Device):
    value: float
    phase_device: DigitalOutputDevice
    enable_device: PWMOutputDevice
    def __init__(
        self, phase: int | str, enable: int | str, *, pwm: bool = True, pin_factory: Any = None
    ) -> None: ...
    def stop(self) -> None: ...
