# Written by hand: the part of simplejpeg 1.9 that Shapechanger uses, from its documentation.

from typing import Any

import numpy as np
from numpy.typing import NDArray

def is_jpeg(data: bytes) -> bool: ...
def decode_jpeg_header(
    data: bytes,
    min_height: int = 0,
    min_width: int = 0,
    min_factor: float = 1,
    strict: bool = True,
) -> tuple[int, int, str, str]: ...
def decode_jpeg(
    data: bytes,
    colorspace: str = "rgb",
    fastdct: bool = False,
    fastupsample: bool = False,
    min_height: int = 0,
    min_width: int = 0,
    min_factor: float = 1,
    buffer: Any = None,
    strict: bool = True,
) -> NDArray[np.uint8]: ...
def encode_jpeg(
    image: NDArray[np.uint8],
    quality: int = 85,
    colorspace: str = "rgb",
    colorsubsampling: str = "444",
    fastdct: bool = False,
) -> bytes: ...
