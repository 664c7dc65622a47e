// Command of the person: the largest value of all devices, and the values of the sliders.

const BY_STICK = ["steering", "throttle"];

export class Pilot {
  #features;
  #devices;
  #held = [];

  /** `features` are from the action layout; each device has a `value` and a method `letGo`. */
  constructor(features, devices) {
    this.#features = features;
    this.#devices = devices;
  }

  /** True if the robot has steering or throttle. */
  get hasStick() {
    return this.#features.some(({ name }) => BY_STICK.includes(name));
  }

  /** Return true if a slider sets this action. */
  static hasSlider(name) {
    return !BY_STICK.includes(name);
  }

  /** Steering and throttle of the devices, -1 to 1 each. */
  get asked() {
    const asked = { steering: 0, throttle: 0 };
    for (const { value } of this.#devices) {
      for (const name of BY_STICK) {
        if (Math.abs(value[name]) > Math.abs(asked[name])) asked[name] = value[name];
      }
    }
    return asked;
  }

  /** True if any device is used. */
  get isAsking() {
    const { steering, throttle } = this.asked;
    return steering !== 0 || throttle !== 0;
  }

  /** Set the value of a slider. */
  hold(index, value) {
    this.#held[index] = value;
  }

  /** Make the sliders follow the robot while the person does not command. */
  follow(applied) {
    this.#held = [...applied];
  }

  /** Return the value of a slider. */
  held(index) {
    return this.#held[index] ?? 0;
  }

  /** Return the values of a command with a scale, in the order of the layout. */
  values(scale) {
    const { asked } = this;
    return this.#features.map(({ name, low, high }, index) => {
      // The cap does not apply to sliders: divide by the scale, which the robot multiplies by.
      if (Pilot.hasSlider(name)) return this.held(index) / scale;
      const value = asked[name];
      const most = value < 0 ? -low : high;
      return Number.isFinite(most) ? value * Math.max(0, most) : value;
    });
  }

  /** Ignore held devices until they are let go and used again. */
  letGo() {
    for (const device of this.#devices) device.letGo();
  }
}
