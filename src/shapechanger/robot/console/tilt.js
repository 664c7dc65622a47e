// Tilting the device: how it is held when this is switched on is the middle.

const FULL_DEG = 25; // Tilt of a full command.
const DEAD_DEG = 3;

export class Tilt {
  #changed;
  #middle = null;
  #listener = (event) => this.#turn(event);

  /** Steering and throttle, -1 to 1 each. */
  value = { steering: 0, throttle: 0 };

  /** Whether it is on. */
  isOn = false;

  constructor(changed) {
    this.#changed = changed;
  }

  /** Whether this device may be one that can be tilted. */
  static get isThere() {
    return "DeviceOrientationEvent" in globalThis && navigator.maxTouchPoints > 0;
  }

  /** Switch it on, after asking where that must be; throws an Error in words. */
  async start() {
    const { requestPermission } = DeviceOrientationEvent;
    if (requestPermission && (await requestPermission.call(DeviceOrientationEvent)) !== "granted") {
      throw new Error("The browser does not let this page know how the device is tilted.");
    }
    this.#middle = null;
    this.isOn = true;
    addEventListener("deviceorientation", this.#listener);
  }

  /** Switch it off. */
  letGo() {
    removeEventListener("deviceorientation", this.#listener);
    this.isOn = false;
    this.value = { steering: 0, throttle: 0 };
  }

  #turn({ beta, gamma }) {
    if (beta === null || gamma === null) return;
    const { across, along } = asHeld(beta, gamma, screen.orientation?.angle ?? 0);
    this.#middle ??= { across, along };
    const steering = wish(across - this.#middle.across);
    const throttle = wish(this.#middle.along - along);
    this.value = { steering, throttle };
    this.#changed();
  }
}

/** Tilt to the right and towards the person, in degrees, however the screen is turned. */
function asHeld(beta, gamma, angle) {
  if (angle === 90) return { across: beta, along: -gamma };
  if (angle === 270) return { across: -beta, along: gamma };
  if (angle === 180) return { across: -gamma, along: -beta };
  return { across: gamma, along: beta };
}

function wish(deg) {
  const size = Math.abs(deg);
  if (size < DEAD_DEG) return 0;
  return Math.sign(deg) * Math.min(1, (size - DEAD_DEG) / (FULL_DEG - DEAD_DEG));
}
