"""The page that a browser sees: what this is, and how to drive it."""

from __future__ import annotations

import html

from shapechanger.robot.daemon.cockpit import Cockpit

__all__ = ["status_page"]


def status_page(cockpit: Cockpit, host: str) -> str:
    """A page in plain HTML that shows nothing which only holders of the key may know.

    Args:
        cockpit: The robot.
        host: Under which address the browser asked.
    """
    plan = cockpit.plan
    name, body, where = (html.escape(text) for text in (plan.robot, plan.body, host))
    camera = "no camera"
    if plan.camera is not None:
        camera = f"a camera of {plan.camera.size[0]} by {plan.camera.size[1]} pixels"
    return f"""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>{name}</title>
<h1>{name}</h1>
<p>A {body} with {camera}, served by Shapechanger.</p>
<p>Make it known on another computer with <code>shapechanger robot remember {name} {where}
--fingerprint</code> and what <code>shapechanger robot key {name}</code> shows on the robot. Then
<code>shapechanger robot drive {name}</code> drives it, and so does the Gymnasium environment
<code>shapechanger/RemoteVehicle-v1</code> with <code>robot="{name}"</code>.</p>
"""
