"""What can go wrong, as one tree; each message is a sentence that says what exists instead.

```
ShapechangerError
├── UnknownName (ValueError)        a name that nothing bears, with the nearest spelling
├── LayoutError (ValueError)        a layout that contradicts itself
├── MorphologyError (ValueError)    an edit that does not fit the model it was given
│   ├── BrokenModel                 the edited model does not compile
│   └── EmptyShift                  source and target do the same, so nothing crosses
├── SpaceMismatch (ValueError)      two spaces that differ where they must not
├── BadAction (ValueError)          an action that an env cannot take
├── EnvArgumentError (ValueError)   an argument of an env that has the wrong type
├── VectorEnvError (ValueError)     a vector env that cannot be made as it was asked for
├── FingerError (ValueError)        a finger that cannot be built, or not move as asked
├── WorldError (ValueError)         a world that cannot be laid out as it was asked for
├── PathError (ValueError)          a path for a fingertip that cannot be made as it was asked for
├── MapError (ValueError)           a body map that cannot be built, inverted or composed
├── TransplantError (ValueError)    a policy whose weights cannot be moved
├── StudyError (ValueError)         a study that cannot start
│   ├── ForeignStudy                the output folder belongs to something else
│   └── CorruptStudy                a file of the study cannot be read
├── DemosError (ValueError)         demonstrations that cannot be recorded, read or learned from
│   └── BrokenEpisode               an episode that is not whole, and the command that repairs it
├── LinkError (ConnectionError)     a robot that cannot be reached, or does not understand
│   ├── RobotRefused                the robot says no, and why
│   └── StaleObservation            the newest observation is too old to act on
├── RobotError (RuntimeError)       the robot's own side: a device that does not answer
│   └── ProfileError (ValueError)   a profile that contradicts itself, with the line
├── OutputError (OSError)           a file or folder that cannot be written
├── RenderError (RuntimeError)      no picture can be drawn here
└── MissingExtra (ImportError)      an optional dependency, and the command that installs it
```

Each class inherits from the builtin in brackets too, so that code which knows only Python can
catch it.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Final

__all__ = [
    "BadAction",
    "BrokenEpisode",
    "BrokenModel",
    "CorruptStudy",
    "DemosError",
    "EmptyShift",
    "EnvArgumentError",
    "FingerError",
    "ForeignStudy",
    "LayoutError",
    "LinkError",
    "MapError",
    "MissingExtra",
    "MorphologyError",
    "OutputError",
    "PathError",
    "ProfileError",
    "RenderError",
    "RobotError",
    "RobotRefused",
    "ShapechangerError",
    "SpaceMismatch",
    "StaleObservation",
    "StudyError",
    "TransplantError",
    "UnknownName",
    "VectorEnvError",
    "WorldError",
]

# A model of a humanoid has some forty names; a longer list hides the sentence it belongs to.
_MOST_NAMES_LISTED: Final = 40


class ShapechangerError(Exception):
    """Something that Shapechanger refuses to do, in a sentence."""


class UnknownName(ShapechangerError, ValueError):
    """A name that nothing bears.

    Attributes:
        kind: What was looked for, such as "body" or "environment id".
        name: The name as given.
        known: The names that exist.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        self.kind = kind
        self.name = name
        self.known = tuple(known)
        close = difflib.get_close_matches(name, self.known, n=1)
        hint = f" Did you mean {close[0]!r}?" if close else ""
        super().__init__(f"No {kind} matches {name!r}.{hint} There are: {_listed(self.known)}.")

    def __reduce__(self) -> tuple[type[UnknownName], tuple[str, str, tuple[str, ...]]]:
        """Let the error cross from a worker process: it is made from three arguments, not one."""
        return type(self), (self.kind, self.name, self.known)


class LayoutError(ShapechangerError, ValueError):
    """A layout that contradicts itself."""


class MorphologyError(ShapechangerError, ValueError):
    """A morphology edit that does not fit the model it was given."""


class BrokenModel(MorphologyError):
    """An edited model that MuJoCo does not compile."""


class EmptyShift(MorphologyError):
    """Source and target do the same, so there is nothing to transfer across."""


class SpaceMismatch(ShapechangerError, ValueError):
    """Two spaces differ where they must be the same."""


class BadAction(ShapechangerError, ValueError):
    """An action that an env cannot take; the message names the env."""


class EnvArgumentError(ShapechangerError, ValueError):
    """An argument of an env that has the wrong type."""


class VectorEnvError(ShapechangerError, ValueError):
    """A vector env that cannot be made, or reset, as it was asked for."""


class FingerError(ShapechangerError, ValueError):
    """A finger that cannot be built as it was asked for, or cannot do what it should."""


class WorldError(ShapechangerError, ValueError):
    """A world to drive in that cannot be laid out as it was asked for."""


class PathError(ShapechangerError, ValueError):
    """A path for a fingertip that cannot be made, or read, as it was asked for."""


class MapError(ShapechangerError, ValueError):
    """A body map that cannot be built, inverted or composed."""


class TransplantError(ShapechangerError, ValueError):
    """A policy whose weights cannot be moved to the target's shapes."""


class StudyError(ShapechangerError, ValueError):
    """A study that cannot start as it was asked for."""


class ForeignStudy(StudyError):
    """The output folder belongs to something else."""


class CorruptStudy(StudyError):
    """A file of the study cannot be read."""


class DemosError(ShapechangerError, ValueError):
    """Demonstrations that cannot be recorded, read or learned from."""


class BrokenEpisode(DemosError):
    """An episode that is not whole."""


class LinkError(ShapechangerError, ConnectionError):
    """A robot that cannot be reached, or that does not understand."""


class RobotRefused(LinkError):
    """The robot says no; the message says why."""


class StaleObservation(LinkError):
    """The newest observation is too old to act on."""


class RobotError(ShapechangerError, RuntimeError):
    """A device of the robot does not answer, or answers nonsense."""


class ProfileError(RobotError, ValueError):
    """A profile that contradicts itself; the message names the file and the line."""


class OutputError(ShapechangerError, OSError):
    """A file or folder that cannot be written."""


class RenderError(ShapechangerError, RuntimeError):
    """No picture can be drawn here."""


class MissingExtra(ShapechangerError, ImportError):
    """An optional dependency is not installed.

    Attributes:
        package: The package that could not be imported.
        extra: The extra of Shapechanger that installs it.
    """

    def __init__(self, package: str, extra: str) -> None:
        self.package = package
        self.extra = extra
        super().__init__(
            f"This needs {package}, which is not installed: "
            f"run `pip install 'shapechanger[{extra}]'`."
        )

    def __reduce__(self) -> tuple[type[MissingExtra], tuple[str, str]]:
        """Let the error cross from a worker process: it is made from two arguments, not one."""
        return type(self), (self.package, self.extra)


def _listed(names: tuple[str, ...]) -> str:
    """The names in one line, at most forty of them."""
    if not names:
        return "none"
    shown = ", ".join(names[:_MOST_NAMES_LISTED])
    more = len(names) - _MOST_NAMES_LISTED
    return f"{shown} and {more} more" if more > 0 else shown
