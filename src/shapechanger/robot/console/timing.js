// Round trips, and how old a thing was when it arrived. Two machines' clocks are never subtracted.

import { msBetween } from "./layout.js";

const REMEMBERED = 5;

export class RoundTrips {
  #trips = [];

  add(ms) {
    this.#trips.push(ms);
    if (this.#trips.length > REMEMBERED) this.#trips.shift();
  }

  clear() {
    this.#trips = [];
  }

  /** The middle one of the last few, ms; null for none yet. */
  get typicalMs() {
    if (!this.#trips.length) return null;
    return [...this.#trips].sort((a, b) => a - b)[this.#trips.length >> 1];
  }
}

/** How old what an observation shows was on its arrival, ms: on the robot, and half the way there. */
export function ageOnArrivalMs(observation, roundTripMs) {
  return msBetween(observation.captured_ns, observation.sent_ns) + (roundTripMs ?? 0) / 2;
}
