# Written by hand: the part of libcamera's Python bindings that Shapechanger uses.

class Transform:
    def __init__(
        self, rotation: int = 0, hflip: int = 0, vflip: int = 0, transpose: int = 0
    ) -> None: ...
