// Assembles the page.

import { Actions } from "./actions.js";
import { find, tell } from "./dom.js";
import { Door, keepKey, keptKey, keyFromAddress, someName } from "./door.js";
import { Driver } from "./driver.js";
import { Episodes } from "./episodes.js";
import { Gamepads } from "./gamepad.js";
import { Keys } from "./keys.js";
import { features, shown } from "./layout.js";
import { introduction, Link } from "./link.js";
import { Log } from "./log.js";
import { Picture } from "./picture.js";
import { Pilot } from "./pilot.js";
import { Readings } from "./readings.js";
import { Recorder } from "./recorder.js";
import { listen } from "./shortcuts.js";
import { Status } from "./status.js";
import { Stick } from "./stick.js";
import { Tilt } from "./tilt.js";
import { ageOnArrivalMs, RoundTrips } from "./timing.js";

const CAP_STEP = 10; // %
const PRESS_MS = 1_000; // The click after a press is the same press.
const OLD_MS = 500; // An older picture is marked as old.

const link = new Link();
const log = new Log(find("log"));
const picture = new Picture(find("picture"));
const trips = new RoundTrips();
const status = new Status();
const recorder = new Recorder(link, log);
const door = new Door(enter);

const changed = () => driver?.changed();
const keys = new Keys(changed);
const pads = new Gamepads(changed, (what) => (what === "stop" ? stop("A gamepad's B was pressed.") : arm()));
const stick = new Stick(find("pad"), changed);
const tilt = new Tilt(changed);
const episodes = new Episodes(link, () => {
  if (driver?.mine) driver.disarm(); // The dialog covers the live picture.
});

let driver = null; // Depends on the robot's actions, so it is made for each connection.
let actions = null;
let readings = null;
let key = "";
let hasBeenIn = false;

function view(name) {
  if (document.body.dataset.view !== name) scrollTo(0, 0);
  document.body.dataset.view = name;
  find("door").hidden = name !== "door";
  find("cockpit").hidden = name !== "cockpit";
  find("facts").hidden = name !== "cockpit";
}

function enter(typed, name) {
  key = typed;
  link.open(key, name);
}

// The connection.

link.addEventListener("state", ({ detail: { state, text } }) => {
  document.body.dataset.link = state;
  const again = state === "waiting" ? " Trying again…" : "";
  tell(find("connection"), text + again);
  find("enter").disabled = state === "connecting";
  if (state === "open") return;
  if (state === "refused") {
    view("door");
    keepKey("");
    door.show(key);
    door.complain(text);
  }
  if (state === "waiting" && hasBeenIn) log.add(text, "trouble");
  if (state !== "connecting") lose(text);
});

function lose(text) {
  driver = null;
  for (const device of [keys, pads, stick, tilt]) device.letGo();
  showTilt();
  picture.forget();
  tell(find("picture-state"), "Not connected.");
  trips.clear();
  episodes.close();
  status.lose(`${text} The robot stops by itself without commands.`);
}

link.addEventListener("welcome", ({ detail: welcome }) => {
  const moves = features(welcome.action_layout);
  const pilot = new Pilot(moves, [keys, pads, stick, tilt]);
  driver = new Driver(link, pilot);
  driver.scale = find("cap").valueAsNumber / 100;
  driver.addEventListener("note", ({ detail }) => log.add(detail));
  actions = new Actions(moves, pilot, () => driver?.changed());
  readings = new Readings(features(welcome.state_layout));
  recorder.begin(welcome.can_record);
  episodes.begin(moves.map(({ name }) => name));
  document.title = welcome.robot;
  tell(find("robot"), welcome.robot);
  find("tilt").hidden = !(Tilt.isThere && pilot.hasStick);
  find("steer").dataset.stick = String(pilot.hasStick);
  tell(find("picture-state"), welcome.image_size ? "No picture yet." : "This robot has no camera.");
  view("cockpit");
  if (!hasBeenIn) find("stage").focus({ preventScroll: true });
  log.add(hasBeenIn ? "Connected again. Nothing moves until you arm it." : `Connected to ${welcome.robot}.`);
  hasBeenIn = true;
  driver.hide(document.hidden);
  driver.begin();
});

link.addEventListener("observation", ({ detail: seen }) => {
  if (!driver) return;
  const nowMs = performance.now();
  driver.observe(seen);
  // A hidden page draws nothing.
  if (document.hidden) return;
  if (seen.frame) picture.show(seen.frame, ageOnArrivalMs(seen, trips.typicalMs), nowMs);
  status.show(seen, driver.mine, nowMs);
  actions.show(seen, driver.isDriving);
  readings.show(seen);
});

link.addEventListener("lease", ({ detail: lease }) => {
  driver?.onLease(lease);
  if (lease.reason) log.add(lease.reason);
});
link.addEventListener("event", ({ detail: { text, name } }) => {
  if (name === "disarmed" && log.said(text)) return; // An emergency stop also disarms, with the same text.
  log.add(text, name === "emergency" || name === "bump" ? "trouble" : "event");
});
link.addEventListener("refused", ({ detail: { reason } }) => log.add(reason, "refused"));
link.addEventListener("nonsense", ({ detail }) => log.add(detail, "trouble"));
link.addEventListener("pong", ({ detail }) => trips.add(detail.roundTripMs));

// Input of the person.

function stop(reason) {
  driver?.stop(reason);
}

function arm() {
  driver?.arm();
}

function disarm() {
  driver?.disarm();
}

function handOver() {
  if (driver?.byProgram) driver.armAsItIs();
  else driver?.handOver();
}

function setCap(percent) {
  const cap = find("cap");
  cap.value = percent;
  tell(find("cap-shown"), `${cap.value} %`);
  cap.setAttribute("aria-valuetext", `${cap.value} percent`);
  if (!driver) return;
  driver.scale = cap.valueAsNumber / 100;
  driver.changed();
}

function showTilt() {
  find("tilt").setAttribute("aria-pressed", String(tilt.isOn));
}

for (const id of ["stop", "episodes-stop"]) {
  // A finger on STOP stops the robot before it is lifted.
  let downMs = -Infinity;
  find(id).addEventListener("pointerdown", () => {
    downMs = performance.now();
    stop("STOP was pressed.");
  });
  find(id).addEventListener("click", () => {
    if (performance.now() - downMs > PRESS_MS) stop("STOP was pressed.");
  });
}
find("arm").addEventListener("click", () => {
  if (driver?.seen?.armed) disarm();
  else if (driver?.byProgram && !driver.seen.emergency) driver.armAsItIs();
  else arm();
});
find("hand").addEventListener("click", () => {
  if (driver && !driver.mine && driver.seen?.holder) driver.take();
  else handOver();
});
find("cap").addEventListener("input", () => setCap(find("cap").valueAsNumber));
find("tilt").addEventListener("click", async () => {
  try {
    if (tilt.isOn) tilt.letGo();
    else await tilt.start();
  } catch (error) {
    log.add(error.message, "refused");
  }
  showTilt();
  changed();
});
find("keep").addEventListener("click", () => {
  const isKept = keptKey() === "";
  keepKey(isKept ? key : "");
  find("keep").setAttribute("aria-pressed", String(isKept));
});
find("leave").addEventListener("click", () => {
  driver?.hide(true);
  link.close();
  keepKey("");
  lose("Disconnected.");
  tell(find("connection"), "Not connected.");
  hasBeenIn = false;
  view("door");
  door.show();
});

listen(stop, () => driver !== null, {
  e: arm,
  x: disarm,
  p: handOver,
  r: () => recorder.toggle(),
  m: () => recorder.mark(),
  u: () => recorder.undo(),
  Backspace: () => recorder.undo(),
  "+": () => setCap(find("cap").valueAsNumber + CAP_STEP),
  "=": () => setCap(find("cap").valueAsNumber + CAP_STEP),
  "-": () => setCap(find("cap").valueAsNumber - CAP_STEP),
});

// Stops without a press of a button.

addEventListener("blur", () => {
  driver?.letGo();
  showTilt();
});
document.addEventListener("visibilitychange", () => {
  driver?.hide(document.hidden);
  showTilt();
  if (!document.hidden) link.retry();
});
addEventListener("pagehide", () => {
  driver?.hide(true);
  link.close();
});
addEventListener("pageshow", ({ persisted }) => {
  if (persisted && hasBeenIn) link.open(key, find("name").value.trim() || someName());
});
addEventListener("online", () => link.retry());

// Numbers that change over time.

function refresh() {
  requestAnimationFrame(refresh);
  const nowMs = performance.now();
  actions?.showAsked();
  const ageMs = picture.ageMs(nowMs);
  const isOld = ageMs === null || ageMs > OLD_MS;
  document.body.dataset.picture = ageMs === null ? "none" : isOld ? "old" : "live";
  tell(find("age"), ageMs === null ? "–" : ageMs < 10_000 ? `${Math.round(ageMs / 10) * 10} ms` : "old");
  tell(find("rate"), `${picture.rate(nowMs).toFixed(0)} /s`);
  tell(find("trip"), trips.typicalMs === null ? "–" : shown(trips.typicalMs, "ms"));
  if (ageMs !== null) {
    const words = `The picture is ${(ageMs / 1000).toFixed(1)} s old, and not the current view.`;
    tell(find("picture-state"), isOld ? words : "");
  }
}

async function begin() {
  view("door");
  setCap(find("cap").valueAsNumber);
  requestAnimationFrame(refresh);
  key = keyFromAddress();
  let known;
  try {
    known = await introduction();
  } catch {
    tell(find("connection"), "The robot does not answer. Load this page again once it runs.");
    return;
  }
  document.title = known.robot;
  tell(find("robot"), known.robot);
  tell(find("connection"), "Not connected.");
  if (!globalThis.isSecureContext) {
    door.bar(
      "The browser does not trust this page enough to prove the key: open it by https, or on the " +
        "robot itself at http://127.0.0.1.",
    );
    return;
  }
  key ||= keptKey();
  find("keep").setAttribute("aria-pressed", String(keptKey() !== ""));
  find("keep").hidden = known.open;
  door.show(key);
  if (!key && !known.open) return;
  try {
    enter(key, find("name").value);
  } catch (error) {
    door.complain(error.message);
  }
}

begin();
