"""`shapechanger demos record | replay`: record an expert or a policy, and replay an episode."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import tyro
from gymnasium.wrappers import TimeLimit

from shapechanger.cli.console import StudyProgress, command_line, counted, interruptible, say
from shapechanger.cli.env_arguments import OneEnv, opened, options_of
from shapechanger.contract.env_ref import EnvRef
from shapechanger.demos.drivers import EXPERT, pilot_of, record_steps
from shapechanger.demos.episodes import episode_at
from shapechanger.demos.recording import RecordEpisodes
from shapechanger.demos.replay import play_in_env, write_episode_film
from shapechanger.envs.catalogue import VEHICLE_ENVS, env_ref
from shapechanger.errors import DemosError, StudyError, check_seed
from shapechanger.robot.client.recordings import play_on_robot
from shapechanger.transfer.executor import use_one_thread


@dataclass(frozen=True, kw_only=True)
class DemosRecord(OneEnv):
    """Record an expert or a policy in an env."""

    out: Path
    """Folder of the recording; new episodes are added to existing ones."""
    minutes: float = 10.0
    """Duration, minutes of the env's time."""
    driver: str = EXPERT
    """"expert", or the file of a policy."""
    corrected_by: str = ""
    """"expert" to let the expert take over when the policy would fail. Training then uses the
    expert's steps only."""
    episode_s: float = 50.0
    """Longest episode, s; the env may end it earlier, for example when a vehicle collides."""
    lenses: tuple[str, ...] = ()
    """Disturbances of a vehicle's camera, such as night."""
    put_back: bool = False
    """Put a vehicle back on its lane after a collision, instead of ending the episode."""
    seed: int = 0
    """Seed of the first episode; it increases by one for each further episode."""

    def run(self) -> None:
        check_seed(self.seed, StudyError)
        for name, value in (("minutes", self.minutes), ("episode-s", self.episode_s)):
            if not 0.0 < value < float("inf"):
                raise DemosError(f"--{name} must be above 0, got {value}.")
        ref = self._ref()
        stopped = f"Stopped; the recording so far is in {self.out}, complete."
        with interruptible(lambda: stopped), opened(ref, max_episode_steps=-1) as made:
            hz = float(made.metadata.get("render_fps") or 20.0)
            longest = max(1, round(self.episode_s * hz))
            steps = max(1, round(self.minutes * 60.0 * hz))
            if self.driver != EXPERT:
                use_one_thread()  # Inference on single frames is slower with more threads.
            pilot = pilot_of(made, self.driver, self.corrected_by, self.seed)
            env = RecordEpisodes(
                TimeLimit(made, longest), self.out, driver="program", about=self._about(made)
            )
            with StudyProgress({ref.id: steps}) as progress:
                record_steps(
                    env, pilot, steps, self.seed, lambda done: progress(ref.id, done, done == steps)
                )
        if self.corrected_by:
            say(
                f"the expert corrected {pilot.corrected / max(pilot.steps, 1):.0%} of the steps, "
                f"{pilot.corrected} of {pilot.steps}, and took over "
                f"{counted(pilot.takeovers, 'time')}"
            )
        say(
            f"wrote {env.steps} steps, {env.steps / hz / 60.0:.1f} minutes, in "
            f"{counted(env.episodes, 'episode')} to {self.out}\n"
            f"look at them: shapechanger demos show {shlex.quote(str(self.out))} --out page.html"
        )

    def _ref(self) -> EnvRef:
        ref = env_ref(self.env, self.body)
        more: dict[str, Any] = {"state": True} if ref.id in VEHICLE_ENVS else {}
        more |= {"lenses": list(self.lenses)} if self.lenses else {}
        more |= {"put_back": True} if self.put_back else {}
        if more and ref.id not in VEHICLE_ENVS:
            raise DemosError(
                f"--put-back and --lenses need a vehicle's env, got {ref.id}; the envs of vehicles "
                f"are {', '.join(VEHICLE_ENVS)}."
            )
        return ref.having({**more, **options_of(self.options, "--options")})

    def _about(self, env: gym.Env[Any, Any]) -> dict[str, Any]:
        world = getattr(env.unwrapped, "world", None)
        who, notes = Path(self.driver).name, {"driver": self.driver}
        if self.corrected_by:
            who += f", corrected by {self.corrected_by}"
            notes["corrected_by"] = self.corrected_by
        body = {} if world is None else {"body": world.vehicle.name}
        return {**body, "driver": who, "source": command_line(), "notes": notes}


@dataclass(frozen=True)
class DemosReplay:
    """Replay an episode as a video, in an env or on a robot."""

    episode: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="EPISODE")]
    """Folder of the episode."""
    film: Path | None = None
    """A film to write, such as out.mp4, with the actions drawn in."""
    env: str = ""
    """Id of an env to play the actions in, from the recorded seed; differences are reported."""
    robot: str = ""
    """Name of a robot to play the actions on, see `robot remember`; a person at this terminal
    arms it, and any key stops it."""

    def run(self) -> None:
        asked = [bool(self.film), bool(self.env), bool(self.robot)]
        if sum(asked) != 1:
            raise DemosError("Give exactly one of --film, --env and --robot.")
        episode = episode_at(self.episode)
        if not episode.kept:
            raise DemosError(
                f"All steps of {episode.path} are dropped: use `demos edit good` first."
            )

        if self.film is not None:
            say(write_episode_film(episode, self.film))
        elif self.env:
            for line in play_in_env(episode, env_ref(self.env)):
                say(line)
        else:
            play_on_robot(episode, self.robot, say)
