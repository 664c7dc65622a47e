"""Fingers as the device needs them: compiled, with the numbers that their tasks read."""

from __future__ import annotations

import math
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.warp.batch import BatchKind
from shapechanger.envs.warp.bodies import DeviceBody, device_body
from shapechanger.envs.warp.reader import register_reader
from shapechanger.errors import VectorEnvError
from shapechanger.finger.anatomy import JOINT_REST
from shapechanger.finger.command_path import slews
from shapechanger.finger.env import FingerLike, as_finger
from shapechanger.finger.gpu import FINGERS
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.plant import CONTROL_DT, FingerPlant
from shapechanger.finger.track import FingerTrackEnv

# A delay this close to a whole number of simulation steps takes one more at some of them.
_WHOLE: Final = 1e-6
_LONGEST_NAME: Final = 60


class FingerReader:
    """Compiles fingers, and reads what a device needs to know about them.

    Args:
        env: A CPU env of the task.

    Attributes:
        spec: The spec of the CPU env, with its time limit.

    Raises:
        VectorEnvError: If the env has goals, or draws another finger at each reset.
    """

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        self._env: Any = env.unwrapped
        self._task = FINGERS[type(self._env)]
        self.spec = env.spec
        if isinstance(env.observation_space, gym.spaces.Dict):
            raise VectorEnvError(
                "backend='warp' takes no goal: its observations are vectors, without goals."
            )
        if isinstance(self._env, FingerTrackEnv) and self._env.path_is_random:
            raise VectorEnvError(
                "backend='warp' takes no path='random': a reset draws no path; name one."
            )
        if self._env.individual:
            raise VectorEnvError(
                f"backend='warp' takes a gap with a {self._env.individual} only: a reset draws no "
                "finger by itself; hand drawn ones with bodies=[...] and options={'bodies': [...]}."
            )

    def body(self, value: FingerLike | None) -> FingerParameters:
        """Return the parameters of a finger; those of the arguments for None.

        Raises:
            FingerError: If they contradict themselves, or the tendons cannot balance a joint.
            UnknownName: If there is no such set or parameter.
        """
        return self._env.parameters if value is None else as_finger(value)

    def read(self, body: FingerParameters) -> tuple[DeviceBody, BatchKind]:
        """Compile a finger.

        Args:
            body: Its parameters.

        Returns:
            The finger, and the kind of a batch that begins with it.

        Raises:
            VectorEnvError: If its delay is a whole number of simulation steps.
            FingerError: If its path does not fit the steps.
        """
        env = self._env
        plant = FingerPlant(body, env.drive, CONTROL_DT)
        model, held = plant.model, plant.held
        found = device_body(_described(body), model, _numbers(plant))
        timestep = float(model.opt.timestep)
        rows = {**found.rows, "actuator_delay": np.full(model.nu, _device_delay(body, timestep))}
        rhythm = (round(CONTROL_DT / timestep), 1, 1)
        if held is not None:
            rhythm = (held.steps, held.ticks, held.computations)
        shared = {
            "path": str(held is not None),
            "steps of an action": str(rhythm),
            "zeros of joint_noise": str(body.joint_noise > 0.0),
            "zeros of tension_noise": str(body.tension_noise > 0.0),
        }
        encoded = {name: text.encode() for name, text in shared.items()}
        found = found._replace(rows=rows, shared={**found.shared, **encoded})
        layouts = env.observation_layout, env.action_layout
        kind = BatchKind(
            found, model, self._task(env, plant), rhythm[0], *layouts, env.action_space
        )
        return found, kind

    def close(self) -> None:
        """Close the CPU env."""
        self._env.close()


def _numbers(plant: FingerPlant) -> dict[str, NDArray[Any]]:
    """Return the numbers of a finger that its task reads."""
    parameters, data = plant.parameters, cast("Any", plant.data)
    path = parameters.path
    rise, fall = (math.inf, math.inf) if path is None else slews(path)
    taut = 0.0
    if parameters.tendon_stiffness is not None:
        taut = parameters.backlash + parameters.least_tension / parameters.tendon_stiffness
    plant.place(JOINT_REST, np.random.default_rng(0))
    numbers = {
        "least": parameters.least_tension,
        "taut": taut,
        "joint_noise": parameters.joint_noise,
        "tension_noise": parameters.tension_noise,
        "rise": rise,
        "fall": fall,
        "step": 0.0 if path is None else path.tension_step,
    }
    return {
        **{name: np.array([number]) for name, number in numbers.items()},
        "arms": parameters.arms,
        "most": np.array(parameters.most_tension),
        "init_qpos": np.array(data.qpos),
        "history": np.array(data.history),
    }


def _device_delay(parameters: FingerParameters, timestep: float) -> float:
    """Return a delay, s, with the same controls at each simulation step as that of a finger.

    Args:
        parameters: The finger.
        timestep: Duration of a simulation step, s.

    Raises:
        VectorEnvError: If it is a whole number of steps.
    """
    delay = parameters.command_delay
    steps = delay / timestep
    if delay > 0.0 and abs(steps - round(steps)) < _WHOLE * steps:
        raise VectorEnvError(
            f"backend='warp' takes no command_delay of {delay:g} s, which is a whole number of "
            f"simulation steps, {timestep:g} s: rounding makes it a step longer at times on a CPU, "
            f"so take {delay - 0.1 * timestep:g} s, which never is."
        )
    # A delay ends at a step, so that it may as well end half a step before, where single precision
    # decides alike.
    return (math.ceil(steps) - 0.5) * timestep if delay > 0.0 else 0.0


def _described(parameters: FingerParameters) -> str:
    """Return what sets a finger apart, for messages."""
    own = [
        f"{name}={getattr(parameters, name)}"
        for name in parameters.__struct_fields__
        if getattr(parameters, name) != getattr(NOMINAL, name)
    ]
    text = ", ".join(own)
    shortened = f"{text[:_LONGEST_NAME]}..." if len(text) > _LONGEST_NAME else text
    return f"the finger with {shortened}" if own else "the nominal finger"


for _env_class in FINGERS:
    register_reader(_env_class, FingerReader)
