// Gamepad: the left stick steers; the triggers or either stick drive.

const DEAD = 0.12; // Dead zone as a share of the travel, because sticks do not rest exactly at 0.
const POLL_MS = 20;
const ARM = 0; // Button A of the standard mapping.
const STOP = 1; // Button B of the standard mapping.

function withDeadZone(value) {
  const size = Math.abs(value);
  return size < DEAD ? 0 : (Math.sign(value) * (size - DEAD)) / (1 - DEAD);
}

export class Gamepads {
  #changed;
  #pressed;
  #note;
  #pads = null; // Description of the connected pads, to detect changes.
  #mustRest = true;
  #buttons = null; // Null before a pad is read for the first time.
  #timer = 0;

  /** Steering and throttle, -1 to 1 each. */
  value = { steering: 0, throttle: 0 };

  /** `pressed` is called with "arm" or "stop", and `note` with a sentence about an ignored pad. */
  constructor(changed, pressed, note) {
    this.#changed = changed;
    this.#pressed = pressed;
    this.#note = note;
    for (const name of ["gamepadconnected", "gamepaddisconnected"]) addEventListener(name, () => this.#begin());
    this.#begin();
  }

  /** Ignore the sticks until they have been at rest. */
  letGo() {
    this.#mustRest = true;
    this.value = { steering: 0, throttle: 0 };
  }

  #begin() {
    clearInterval(this.#timer);
    this.#pads = null;
    this.#timer = setInterval(() => this.#poll(), POLL_MS);
    this.#poll();
  }

  #poll() {
    const before = this.value;
    // The function does not exist in an insecure context.
    const pads = [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad?.connected);
    const pad = pads.find(({ mapping }) => mapping === "standard");
    this.#compare(pads, pad);
    if (pad) this.#read(pad);
    if (!pads.length) clearInterval(this.#timer);
    const { steering, throttle } = this.value;
    if (steering !== before.steering || throttle !== before.throttle) this.#changed();
  }

  /** Require rest whenever the list of pads changes, because another pad may be read from now on. */
  #compare(pads, used) {
    const now = pads.map(({ index, id, mapping }) => `${index} ${mapping} ${id}`).join("\n");
    if (now === this.#pads) return;
    this.#pads = now;
    this.#buttons = null;
    this.letGo();
    if (used) return;
    for (const { id } of pads) {
      this.#note(`The gamepad "${id}" is ignored: the browser does not know which stick is which ("standard" mapping).`);
    }
  }

  #read(pad) {
    const [across, left, right] = [0, 1, 3].map((axis) => pad.axes[axis] ?? 0);
    const [backward, forward] = [6, 7].map((button) => pad.buttons[button]?.value ?? 0);
    const inputs = [across, left, right, backward, forward];
    // Check each input separately: two triggers that rest half-way would cancel each other.
    if (this.#mustRest) this.#mustRest = !inputs.every((input) => Math.abs(input) < DEAD);
    // A person may be using the pad in another window.
    if (!document.hasFocus() || !inputs.every(Number.isFinite)) this.letGo();
    if (!this.#mustRest) {
      const ways = [forward - backward, -right, -left].map(withDeadZone);
      const throttle = ways.reduce((most, way) => (Math.abs(way) > Math.abs(most) ? way : most), 0);
      this.value = { steering: withDeadZone(across), throttle };
    }
    // Browsers report a pad at its first press, so that press of A does not count.
    const now = pad.buttons.map((button) => button.pressed);
    if (now[STOP] && !this.#buttons?.[STOP]) this.#pressed("stop");
    if (now[ARM] && this.#buttons?.[ARM] === false && document.hasFocus()) this.#pressed("arm");
    this.#buttons = now;
  }
}
