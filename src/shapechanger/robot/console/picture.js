// Live picture. While a JPEG is decoded, the newest later JPEG waits, and older ones are dropped.

import { msBetween } from "./layout.js";

export class Picture {
  #canvas;
  #context;
  #waiting = null;
  #busy = false;
  #drawnMs = [];

  constructor(canvas) {
    this.#canvas = canvas;
    this.#context = canvas.getContext("2d", { alpha: false });
  }

  /**
   * Show a picture once it is decoded.
   *
   * `ageMs` is the age of the picture at the time `atMs` of this page's clock.
   */
  show(jpeg, ageMs, atMs) {
    // Copy the bytes, because a view would keep the whole message in memory.
    this.#waiting = { blob: new Blob([jpeg], { type: "image/jpeg" }), ageMs, atMs };
    if (!this.#busy) this.#work();
  }

  /** Age and time of the shown picture, or null. */
  newest = null;

  /** Return the age of the shown picture now, ms, or null. */
  ageMs(nowMs) {
    return this.newest && this.newest.ageMs + nowMs - this.newest.atMs;
  }

  /** Pictures per second, over the last two seconds. */
  rate(nowMs) {
    this.#drawnMs = this.#drawnMs.filter((atMs) => nowMs - atMs < 2_000);
    return this.#drawnMs.length / 2;
  }

  /** Clear the picture, for example after the connection has ended. */
  forget() {
    this.#waiting = null;
    this.newest = null;
    this.#drawnMs = [];
  }

  async #work() {
    this.#busy = true;
    while (this.#waiting) {
      const { blob, ageMs, atMs } = this.#waiting;
      this.#waiting = null;
      try {
        const bitmap = await createImageBitmap(blob);
        draw(this.#canvas, this.#context, bitmap);
        this.newest = { ageMs, atMs };
        this.#drawnMs.push(performance.now());
      } catch {
        // The JPEG is invalid. The last picture stays, and its age increases.
      }
    }
    this.#busy = false;
  }
}

/** Draw a picture over the whole canvas, at its own size. */
export function draw(canvas, context, bitmap) {
  if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
    canvas.width = bitmap.width;
    canvas.height = bitmap.height;
  }
  context.drawImage(bitmap, 0, 0);
  bitmap.close();
}

/**
 * Return the age of an observation on arrival, ms: its age when sent plus half a round trip.
 *
 * Times of two machines are never subtracted, because their clocks differ.
 */
export function ageOnArrivalMs(observation, roundTripMs) {
  return msBetween(observation.captured_ns, observation.sent_ns) + (roundTripMs ?? 0) / 2;
}
