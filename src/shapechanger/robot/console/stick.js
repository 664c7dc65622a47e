// The stick on the screen, for a finger or a mouse; it springs back.

export class Stick {
  #pad;
  #changed;
  #pointer = null;

  /** Steering and throttle, -1 to 1 each. */
  value = { steering: 0, throttle: 0 };

  constructor(pad, changed) {
    this.#pad = pad;
    this.#changed = changed;
    pad.addEventListener("pointerdown", (event) => this.#down(event));
    pad.addEventListener("pointermove", (event) => this.#move(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      pad.addEventListener(end, (event) => {
        if (event.pointerId === this.#pointer) this.#release();
      });
    }
    // A long press opens no menu, and a finger neither scrolls nor zooms while it steers.
    pad.addEventListener("contextmenu", (event) => event.preventDefault());
    pad.addEventListener("touchmove", (event) => event.preventDefault(), { passive: false });
  }

  /** Spring back; whoever holds it must let go first. */
  letGo() {
    this.#pointer = null;
    this.value = { steering: 0, throttle: 0 };
    document.documentElement.classList.remove("held");
  }

  #down(event) {
    if (this.#pointer !== null || event.button !== 0) return;
    event.preventDefault();
    this.#pointer = event.pointerId;
    this.#pad.setPointerCapture(event.pointerId);
    document.documentElement.classList.add("held"); // No other finger zooms or scrolls meanwhile.
    this.#follow(event);
  }

  #move(event) {
    if (event.pointerId === this.#pointer) this.#follow(event);
  }

  #release() {
    this.letGo();
    this.#changed();
  }

  #follow(event) {
    const { left, top, width, height } = this.#pad.getBoundingClientRect();
    const clip = (value) => Math.max(-1, Math.min(1, value));
    // The middle of the knob travels a third of the pad to each side, as `place` shows it.
    const steering = clip(((event.clientX - left) / width - 0.5) / 0.33);
    const throttle = clip((0.5 - (event.clientY - top) / height) / 0.33);
    this.value = { steering: calm(steering), throttle: calm(throttle) };
    this.#changed();
  }
}

/** Nothing near the middle: a finger that goes straight ahead shall not steer. */
function calm(value) {
  const size = Math.abs(value);
  return size < 0.08 ? 0 : (Math.sign(value) * (size - 0.08)) / 0.92;
}

/** Put a mark on the pad where a steering and a throttle are. */
export function place(mark, steering, throttle) {
  mark.style.left = `${50 + 33 * steering}%`;
  mark.style.top = `${50 - 33 * throttle}%`;
}
