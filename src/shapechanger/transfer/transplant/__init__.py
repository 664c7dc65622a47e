"""A trained policy in the shapes of another body, so that it can go on learning there.

A body map is affine, and so are the first and the last layer of a network: what the target senses
is mapped inside the first layer, and what the source does inside the last. The transplanted policy
then does in the target what the source policy does through the map, to rounding, from its first
step; new inputs begin with weights of zero and are open to training.

A `BodyMap` says how the bodies correspond, `transplant` moves a model of Stable-Baselines3, and
`transplant_normalisation` moves the statistics that its observations are normalised by.
"""

try:
    import stable_baselines3  # noqa: F401  # pyright: ignore[reportUnusedImport]
    import torch  # noqa: F401  # pyright: ignore[reportUnusedImport]
except ImportError as error:
    from shapechanger.errors import MissingExtra

    raise MissingExtra("torch and stable-baselines3", "learn") from error

from shapechanger.transfer.transplant.layers import transplant_normalisation
from shapechanger.transfer.transplant.model import transplant

__all__ = ["transplant", "transplant_normalisation"]
