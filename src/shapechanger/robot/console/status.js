// State of the robot and its driver in a sentence, and the buttons that can change it.

import { find, label, setText } from "./dom.js";
import { showKeys } from "./letters.js";

const STOPPED_MS = 400; // A shorter reason would only flicker.

export class Status {
  #reason = "";
  #sinceMs = 0;
  #wasEmergency = false;

  /** Show an observation; `mine` is true if this page has control. */
  show(seen, mine, nowMs) {
    if (seen.stop_reason !== this.#reason) {
      this.#reason = seen.stop_reason;
      this.#sinceMs = nowMs;
    }
    const reason = nowMs - this.#sinceMs >= STOPPED_MS ? this.#reason : "";
    const { body } = document;
    body.dataset.robot = seen.emergency ? "emergency" : seen.armed ? "armed" : "disarmed";
    body.dataset.driver = mine ? "me" : seen.holder_role || "nobody";
    setText(find("holder"), mine ? "you" : seen.holder || "none");
    setText(find("state"), sentence(seen, mine, reason));
    if (seen.emergency && !this.#wasEmergency) setText(find("alert"), `Emergency stop. ${seen.stop_reason}`);
    if (!seen.emergency) setText(find("alert"), "");
    this.#wasEmergency = seen.emergency;
    const isByProgram = !mine && seen.holder_role === "program";
    const arm = seen.emergency ? "End the stop, arm" : isByProgram ? `Arm for ${seen.holder}` : "Arm";
    label(find("arm"), seen.armed ? "Disarm" : arm);
    showKeys(find("arm"), seen.armed ? "KeyX" : isByProgram ? "KeyP" : "KeyE");
    const isOthers = !mine && seen.holder !== "";
    label(find("hand"), isOthers ? "Take over" : "Let a program drive");
    showKeys(find("hand"), isOthers ? "KeyE" : "KeyP");
  }

  /** Show a lost connection. */
  showLost(text) {
    const { body } = document;
    body.dataset.robot = "lost";
    body.dataset.driver = "nobody";
    setText(find("holder"), "unknown");
    setText(find("state"), text);
  }
}

function sentence(seen, mine, reason) {
  if (seen.emergency) return `Emergency stop: ${reason || seen.stop_reason || "all outputs are at rest."}`;
  const who = mine ? "You drive" : seen.holder ? `${seen.holder} drives` : "";
  if (!seen.armed) {
    if (mine) return "You have control. Arm the robot to drive.";
    return who ? `${seen.holder} has control; not armed.` : "No driver. Arm the robot to drive.";
  }
  if (!who) return "Armed, without a driver.";
  return reason ? `${who}. At rest: ${reason}` : `${who}.`;
}
