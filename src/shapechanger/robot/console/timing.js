// Round trips and ages on arrival. Clocks of two machines are never subtracted.

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

  /** Median of the last few, ms, or null. */
  get typicalMs() {
    if (!this.#trips.length) return null;
    return [...this.#trips].sort((a, b) => a - b)[this.#trips.length >> 1];
  }
}

/** Return the age of an observation on arrival, ms: on the robot, plus half a round trip. */
export function ageOnArrivalMs(observation, roundTripMs) {
  return msBetween(observation.captured_ns, observation.sent_ns) + (roundTripMs ?? 0) / 2;
}
