// Tilt control; the orientation at switch-on is the centre.

const FULL_DEG = 25; // Tilt of a full command.
const DEAD_DEG = 3;

export class Tilt {
  #changed;
  #middle = null;
  #listener = (event) => this.#turn(event);

  /** Steering and throttle, -1 to 1 each. */
  value = { steering: 0, throttle: 0 };

  /** True while tilt control is on. */
  isOn = false;

  constructor(changed) {
    this.#changed = changed;
  }

  /** True if the device may have a tilt sensor. */
  static get isThere() {
    return "DeviceOrientationEvent" in globalThis && navigator.maxTouchPoints > 0;
  }

  /** Switch tilt control on; asks for permission if needed, and throws an Error if denied. */
  async start() {
    const { requestPermission } = DeviceOrientationEvent;
    if (requestPermission && (await requestPermission.call(DeviceOrientationEvent)) !== "granted") {
      throw new Error("The browser denies access to the tilt sensor.");
    }
    this.#middle = null;
    this.isOn = true;
    addEventListener("deviceorientation", this.#listener);
  }

  /** Switch tilt control off. */
  letGo() {
    removeEventListener("deviceorientation", this.#listener);
    this.isOn = false;
    this.value = { steering: 0, throttle: 0 };
  }

  #turn({ beta, gamma }) {
    if (beta === null || gamma === null) return;
    const { across, along } = asHeld(beta, gamma, screen.orientation?.angle ?? 0);
    this.#middle ??= { across, along };
    const steering = deflection(across - this.#middle.across);
    const throttle = deflection(this.#middle.along - along);
    this.value = { steering, throttle };
    this.#changed();
  }
}

/** Return the tilt to the right and towards the person, degrees, in any screen orientation. */
function asHeld(beta, gamma, angle) {
  if (angle === 90) return { across: beta, along: -gamma };
  if (angle === 270) return { across: -beta, along: gamma };
  if (angle === 180) return { across: -gamma, along: -beta };
  return { across: gamma, along: beta };
}

function deflection(deg) {
  const size = Math.abs(deg);
  if (size < DEAD_DEG) return 0;
  return Math.sign(deg) * Math.min(1, (size - DEAD_DEG) / (FULL_DEG - DEAD_DEG));
}
