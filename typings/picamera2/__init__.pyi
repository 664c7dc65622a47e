# Written by hand: the part of picamera2 0.3 that Shapechanger uses, from its source.

from typing import Any

import numpy as np
from numpy.typing import NDArray

class CompletedRequest:
    def make_array(self, name: str) -> NDArray[np.uint8]: ...
    def get_metadata(self) -> dict[str, Any]: ...
    def release(self) -> None: ...

class Picamera2:
    def __init__(self, camera_num: int = 0, verbose_console: Any = None, tuning: Any = None) -> None: ...
    def create_video_configuration(
        self,
        main: dict[str, Any] = ...,
        lores: dict[str, Any] | None = None,
        raw: dict[str, Any] | None = None,
        transform: Any = ...,
        colour_space: Any = None,
        buffer_count: int = 6,
        controls: dict[str, Any] = ...,
        display: str | None = "main",
        encode: str | None = "main",
        queue: bool = True,
        sensor: dict[str, Any] = ...,
        use_case: str = "video",
    ) -> dict[str, Any]: ...
    def configure(self, camera_config: Any = "preview") -> None: ...
    def start(self, config: Any = None, show_preview: bool | None = False) -> None: ...
    def capture_request(
        self, wait: bool | float | None = None, signal_function: Any = None, flush: Any = None
    ) -> CompletedRequest: ...
    def stop(self) -> None: ...
    def close(self) -> None: ...
