// Log of events, newest last, which screen readers announce.

import { make } from "./dom.js";

const MOST = 100;
const AGAIN_MS = 5_000; // Within this time, repeats of a text are only counted.

export class Log {
  #list;
  #last = { text: "", atMs: -Infinity, count: 1, item: null };

  constructor(list) {
    this.#list = list;
  }

  /** Return true if this text was the last one. */
  isLast(text) {
    return text === this.#last.text;
  }

  /** Add a sentence; `kind` is "event", "refused" or "trouble". */
  add(text, kind = "event") {
    const nowMs = performance.now();
    const last = this.#last;
    if (text === last.text && nowMs - last.atMs < AGAIN_MS) {
      last.count += 1;
      last.atMs = nowMs;
      last.item.dataset.count = `×${last.count}`;
      return;
    }
    const time = new Date();
    const stamp = make("time", { datetime: time.toISOString() }, time.toLocaleTimeString());
    const item = make("li", { class: kind }, stamp, " ", text);
    const isAtEnd = this.#list.scrollHeight - this.#list.scrollTop - this.#list.clientHeight < 24;
    this.#list.append(item);
    if (this.#list.childElementCount > MOST) this.#list.firstElementChild.remove();
    if (isAtEnd) this.#list.scrollTop = this.#list.scrollHeight;
    this.#last = { text, atMs: nowMs, count: 1, item };
  }
}
