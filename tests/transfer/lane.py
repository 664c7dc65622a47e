"""A small camera env with a demonstrator: keep to the middle of a lane."""

from __future__ import annotations

from typing import Any, Final

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef
from shapechanger.demos.cloning.clone import CloneSettings
from shapechanger.layout import Element, Feature, Layout
from shapechanger.policy import Framing
from shapechanger.vehicles.cloning import CloningSettings

_ROWS, _COLUMNS = 12, 20
HELD_OUT: Final = 1_000


class Lane(gym.Env[NDArray[np.uint8], NDArray[np.float32]]):
    """Stay in the middle of a lane: `steering` moves sideways against wind, `throttle` adds reward.

    Full steering moves the distance `grip` in a step.
    """

    observation_space = gym.spaces.Box(0, 255, (_ROWS, _COLUMNS, 3), np.uint8)
    action_space = gym.spaces.Box(-1.0, 1.0, (2,), np.float32)

    def __init__(self, grip: float = 0.3) -> None:
        self.grip = grip
        self.place = 0.0
        self.held_out = False
        camera = Element("camera", "camera")
        image = Feature("camera/image", "1", 0.0, 255.0, camera, (_ROWS, _COLUMNS, 3))
        self.observation_layout = Layout((image,))
        self.action_layout = Layout(
            tuple(
                Feature(f"{name}/value", "1", -1.0, 1.0, Element("actuator", name))
                for name in ("steering", "throttle")
            )
        )

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.course = int(self.np_random.integers(HELD_OUT)) + HELD_OUT * self.held_out
        self.place = float(self.np_random.uniform(-0.8, 0.8))
        return self._picture(), {"course": self.course}

    def step(self, action: Any) -> Any:
        wind = float(self.np_random.uniform(-0.05, 0.05))
        self.place += self.grip * float(action[0]) + wind
        terms = {
            "reward_middle": 1.0 - min(abs(self.place), 1.0),
            "reward_speed": 0.1 * float(action[1]),
        }
        over = abs(self.place) > 1.0
        return self._picture(), sum(terms.values()), over, False, terms

    def hold_out(self) -> None:
        self.held_out = True

    def demonstrator(self, seed: int) -> _Keeper:
        return _Keeper(self, seed)

    def _picture(self) -> NDArray[np.uint8]:
        picture = np.zeros((_ROWS, _COLUMNS, 3), np.uint8)
        column = round((0.5 - 0.5 * np.clip(self.place, -1.0, 1.0)) * (_COLUMNS - 3))
        picture[:, column : column + 3] = 255
        return picture


class _Keeper:
    def __init__(self, lane: Lane, seed: int) -> None:
        self._lane = lane
        self._rng = np.random.default_rng(seed)

    def begin(self) -> None:
        pass

    def act(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        meant = np.array([-self._lane.place, 0.5], np.float32)
        done = meant.copy()
        if self._rng.random() < 0.3:
            done[0] += self._rng.uniform(-0.5, 0.5)
        return meant, np.clip(done, -1.0, 1.0)


gym.register("tests/Lane-v0", Lane, max_episode_steps=30)
# The envs of a suite have different ids.
for _name, _grip in (("Dry", 0.3), ("Wet", 0.2), ("Icy", 0.1)):
    gym.register(f"tests/{_name}-v1", Lane, max_episode_steps=30, kwargs={"grip": _grip})

LANE = EnvRef("tests.transfer.lane:tests/Lane-v0")
SLIPPERY = EnvRef("tests.transfer.lane:tests/Lane-v0", {"grip": 0.15})

DRY, WET, ICY = (EnvRef(f"tests.transfer.lane:tests/{name}-v1") for name in ("Dry", "Wet", "Icy"))

# A network and budgets that learn within a second.
TINY_CLONING = CloningSettings(
    budgets=(30, 60, 120),
    episode_steps=20,
    eval_episodes=2,
    eval_steps=25,
    clone=CloneSettings(
        framing=Framing(height=12, width=20, top=0.0),
        channels=(4, 8),
        features=8,
        batch=16,
        fewest_steps=40,
        most_steps=40,
        warm_up=4,
        checks=2,
        held_out=0.0,
    ),
)

# Minimal training, for tests that do not depend on the result.
QUICK_CLONING = msgspec.structs.replace(
    TINY_CLONING,
    budgets=(20, 40),
    clone=msgspec.structs.replace(
        TINY_CLONING.clone, fewest_steps=10, most_steps=10, warm_up=2, checks=1
    ),
)
