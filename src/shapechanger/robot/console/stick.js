// Stick on the screen for a finger or a mouse; it returns to the centre when released.

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
    // While steering, a long press opens no menu, and a finger does not scroll or zoom.
    pad.addEventListener("contextmenu", (event) => event.preventDefault());
    pad.addEventListener("touchmove", (event) => event.preventDefault(), { passive: false });
  }

  /** Return to the centre; a held stick does not count until it is let go and used again. */
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
    document.documentElement.classList.add("held"); // Keep other fingers from zooming or scrolling.
    this.#follow(event);
  }

  #move(event) {
    if (event.pointerId !== this.#pointer) return;
    // The end of a press may be lost; of two mouse buttons, only the last one has a pointerup.
    if (event.buttons & 1) this.#follow(event);
    else this.#release();
  }

  #release() {
    this.letGo();
    this.#changed();
  }

  #follow(event) {
    const { left, top, width, height } = this.#pad.getBoundingClientRect();
    const clip = (value) => Math.max(-1, Math.min(1, value));
    // The knob's centre travels a third of the pad to each side, as in `place`.
    const steering = clip(((event.clientX - left) / width - 0.5) / 0.33);
    const throttle = clip((0.5 - (event.clientY - top) / height) / 0.33);
    this.value = { steering: withDeadZone(steering), throttle: withDeadZone(throttle) };
    this.#changed();
  }
}

/** Dead zone in the middle, so that a finger straight ahead does not steer. */
function withDeadZone(value) {
  const size = Math.abs(value);
  return size < 0.08 ? 0 : (Math.sign(value) * (size - 0.08)) / 0.92;
}

/** Place a mark on the pad at a steering and a throttle. */
export function place(mark, steering, throttle) {
  mark.style.left = `${50 + 33 * steering}%`;
  mark.style.top = `${50 - 33 * throttle}%`;
}
