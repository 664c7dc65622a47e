"""Exceptions; most of their messages state the valid names or what to do.

Each subclass of `ShapechangerError` also inherits from a builtin exception.
"""

from __future__ import annotations

import difflib
import glob
import operator
from collections.abc import Callable, Collection, Generator, Iterable
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, TypeVar

_MOST_NAMES_LISTED: Final = 40

LARGEST_SEED: Final = 2**32 - 1
"""The largest seed that NumPy's, PyTorch's and Stable-Baselines3's generators all accept."""

LARGEST_RESET_SEED: Final = 2**63 - 1
"""The largest seed of a vector env, whose seeds may be a tensor of 64-bit integers."""


class ShapechangerError(Exception):
    """Base class of all errors of Shapechanger."""


class UnknownName(ShapechangerError, ValueError):
    """Unknown name.

    Attributes:
        kind: Kind of name, such as "body" or "environment".
        name: The name as given.
        known: The names that exist.
        instead: A sentence with advice, which ends the message; may be empty.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str], instead: str = "") -> None:
        self.kind, self.name, self.known, self.instead = kind, name, tuple(known), instead
        super().__init__(kind, name, self.known, instead)  # Arguments for unpickling.

    def __str__(self) -> str:
        """Return the message."""
        close = difflib.get_close_matches(self.name, self.known, n=1)
        hint = f" Did you mean {close[0]!r}?" if close else ""
        # A humanoid has some forty names; a longer list would hide the message.
        listed = ", ".join(self.known[:_MOST_NAMES_LISTED]) or "none"
        more = len(self.known) - _MOST_NAMES_LISTED
        listed += f" and {more} more" if more > 0 else ""
        message = f"No {self.kind} matches {self.name!r}.{hint} There are: {listed}."
        return f"{message} {self.instead}".rstrip()


def require_known(kind: str, known: Collection[str], *names: object) -> None:
    """Raise UnknownName for the first name that is not among the known ones."""
    for name in names:
        if name not in known:
            raise UnknownName(kind, str(name), known)


class LayoutError(ShapechangerError, ValueError):
    """Missing or inconsistent layout."""


class MorphologyError(ShapechangerError, ValueError):
    """Edit that does not fit the model."""


class BrokenModel(MorphologyError):
    """Model that cannot be read or compiled."""


class EmptyShift(MorphologyError):
    """Source and target behave identically, so there is nothing to transfer."""


class SpaceMismatch(ShapechangerError, ValueError):
    """Incompatible spaces."""


class BadAction(ShapechangerError, ValueError):
    """Action that an env cannot take."""


class EnvArgumentError(ShapechangerError, ValueError):
    """Argument of an env with a wrong type or value."""


class VectorEnvError(ShapechangerError, ValueError):
    """Vector env that cannot be made, reset or changed as requested."""


class FingerError(ShapechangerError, ValueError):
    """Finger that cannot be built or moved as requested."""


class WorldError(ShapechangerError, ValueError):
    """World, or camera in it, that cannot be made as requested."""


class TaskError(ShapechangerError, ValueError):
    """Task that cannot be used for a robot."""


class PathError(ShapechangerError, ValueError):
    """Fingertip path that cannot be made, or read, as requested."""


class MapError(ShapechangerError, ValueError):
    """Body map that cannot be built, inverted or composed."""


class TransplantError(ShapechangerError, ValueError):
    """Policy whose weights cannot be transplanted to the target's shapes."""


class PolicyError(ShapechangerError, ValueError):
    """File that is not a policy, or a policy that does not fit its use."""


class StudyError(ShapechangerError, ValueError):
    """Study, or one of its envs or files, that cannot be used as requested."""


class FailedRuns(StudyError):
    """Some runs of a study failed; all others have ended."""


class ForeignStudy(StudyError):
    """Folder or policy that belongs to another study, or to another version of this one."""


class CorruptStudy(StudyError):
    """Unreadable file of a study."""


class DemosError(ShapechangerError, ValueError):
    """Demonstrations that cannot be recorded, read or learned from."""


class BrokenEpisode(DemosError):
    """Incomplete episode; the message has the command that repairs it."""


class LinkError(ShapechangerError, ConnectionError):
    """Robot that cannot be reached or breaks the protocol."""


class RobotRefused(LinkError):
    """The robot refuses; the message is its reason."""


class StaleObservation(LinkError):
    """The newest observation is too old to act on."""


class HubError(ShapechangerError, ConnectionError):
    """Repository on the Hugging Face Hub that cannot be reached, or whose files are refused."""


class RobotError(ShapechangerError, RuntimeError):
    """Error on the robot, such as a device that does not respond."""


class ProfileError(RobotError, ValueError):
    """Invalid profile; the message names the file and the line."""


class OutputError(ShapechangerError, OSError):
    """File or folder that cannot be written."""


class RenderError(ShapechangerError, RuntimeError):
    """Rendering is not possible here."""


class MissingExtra(ShapechangerError, ImportError):
    """An optional dependency is not installed.

    Attributes:
        package: The package that could not be imported.
        extra: The extra of Shapechanger that installs it.
    """

    def __init__(self, package: str, extra: str) -> None:
        self.package, self.extra = package, extra
        super().__init__(package, extra)  # Arguments for unpickling.

    def __str__(self) -> str:
        """Return the message."""
        return (
            f"This needs {self.package}, which is not installed: "
            f"run `pip install 'shapechanger[{self.extra}]'`."
        )


@contextmanager
def needing_extra(extra: str) -> Generator[None]:
    """Raise a MissingExtra if an import in the block fails; `extra` installs the package."""
    try:
        yield
    except Exception as error:
        # Gymnasium's modules raise DependencyNotInstalled, which is no ImportError.
        is_import = isinstance(error, ImportError) and not isinstance(error, MissingExtra)
        if is_import or type(error).__name__ == "DependencyNotInstalled":
            raise MissingExtra(getattr(error, "name", "") or "mujoco", extra) from error
        raise


_Error = TypeVar("_Error", bound=Exception)


@contextmanager
def translate_errors(
    *kinds: type[_Error], to: Callable[[_Error], BaseException]
) -> Generator[None]:
    """Replace errors of these kinds by the error that `to` returns; the original is its cause.

    ```python
    with translate_errors(OSError, to=lambda error: RobotError(f"Cannot read {file}: {error}.")):
        text = file.read_text()
    ```
    """
    try:
        yield
    except kinds as error:
        raise to(error) from error


def check_seed(
    seed: Any,
    error: type[ShapechangerError],
    kind: str = "A seed must be",
    largest: int | None = LARGEST_SEED,
) -> int:
    """Return a seed as an integer.

    Args:
        seed: A whole number, of Python or NumPy; not a truth value.
        error: Error to raise.
        kind: Beginning of the message, such as "The seed of a course must be".
        largest: The largest seed; None for no limit, as for NumPy's generators.

    Raises:
        ShapechangerError: The given error, if the seed is not a whole number in this range.
    """
    try:
        number = -1 if isinstance(seed, bool) else operator.index(seed)
    except TypeError:
        number = -1
    if number < 0 or (largest is not None and number > largest):
        end = "" if largest is None else f" to {largest}"
        raise error(f"{kind} a whole number from 0{end}, got {seed!r}.")
    return number


def no_policy_file(path: Path, names: Iterable[str] = (), noun: str = "file") -> str:
    """Return the message about a missing policy file, with the most similar name in its folder.

    Args:
        path: The missing file.
        names: Names that are valid instead of a file, such as "reference".
        noun: Noun for the path: "file", or "file or folder".
    """
    siblings = (str(each) for each in path.parent.glob(f"*{glob.escape(path.suffix)}"))
    close = difflib.get_close_matches(str(path), [*names, *sorted(siblings)], n=1)
    return f"There is no policy {noun} {path}" + (f"; did you mean {close[0]}?" if close else ".")
