"""Models of robots and mechanisms, in MJCF and URDF, that tests load and edit."""

from pathlib import Path


def xml(name: str) -> str:
    """Return the text of a model, some with placeholders for `str.format`."""
    return (Path(__file__).parent / f"{name}.xml").read_text()
