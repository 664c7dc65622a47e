// The live picture: the newest JPEG only. What comes while one is decoded replaces what waits.

export class Picture {
  #canvas;
  #context;
  #waiting = null;
  #busy = false;
  #drawnMs = [];

  /** Pictures that came and were never drawn, because there was a newer one. */
  dropped = 0;

  constructor(canvas) {
    this.#canvas = canvas;
    this.#context = canvas.getContext("2d", { alpha: false });
  }

  /**
   * Show a picture as soon as it is decoded.
   *
   * `ageMs` is its age at the moment `atMs` of this page's clock.
   */
  show(jpeg, ageMs, atMs) {
    if (this.#waiting) this.dropped += 1;
    // A copy: the bytes are a part of a message that would stay in memory as a whole.
    this.#waiting = { blob: new Blob([jpeg], { type: "image/jpeg" }), ageMs, atMs };
    if (!this.#busy) this.#work();
  }

  /** Age and time of what is on the canvas; null for nothing yet. */
  newest = null;

  /** How old the picture on the canvas is now, ms; null without one. */
  ageMs(nowMs) {
    return this.newest && this.newest.ageMs + nowMs - this.newest.atMs;
  }

  /** Pictures drawn a second, over the last two. */
  rate(nowMs) {
    this.#drawnMs = this.#drawnMs.filter((atMs) => nowMs - atMs < 2_000);
    return this.#drawnMs.length / 2;
  }

  /** Forget what is shown, such as when the connection ended. */
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
        this.dropped += 1; // The robot's camera gave something broken; the age tells it.
      }
    }
    this.#busy = false;
  }
}

/** Draw a picture over a whole canvas, in its own size. */
export function draw(canvas, context, bitmap) {
  if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
    canvas.width = bitmap.width;
    canvas.height = bitmap.height;
  }
  context.drawImage(bitmap, 0, 0);
  bitmap.close();
}
