"""Mixin that gives a Gymnasium MuJoCo env an editable body."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any, Final, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.opengl import choose_gl, require_screen
from shapechanger.errors import (
    EnvArgumentError,
    SpaceMismatch,
    check_seed,
    needing_extra,
    require_known,
)

with needing_extra("sim"):
    import mujoco
    from gymnasium.envs.mujoco import MujocoEnv

from shapechanger.contract.pages import Page
from shapechanger.envs.checks import check_action, check_arguments
from shapechanger.envs.layouts import action_layout, position_features, velocity_features
from shapechanger.envs.renderer import Renderer, body_reach, draw, halve_textures, prepare_scene
from shapechanger.layout import Feature, Layout
from shapechanger.morphology import Body, compile_body, interpolate, reshape, to_json
from shapechanger.morphology.certificate import Certificate, certify
from shapechanger.morphology.families import BodyLike, Family, Split
from shapechanger.morphology.pose import (
    StartRules,
    standing_height,
    standing_pose,
    start_pose,
    travelling_body,
)
from shapechanger.morphology.tree import Tree, tree_of

if TYPE_CHECKING:
    from gymnasium.envs.registration import EnvSpec

# Distance of a camera that follows a body, in multiples of its reach: 3.5 m for the ant; and of a
# fixed camera: 2.04 m for the inverted pendulum, like Gymnasium's.
_FOLLOWING_PER_REACH: Final = 3.0
_FIXED_PER_REACH: Final = 4.1
BAD_STATE: Final = slice(
    int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1
)
"""The warnings in `data.warning` of a bad position, velocity or acceleration."""

# Arguments of every env that Gymnasium's constructors do not have, with their defaults.
_OWN_ARGUMENTS: Final[dict[str, Any]] = {"shadows": None, "fast_model": True, "towards": None}


class Reshapable(Page, MujocoEnv):
    """Mixin that gives a Gymnasium MuJoCo env any body of a family, and named spaces.

    The env keeps its rewards, terminations, infos and arguments. Model, spaces, layouts and start
    pose are derived from the body.

    An env without a `render_mode` stores the textures of bodies and skies at half their width and
    height, to save memory.

    ## Common arguments
    - `render_mode` (None): "human", "rgb_array", "depth_array" or "rgbd_tuple".
    - `width` (480) and `height` (480) of frames, pixels.
    - `camera_id` (None) or `camera_name` (None): a camera of the model, by number or name, that
      frames show; `default_camera_config`: settings of the camera that shows them otherwise, such
      as `{"distance": 4.0}`.
    - `max_geom` (1000): largest number of shapes in a frame; `visual_options` (None): flags of
      MuJoCo's `mjtVisFlag`, keyed by number.
    - `shadows` (None): whether frames have shadows, reflections and smoothed edges. By default,
      frames of more than 256 x 256 pixels have them, and smaller ones, which render faster without
      them, do not.
    - `fast_model` (True): whether a cheaper model with bit-equal motion may step the physics, while
      MuJoCo's profiling clock (`data.timer`) is paused. Ants and single pendulums may have such a
      model; other envs accept the argument and ignore it.
    - `towards` (None): another body of the family with the same spaces. Each reset then draws a
      body uniformly between `body` and `towards`, unless the reset gives a body.

    Attributes:
        family: The bodies that the env can have.
        body: The edits of the family's model that make the present body.
        observation_layout: Name, unit and range of each number of the observation.
        action_layout: Name, unit and range of each number of the action.
        standing_height: Height of the trunk above the floor when it stands with each joint in the
            middle of its range, or as the subclass defines, m; None if it does not stand.
    """

    family: Family

    body: Body
    observation_layout: Layout
    action_layout: Layout
    standing_height: float | None
    _spec: EnvSpec | None = None
    fast_model: bool = True
    # Arguments that may be objects; they are recorded as JSON for pickling.
    _as_json: frozenset[str] = frozenset()
    _draws_bare_floors: bool = False  # Whether planes without a material are drawn.
    _started: bool = False  # Whether a state has been set since the env was made.
    _starting: bool = False  # Whether a start state is being drawn.

    def _begin(self, body: BodyLike, arguments: dict[str, Any]) -> None:
        """Store the arguments that Gymnasium's env lacks, and prepare to compile the body."""
        check_arguments(type(self), self.family.name, _OWN_ARGUMENTS, arguments)
        own = {name: arguments.pop(name, default) for name, default in _OWN_ARGUMENTS.items()}
        self._own_arguments: dict[str, Any] = own
        self.fast_model = own["fast_model"]
        self.body = self.family.body(body)
        # The bodies between which each reset draws a body.
        self._ends: tuple[Body, Body] | None = None
        if own["towards"] is not None:
            self._ends = self.body, self.family.body(own["towards"])
            own["towards"] = to_json(self._ends[1])
        self._body_rng = np.random.default_rng()
        mode = arguments.get("render_mode")
        self._draws = mode is not None
        if mode == "human":
            require_screen()
        elif mode is not None:
            choose_gl()
        self._given_camera: dict[str, Any] | None = arguments.get("default_camera_config")
        names = ("camera_id", "camera_name", "visual_options")
        self._renderer_arguments = {
            "max_geom": arguments.get("max_geom", 1000),
            "shadows": own["shadows"],
            **{name: arguments.get(name) for name in names},
        }

    def _finish(self, arguments: dict[str, Any]) -> None:
        """Set attributes that depend on the compiled model, and record arguments for pickling."""
        self._follow_body()
        shape = (self.observation_layout.size,)
        if self.observation_space.shape != shape:  # The constructor set it for Gymnasium's body.
            self.observation_space = gym.spaces.Box(-np.inf, np.inf, shape, np.float64)
        self._renew_renderer()
        # Gymnasium's constructor has recorded its own arguments only.
        self._ezpickle_args: tuple[Any, ...] = ()
        self._ezpickle_kwargs = {"body": to_json(self.body), **arguments, **self._own_arguments}

    # `gym.make`, Minari and vector envs build the env again from its spec.

    @property
    def spec(self) -> EnvSpec | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The registered spec, with the present body and other objects as their JSON."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # pyright: ignore[reportIncompatibleVariableOverride]
        self._spec = copy.deepcopy(spec)
        if self._spec is not None:
            given = self._spec.kwargs
            given |= {name: self._ezpickle_kwargs[name] for name in self._as_json & {*given}}
        self._record_body()

    def _record_body(self) -> None:
        """Record the present body for pickling and in the spec, unless resets draw bodies."""
        for record in (self._ezpickle_kwargs, {} if self._spec is None else self._spec.kwargs):
            if self._ends is None:
                record["body"] = to_json(self.body)

    def _initialize_simulation(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Compile the present body instead of the plain file."""
        model = compile_body(self._load_family(), self.body)
        # As in Gymnasium's method: the frame buffer must be as large as the frame.
        buffer = model.vis.global_
        buffer.offwidth = max(buffer.offwidth, self.width)
        buffer.offheight = max(buffer.offheight, self.height)
        return model, mujoco.MjData(model)

    def body_spec(self) -> mujoco.MjSpec:
        """Return the spec of the present body: the family's with the edits applied."""
        return reshape(self._load_family(), self.body)

    def _load_family(self) -> mujoco.MjSpec:
        """Return the family's model, with smaller textures if the env never renders."""
        spec = self.family.load(self.fullpath)
        prepare_scene(spec, bare_floors=self._draws_bare_floors)
        if not self._draws:
            halve_textures(spec)
        return spec

    def _follow_body(self) -> None:
        """Set attributes of the env that depend on the model."""
        self.init_qpos, self.standing_height = self._start_and_height(self.model)
        self.init_qvel = np.zeros(self.model.nv)
        self.observation_layout = Layout(tuple(self._observation_features(self.model)))
        self.action_layout = action_layout(self.model)

    def _start_and_height(self, model: mujoco.MjModel) -> tuple[NDArray[np.float64], float | None]:
        """Return the start pose (nq,) and the standing height, m, of a body of this family."""
        return start_pose(model), standing_height(model)

    def _observation_features(self, model: mujoco.MjModel) -> list[Feature]:
        """Return the features of this task's observation, in order."""
        return position_features(model) + velocity_features(model)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Start an episode.

        Args:
            seed: Seed of all randomness from here on; None keeps the present generator.
            options: `{"body": ...}` changes the body: its name, edits, or their JSON.

        Raises:
            SpaceMismatch: If the new body would change a space.
            UnknownName: If there is no such option or body.
            MorphologyError: If the body cannot be built.
            EnvArgumentError: If the seed is not a whole number from 0.
        """
        require_known("option of reset", ("body",), *(options or {}))
        if seed is not None:
            seed = check_seed(seed, EnvArgumentError, largest=None)
            self._body_rng = np.random.default_rng(seed)
        if options:
            self._change_body(self.family.body(options["body"]))
        elif self._ends is not None:
            self._change_body(interpolate(*self._ends, float(self._body_rng.uniform())))
        return cast("Any", super()).reset(seed=seed, options=options)

    def step(self, action: Any) -> Any:
        """Take one step with Gymnasium's own methods.

        After MuJoCo has found that the simulation diverged, `info["diverged"]` is true until the
        next reset.

        Args:
            action: Shape (nu,), finite.

        Raises:
            BadAction: If the action has another shape or is not finite; the state is unchanged.
            ResetNeeded: If `reset` has not been called.
        """
        check_action(self, action)
        self._require_reset("step")
        result = cast("Any", super()).step(action)
        if self.diverged:
            result[-1]["diverged"] = True
        return result

    @property
    def diverged(self) -> bool:
        """Return whether MuJoCo has found the state huge or not finite since the last reset.

        MuJoCo then restarts from the model's own pose, unless the model forbids it.
        """
        return bool(cast("Any", self.data.warning).number[BAD_STATE].any())

    def reset_model(self) -> NDArray[np.float64]:
        """Draw a start state as Gymnasium does, and make it feasible.

        Joints that the noise moved beyond their limits are moved back, orientations are normalised,
        equalities such as coupled joints and closed loops are satisfied, and a trunk whose feet the
        noise pushed into the floor is lifted.
        """
        self._starting = True
        try:
            return self._draw_start()
        finally:
            self._starting = False

    def _draw_start(self) -> NDArray[np.float64]:
        """Set a start state as Gymnasium draws it, and return the observation."""
        return cast("Any", super()).reset_model()

    def set_state(self, qpos: NDArray[np.float64], qvel: NDArray[np.float64]) -> None:
        """Set the pose (nq,) and the velocities (nv,), which a reset first makes feasible."""
        if self._starting:
            rules = self.start_rules()
            qpos = rules.feasible(qpos, self.data, self.init_qpos)
            qvel = rules.still(qpos, qvel, self.data)
        cast("Any", super()).set_state(qpos, qvel)
        self._started = True

    def _require_reset(self, method: str) -> None:
        """Refuse a call before the first reset; a copy made during an episode must be reset too."""
        if not self._started:
            raise gym.error.ResetNeeded(
                f"Cannot call env.{method}() before calling env.reset(): "
                f"{type(self).__name__} has no state yet."
            )

    def start_rules(self) -> StartRules:
        """Return the rules that make a start pose feasible, for the present model."""
        return StartRules(self.model)

    def _change_body(self, body: Body) -> None:
        """Build another body with the same spaces; on any error the present one stays."""
        if body == self.body:
            return
        present = self.body
        self.body = body
        try:
            model, data = self._initialize_simulation()
            observation = Layout(tuple(self._observation_features(model)))
            self._require_same_spaces(observation, action_layout(model))
        except Exception:
            self.body = present
            raise
        self.model, self.data = model, data
        self._follow_body()
        self._record_body()
        self._renew_renderer()

    def _renew_renderer(self) -> None:
        """Render the present body from now on."""
        self.mujoco_renderer.close()
        trunk, camera = travelling_body(self.model), self._given_camera
        if not camera and trunk is not None:
            camera = {"distance": _FOLLOWING_PER_REACH * self.reach, "elevation": -20.0}
        elif not camera:
            # At Gymnasium's distance, a longer pole would be cut off.
            default = cast("dict[str, Any]", self.mujoco_renderer.default_cam_config or {})
            distance = max(default.get("distance", 0.0), _FIXED_PER_REACH * self.reach)
            camera = {"distance": distance, "lookat": self.model.body(1).pos.tolist()}
        self.mujoco_renderer = Renderer(
            *(self.model, self.data, camera, self.width, self.height),
            # A camera with a given `lookat` does not follow the body.
            follow=None if "lookat" in camera else trunk,
            **self._renderer_arguments,
        )

    def _require_same_spaces(self, observation: Layout, action: Layout) -> None:
        """Refuse layouts that would change a space that learners already rely on."""
        for space, old, new in (
            ("observation", self.observation_layout, observation),
            ("action", self.action_layout, action),
        ):
            changed = sorted(set(old.names) ^ set(new.names)) or [
                one.name
                for one, other in zip(old, new, strict=True)
                if one.name != other.name
                or (space == "action" and (one.low, one.high) != (other.low, other.high))
            ]
            if changed:
                raise SpaceMismatch(
                    f"This body would change the {space} space from {old.size} to {new.size} "
                    f"numbers, such as {', '.join(changed[:3])}: a reset cannot change a space, "
                    "so make another env with this body and transfer with a body map."
                )

    # Interface of transfer studies; see `shapechanger.contract.env_ref`.

    @staticmethod
    def certify_shift(
        source: gym.Env[Any, Any], target: gym.Env[Any, Any], *, allow_empty: bool = False
    ) -> Certificate:
        """Compare the envs of a transfer, including their wrappers; both are reset.

        Raises:
            EmptyShift: If the envs do not differ and `allow_empty` is false.
        """
        return certify(source, target, allow_empty=allow_empty)

    @property
    def family_name(self) -> str:
        """Name of the family of bodies."""
        return self.family.name

    def arguments_towards(self, target: Reshapable, alpha: float) -> dict[str, Any]:
        """Return arguments for the body at `alpha`, 0 to 1, between this one and another env's."""
        return {"body": to_json(interpolate(self.body, target.body, alpha))}

    def arguments_between(self, target: Reshapable) -> dict[str, Any]:
        """Return arguments that draw a body between this one and another env's at each reset."""
        ends = {"body": to_json(self.body), "towards": to_json(target.body)}
        # For a single episode, finding a fast model takes longer than it saves.
        return {**ends, "fast_model": False}

    def drawn_bodies(self, count: int, seed: int, split: Split) -> list[str]:
        """Return bodies of the family as JSON, drawn as `Family.sample` does."""
        seed = check_seed(seed, EnvArgumentError, largest=None)
        return [to_json(body) for body in self.family.sample(count, seed, split)]

    @property
    def tree(self) -> Tree:
        """The trunk and the limbs of the present body, and the numbers that describe them."""
        return tree_of(self.model, self.init_qpos)

    @property
    def reach(self) -> float:
        """Distance from the middle of the body to its farthest point at the start, m."""
        return body_reach(self.model, self.init_qpos)

    def picture(
        self, width: int = 480, height: int = 360, reach: float | None = None
    ) -> NDArray[np.uint8]:
        """Return an image of the body in its start pose, on the floor, shape (height, width, 3).

        Args:
            width: Width in pixels.
            height: Height in pixels.
            reach: Radius in view around the middle of the body, m; None for the body's reach.

        Raises:
            RenderError: If rendering does not work on this machine.
        """
        pose = standing_pose(self.model, self.init_qpos)
        return draw(self.model, pose, width, height, reach or self.reach)
