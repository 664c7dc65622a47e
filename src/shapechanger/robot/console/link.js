// Connection to the robot: authenticates, watches for silence, and reconnects.

import { decode, encode } from "./codec.js";
import { fromHex, makeProof, parseKey } from "./proof.js";

/** Version of the messages that this page uses. */
export const VERSION = 1;

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 5_000;
const PING_MS = 1_000;
const SILENCE_MS = 6_000; // A longer silence means that the connection is lost.
const GREETING_MS = 8_000;
const REMEMBERED = 5; // Number of round trips to store.

/** Fetch the description of the robot before authentication; throws if the robot does not answer. */
export async function describeRobot() {
  const answer = await fetch("/console/robot.json", { cache: "no-store" });
  if (!answer.ok) throw new Error(`The robot answered ${answer.status}.`);
  return answer.json();
}

/**
 * Fires `state` (detail: {state, text}) with the state connecting, open, waiting, refused or
 * displaced. After "displaced", another person has replaced this page, and it does not reconnect.
 * Fires `invalid` (detail: a sentence) for bytes that are not a message. For each other message of
 * the robot except pongs, fires an event named after its type, with the message as detail.
 */
export class Link extends EventTarget {
  #socket = null;
  #timer = 0;
  #pinging = 0;
  #heardMs = 0;
  #waitMs = FIRST_WAIT_MS;
  #attempt = 0;
  #pings = new Map();
  #token = 0;
  #key = "";
  #name = "";
  #trips = [];

  /** Description of the robot; null without a connection. */
  welcome = null;

  /** Median of the last round trips, ms, or null. */
  get roundTripMs() {
    if (!this.#trips.length) return null;
    return [...this.#trips].sort((a, b) => a - b)[this.#trips.length >> 1];
  }

  /** Connect with a key, and reconnect until `close`. Throws an Error for an invalid key. */
  open(key, name) {
    if (key) parseKey(key);
    this.#key = key;
    this.#name = name;
    this.#waitMs = FIRST_WAIT_MS;
    this.#connect();
  }

  /** End the connection, and do not reconnect. */
  close() {
    this.#attempt += 1;
    this.#drop();
  }

  /** Reconnect at once, if a later attempt is scheduled. */
  retry() {
    if (this.#timer) this.#connect();
  }

  /** Send a message; returns false without a connection. */
  send(kind, fields = {}) {
    if (!this.welcome || this.#socket?.readyState !== WebSocket.OPEN) return false;
    this.#socket.send(encode({ kind, ...fields }));
    return true;
  }

  #drop() {
    clearTimeout(this.#timer);
    clearInterval(this.#pinging);
    this.#timer = 0;
    this.#pings.clear();
    this.#trips = [];
    this.welcome = null;
    const socket = this.#socket;
    this.#socket = null;
    socket?.close();
  }

  #report(state, text) {
    this.dispatchEvent(new CustomEvent("state", { detail: { state, text } }));
  }

  async #connect() {
    this.#drop();
    this.#attempt += 1;
    const attempt = this.#attempt;
    const isOver = () => attempt !== this.#attempt;
    this.#report("connecting", "Connecting…");
    let known;
    try {
      known = await describeRobot();
    } catch {
      if (!isOver()) this.#wait("The robot does not answer.");
      return;
    }
    if (isOver()) return;
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}/link`);
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    let refused = "";
    const greeting = setTimeout(() => socket.close(), GREETING_MS);
    socket.onclose = () => {
      clearTimeout(greeting);
      if (isOver()) return;
      const was = this.welcome;
      this.#drop();
      if (refused && !was && /key/i.test(refused)) this.#report("refused", refused);
      // Displaced pages that reconnect at once would displace one another endlessly.
      else if (was && /are the limit/.test(refused)) this.#report("displaced", refused);
      else this.#wait(refused || (was ? "The connection is lost." : "The robot does not answer."));
    };
    socket.onmessage = async ({ data }) => {
      if (isOver()) return;
      this.#heardMs = performance.now();
      const message = this.#decoded(data);
      if (message === null) return;
      if (message.kind === "challenge") {
        const key = this.#key ? parseKey(this.#key) : new Uint8Array();
        const proof = known.open
          ? new Uint8Array()
          : await makeProof(key, message.nonce, fromHex(known.certificate), "person");
        if (isOver()) return;
        const hello = { version: VERSION, proof, name: this.#name, role: "person" };
        socket.send(encode({ kind: "hello", ...hello }));
      } else if (message.kind === "welcome") {
        clearTimeout(greeting);
        this.welcome = message;
        this.#waitMs = FIRST_WAIT_MS;
        this.#report("open", "Connected.");
        this.dispatchEvent(new CustomEvent("welcome", { detail: message }));
        this.#pinging = setInterval(() => this.#check(), PING_MS);
        this.ping();
      } else if (message.kind === "pong") {
        this.#pong(message);
      } else {
        if (message.kind === "refused" && message.fatal) refused = message.reason;
        this.dispatchEvent(new CustomEvent(message.kind, { detail: message }));
      }
    };
  }

  #decoded(data) {
    try {
      return decode(new Uint8Array(data));
    } catch (error) {
      this.dispatchEvent(new CustomEvent("invalid", { detail: `Invalid message: ${error.message}` }));
      return null;
    }
  }

  #wait(text) {
    const waitMs = this.#waitMs * (0.75 + 0.5 * Math.random()); // Spread the pages over time.
    this.#waitMs = Math.min(2 * this.#waitMs, LONGEST_WAIT_MS);
    this.#timer = setTimeout(() => this.#connect(), waitMs);
    this.#report("waiting", text);
  }

  /** Measure the round trip. */
  ping() {
    this.#token += 1;
    if (this.send("ping", { token: this.#token })) this.#pings.set(this.#token, performance.now());
  }

  #check() {
    if (performance.now() - this.#heardMs > SILENCE_MS) {
      // The radio may be out of reach, and the browser may report it only after minutes.
      this.#attempt += 1;
      this.#drop();
      this.#wait("The robot no longer answers.");
      return;
    }
    this.ping();
  }

  #pong({ token }) {
    const sentMs = this.#pings.get(token);
    this.#pings.delete(token);
    if (sentMs === undefined) return;
    this.#trips.push(performance.now() - sentMs);
    if (this.#trips.length > REMEMBERED) this.#trips.shift();
  }
}
