// Driving: answers each observation once, and sends stops at once.

import { letterAt } from "./letters.js";

const TAKEN_WITHIN_MS = 2_000; // Time in which a waiting program takes control.
const LEASE_MS = 2_000;
const ARMED_MS = 2_000; // Time in which an order to arm has an effect.
const PAUSE_MS = 1_000; // After a longer pause of the robot, a held input does not count.
const LEAST_MS = 15; // Least time between extra commands while the stick moves.

/** Fires `note` (detail: a sentence) when a request failed. */
export class Driver extends EventTarget {
  #link;
  #pilot;
  #seq = 0;
  #seenMs = 0;
  #saidMs = 0;
  #armMs = -Infinity;
  #isTaking = false;
  #isHidden = false;

  /** The newest observation, or null. */
  seen = null;

  /** True if this page has control. */
  mine = false;

  /** Speed cap, 0.1 to 1, as a share of the robot's full range. */
  scale = 0.5;

  constructor(link, pilot) {
    super();
    this.#link = link;
    this.#pilot = pilot;
  }

  /** True if the person's input moves the robot. */
  get isDriving() {
    return this.mine && isArmed(this.seen) && !this.#isHidden;
  }

  /** True if a program has control. */
  get byProgram() {
    return !this.mine && this.seen?.holder_role === "program";
  }

  /** Begin a new connection, without any state of the old one. */
  begin() {
    this.#seq = 0;
    this.seen = null;
    this.mine = false;
    this.#isTaking = false;
    this.#pilot.letGo();
    this.#link.send("acknowledge");
  }

  /** Handle an observation, and answer it. */
  observe(observation) {
    const nowMs = performance.now();
    const wasDriving = this.isDriving;
    const wasArmed = isArmed(this.seen);
    const pauseMs = nowMs - this.#seenMs;
    this.#seenMs = nowMs;
    this.seen = observation;
    this.mine = observation.mine;
    if (wasDriving && pauseMs > PAUSE_MS) {
      this.#pilot.letGo();
      this.#note("The robot sent nothing for a while: let go, and press again to drive on.");
    }
    // An input that was held while another person armed the robot must not drive it.
    if (isArmed(observation) && !wasArmed) {
      if (nowMs - this.#armMs > ARMED_MS) this.#pilot.letGo();
      this.#armMs = -Infinity;
    }
    if (!this.isDriving) this.#pilot.follow(observation.action_applied);
    if (this.isDriving) this.#command();
    else this.#link.send("acknowledge", { seq: observation.seq });
  }

  /** Handle a change of control. */
  onLease({ mine }) {
    this.mine = mine;
    this.#isTaking = false;
    if (this.isDriving) this.#command();
  }

  /** Handle a change of the person's input. */
  changed() {
    if (this.isDriving) {
      const isRest = !this.#pilot.isAsking;
      if (isRest || performance.now() - this.#saidMs >= LEAST_MS) this.#command();
    } else if (this.#pilot.isAsking && this.byProgram && this.seen.armed && !this.#isTaking) {
      // Moving the stick while a program drives takes control at once.
      this.take();
    }
  }

  /** Stop the robot, even without control of it. */
  stop(reason) {
    this.#pilot.letGo();
    this.#link.send("emergencystop", { reason });
  }

  /** Take control; resolves to true if the robot gave it. */
  async take() {
    if (this.mine) return true;
    this.#isTaking = true;
    const lease = nextMessage(this.#link, "lease", LEASE_MS);
    this.#link.send("take");
    if (!(await lease)) this.#note("The robot did not answer in time: try again.");
    this.#isTaking = false;
    return this.mine;
  }

  /** Take control, and arm the robot. */
  async arm() {
    this.#pilot.letGo();
    if (await this.take()) this.#arm();
  }

  /** Arm the robot for the client in control. */
  armForHolder() {
    this.#pilot.letGo();
    this.#arm();
  }

  #arm() {
    if (!this.seen) return;
    this.#armMs = performance.now();
    this.#link.send("arm", { answers: this.seen.seq, emergency: this.seen.emergencies });
  }

  /** Disarm the robot. */
  disarm() {
    this.#pilot.letGo();
    if (this.isDriving) this.#command();
    this.#link.send("disarm");
  }

  /** Give control to a waiting program, and arm the robot for it. */
  async handOver() {
    this.#pilot.letGo();
    if (this.mine) this.#link.send("release");
    const untilMs = performance.now() + TAKEN_WITHIN_MS;
    while (performance.now() < untilMs) {
      const observation = await nextMessage(this.#link, "observation", TAKEN_WITHIN_MS);
      if (observation?.holder_role === "program") {
        this.#arm();
        const back = letterAt("KeyE");
        this.#note(`${observation.holder} drives from now on. Space stops it, ${back} takes it back.`);
        return;
      }
    }
    this.#note("No program waits for control: start one, and try again while its reset waits.");
  }

  /** Ignore all held inputs until they are let go and used again. */
  letGo() {
    this.#pilot.letGo();
    if (this.isDriving) this.#command();
  }

  /** Handle a hidden page: disarm the robot if this page has control; a program drives on. */
  hide(isHidden) {
    if (isHidden && this.mine) this.disarm();
    if (isHidden) this.#pilot.letGo();
    this.#isHidden = isHidden;
  }

  #command() {
    this.#seq += 1;
    this.#saidMs = performance.now();
    const { scale } = this;
    const values = this.#pilot.values(scale);
    this.#link.send("command", { seq: this.#seq, answers: this.seen.seq, values, scale });
  }

  #note(text) {
    this.dispatchEvent(new CustomEvent("note", { detail: text }));
  }
}

function isArmed(seen) {
  return Boolean(seen?.armed && !seen.emergency);
}

/** Resolve to the next message of a type, or null after the time limit. */
function nextMessage(link, kind, withinMs) {
  return new Promise((resolve) => {
    const done = (event) => {
      clearTimeout(timer);
      link.removeEventListener(kind, done);
      resolve(event?.detail ?? null);
    };
    const timer = setTimeout(done, withinMs);
    link.addEventListener(kind, done);
  });
}
