"""Draw the picture of the README: `python scripts/draw_pictures.py`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, cast

import imageio.v3 as iio
import numpy as np

from shapechanger.transfer.env_ref import EnvRef

PICTURES: Final = Path(__file__).parents[1] / "docs" / "pictures"
BODIES: Final = ("Ant", "AmputatedAnt", "BigAnt", "ExtendedAnt")


def main() -> None:
    """Draw the four ants to one scale, side by side."""
    envs = [cast("Any", EnvRef(f"shapechanger/{name}-v1").make().unwrapped) for name in BODIES]
    reach = 0.8 * max(env.reach for env in envs)
    row = np.concatenate([env.picture(300, 240, reach) for env in envs], axis=1)
    PICTURES.mkdir(parents=True, exist_ok=True)
    iio.imwrite(PICTURES / "ants.jpg", row, quality=85)
    for env in envs:
        env.close()


if __name__ == "__main__":
    main()
