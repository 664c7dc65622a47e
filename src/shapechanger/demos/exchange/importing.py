"""Options and findings of an import: what is left out and why, and what contradicts itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from shapechanger.errors import DemosError

_MAX_NAMED: Final = 3


class ImportContext:
    """Options of an import, and its findings so far.

    A reader yields what is whole. It calls `leave_out` for each part that it skips, `warn` where a
    source contradicts itself or is implausible, and `note` for what is neither lost nor wrong. With
    `strict`, the import is refused at the end if there is anything of the first two kinds.

    Args:
        camera: Name of the camera to take, if there are several; "" for the only one.
        hz: Steps per second, as stated by the user; None to read or measure them.
        strict: Whether to refuse a source that is incomplete or contradicts itself.

    Attributes:
        left_out: Names of the parts that are left out, by what they are and by the reason.
        warnings: Contradictions, as sentences that state their size.
        notes: Further facts, as sentences.
    """

    def __init__(self, *, camera: str = "", hz: float | None = None, strict: bool = False) -> None:
        self.camera = camera
        self.hz = hz
        self.strict = strict
        self.left_out: dict[tuple[str, str], list[str]] = {}
        self.warnings: list[str] = []
        self.notes: list[str] = []

    def leave_out(self, what: str, reason: str, name: object) -> None:
        """Note that a part is left out.

        Args:
            what: What it is, in the singular, such as "record".
            reason: Why it is left out, such as "without a picture"; it must fit the plural, too.
            name: The part's name or number in the source.
        """
        self.left_out.setdefault((what, reason), []).append(str(name))

    def warn(self, sentence: str) -> None:
        """Note a contradiction in the source, once."""
        if sentence not in self.warnings:
            self.warnings.append(sentence)

    def note(self, sentence: str) -> None:
        """Note a fact that is neither a loss nor a contradiction, once."""
        if sentence not in self.notes:
            self.notes.append(sentence)

    def left_out_lines(self) -> list[str]:
        """Return a line for each reason, such as "9 records with an empty picture: 31, 32, ...".

        The reason with most parts is first.
        """
        groups = sorted(self.left_out.items(), key=lambda group: -len(group[1]))
        return [
            f"{counted(len(names), what)} {reason}: {few(names)}"
            for (what, reason), names in groups
        ]

    def require_whole(self, source: object) -> None:
        """Refuse a source of which something is left out, or which contradicts itself.

        Args:
            source: How to name the source.

        Raises:
            DemosError: If there is such a finding; it names all of them.
        """
        findings = [f"left out: {line}" for line in self.left_out_lines()]
        findings += [warning.removesuffix(".") for warning in self.warnings]
        if findings:
            raise DemosError(
                f"{source} is not whole ({'; '.join(findings)}): repair it, or import it with "
                "`shapechanger demos import` and without --strict."
            )


def counted(number: int, what: str) -> str:
    """Format a count, such as "1 record" or "2 records"."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def few(names: Sequence[object]) -> str:
    """List the first few names and count the rest, such as "12, 15, 20, and 286 more"."""
    shown = ", ".join(map(str, names[:_MAX_NAMED]))
    more = len(names) - _MAX_NAMED
    return f"{shown}, and {more} more" if more > 0 else shown
