"""Fill the stars of a name with what the stars of a pattern stood for.

>>> filled_in("ankle_*/motor", "foot_*/motor", "foot_2/motor")
'ankle_2/motor'
"""

from __future__ import annotations

import re
from typing import Final

from shapechanger.errors import MapError

__all__ = ["filled_in"]

_TOKEN: Final = re.compile(r"\[!?\]?[^\]]*\]|.", re.DOTALL)


def filled_in(template: str, pattern: str, name: str) -> str:
    """Replace each `*` of `template`, in order, by what a wildcard of `pattern` fits in `name`.

    Args:
        template: A name with stars; one without is given back as it is.
        pattern: A glob that fits `name`; `?` and `[...]` count as wildcards too.
        name: The name that `pattern` fits.

    Raises:
        MapError: If the template has stars, and not as many as the pattern has wildcards.
    """
    if "*" not in template:
        return template
    fit = re.fullmatch("".join(map(_as_group, _TOKEN.findall(pattern))), name, re.DOTALL)
    found = fit.groups() if fit else ()
    if len(found) != template.count("*"):
        raise MapError(
            f"{template!r} must have a star for each wildcard of {pattern!r}, which has "
            f"{len(found)}."
        )
    literal = template.split("*")
    return "".join(a + b for a, b in zip(literal, (*found, ""), strict=True))


def _as_group(token: str) -> str:
    """One token of a glob as a regular expression; a wildcard becomes a group."""
    if token == "*":
        return "(.*)"
    if token == "?":
        return "(.)"
    if len(token) > 1:
        inside = token[1:-1].replace("\\", r"\\")
        return f"([^{inside[1:]}])" if inside.startswith("!") else f"([{inside}])"
    return re.escape(token)
