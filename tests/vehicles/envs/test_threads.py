"""Rendering of vehicles in threads."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import shapechanger


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_pictures_do_not_depend_on_threads() -> None:
    """Pictures of two threads equal one thread's."""

    def pictures(threads: int) -> list[Any]:
        envs = shapechanger.make_vec(
            *("Car", 3),
            threads=threads,
            autoreset_mode="Disabled",
            size=(48, 32),
            render_mode="rgb_array",
        )
        seen: list[Any] = [envs.reset(seed=0)[0]]
        for number in range(3):
            mask = np.arange(3) == number
            seen.append(envs.reset(seed=[1, 2, 3], options={"reset_mask": mask})[0])
            seen.append(envs.step(np.full(envs.action_space.shape, 0.5, np.float32))[0])
        seen += envs.render()
        envs.close()
        return seen

    for one, two in zip(pictures(1), pictures(2), strict=True):
        assert one.std() > 5.0
        np.testing.assert_array_equal(one, two)
