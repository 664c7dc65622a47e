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

/** Fetch the description of the robot before authentication; throws if it does not answer. */
export async function introduction() {
  const answer = await fetch("/console/robot.json", { cache: "no-store" });
  if (!answer.ok) throw new Error(`The robot answered ${answer.status}.`);
  return answer.json();
}

/**
 * Fires `state` (detail: {state, text, waitMs?}) with the states connecting, open, waiting and
 * refused, and for each message of the robot an event of its type, with the message as detail.
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
  #frames = true;

  /** Description of the robot; null without a connection. */
  welcome = null;

  constructor({ frames = true } = {}) {
    super();
    this.#frames = frames;
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
  say(kind, fields = {}) {
    if (!this.welcome || this.#socket?.readyState !== WebSocket.OPEN) return false;
    this.#socket.send(encode({ kind, ...fields }));
    return true;
  }

  #drop() {
    clearTimeout(this.#timer);
    clearInterval(this.#pinging);
    this.#timer = 0;
    this.#pings.clear();
    this.welcome = null;
    const socket = this.#socket;
    this.#socket = null;
    socket?.close();
  }

  #tell(state, text, more = {}) {
    this.dispatchEvent(new CustomEvent("state", { detail: { state, text, ...more } }));
  }

  async #connect() {
    this.#drop();
    this.#attempt += 1;
    const attempt = this.#attempt;
    const isOver = () => attempt !== this.#attempt;
    this.#tell("connecting", "Connecting…");
    let known;
    try {
      known = await introduction();
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
      if (refused && !was && /key/i.test(refused)) this.#tell("refused", refused);
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
        socket.send(encode({ kind: "hello", ...hello, frames: this.#frames }));
      } else if (message.kind === "welcome") {
        clearTimeout(greeting);
        this.welcome = message;
        this.#waitMs = FIRST_WAIT_MS;
        this.#tell("open", "Connected.");
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
      this.dispatchEvent(new CustomEvent("nonsense", { detail: `Invalid message: ${error.message}` }));
      return null;
    }
  }

  #wait(text) {
    const waitMs = this.#waitMs * (0.75 + 0.5 * Math.random()); // Spread the pages over time.
    this.#waitMs = Math.min(2 * this.#waitMs, LONGEST_WAIT_MS);
    this.#timer = setTimeout(() => this.#connect(), waitMs);
    this.#tell("waiting", text, { waitMs });
  }

  /** Measure the round trip; fires `pong`. */
  ping() {
    this.#token += 1;
    if (this.say("ping", { token: this.#token })) this.#pings.set(this.#token, performance.now());
  }

  #check() {
    if (performance.now() - this.#heardMs > SILENCE_MS) {
      // The radio is gone without a sign. The end of the socket may take minutes.
      this.#attempt += 1;
      this.#drop();
      this.#wait("The robot no longer answers.");
      return;
    }
    this.ping();
  }

  #pong({ token, now_ns: robotNs }) {
    const sentMs = this.#pings.get(token);
    this.#pings.delete(token);
    if (sentMs === undefined) return;
    const arrivedMs = performance.now();
    const detail = { sentMs, arrivedMs, robotNs, roundTripMs: arrivedMs - sentMs };
    this.dispatchEvent(new CustomEvent("pong", { detail }));
  }
}
