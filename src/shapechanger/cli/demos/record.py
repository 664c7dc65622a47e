"""`shapechanger demos record`: an expert or a policy drives in an env, and it is recorded."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.cli.demos.drivers import EXPERT, pilot_of
from shapechanger.cli.env_arguments import driven, env_ref, options_of, require_seed
from shapechanger.cli.progress import StudyProgress
from shapechanger.cli.stopping import Interrupted
from shapechanger.envs.catalogue import VEHICLE_ENVS
from shapechanger.errors import DemosError

if TYPE_CHECKING:
    import gymnasium as gym

    from shapechanger.demos.recording import RecordEpisodes
    from shapechanger.transfer.env_ref import EnvRef

__all__ = ["Record"]


@dataclass(frozen=True)
class Record:
    """Record how an expert or a policy drives in an env."""

    env: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ENV")]
    """Id of the env, such as Car."""
    out: Path
    """Folder of the recording; what is there already stays, and more comes to it."""
    minutes: float = 10.0
    """How long, in minutes of the env."""
    driver: str = EXPERT
    """"expert", or the file of a policy."""
    corrected_by: str = ""
    """"expert" to let it take over where the policy would go wrong. Only what the expert does is
    learned from then."""
    episode_s: float = 50.0
    """Longest episode, s; a collision ends it earlier."""
    body: str = ""
    """Another body of the family: its name, or edits as JSON."""
    lenses: tuple[str, ...] = ()
    """What is wrong with a vehicle's camera, such as night."""
    put_back: bool = False
    """Put a vehicle that runs into something back on its lane, in place of ending the episode."""
    options: str = ""
    """More arguments of the env as JSON, such as '{"courses": "held-out"}'."""
    seed: int = 0
    """Seed of the first episode; each later one has the next whole number."""

    def run(self) -> None:
        """Record, and say what came of it."""
        from gymnasium.wrappers import TimeLimit

        from shapechanger.demos.pilots import record_steps
        from shapechanger.demos.recording import RecordEpisodes

        require_seed(self.seed)
        for name, value in (("minutes", self.minutes), ("episode-s", self.episode_s)):
            if not 0.0 < value < float("inf"):
                raise DemosError(f"--{name} is more than 0, got {value}.")
        ref = self._ref()
        console = plain_console()
        made = _made(ref)
        try:
            hz = float(made.metadata.get("render_fps") or 20.0)
            longest = max(1, round(self.episode_s * hz))
            steps = max(1, round(self.minutes * 60.0 * hz))
            pilot = pilot_of(made, self.driver, self.corrected_by, self.seed)
            env = RecordEpisodes(
                TimeLimit(made, longest), self.out, driver="program", about=self._about(made)
            )
            with StudyProgress({ref.id: steps}) as progress:
                record_steps(
                    env, pilot, steps, self.seed, lambda done: progress(ref.id, done, done == steps)
                )
        except KeyboardInterrupt:
            raise Interrupted(f"Stopped; what was recorded is in {self.out}, whole.") from None
        finally:
            made.close()
        console.print(_told(env, self.out), soft_wrap=True)

    def _ref(self) -> EnvRef:
        """The env, with what is asked of it."""
        from shapechanger.transfer.env_ref import EnvRef

        ref = env_ref(self.env, self.body)
        more: dict[str, Any] = {}
        if ref.id in VEHICLE_ENVS:
            more["state"] = True
            if self.lenses:
                driven(ref, self.lenses)
                more["lenses"] = list(self.lenses)
            if self.put_back:
                more["put_back"] = True
        elif self.lenses or self.put_back:
            raise DemosError(
                f"{ref.id} is no vehicle that could be put back or has a lens; these are: "
                f"{', '.join(VEHICLE_ENVS)}."
            )
        return EnvRef(ref.id, {**ref.kwargs, **more, **options_of(self.options, "--options")})

    def _about(self, env: gym.Env[Any, Any]) -> dict[str, Any]:
        """What the header says beyond what the env says."""
        world = getattr(env.unwrapped, "world", None)
        who = self.driver if self.driver == EXPERT else Path(self.driver).name
        notes: dict[str, Any] = {"driver": self.driver}
        if self.corrected_by:
            who += f", corrected by {self.corrected_by}"
            notes["corrected_by"] = self.corrected_by
        body = {} if world is None else {"body": world.vehicle.name}
        return {
            **body,
            "driver": who,
            "source": shlex.join(["shapechanger", *sys.argv[1:]]),
            "notes": notes,
        }


def _made(ref: EnvRef) -> gym.Env[Any, Any]:
    """The env, without its own longest episode.

    Raises:
        DemosError: If it takes no such arguments.
    """
    try:
        return ref.make(max_episode_steps=-1)
    except TypeError as error:
        reason = str(error).partition(" was raised from")[0]
        raise DemosError(f"{ref.id} cannot be made with these --options: {reason}.") from error


def _told(env: RecordEpisodes, out: Path) -> str:
    """What was recorded, and what can be done with it."""
    seconds = env.steps / env.control_hz
    episodes = f"{env.episodes} episode{'' if env.episodes == 1 else 's'}"
    return (
        f"wrote {env.steps} steps, {seconds / 60.0:.1f} minutes, in {episodes} to {out}\n"
        f"look at them: shapechanger demos show {shlex.quote(str(out))} --out page.html"
    )
