// What the person wants: of all devices the one that asks for most, and the sliders for the rest.

const BY_STICK = ["steering", "throttle"];

export class Pilot {
  #features;
  #devices;
  #held = [];

  /** `features` of the action layout; `devices` have a `value` and can `letGo`. */
  constructor(features, devices) {
    this.#features = features;
    this.#devices = devices;
  }

  /** Whether a stick means anything to this robot. */
  get hasStick() {
    return this.#features.some(({ name }) => BY_STICK.includes(name));
  }

  /** Whether an action is one that a slider sets. */
  static hasSlider(name) {
    return !BY_STICK.includes(name);
  }

  /** Steering and throttle as the devices have them, -1 to 1 each. */
  get asked() {
    const asked = { steering: 0, throttle: 0 };
    for (const { value } of this.#devices) {
      for (const name of BY_STICK) {
        if (Math.abs(value[name]) > Math.abs(asked[name])) asked[name] = value[name];
      }
    }
    return asked;
  }

  /** Whether anybody asks for anything. */
  get isAsking() {
    const { steering, throttle } = this.asked;
    return steering !== 0 || throttle !== 0;
  }

  /** Hold what a slider says. */
  hold(index, value) {
    this.#held[index] = value;
  }

  /** The robot moves its other actions by itself: the sliders follow until somebody commands. */
  follow(applied) {
    this.#held = [...applied];
  }

  /** What a slider holds. */
  held(index) {
    return this.#held[index] ?? 0;
  }

  /** The values of a command that goes with a scale, in the order of the layout. */
  values(scale) {
    const { asked } = this;
    return this.#features.map(({ name, low, high }, index) => {
      // What no cap is meant for is divided by it, because the robot multiplies all values.
      if (Pilot.hasSlider(name)) return this.held(index) / scale;
      const value = asked[name];
      const most = value < 0 ? -low : high;
      return Number.isFinite(most) ? value * Math.max(0, most) : value;
    });
  }

  /** Count nothing that is held now; it must be let go, and pressed again. */
  letGo() {
    for (const device of this.#devices) device.letGo();
  }
}
