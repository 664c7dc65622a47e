// Keys, identified by their position on the keyboard (`event.code`) in any layout. A position has one
// meaning: a key that drives is never a shortcut.

const DRIVE = "drive";
const STOP = "stop";

const MEANINGS = new Map([
  ["Space", [STOP]], ["Escape", [STOP]],
  ["KeyW", [DRIVE, "throttle", 1]], ["ArrowUp", [DRIVE, "throttle", 1]],
  ["KeyS", [DRIVE, "throttle", -1]], ["ArrowDown", [DRIVE, "throttle", -1]],
  ["KeyA", [DRIVE, "steering", -1]], ["ArrowLeft", [DRIVE, "steering", -1]],
  ["KeyD", [DRIVE, "steering", 1]], ["ArrowRight", [DRIVE, "steering", 1]],
  ["KeyE", ["arm"]], ["KeyX", ["disarm"]], ["KeyP", ["handOver"]],
  ["KeyR", ["record"]], ["KeyM", ["mark"]], ["KeyU", ["undo"]], ["Backspace", ["undo"]],
  ["Equal", ["raiseCap"]], ["NumpadAdd", ["raiseCap"]],
  ["Minus", ["lowerCap"]], ["NumpadSubtract", ["lowerCap"]],
]);

// Shift is not included, because it does not change the meaning of a key here.
const MODIFIERS = new Set(["Meta", "OS", "Super", "Hyper", "Control", "Alt", "AltGraph"]);

export class Keys {
  #held = new Set();
  #isLive;
  #changed;
  #letGoAll;
  #actions;

  /**
   * `isLive` returns whether keys have a meaning now. `changed` is called when a driving key goes
   * down or up. `letGoAll` is called at a combination with a modifier, which the system may use, and
   * because macOS sends no keyup of a letter while Meta is held. `actions` has a function for each
   * other meaning; `stop` is called with the reason.
   */
  constructor(isLive, changed, letGoAll, actions) {
    this.#isLive = isLive;
    this.#changed = changed;
    this.#letGoAll = letGoAll;
    this.#actions = actions;
    // Capture the key before any element: Space on a button must stop the robot.
    addEventListener("keydown", (event) => this.#stop(event), { capture: true });
    addEventListener("keydown", (event) => this.#down(event));
    addEventListener("keyup", (event) => this.#up(event), { capture: true });
  }

  /** Steering and throttle, -1 to 1 each. */
  get value() {
    const value = { steering: 0, throttle: 0 };
    for (const code of this.#held) {
      const [, name, way] = MEANINGS.get(code);
      value[name] = Math.max(-1, Math.min(1, value[name] + way));
    }
    return value;
  }

  /** Ignore held keys until they are pressed again. */
  letGo() {
    this.#held.clear();
  }

  #stops({ code, target }) {
    return this.#isLive() && MEANINGS.get(code)?.[0] === STOP && !isText(target);
  }

  /** Stop the robot at a stop key, with any modifier, unless the focus is in a text field. */
  #stop(event) {
    if (!this.#stops(event)) return;
    if (event.code === "Space") {
      event.preventDefault();
      event.stopPropagation();
    }
    if (!event.repeat) this.#actions.stop(`${event.code} was pressed.`);
  }

  #down(event) {
    const { code = "", repeat, target } = event; // A browser that fills in a form sends no code.
    // A held Enter presses a focused button only once.
    if (repeat && code.endsWith("Enter") && target instanceof HTMLButtonElement) event.preventDefault();
    if (!this.#isLive()) return;
    if (isModified(event)) {
      this.#letGoAll();
      return;
    }
    const [meaning] = MEANINGS.get(code) ?? [STOP];
    if (meaning === STOP || isElsewhere(event)) return;
    event.preventDefault(); // Prevents scrolling of the page.
    if (repeat) return;
    if (meaning !== DRIVE) this.#actions[meaning]();
    else if (!this.#held.has(code)) {
      this.#held.add(code);
      this.#changed();
    }
  }

  #up(event) {
    if (this.#stops(event) && event.code === "Space") event.preventDefault(); // Firefox clicks on key-up.
    if (this.#held.delete(event.code)) this.#changed();
    if (this.#isLive() && isModified(event)) this.#letGoAll();
  }
}

function isText(target) {
  if (target instanceof HTMLInputElement) return !["range", "checkbox"].includes(target.type);
  return target instanceof HTMLTextAreaElement || target.isContentEditable === true;
}

function isModified(event) {
  const { key, ctrlKey, metaKey, altKey } = event;
  return MODIFIERS.has(key) || ctrlKey || metaKey || altKey || event.getModifierState?.("AltGraph");
}

/** Return true if a key belongs to an input method, a dialog or a focused element. */
function isElsewhere({ code, key, keyCode, isComposing, target }) {
  if (isComposing || keyCode === 229 || key === "Dead") return true; // 229: of an input method.
  if (isText(target) || target instanceof HTMLSelectElement) return true;
  // The arrow keys move a focused slider instead of the robot.
  if (code.startsWith("Arrow") && target instanceof HTMLInputElement) return true;
  return document.querySelector("dialog[open]") !== null;
}
