// Gamepad: the left stick steers; the triggers or either stick drive.

const DEAD = 0.12; // Dead zone as a share of the travel: sticks do not rest at 0.
const POLL_MS = 20;
const ARM = 0; // Of the standard mapping: A.
const STOP = 1; // B.

function withDeadZone(value) {
  const size = Math.abs(value);
  return size < DEAD ? 0 : (Math.sign(value) * (size - DEAD)) / (1 - DEAD);
}

export class Gamepads {
  #changed;
  #pressed;
  #mustRest = true;
  #buttons = [];
  #timer = 0;

  /** Steering and throttle, -1 to 1 each. */
  value = { steering: 0, throttle: 0 };

  /** `pressed` is called with "arm" or "stop". */
  constructor(changed, pressed) {
    this.#changed = changed;
    this.#pressed = pressed;
    addEventListener("gamepadconnected", () => this.#begin());
    if (this.#pad()) this.#begin();
  }

  /** Ignore the sticks until they have been at rest. */
  letGo() {
    this.#mustRest = true;
    this.value = { steering: 0, throttle: 0 };
  }

  #pad() {
    // The function does not exist in an insecure context.
    return navigator.getGamepads?.().find((pad) => pad?.connected) ?? null;
  }

  #begin() {
    clearInterval(this.#timer);
    this.letGo();
    this.#timer = setInterval(() => this.#poll(), POLL_MS);
  }

  #poll() {
    const pad = this.#pad();
    const before = this.value;
    if (!pad) {
      clearInterval(this.#timer);
      this.letGo();
    } else {
      this.#read(pad);
    }
    const { steering, throttle } = this.value;
    if (steering !== before.steering || throttle !== before.throttle) this.#changed();
  }

  #read(pad) {
    const triggers = (pad.buttons[7]?.value ?? 0) - (pad.buttons[6]?.value ?? 0);
    const ways = [triggers, -(pad.axes[3] ?? 0), -(pad.axes[1] ?? 0)].map(withDeadZone);
    const throttle = ways.reduce((most, way) => (Math.abs(way) > Math.abs(most) ? way : most), 0);
    const value = { steering: withDeadZone(pad.axes[0] ?? 0), throttle };
    if (this.#mustRest) this.#mustRest = value.steering !== 0 || value.throttle !== 0;
    if (!this.#mustRest) this.value = value;
    const now = pad.buttons.map((button) => button.pressed);
    if (now[STOP] && !this.#buttons[STOP]) this.#pressed("stop");
    if (now[ARM] && !this.#buttons[ARM]) this.#pressed("arm");
    this.#buttons = now;
  }
}
