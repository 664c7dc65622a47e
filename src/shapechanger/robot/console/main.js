// Assembles the page.

import { Actions } from "./actions.js";
import { find, setText } from "./dom.js";
import { Driver } from "./driver.js";
import { Episodes } from "./episodes.js";
import { Gamepads } from "./gamepad.js";
import { defaultName, keepKey, KeyForm, keyFromAddress, keptKey } from "./key_form.js";
import { Keys } from "./keys.js";
import { features, formatNumber } from "./layout.js";
import { learnLetters } from "./letters.js";
import { describeRobot, Link } from "./link.js";
import { Log } from "./log.js";
import { ageOnArrivalMs, Picture } from "./picture.js";
import { Pilot } from "./pilot.js";
import { Policies } from "./policies.js";
import { Readings } from "./readings.js";
import { Recorder } from "./recorder.js";
import { Status } from "./status.js";
import { Stick } from "./stick.js";
import { Tilt } from "./tilt.js";

const CAP_STEP = 10; // %
const PRESS_MS = 1_000; // A click within this time after a press belongs to the press.
const OLD_MS = 500; // Age above which a picture is marked as old.

let driver = null; // Made for each connection, because it depends on the robot's actions.
let actions = null;
let readings = null;
let key = "";
let wasConnected = false;

const link = new Link();
const log = new Log(find("log"));
const picture = new Picture(find("picture"));
const status = new Status();
const recorder = new Recorder(link, log);
const policies = new Policies(link, log);
const keyForm = new KeyForm(connect);

const changed = () => driver?.changed();
const keys = new Keys(() => driver !== null, changed, letGo, {
  stop,
  arm,
  disarm,
  handOver,
  record: () => recorder.toggle(),
  mark: () => recorder.mark(),
  undo: () => recorder.undo(),
  raiseCap: () => setCap(find("cap").valueAsNumber + CAP_STEP),
  lowerCap: () => setCap(find("cap").valueAsNumber - CAP_STEP),
});
const pads = new Gamepads(changed, pressed, (text) => log.add(text, "refused"));
const stick = new Stick(find("pad"), changed);
const tilt = new Tilt(changed);
const episodes = new Episodes(link, () => {
  if (driver?.mine) driver.disarm(); // The dialog covers the live picture.
});

function view(name) {
  if (document.body.dataset.view !== name) scrollTo(0, 0);
  document.body.dataset.view = name;
  find("login").hidden = name !== "login";
  find("drive").hidden = name !== "drive";
  find("facts").hidden = name !== "drive";
}

function connect(typed, name) {
  key = typed;
  link.open(key, name);
}

// The connection.

link.addEventListener("state", ({ detail: { state, text } }) => {
  document.body.dataset.link = state;
  const again = state === "waiting" ? " Trying again…" : "";
  setText(find("connection"), text + again);
  find("enter").disabled = state === "connecting";
  if (state === "open") return;
  if (state === "refused") {
    view("login");
    keepKey("");
    keyForm.show(key);
    keyForm.showError(text);
  }
  if (state === "displaced") {
    view("login");
    keyForm.show(key, `${text} Connect again to take the place of another.`);
  }
  if (state === "waiting" && wasConnected) log.add(text, "trouble");
  if (state !== "connecting") disconnected(text);
});

function disconnected(text) {
  driver = null;
  for (const device of [keys, pads, stick, tilt]) device.letGo();
  showTilt();
  picture.forget();
  setText(find("picture-state"), "Not connected.");
  episodes.close();
  status.showLost(`${text} The robot stops by itself without commands.`);
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
  policies.begin();
  episodes.begin(moves.map(({ name }) => name));
  document.title = welcome.robot;
  setText(find("robot"), welcome.robot);
  const [wide, high] = welcome.image_size ?? [4, 3];
  find("stage").style.setProperty("--shape", String(wide / high));
  find("tilt").hidden = !(Tilt.isThere && pilot.hasStick);
  find("steer").dataset.stick = String(pilot.hasStick);
  setText(find("picture-state"), welcome.image_size ? "No picture yet." : "This robot has no camera.");
  view("drive");
  if (!wasConnected) find("stage").focus({ preventScroll: true });
  log.add(wasConnected ? "Connected again. The robot does not move until you arm it." : `Connected to ${welcome.robot}.`);
  wasConnected = true;
  driver.hide(document.hidden);
  driver.begin();
});

link.addEventListener("observation", ({ detail: seen }) => {
  if (!driver) return;
  const nowMs = performance.now();
  driver.observe(seen);
  showTilt(); // Arming, disarming and stopping switch the tilt control off.
  // A hidden page does not draw pictures.
  if (document.hidden) return;
  if (seen.frame) picture.show(seen.frame, ageOnArrivalMs(seen, link.roundTripMs), nowMs);
  status.show(seen, driver.mine, nowMs);
  actions.show(seen, driver.isDriving);
  readings.show(seen);
});

link.addEventListener("lease", ({ detail: lease }) => {
  driver?.onLease(lease);
  if (lease.reason) log.add(lease.reason);
});
link.addEventListener("event", ({ detail: { text, name } }) => {
  if (name === "disarmed" && log.isLast(text)) return; // An emergency stop also disarms, with the same text.
  log.add(text, name === "emergency" || name === "bump" ? "trouble" : "event");
});
link.addEventListener("refused", ({ detail: { reason } }) => log.add(reason, "refused"));
link.addEventListener("invalid", ({ detail }) => log.add(detail, "trouble"));

// Input of the person.

function stop(reason) {
  driver?.stop(reason);
}

function arm() {
  driver?.arm();
}

/** Handle a press of a gamepad's button. */
function pressed(what) {
  if (what === "stop") stop("A gamepad's B was pressed.");
  else if (!document.querySelector("dialog[open]")) arm(); // A dialog covers the picture.
}

/** Release everything that is held. */
function letGo() {
  driver?.letGo();
  showTilt();
}

function disarm() {
  driver?.disarm();
}

function handOver() {
  if (driver?.byProgram) driver.armForHolder();
  else driver?.handOver();
}

function setCap(percent) {
  const cap = find("cap");
  cap.value = percent;
  setText(find("cap-shown"), `${cap.value} %`);
  cap.setAttribute("aria-valuetext", `${cap.value} percent`);
  if (!driver) return;
  driver.scale = cap.valueAsNumber / 100;
  driver.changed();
}

function showTilt() {
  find("tilt").setAttribute("aria-pressed", String(tilt.isOn));
}

for (const id of ["stop", "episodes-stop"]) {
  // STOP acts when it is pressed, not when the finger is lifted.
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
  else if (driver?.byProgram && !driver.seen.emergency) driver.armForHolder();
  else arm();
});
find("hand").addEventListener("click", () => {
  if (driver && !driver.mine && driver.seen?.holder) {
    letGo(); // Inputs that are held already must not drive the robot.
    driver.take();
  } else {
    handOver();
  }
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
  disconnected("Disconnected.");
  setText(find("connection"), "Not connected.");
  wasConnected = false;
  view("login");
  keyForm.show();
});

// Events after which held inputs do not count, or the robot stops.

// After these events, the page may not be notified of the end of a press.
for (const name of ["blur", "dragstart", "compositionstart"]) addEventListener(name, letGo);
for (const name of ["focusin", "focusout"]) {
  addEventListener(name, () => {
    for (const device of [keys, pads, stick]) device.letGo(); // Tilt control stays on.
    changed();
  });
}
for (const name of ["fullscreenchange", "pointerlockchange"]) document.addEventListener(name, letGo);
addEventListener("contextmenu", (event) => {
  if (!event.defaultPrevented) letGo(); // The stick opens no menu.
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
document.addEventListener("freeze", () => driver?.hide(true));
document.addEventListener("resume", () => driver?.hide(document.hidden));
addEventListener("focus", learnLetters); // The layout may have changed meanwhile.
addEventListener("pageshow", ({ persisted }) => {
  if (persisted && wasConnected) link.open(key, find("name").value.trim() || defaultName());
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
  setText(find("age"), ageMs === null ? "–" : ageMs < 10_000 ? `${Math.round(ageMs / 10) * 10} ms` : "old");
  setText(find("rate"), `${picture.rate(nowMs).toFixed(0)} /s`);
  setText(find("trip"), formatNumber(link.roundTripMs, "ms"));
  if (ageMs !== null) {
    const words = `The picture is ${(ageMs / 1000).toFixed(1)} s old, and not the current view.`;
    setText(find("picture-state"), isOld ? words : "");
  }
}

async function begin() {
  view("login");
  setCap(find("cap").valueAsNumber);
  requestAnimationFrame(refresh);
  learnLetters();
  key = keyFromAddress();
  let known;
  try {
    known = await describeRobot();
  } catch {
    setText(find("connection"), "The robot does not answer. Load this page again once it runs.");
    return;
  }
  document.title = known.robot;
  setText(find("robot"), known.robot);
  setText(find("connection"), "Not connected.");
  if (!globalThis.isSecureContext) {
    keyForm.block(
      "The browser does not trust this page enough to prove the key: open it by https, or on the " +
        "robot itself at http://127.0.0.1.",
    );
    return;
  }
  key ||= keptKey();
  find("keep").setAttribute("aria-pressed", String(keptKey() !== ""));
  find("keep").hidden = known.open;
  keyForm.show(key);
  if (!key && !known.open) return;
  try {
    connect(key, find("name").value);
  } catch (error) {
    keyForm.showError(error.message);
  }
}

begin();
