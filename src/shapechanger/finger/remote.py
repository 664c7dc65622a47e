"""The tasks of the finger on a rig of servos, or on its twin."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Final, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import FingerError, RobotRefused, check_seed, require_known
from shapechanger.finger.anatomy import JOINTS, TENDONS
from shapechanger.finger.env import FingerEnv
from shapechanger.finger.gap import GAPS, with_gears
from shapechanger.finger.parameters import NOMINAL, CommandPath, FingerParameters
from shapechanger.finger.paths import PathSource
from shapechanger.finger.plant import CONTROL_DT
from shapechanger.finger.reach import FingerReachEnv
from shapechanger.finger.rig import RigSenses, StartApproach
from shapechanger.finger.task import FingerSenses
from shapechanger.finger.track import FingerTrackEnv
from shapechanger.robot.client.env import RemoteVehicleEnv
from shapechanger.robot.profile.load import find_profile
from shapechanger.robot.twin.robot import Operator, RunningRobot, run_robot

NOMINAL_TWIN: Final = "nominal"
"""Name of the twin with the parameters of the nominal finger."""

# Tolerance of the start posture, rad, and time limit to reach it, s. If gears stick, the episode
# begins at the posture that was reached.
_START_OFF_RAD: Final = 0.03
_START_S: Final = 1.0
# Time for the pretension to wind in slack, s.
_SLACK_S: Final = 0.6
# Times without a message after which the link is lost, s: of a robot, and of the env's own twin,
# which may have to wait for a busy machine.
_TIMEOUT_S: Final = 2.0
_OWN_TIMEOUT_S: Final = 30.0
# Prefixes of the keys of `info` that concern driving only.
_DRIVING: Final = ("reward", "frame", "captured_ns")
# Arguments that `FingerEnv` also has.
_SHARED: Final = ("reward", "render_mode", "width", "height")


class RigMixin(FingerEnv):
    """Mixin that performs a task of the finger on a rig.

    The simulation is never stepped: it shows the state of the rig for rendering and rewards.

    ## On a rig
    The spaces equal the simulation's, so a script runs on both envs if the id is changed. The env
    converts commands to tensions, by the newest lengths and speeds of the tendons at the servos. On
    a rig with encoders at its joints the angles are measured, with noise, and velocities are
    differences of angles over 20 ms, smoothed over 40 ms. Without encoders, angles and velocities
    are computed from lengths and speeds of the tendons, and are as accurate as the nominal moment
    arms. The fingertip is computed from the angles. Distance, reward and `info["is_success"]` are
    computed from the measured angles, or from the true state of the env's own twin (`twin`).

    ## Common arguments
    - `robot` ("finger"): name of a known rig, or its address as HOST or HOST:PORT. A twin of the
      profile "finger" that runs on this machine has the name "finger".
    - `twin` (""): twin that this env runs instead of connecting to `robot`: "nominal", or the name
      of the gap from which its finger is drawn.
    - `finger_seed` (None): seed of the finger drawn from the gap; None for 0.
    - `twin_folder` (""): folder of a twin on this machine, for its true state.
    - `actions` ("impedance"): meaning of an action; see `shapechanger.finger.tensions.DRIVES`.
    - `reward` (None): weights that replace the default ones, keyed by name.
    - `render_mode` (None): "human", "rgb_array" or "depth_array" of the finger as measured.
    - `width` (480) and `height` (480) of frames, pixels.
    - `key` (""), `fingerprint` (""), `on_reset` ("operator"), `on_waiting` (None) and
      `reset_timeout_s` (60): as for `RemoteVehicleEnv`.

    Args:
        task: Arguments of the class of the task.

    Raises:
        UnknownName: If the name of the rig, twin, mode of action or weight is unknown.
        FingerError: If `finger_seed` is given without a gap, or the mode does not suit the rig.
        LinkError: If the rig cannot be reached, or is not trusted.
        RobotRefused: If the rig refuses the connection, or is not a finger rig.
    """

    side_by_side: ClassVar[bool] = False
    """Whether several envs can run at once: False, because there is only one rig."""

    def __init__(
        self,
        robot: str,
        task: Mapping[str, Any],
        *,
        twin: str = "",
        finger_seed: int | None = None,
        twin_folder: str = "",
        actions: str = "impedance",
        **more: Any,
    ) -> None:
        own = {name: more.pop(name) for name in _SHARED if name in more}
        super().__init__(**task, actions=actions, **own)
        self._twin, self._finger_seed, self._seed = twin, finger_seed, None
        self._truth: dict[str, NDArray[np.float64]] = {}
        self._rig_info: dict[str, Any] = {}
        self._command = np.zeros(len(TENDONS))
        self._own: RunningRobot | None = None
        self._operator: Operator | None = None
        with ExitStack() as opened:
            if twin or finger_seed is not None:
                self._own = opened.enter_context(closing(_serve_twin(twin, finger_seed)))
                known = self._own.known
                robot = known.address
                more |= {"key": known.key, "fingerprint": known.fingerprint}
                twin_folder = str(self._own.folder)
            connect = partial(
                RemoteVehicleEnv,
                robot,
                state=True,
                image=False,
                timeout_s=_TIMEOUT_S if self._own is None else _OWN_TIMEOUT_S,
                **more,
            )
            rig = connect(pace="lockstep")
            if rig.welcome.clock == "real":
                rig.close()
                rig = connect(pace="realtime")
            self._rig = opened.enter_context(closing(rig))
            name = rig.welcome.robot
            self._rig_senses = RigSenses(name, rig.action_layout, rig.observation_layout)
            if self._rig_senses.controls_length and actions != "length":
                raise FingerError(
                    f'{name} controls lengths, so actions must be "length", not {actions!r}; '
                    'control = "tension" in its profile allows all modes.'
                )
            if twin_folder:
                operator = Operator(str(Path(twin_folder) / "board.socket"))
                self._operator = opened.enter_context(closing(operator))
            self._opened = opened.pop_all()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode; the options are the same as in the simulation.

        Raises:
            UnknownName: If the name of an option is unknown.
            FingerError: If a posture is malformed or out of range, or a target is malformed.
            PathError: If a path is invalid, or the finger cannot follow it.
            RobotRefused: If the rig was not armed in time, refuses the connection, or stops on the
                way to the start, or if the lengths of its tendons fit no posture.
            LinkError: If the rig cannot be reached in time.
        """
        self._seed = seed
        if self._own is not None and self._operator is not None:
            for name in TENDONS:  # Resets the temperature of each servo of the twin.
                self._operator.break_servo(name, "")
        observation, info = super().reset(seed=seed, options=options)
        return observation, self._with_rig(info)

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take one step.

        Raises:
            BadAction: If the action has another shape or is not finite; no command was sent then.
            ResetNeeded: If `reset` was never called, or the link was lost.
        """
        observation, reward, terminated, _, info = super().step(action)
        info = self._with_rig(info)
        return observation, float(reward), terminated, bool(info["truncated_because"]), info

    def close(self) -> None:
        """Stop and release the rig, end its own twin, and free the renderer."""
        super().close()
        self._opened.close()

    @property
    def exclusive(self) -> bool:
        """Return whether this env blocks other clients of a robot; False with its own twin."""
        return self._own is None

    @property
    def individual(self) -> str:
        """The argument that selects a finger of the gap, or "" if there is only one finger."""
        many = bool(self._twin) and self._twin != NOMINAL_TWIN
        return "finger_seed" if many and self._finger_seed is None else ""

    @property
    def motors(self) -> FingerParameters:
        """The nominal finger with the rig's range of tensions and path, on geared servos."""
        rig, welcome = self._rig_senses, self._rig.welcome
        # Uses the slowest servo's slew rates.
        up, down = (
            min((slew for slew in given if slew > 0.0), default=None)
            for given in (welcome.slew_per_s, welcome.slew_down_per_s)
        )
        path = CommandPath(
            control_hz=welcome.control_hz,
            tick_hz=welcome.tick_hz,
            slew_per_s=up,
            slew_down_per_s=down,
        )
        most, least = tuple(rig.most.tolist()), float(rig.least.max())
        return with_gears(NOMINAL.replace(most_tension=most, least_tension=least, path=path))

    def _start_at(self, angles: NDArray[np.float64]) -> FingerSenses:
        """Arm the rig, and bring the finger to its start."""
        rig = self._rig_senses
        state, self._rig_info = self._rig.reset(seed=self._seed)
        self._command = np.zeros(len(TENDONS))
        rig.forget()
        senses = self._sense(state)
        for _ in range(round(_SLACK_S / CONTROL_DT)):
            if not rig.misfit(senses):
                break
            senses = self._on_the_way(rig.values(rig.least))
        if misfit := rig.misfit(senses):
            raise RobotRefused(misfit)
        way = StartApproach(angles, rig)
        for _ in range(round(_START_S / CONTROL_DT)):
            if way.off(senses) < _START_OFF_RAD:
                break
            senses = self._on_the_way(way.values(senses))
        # As in the simulation, the first command is the one that gives the present tensions.
        tensions = np.clip(senses.tensions, rig.least, rig.most)
        command = self.drive.command(tensions, senses.lengths, rig.speeds)
        self._command = np.clip(command, -1.0, 1.0)
        return dataclasses.replace(senses, commands=self._command)

    def _move(self, command: NDArray[np.float64]) -> FingerSenses:
        """Convert a command to tensions or lengths, and pull for one control period."""
        self._command = command
        rig = self._rig_senses
        if rig.controls_length:
            # Send the lengths at which the drive pulls with the least tension.
            still = self.drive.tension(command, np.zeros(len(TENDONS)), np.zeros(len(TENDONS)))
            return self._send(rig.length_values((rig.least - still) / self.drive.stiffness))
        lengths = cast("FingerSenses", self._senses).lengths
        return self._send(rig.values(self.drive.tension(command, lengths, rig.speeds)))

    def _send(self, values: NDArray[np.float32]) -> FingerSenses:
        """Send a command of the rig for one control period."""
        state, _, _, _, self._rig_info = self._rig.step(values)
        return self._sense(state)

    def _on_the_way(self, values: NDArray[np.float32]) -> FingerSenses:
        """Send a command before an episode; raise RobotRefused if the rig stops."""
        senses = self._send(values)
        if because := self._rig_info["truncated_because"]:
            raise RobotRefused(f"The finger did not come to its start: {because}")
        return senses

    def _sense(self, state: NDArray[Any]) -> FingerSenses:
        """Read a state of the rig, and show it, or the true state of the own twin, in the plant."""
        senses = self._rig_senses.read(state, self._rig_info["absent"], self._command)
        if self._operator is not None:
            truth = self._operator.where().truth
            self._truth = {
                "tip": np.array([truth[f"fingertip/{axis}"] for axis in "xyz"]),
                "angles": np.array([truth[f"{name}/angle"] for name in JOINTS]),
            }
        data = self.plant.data
        data.qpos[:] = senses.angles if self._own is None else self._truth["angles"]
        data.qvel[:] = senses.velocities
        mujoco.mj_kinematics(self.plant.model, data)
        data.actuator_force[:] = -senses.tensions
        return senses

    def _with_rig(self, info: dict[str, Any]) -> dict[str, Any]:
        """Return an info of the task with the rig's entries and the true state of a twin."""
        of_rig = {n: v for n, v in self._rig_info.items() if not n.startswith(_DRIVING)}
        info = {"truncated_because": "", **of_rig, **info}
        if self._truth:
            distance = np.linalg.norm(self._truth["tip"] - info["target"])
            info |= {"true_distance": float(distance), "true_angles": self._truth["angles"].copy()}
        return info


class RemoteFingerEnv(RigMixin, FingerReachEnv):
    """Bring the fingertip of a real finger, or of its twin, to a point that it can reach.

    ## Start
    The operator arms a rig; the env arms a twin. For up to 1 s, the env moves the finger to the
    start of `Finger-v1` for the same seed. The measured error is a few hundredths of a radian, or
    more if gears stick. The target is as in `Finger-v1`. Servos of the env's own twin are cool at
    the start; servos of a rig need pauses, or they get hot and switch off.

    ## End
    Truncated after 100 steps, and when the rig stops: a servo that fails, an emergency stop, a lost
    link. `info["truncated_because"]` is the reason.

    ## Info
    The keys of `Finger-v1`: `is_success`, `distance`, `target`, `smoothness` and the terms of the
    reward; and of `RemoteVehicleEnv`: `action_applied`, `stop_reason`, `refused`, `events`,
    `latency`, `armed`, `emergency`, `absent`, `truncated_because`. With `twin_folder` or `twin`
    also `true_distance`, m, and `true_angles`, rad, (4,), of the twin.

    ## Versions
    v1: the first.

    Args:
        robot: Name of a known rig, or its address.
        goal: Whether observations are Dicts with goals.
        **rig: See the section Common arguments of this page.

    Raises:
        UnknownName, LinkError, RobotRefused: As `RigMixin`.
    """

    def __init__(self, robot: str = "finger", *, goal: bool = False, **rig: Any) -> None:
        super().__init__(robot, {"goal": goal}, **rig)


class RemoteFingerTrackEnv(RigMixin, FingerTrackEnv):
    """Follow a point that moves along a known path with a real finger, or its twin.

    ## Start
    The finger is brought to the point of the path where `FingerTrack-v1` starts for the same seed,
    as in `RemoteFinger-v1`; then the point moves.

    ## End
    Truncated after 250 steps, 5 s, and when the rig stops; `info["truncated_because"]` is the
    reason.

    ## Info
    The keys of `FingerTrack-v1`: `is_success`, `distance`, `rms`, `target`, `smoothness` and the
    terms of the reward; and the keys of a rig and its twin as in `RemoteFinger-v1`.

    ## Versions
    v1: the first.

    Args:
        robot: Name of a known rig, or its address.
        path: As for `FingerTrack-v1`.
        **rig: See the section Common arguments of this page.

    Raises:
        PathError: If `path` is not a path, or the nominal finger cannot follow it.
        UnknownName, LinkError, RobotRefused: As `RigMixin`.
    """

    def __init__(self, robot: str = "finger", *, path: PathSource = "circle", **rig: Any) -> None:
        super().__init__(robot, {"path": path}, **rig)


def _serve_twin(twin: str, finger_seed: int | None) -> RunningRobot:
    """Serve the package's finger profile on a twin with its own clock."""
    if twin:
        require_known("twin of a finger", (NOMINAL_TWIN, *GAPS), twin)
    if twin not in GAPS and finger_seed is not None:
        raise FingerError("finger_seed selects a finger of a gap, so `twin` must name a gap.")
    seed = check_seed(0 if finger_seed is None else finger_seed, FingerError, "finger_seed must be")
    drawn = ("--gap", twin, "--finger-seed", str(seed)) if twin in GAPS else ()
    return run_robot(find_profile("finger"), clock="twin", arguments=drawn)
