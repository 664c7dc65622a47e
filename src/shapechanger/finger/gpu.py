"""The finger on a device: its command path, senses and tasks as functions of tensors.

Only the physics uses single precision. The command path uses double precision, so that its
tensions are rounded to the same steps as on a CPU.
"""

from __future__ import annotations

import dataclasses
import math
from abc import abstractmethod
from functools import partial
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from typing_extensions import override

from shapechanger.envs.warp.kernels import uniforms
from shapechanger.envs.warp.reader import BodyReader, MakeWorlds, register_reader
from shapechanger.envs.warp.tasks import length
from shapechanger.envs.warp.worlds import DeviceBody, Infos, Worlds, device_body
from shapechanger.errors import VectorEnvError
from shapechanger.finger.anatomy import DIP_BAND, JOINT_REST, JOINTS, TENDONS
from shapechanger.finger.env import SMOOTHNESS, FingerLike, as_finger
from shapechanger.finger.parameters import FingerParameters
from shapechanger.finger.plant import CONTROL_DT, FingerPlant, shares, slewed, slews, smoothed
from shapechanger.finger.postures import START_SPREAD, coupled, inner_range
from shapechanger.finger.reach import HELD_STEPS, TOLERANCE_M, FingerReachEnv
from shapechanger.finger.task import directions, tip_at
from shapechanger.finger.track import FOLLOWS_M, SEEN_S, SETTLING_STEPS, FingerTrackEnv

_J: Final = len(JOINTS)
_T: Final = len(TENDONS)
# Numbers of random streams; measurements of step n use the stream `_SENSES + n`.
_STARTS: Final = 0
_TARGETS: Final = 1
_SENSES: Final = 2


class DeviceFinger(Worlds):
    """Batch of fingers, each with its own parameters and target; `plant` is the first finger."""

    precision = torch.float64

    def __init__(self, env: Any, plant: FingerPlant, *args: Any, **kwargs: Any) -> None:
        model, parameters = plant.model, plant.parameters
        self._gives, self._held = parameters.gives, plant.held
        self._noisy = parameters.joint_noise > 0.0, parameters.tension_noise > 0.0
        super().__init__(env, model, *args, **kwargs)
        # Indices of former controls in MuJoCo's history, which begins with two settings and times.
        samples = int(model.actuator_history[0, 0])
        first = np.asarray(model.actuator_historyadr) + 2 + samples
        self._former = torch.as_tensor(
            first[:, None] + np.arange(samples), dtype=torch.int64, device=self.device
        )
        arrays: dict[str, Any] = {
            name: torch.as_tensor(getattr(env.drive, name)).to(self.device)
            for name in ("offset", "gain", "rest")
        }
        self._drive: Any = dataclasses.replace(env.drive, **arrays)
        zeros = partial(torch.zeros, dtype=self.precision, device=self.device)
        whole = partial(torch.zeros, self.count, dtype=torch.int64, device=self.device)
        count = self.count
        self._commands, self._change = zeros(count, _T), zeros(count, _T)
        self._shares = zeros(count, _T)  # Tensions on the command path, 0 to 1 of their range.
        self._angles, self._velocities = zeros(count, _J), zeros(count, _J)
        self._senses = zeros(count, 2 * _J + 3 * _T)
        self._seen_tip, self._tip, self._target = zeros(count, 3), zeros(count, 3), zeros(count, 3)
        self._ahead: Tensor | None = None  # Next points of the path, m, (n, k, 3).
        self._seeds, self._episodes, self._steps = whole(), whole(), whole()

    @override
    def begin(self, mask: Tensor, seeds: Tensor, episodes: Tensor) -> None:
        constants = self.constants
        _put(self._seeds, mask, seeds)
        _put(self._episodes, mask, episodes)
        self._steps.masked_fill_(mask, 0)
        angles = self._draw(mask)
        lengths = -_turned(constants["arms"], angles)
        qpos = torch.cat([angles, constants["taut"] - lengths], dim=1) if self._gives else angles
        command = self._drive.command(constants["least"], lengths, torch.zeros_like(lengths))
        command = command.clip(-1.0, 1.0)
        self._shares.masked_fill_(mask[:, None], 0.0)
        controls = command if self._held is None else self._controls(constants)
        held = controls.to(self.ctrl.dtype)
        _put(self.qpos, mask, qpos)
        _put(self.ctrl, mask, held)
        _put(self.act, mask, held)
        if constants["history"].numel():
            history = constants["history"].to(held.dtype, copy=True)
            history[:, self._former] = held[:, :, None]
            _put(self.history, mask, history)
        _put(self._commands, mask, command)
        self._change.masked_fill_(mask[:, None], 0.0)
        self.forward()
        self._measure(mask)

    @abstractmethod
    def _draw(self, mask: Tensor) -> Tensor:
        """Set targets of the masked fingers, and return start angles of all, rad, (n, 4)."""

    @abstractmethod
    def _follow(self) -> None:
        """Update the task after a step, when `_steps` and the fingertips are new."""

    @property
    @abstractmethod
    def _succeeds(self) -> Tensor:
        """Whether each finger has reached the goal of its task, shape (n,)."""

    @override
    def apply(self, actions: Tensor) -> None:
        constants = self.constants
        before = self._commands
        self._commands = actions.to(self.precision).clip(-1.0, 1.0)
        self._change = self._commands - before
        if self._held is None:
            self.ctrl[:] = self._commands
            self.simulate()
        else:
            for _ in range(self._held.computations):
                lengths, speeds = self._lengths()
                tensions = self._drive.tension(self._commands, lengths, speeds)
                aim = shares(tensions, constants["least"], constants["most"])
                for _ in range(self._held.ticks):
                    slew = constants["rise"], constants["fall"]
                    self._shares = slewed(self._shares, aim, *slew)
                    self.ctrl[:] = self._controls(constants)
                    self.simulate()
        self._steps += 1
        self._measure(None)
        self._follow()

    def _controls(self, constants: dict[str, Tensor]) -> Tensor:
        """Return the controls for the command path's tensions, as `plant.HeldTensions` does."""
        least, most, step = constants["least"], constants["most"], constants["step"]
        tensions = least + self._shares * (most - least)
        rounded = shares(torch.floor(tensions / step) * step, least, most)
        return 2.0 * torch.where(step > 0.0, rounded, self._shares) - 1.0

    def _lengths(self) -> tuple[Tensor, Tensor]:
        """Return lengths at the motors, m, and their rates, m/s, shape (n, 7) each."""
        qpos, qvel = self.qpos.to(self.precision), self.qvel.to(self.precision)
        if self._gives:  # Elastic tendons: winding up by 1 m shortens a tendon by 1 m.
            return -qpos[:, _J:], -qvel[:, _J:]
        arms = self.constants["arms"]
        return -_turned(arms, qpos), -_turned(arms, qvel)

    def _measure(self, mask: Tensor | None) -> None:
        """Measure all fingers after a step, or the masked fingers after their start."""
        angles = true = self.qpos[:, :_J].to(self.precision)
        tensions = self.actuator_force.abs().to(self.precision)
        if any(self._noisy):
            constants, stream = self.constants, _SENSES + self._steps
            noise = uniforms(self._seeds, self._episodes, stream, _J + _T, normal=True)
            angles = angles + constants["joint_noise"] * noise[:, :_J]
            tensions = (tensions + constants["tension_noise"] * noise[:, _J:]).clip(0.0)
        velocities = self.qvel[:, :_J].to(self.precision)
        if mask is not None:
            velocities = torch.zeros_like(velocities)
        elif self._noisy[0]:
            velocities = smoothed(self._velocities, self._angles, angles)
        lengths, _ = self._lengths()
        senses = torch.cat([angles, velocities, tensions, lengths, self._commands], dim=1)

        def kept(former: Tensor, new: Tensor) -> Tensor:
            return new if mask is None else torch.where(mask[:, None], new, former)

        self._angles = kept(self._angles, angles)
        self._velocities = kept(self._velocities, velocities)
        self._senses = kept(self._senses, senses)
        self._seen_tip = kept(self._seen_tip, _fingertip(angles))
        self._tip = kept(self._tip, _fingertip(true))

    @override
    def observations(self) -> Tensor:
        tip = self._seen_tip
        # Points (n, k, 3); the first of the k points is the target.
        points = self._target[:, None] if self._ahead is None else self._ahead
        offsets = (points - tip[:, None]).flatten(1)
        return torch.cat([self._senses, tip, points[:, 0], offsets], dim=1).to(self.qpos.dtype)

    @override
    def outcome(self, before: Tensor, actions: Tensor) -> tuple[Tensor, Tensor, Infos]:
        pulled = self.actuator_force / self.constants["most"]
        terms: dict[str, Tensor] = self._env._reward.terms(
            length(self._tip - self._target),
            pulled.square().mean(dim=1),
            self._change.square().mean(dim=1),
            CONTROL_DT,
        )
        dtype = self.qpos.dtype
        rewards = cast("Tensor", sum(terms.values())).to(dtype)
        terms[SMOOTHNESS.key] = 1.0 - 0.5 * self._change.abs().mean(dim=1)
        infos = self.start_infos()
        infos |= {name: term.to(dtype) for name, term in terms.items()}
        never = torch.zeros_like(self._steps, dtype=torch.bool)
        return rewards, never, infos

    @override
    def start_infos(self) -> Infos:
        return {
            "is_success": self._succeeds,
            "distance": length(self._tip - self._target).to(self.qpos.dtype),
            "target": self._target.to(self.qpos.dtype),
        }


class DeviceReach(DeviceFinger):
    """Fingers that reach for a point."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._near = torch.zeros_like(self._steps)
        self._low, self._high, self._rest = (
            torch.as_tensor(angles, dtype=self.precision, device=self.device)
            for angles in (*inner_range(), JOINT_REST)
        )

    def _draw(self, mask: Tensor) -> Tensor:
        low, high, rest = self._low, self._high, self._rest
        drawn = uniforms(self._seeds, self._episodes, _TARGETS, _J)
        free = low[:3] + (high - low)[:3] * drawn[:, :3]
        off = DIP_BAND * (2.0 * drawn[:, 3] - 1.0)
        posture = torch.stack(coupled(free[:, 0], free[:, 1], free[:, 2], off), dim=1)
        _put(self._target, mask, _fingertip(posture.clip(low, high)))
        self._near.masked_fill_(mask, 0)
        moved = 2.0 * uniforms(self._seeds, self._episodes, _STARTS, _J) - 1.0
        return (rest + START_SPREAD * moved).clip(low, high)

    def _follow(self) -> None:
        near = length(self._tip - self._target) <= TOLERANCE_M
        self._near = torch.where(near, self._near + 1, 0)

    @property
    def _succeeds(self) -> Tensor:
        return self._near >= HELD_STEPS


class DeviceTrack(DeviceFinger):
    """Fingers that follow a path.

    Points of the path and start angles are computed on the CPU, because paths are NumPy functions.
    Each step therefore copies the mask of started fingers to the CPU, and path points back.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._path, self._angles_there = self._env.path, self._env.start_angles
        self._times = np.zeros(self.count)
        self._squares = torch.zeros_like(self._target[:, 0])

    def _draw(self, mask: Tensor) -> Tensor:
        chosen = mask.cpu().numpy()
        if not chosen.any():
            return self._angles
        if self._path.closed:
            drawn = uniforms(self._seeds, self._episodes, _STARTS, 1)[:, 0].cpu().numpy()
            self._times[chosen] = self._path.duration_s * drawn[chosen]
        else:
            self._times[chosen] = 0.0
        angles = np.tile(JOINT_REST, (len(chosen), 1))
        for i in np.flatnonzero(chosen):
            angles[i] = self._angles_there(self._times[i])
        self._squares.masked_fill_(mask, 0.0)
        self._look()
        return torch.as_tensor(angles, dtype=self.precision, device=mask.device)

    def _follow(self) -> None:
        self._times += CONTROL_DT
        self._look()
        squares = (self._tip - self._target).square().sum(dim=1)
        self._squares += torch.where(self._steps > SETTLING_STEPS, squares, 0.0)

    def _look(self) -> None:
        """Compute the present and coming points of the path."""
        places = self._path.at(self._times[:, None] + SEEN_S)
        points = torch.as_tensor(places, dtype=self.precision, device=self._target.device)
        self._target, self._ahead = points[:, 0], points[:, 1:]

    @property
    def _rms(self) -> Tensor:
        """Root mean square of the counted distances, m, shape (n,); infinite before the first."""
        counted = (self._steps - SETTLING_STEPS).clip(0)
        return torch.where(counted > 0, (self._squares / counted).sqrt(), torch.inf)

    @property
    def _succeeds(self) -> Tensor:
        return self._rms < FOLLOWS_M

    @override
    def start_infos(self) -> Infos:
        rms = self._rms.to(self.qpos.dtype)
        return {**super().start_infos(), "rms": rms}


FINGERS: Final = {FingerReachEnv: DeviceReach, FingerTrackEnv: DeviceTrack}
"""Classes of batched fingers, keyed by the class of their CPU env."""


def _put(target: Tensor, mask: Tensor, values: Tensor) -> None:
    """Replace the masked rows of a target by rows of values, shape (n, ...); mask: (n,)."""
    chosen = mask.view(-1, *[1] * (target.dim() - 1))
    target.copy_(torch.where(chosen, values.to(target.dtype), target))


def _turned(arms: Tensor, angles: Tensor) -> Tensor:
    """Return tendon excursions for the given joint angles, m, shape (n, 7)."""
    return torch.einsum("ntj,nj->nt", arms, angles[:, :_J])


def _fingertip(angles: Tensor) -> Tensor:
    """Return the fingertips, m, shape (n, 3), at joint angles, rad, shape (n, 4)."""
    turned = directions(angles)
    cos, sin = [angle.cos() for angle in turned], [angle.sin() for angle in turned]
    return torch.stack(tip_at(cos, sin), dim=1)


# Relative distance to a whole number of steps below which rounding can add a step to a delay.
_WHOLE: Final = 1e-6


class FingerReader(BodyReader):
    """Compiles fingers for a CPU env's task, and extracts the numbers that a device needs.

    Raises:
        VectorEnvError: If the env has goals, or draws another path or finger at each reset.
    """

    def __init__(self, env: gym.Env[Any, Any], *_: Any) -> None:
        self._env: Any = env.unwrapped
        self._task = FINGERS[type(self._env)]
        self.spec = env.spec
        individual = self._env.individual
        if isinstance(env.observation_space, gym.spaces.Dict):
            raise VectorEnvError("backend='warp' supports no goal: its observations are vectors.")
        if getattr(self._env, "path_is_random", False):
            raise VectorEnvError(
                "backend='warp' supports no path='random', because its resets draw no paths: "
                "name a path."
            )
        if individual:
            raise VectorEnvError(
                f"backend='warp' needs a {individual} with a gap, because its resets draw no "
                "fingers. For other fingers, pass bodies=[...] and options={'bodies': [...]}."
            )

    @override
    def body(self, value: FingerLike | None) -> FingerParameters:
        """Return the parameters of a finger (see `as_finger`); None is the env's finger."""
        return self._env.parameters if value is None else as_finger(value)

    @override
    def read(self, body: FingerParameters) -> tuple[DeviceBody, MakeWorlds]:
        """Return a compiled finger, and a function that makes a batch with it as the first finger.

        Raises:
            VectorEnvError: If the command delay is a whole number of simulation steps above 0.
            FingerError: If the command path does not fit the simulation steps.
        """
        env = self._env
        plant = FingerPlant(body, env.drive)
        model, held = plant.model, plant.held
        found = device_body("a finger", model, _numbers(plant))
        timestep = float(model.opt.timestep)
        rows = {**found.rows, "actuator_delay": np.full(model.nu, _device_delay(body, timestep))}
        steps = round(CONTROL_DT / timestep)
        rhythm = (steps, 1, 1) if held is None else (held.steps, held.ticks, held.computations)
        shared = {
            "path": held is not None,
            "steps of an action": rhythm,
            "zeros of joint_noise": body.joint_noise > 0.0,
            "zeros of tension_noise": body.tension_noise > 0.0,
        }
        encoded = {name: str(value).encode() for name, value in shared.items()}
        found = found._replace(rows=rows, shared={**found.shared, **encoded})
        layouts = env.observation_layout, env.action_layout
        return found, partial(self._task, env, plant, rhythm[0], layouts)

    @override
    def close(self) -> None:
        """Close the CPU env."""
        self._env.close()


def _numbers(plant: FingerPlant) -> dict[str, NDArray[Any]]:
    """Return the numbers of a finger that its task uses."""
    parameters, data = plant.parameters, cast("Any", plant.data)
    path = parameters.path
    rise, fall = (math.inf, math.inf) if path is None else slews(path)
    plant.place(JOINT_REST, np.random.default_rng(0))
    numbers = {
        "least": parameters.least_tension,
        "taut": parameters.taut,
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
    """Return a delay, s, that delays controls by as many simulation steps as a finger's delay."""
    delay = parameters.command_delay
    steps = delay / timestep
    if delay > 0.0 and abs(steps - round(steps)) < _WHOLE * steps:
        raise VectorEnvError(
            f"backend='warp' supports no command_delay of {delay:g} s: it is a whole number of "
            f"simulation steps of {timestep:g} s, and rounding sometimes makes it a step longer "
            f"on a CPU. Use {delay - 0.1 * timestep:g} s."
        )
    # A delay takes effect at the next step. If it ends half a step earlier, the effect is the same,
    # and rounding in single precision cannot change the step.
    return (math.ceil(steps) - 0.5) * timestep if delay > 0.0 else 0.0


for _env_class in FINGERS:
    register_reader(_env_class, FingerReader)
