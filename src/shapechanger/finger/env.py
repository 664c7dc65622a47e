"""Base class of the finger envs: the simulated finger, actions, rewards and rendering."""

from __future__ import annotations

import copy
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Final, Self, cast

import gymnasium as gym
import msgspec
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from shapechanger.contract.env_ref import Measure
from shapechanger.contract.pages import Page
from shapechanger.envs.checks import check_action
from shapechanger.envs.opengl import choose_gl, require_screen
from shapechanger.envs.renderer import Renderer, body_reach, draw
from shapechanger.errors import FingerError, check_seed, require_known
from shapechanger.finger.anatomy import JOINT_RANGE, JOINT_REST, JOINTS, TENDONS
from shapechanger.finger.gap import Gap, geared_around, resolve_gap, with_gears
from shapechanger.finger.model import TARGET, FingerFigure
from shapechanger.finger.parameters import (
    NOMINAL,
    PARAMETER_SETS,
    FingerParameters,
    as_numbers,
    named_set,
)
from shapechanger.finger.plant import CONTROL_DT, FingerPlant
from shapechanger.finger.postures import draw_start
from shapechanger.finger.task import FingerSenses, FingertipReward
from shapechanger.finger.tensions import drive_of, spans_all_torques
from shapechanger.finger.visuals import tendon_legend
from shapechanger.layout import Element, Feature, Layout

_MODES: Final = ("human", "rgb_array", "depth_array")
# The camera sees the workspace and the end of the hand from the thumb's side.
_CAMERA: Final[Mapping[str, Any]] = {
    "lookat": np.array([0.017, 0.0, -0.024]),
    "distance": 0.18,
    "azimuth": -125.0,
    "elevation": -15.0,
}
_PICTURE: Final = 480
# Duration of the recorded motions from which a finger is identified, s.
_BABBLE_S: Final = 10.0

# Weight of the reward in envs for policies that transfer to a rig. A rig cannot follow fast
# changes, so they are penalised.
_CALM: Final = {"change": 5.0}

SMOOTHNESS: Final = Measure("smoothness", "1", "smoothness", "episode")
"""1 minus half the mean absolute change of a tendon's command in a step."""


class FingerEnv(Page, gym.Env[Any, NDArray[np.float32]], EzPickle):
    """An index finger moved by seven tendons; derived classes define the task.

    ## Action space
    `Box(-1, 1, (7,), float32)`, one command per tendon, which lasts 0.02 s. The argument `actions`
    sets the meaning of a command: "impedance", a muscle whose tension grows with its length;
    "tension"; or "length".

    | Num | Action        | Min | Max | Unit |
    | --- | ------------- | --- | --- | ---- |
    | 0   | `FDP/command` | -1  | 1   | 1    |
    | 1   | `FDS/command` | -1  | 1   | 1    |
    | 2   | `EIP/command` | -1  | 1   | 1    |
    | 3   | `EDC/command` | -1  | 1   | 1    |
    | 4   | `LUM/command` | -1  | 1   | 1    |
    | 5   | `DI/command`  | -1  | 1   | 1    |
    | 6   | `PI/command`  | -1  | 1   | 1    |

    ## Common arguments
    - `actions` ("impedance"): meaning of an action; see `shapechanger.finger.tensions.DRIVES`.
    - `parameters` (None): parameters of the finger: `FingerParameters`, their JSON, a mapping of
      changed parameters, or the name of a set, "an-1983"; None for the nominal finger.
    - `gap` (None): distribution from which the finger is drawn instead of using `parameters`, its
      name or a mapping of its ranges; see `shapechanger.finger.gap`.
    - `finger_seed` (None): seed of the finger drawn from the gap; None draws another finger at each
      reset (domain randomisation).
    - `reward` (None): weights that replace the default ones, keyed by name.
    - `render_mode` (None): "human", "rgb_array" or "depth_array".
    - `width` (480) and `height` (480) of frames, pixels.

    Attributes:
        plant: The simulated finger, with its ground truth.
        observation_layout: Name, unit and range of each number of the observation.
        action_layout: Name, unit and range of each number of the action.

    Raises:
        UnknownName: If the mode of action, gap, parameter, weight or render mode is unknown.
        FingerError: If an argument is invalid, both parameters and a gap are given, `finger_seed`
            has no gap, or the tendons cannot balance the joints (only "an-1983" is allowed).
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - Gymnasium declares it without ClassVar.
        "render_modes": [*_MODES],
        "render_fps": round(1.0 / CONTROL_DT),
    }
    observation_layout: Layout
    _options: tuple[str, ...] = ("posture",)
    _spec: EnvSpec | None = None
    _target: NDArray[np.float64]

    def __new__(cls, *arguments: Any, **options: Any) -> Self:
        """Store the arguments for pickling."""
        env = super().__new__(cls)
        EzPickle.__init__(env, *arguments, **options)
        return env

    def __init__(
        self,
        *,
        actions: str = "impedance",
        parameters: FingerParameters | Mapping[str, Any] | str | None = None,
        gap: str | Gap | Mapping[str, Any] | None = None,
        finger_seed: int | None = None,
        reward: Mapping[str, float] | None = None,
        render_mode: str | None = None,
        width: int = _PICTURE,
        height: int = _PICTURE,
    ) -> None:
        if render_mode is not None:
            require_known("render mode", _MODES, render_mode)
            (require_screen if render_mode == "human" else choose_gl)()
        if gap is not None and parameters is not None:
            raise FingerError("Give either parameters or a gap to draw them from, not both.")
        if gap is None and finger_seed is not None:
            raise FingerError("finger_seed selects a finger of a gap: give a gap too.")
        self.render_mode = render_mode
        self.width, self.height = width, height
        self._actions = actions
        self._gap = None if gap is None else resolve_gap(gap)
        self._is_drawn_anew = gap is not None and finger_seed is None  # At each reset.
        self._reward = FingertipReward.from_weights(reward or {})
        self._figure: FingerFigure | None = None
        self._renderer: Renderer | None = None
        if self._gap is None:
            self._use(as_finger(parameters))
        else:
            seed = 0 if finger_seed is None else finger_seed
            seed = check_seed(seed, FingerError, "finger_seed must be", largest=None)
            self._use(self._gap.draw(np.random.default_rng(seed)))
        self._senses: FingerSenses | None = None
        self._change = np.zeros(len(TENDONS))  # Change of the command in the newest step.
        command = ("1", -1.0, 1.0)
        self.action_layout = Layout(
            tuple(Feature(f"{t}/command", *command, Element("tendon", t)) for t in TENDONS)
        )
        self.action_space = gym.spaces.Box(-1.0, 1.0, (len(TENDONS),), np.float32)

    def _use(self, parameters: FingerParameters) -> None:
        """Simulate a finger with these parameters from here on."""
        self.parameters = parameters
        self.drive = drive_of(self._actions, NOMINAL)
        self.plant = FingerPlant(parameters, self.drive)
        self._most = np.array(parameters.most_tension)
        self.plant.place(JOINT_REST, np.random.default_rng(0))  # Until the first reset.

    def _place(self, options: dict[str, Any] | None) -> FingerSenses:
        """Draw a finger if each reset draws one, and put the finger at its start."""
        require_known("option of reset", self._options, *(options or {}))
        if self._is_drawn_anew and self._gap is not None:
            self._use(self._gap.draw(self.np_random))
        given = (options or {}).get("posture")
        angles, (low, high) = as_numbers(given), JOINT_RANGE.T
        if given is None:
            angles = draw_start(self.np_random)
        elif angles.shape != (len(JOINTS),) or not ((angles >= low) & (angles <= high)).all():
            raise FingerError(
                f"A posture must be four angles in rad, {', '.join(JOINTS)}, within "
                f"{low.round(3).tolist()} and {high.round(3).tolist()}; got {given}."
            )
        self._senses = self._start_at(angles)
        return self._senses

    def _start_at(self, angles: NDArray[np.float64]) -> FingerSenses:
        """Start at rest with these angles, rad, (4,)."""
        return self.plant.place(angles, self.np_random)

    def _move(self, command: NDArray[np.float64]) -> FingerSenses:
        """Apply a command, -1 to 1, (7,), for one control period."""
        return self.plant.act(command, self.np_random)

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take one step.

        Raises:
            BadAction: If the action has another shape or is not finite; the state is unchanged.
            ResetNeeded: If `reset` was never called.
        """
        if self._senses is None:
            raise gym.error.ResetNeeded("Call reset() before the first step.")
        checked = check_action(self, action)
        before = self._senses.commands
        senses = self._senses = self._move(np.clip(np.asarray(checked, np.float64), -1.0, 1.0))
        self._change = senses.commands - before
        self._advance()
        terms = self._terms(senses)
        info = {**self._info(), **terms}
        info[SMOOTHNESS.key] = 1.0 - 0.5 * float(np.abs(self._change).mean())
        if self.plant.diverged:
            info["diverged"] = True
        return self._observation(senses), sum(terms.values()), False, False, info

    @abstractmethod
    def _advance(self) -> None:
        """Update the task after the finger has moved for one control period."""

    @abstractmethod
    def _observation(self, senses: FingerSenses) -> Any:
        """Return the observation of the task."""

    @abstractmethod
    def _info(self) -> dict[str, Any]:
        """Return the entries of `info` that both `reset` and `step` return."""

    def _terms(self, senses: FingerSenses) -> dict[str, float]:
        """Return the terms of the reward, keyed by name; the reward is their sum."""
        effort, change = float(np.mean(self._pulled**2)), float(np.mean(self._change**2))
        return self._reward.terms(self._distance, effort, change, CONTROL_DT)

    @property
    def _distance(self) -> float:
        """True distance of the fingertip from its target, m."""
        return float(np.linalg.norm(self.plant.fingertip - self._target))

    def render(self) -> Any:
        """Return a frame; None in the mode "human", or without a render mode.

        Raises:
            RenderError: If this machine cannot render.
        """
        if self.render_mode is None:
            return None
        figure = self._shown()
        if self._renderer is None:
            self._renderer = Renderer(
                figure.model, figure.data, dict(_CAMERA), self.width, self.height
            )
        if self.render_mode == "depth_array":
            return self._renderer.render(self.render_mode)
        frame = self._renderer.render(self.render_mode, self._markers())
        return frame if frame is None else tendon_legend(frame, self._pulled)

    def _markers(self) -> list[dict[str, Any]]:
        """Return the marks that frames show in addition to the finger."""
        return []

    @property
    def _pulled(self) -> NDArray[np.float64]:
        """Tension of each tendon divided by its largest tension, (7,)."""
        return np.abs(self.plant.data.actuator_force) / self._most

    def _shown(self) -> FingerFigure:
        """Return a model of the present finger with bones and routes of tendons, to be drawn."""
        if self._figure is None:
            self._figure = FingerFigure()
        self._figure.show(self.plant.angles, self._pulled, self.plant.data.mocap_pos[0])
        return self._figure

    def close(self) -> None:
        """Free the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    # `gym.make`, Minari and vector envs build the env again from its spec, which is stored as JSON.

    @property
    def spec(self) -> EnvSpec | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The registered spec, with parameters and gap as values that JSON can represent."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # pyright: ignore[reportIncompatibleVariableOverride]
        self._spec = copy.deepcopy(spec)
        kwargs: dict[str, Any] = {} if self._spec is None else self._spec.kwargs
        for name in ("parameters", "gap"):
            if isinstance(kwargs.get(name), msgspec.Struct):
                kwargs[name] = msgspec.to_builtins(kwargs[name])

    @property
    def motors(self) -> FingerParameters | None:
        """This path and tension range in a nominal finger on geared servos; None without a path."""
        own = self.parameters
        if own.path is None:
            return None
        known = {"most_tension": own.most_tension, "least_tension": own.least_tension}
        return with_gears(NOMINAL.replace(**known, path=own.path))

    # Interface of transfer studies; see `shapechanger.transfer`.

    @property
    def reach(self) -> float:
        """Distance from the middle of the finger to its farthest point, m."""
        figure = self._shown()
        return body_reach(figure.model, figure.data.qpos)

    def picture(
        self, width: int = 480, height: int = 360, reach: float | None = None
    ) -> NDArray[np.uint8]:
        """Return an image of the present finger, shape (height, width, 3).

        `reach` is the radius in view around the middle of the finger, m; None for its own reach.
        """
        figure = self._shown()
        model = figure.model.__copy__()
        model.geom_rgba[model.geom(TARGET).id, 3] = 0.0
        return draw(model, figure.data.qpos, width, height, reach or self.reach)

    @property
    def individual(self) -> str:
        """The argument that selects a finger of the gap, or "" if there is only one finger."""
        return "finger_seed" if self._is_drawn_anew else ""

    def randomised_source(self) -> dict[str, Any]:
        """Arguments of an env whose random fingers are likely to include this one."""
        return {"gap": "wide", "reward": _CALM}

    def identified_source(self, seed: int) -> dict[str, Any]:
        """Identify this finger, and return arguments of `Finger-v1` for a finger like it.

        The finger moves for ten seconds, determined by `seed`. If it has a command path, the
        arguments are a gap, from which each episode draws a finger; see `geared_around`.
        """
        # Imported here, because an env that only steps does not need the optimiser.
        from shapechanger.finger.identify import identify, record_babble

        found = identify(record_babble(self, _BABBLE_S, seed, self._actions)).parameters
        if found.path is None:
            return {"parameters": msgspec.to_builtins(found)}
        return {"gap": msgspec.to_builtins(geared_around(found)), "reward": _CALM}


FingerLike = FingerParameters | Mapping[str, Any] | str
"""A finger: parameters, their JSON, a mapping of changed parameters, or the name of a set."""


def as_finger(value: FingerLike | None) -> FingerParameters:
    """Return the parameters of a finger; the nominal finger for None."""
    given: Any = NOMINAL if value is None else value
    if isinstance(given, str):
        is_json = given.lstrip().startswith("{")
        given = FingerParameters.from_json(given) if is_json else named_set(given)
    elif isinstance(given, Mapping):
        named = cast("Mapping[str, Any]", given)
        require_known("parameter of a finger", FingerParameters.__struct_fields__, *named)
        given = NOMINAL.replace(**named)
    if not isinstance(given, FingerParameters):
        raise FingerError(f"A finger must be parameters, JSON, a mapping or a name, got {given!r}.")
    if given not in PARAMETER_SETS.values() and not spans_all_torques(given.arms):
        raise FingerError(
            "The tendons cannot balance the joints: tendons only pull, so with these moment arms "
            "no tensions produce some of the torques."
        )
    return given
