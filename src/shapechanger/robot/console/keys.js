// Driving keys: W A S D by their position on the keyboard, and the arrows.

const DRIVES = {
  KeyW: ["throttle", 1], ArrowUp: ["throttle", 1],
  KeyS: ["throttle", -1], ArrowDown: ["throttle", -1],
  KeyA: ["steering", -1], ArrowLeft: ["steering", -1],
  KeyD: ["steering", 1], ArrowRight: ["steering", 1],
};

/** Return true if a key belongs to a focused text field. */
export function isTyping(event) {
  const { target } = event;
  return target instanceof HTMLInputElement && !["range", "checkbox"].includes(target.type);
}

export class Keys {
  #held = new Set();
  #changed;

  constructor(changed) {
    this.#changed = changed;
    addEventListener("keydown", (event) => this.#down(event));
    addEventListener("keyup", (event) => this.#up(event));
  }

  /** Steering and throttle, -1 to 1 each. */
  get value() {
    const value = { steering: 0, throttle: 0 };
    for (const code of this.#held) {
      const [name, way] = DRIVES[code];
      value[name] = Math.max(-1, Math.min(1, value[name] + way));
    }
    return value;
  }

  /** Ignore held keys until they are pressed again. */
  letGo() {
    this.#held.clear();
  }

  #down(event) {
    const { code, ctrlKey, metaKey, altKey, target } = event;
    if (!(code in DRIVES) || ctrlKey || metaKey || altKey || isTyping(event)) return;
    if (document.querySelector("dialog[open]")) return;
    // The arrows move a focused slider, and not the robot.
    if (code.startsWith("Arrow") && target instanceof HTMLInputElement) return;
    event.preventDefault(); // Do not scroll the page.
    if (event.repeat || this.#held.has(code)) return;
    this.#held.add(code);
    this.#changed();
  }

  #up({ code }) {
    if (this.#held.delete(code)) this.#changed();
  }
}
