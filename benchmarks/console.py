"""Age of the console's images on its canvas, and the console's effect on the robot's control loop.

The camera of the twin draws the capture time into the first rows of each image. A script in the
page reads it back from the canvas at each animation frame. The page's clock is compared with the
robot's by pings on loopback; the fastest round trip counts, so the error is at most half of it.
"""

from __future__ import annotations

import binascii
import shutil
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import numpy as np
from playwright.sync_api import Browser, Page, sync_playwright

from benchmarks.row import Row
from shapechanger.robot.profile.load import load_profile
from shapechanger.robot.twin.robot import RunningRobot, run_robot
from tests.robots import CAR, IN_A_ROOM

SECONDS: Final = 35.0
_MOST_MS: Final = 100.0

# Simultaneous times of both clocks and their uncertainty: page ms, robot ns, ms.
_CALIBRATE: Final = """async ([key, times]) => {
  const { Link } = await import("/console/link.js");
  const link = new Link({ frames: false });
  let best = null, token = 1e6;
  const open = new Promise((done) => link.addEventListener("welcome", done, { once: true }));
  link.open(key, "stopwatch");
  await open;
  for (let i = 0; i < times; i += 1) {
    const pong = new Promise((done) => link.addEventListener("pong", done, { once: true }));
    link.ping();
    const { sentMs, arrivedMs, robotNs } = (await pong).detail;
    const error = (arrivedMs - sentMs) / 2;
    if (!best || error < best[2]) best = [(sentMs + arrivedMs) / 2, Number(robotNs), error];
    await new Promise((done) => setTimeout(done, 20));
  }
  link.close();
  return best;
}"""

# Reads the 64 cells of the time code at each frame: 48 bits of nanoseconds and a 16-bit CRC.
_WATCH: Final = """() => {
  const canvas = document.getElementById("picture");
  const context = canvas.getContext("2d");
  const seen = (globalThis.seen = []);
  let last = "";
  const look = () => {
    requestAnimationFrame(look);
    const cell = Math.floor(canvas.width / 32), high = Math.max(4, Math.floor(canvas.width / 40));
    const { data } = context.getImageData(0, 0, canvas.width, 2 * high);
    let bits = "";
    for (let row = 0; row < 2; row += 1) {
      for (let column = 0; column < 32; column += 1) {
        const x = Math.floor((column + 0.5) * cell), y = Math.floor((row + 0.5) * high);
        bits += data[4 * (y * canvas.width + x) + 1] > 127 ? "1" : "0";
      }
    }
    if (bits === last) return;
    last = bits;
    seen.push([Number.parseInt(bits.slice(0, 48), 2), performance.now(), bits]);
  };
  look();
}"""


# Blocks the page 80 % of the time.
_HANG: Final = """setInterval(() => {
  const end = performance.now() + 400;
  while (performance.now() < end);
}, 500)"""


def console(seconds: float = SECONDS) -> list[Row]:
    """Measure the age of images on the page, and the control loop next to a slow page."""
    with _robot() as robot, _browser() as browser:
        ages, error_ms = _ages_ms(browser, robot, seconds)
        alone = _commands_ms(robot, seconds / 2)
        with _page(browser, robot) as page:
            page.evaluate(_HANG)
            stalled = _commands_ms(robot, seconds / 2)
        # For comparison: a page without a connection also takes CPU time from the robot.
        with browser.new_context() as context:
            context.new_page().evaluate(_HANG)
            stranger = _commands_ms(robot, seconds / 2)
    p50, p95 = np.percentile(ages, [50, 95])
    rate = len(ages) / seconds
    rows = [
        Row(
            "picture from the camera to the page's canvas",
            f"p50 {p50:.1f}, p95 {p95:.1f}, max {max(ages):.1f} ms",
            f"{len(ages)} pictures of 160x120 in {seconds:.0f} s, {rate:.1f} a second; clocks "
            f"agree to {error_ms:.2f} ms",
            f"< {_MOST_MS:.0f} ms at 20 pictures/s on loopback",
            bool(p95 < _MOST_MS),
        )
    ]
    (a50, a99, a_max), (b50, b99, b_max), (s50, s99, s_max) = (
        (*np.percentile(each, [50, 99]), max(each)) for each in (alone, stalled, stranger)
    )
    rows.append(
        Row(
            "time between two commands at the guard, with a page that hangs 80 % of the time",
            f"p50 {b50:.1f}, p99 {b99:.1f}, max {b_max:.1f} ms",
            f"without any page p50 {a50:.1f}, p99 {a99:.1f}, max {a_max:.1f} ms; "
            f"{len(stalled)} and {len(alone)} commands at 20 Hz",
            "none delayed: p99 within 10 ms of that without",
            bool(b99 - a99 < 10.0),
        )
    )
    rows.append(
        Row(
            "the same next to a page that hangs as much and knows no robot",
            f"p99 {b99:.1f} ms with, {s99:.1f} ms without a connection",
            f"without a connection p50 {s50:.1f}, max {s_max:.1f} ms; {len(stranger)} commands",
            "the connection delays none: p99 within 10 ms",
            bool(b99 - s99 < 10.0),
        )
    )
    return rows


@contextmanager
def _robot() -> Generator[RunningRobot]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "car.toml"
        path.write_text(CAR)
        files = Path(folder) / "robot"
        files.mkdir()
        with run_robot(load_profile(path), folder=files, arguments=IN_A_ROOM) as robot:
            yield robot


@contextmanager
def _browser() -> Generator[Browser]:
    with sync_playwright() as playwright:
        path = shutil.which("chromium") or shutil.which("google-chrome")
        browser = playwright.chromium.launch(
            executable_path=path, args=["--no-sandbox", "--disable-gpu"]
        )
        yield browser
        browser.close()


@contextmanager
def _page(browser: Browser, robot: RunningRobot) -> Generator[Page]:
    with browser.new_context(ignore_https_errors=True) as context:
        page = context.new_page()
        page.goto(f"https://127.0.0.1:{robot.port}/#key={robot.known.key}")
        page.locator("body[data-picture='live']").wait_for()
        yield page


def _ages_ms(browser: Browser, robot: RunningRobot, seconds: float) -> tuple[list[float], float]:
    """Return the age of each image on the canvas, and the error of the clocks, ms."""
    with _page(browser, robot) as page:
        page_ms, robot_ns, error_ms = page.evaluate(_CALIBRATE, [robot.known.key, 50])
        page.evaluate(_WATCH)
        page.wait_for_timeout(1e3 * seconds)
        seen: list[tuple[int, float, str]] = page.evaluate("globalThis.seen")
    if len(seen) < 10.0 * seconds:
        # Probably the robot restarted, because the machine was too busy for its guard.
        raise RuntimeError(f"Only {len(seen)} pictures came in {seconds:.0f} s: {robot.log_text()}")
    ages: list[float] = []
    for number, at_ms, bits in seen[1:]:
        if not _crc_matches(bits):
            continue
        now_ns = robot_ns + 1e6 * (at_ms - page_ms)
        ages.append(((now_ns - number) % 2**48) / 1e6)
    return ages, error_ms


def _crc_matches(bits: str) -> bool:
    """Return whether the CRC of a time code matches, as `read_barcode` checks it."""
    data = int(bits, 2).to_bytes(8, "big")
    return binascii.crc_hqx(data[:6], 0xFFFF) == int.from_bytes(data[6:], "big")


def _commands_ms(robot: RunningRobot, seconds: float) -> list[float]:
    """Return the times between a client's commands at the outputs, ms, by the robot's clock."""
    applied: list[int] = []
    with robot.client(name="program", frames=True) as client, robot.operator() as operator:
        operator.place(0)
        client.take()
        client.arm()
        seen = client.ask().message
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            client.command((1.0, 0.0), answers=seen.seq)
            seen = client.observation(seen.seq).message
            if seen.applied_ns is not None and seen.applied_ns not in applied[-1:]:
                applied.append(seen.applied_ns)
    return [float(gap) for gap in np.diff(np.array(applied)) / 1e6]
