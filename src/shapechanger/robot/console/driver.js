// Who drives, and what is said to the robot: one answer to each observation, and stops at once.

const TAKEN_WITHIN_MS = 2_000; // A program that waits takes a robot that is free within a moment.
const LEASE_MS = 2_000;
const PAUSE_MS = 1_000; // After a pause as long as this, what was held before it is not meant any more.
const LEAST_MS = 15; // Between commands that nobody asked for but a moving stick.

/** Fires `note` (detail: a sentence) when something did not come about. */
export class Driver extends EventTarget {
  #link;
  #pilot;
  #seq = 0;
  #seenMs = 0;
  #saidMs = 0;
  #isTaking = false;
  #isHidden = false;

  /** The newest observation; null for none. */
  seen = null;

  /** Whether this page holds the command. */
  mine = false;

  /** Largest share of what the robot allows, 0.1 to 1. */
  scale = 0.5;

  constructor(link, pilot) {
    super();
    this.#link = link;
    this.#pilot = pilot;
  }

  /** Whether what the person does moves the robot. */
  get isDriving() {
    return Boolean(this.mine && this.seen?.armed && !this.seen.emergency && !this.#isHidden);
  }

  /** Whether a program holds the command. */
  get byProgram() {
    return !this.mine && this.seen?.holder_role === "program";
  }

  /** Begin with a new connection: nothing of an old one goes on. */
  begin() {
    this.#seq = 0;
    this.seen = null;
    this.mine = false;
    this.#isTaking = false;
    this.#pilot.letGo();
    this.#link.say("acknowledge");
  }

  /** Take an observation, and answer it. */
  observe(observation) {
    const nowMs = performance.now();
    const wasDriving = this.isDriving;
    const pauseMs = nowMs - this.#seenMs;
    this.#seenMs = nowMs;
    this.seen = observation;
    this.mine = observation.mine;
    if (wasDriving && pauseMs > PAUSE_MS) {
      this.#pilot.letGo();
      this.#note("Nothing came from the robot for a while: let go, and press again to drive on.");
    }
    if (!this.isDriving) this.#pilot.follow(observation.action_applied);
    if (this.isDriving) this.#command();
    else this.#link.say("acknowledge", { seq: observation.seq });
  }

  /** Somebody else or nobody commands, or this page does. */
  onLease({ mine }) {
    this.mine = mine;
    this.#isTaking = false;
    if (this.isDriving) this.#command();
  }

  /** The person does something else than before. */
  changed() {
    if (this.isDriving) {
      const isRest = !this.#pilot.isAsking;
      if (isRest || performance.now() - this.#saidMs >= LEAST_MS) this.#command();
    } else if (this.#pilot.isAsking && this.byProgram && this.seen.armed && !this.#isTaking) {
      // Whoever grasps the stick while a program drives wants to drive, at once.
      this.take();
    }
  }

  /** Everything stops, whoever drives. */
  stop(reason) {
    this.#pilot.letGo();
    this.#link.say("emergencystop", { reason });
  }

  /** Take the command; whether it was given. */
  async take() {
    if (this.mine) return true;
    this.#isTaking = true;
    const lease = heard(this.#link, "lease", LEASE_MS);
    this.#link.say("take");
    if (!(await lease)) this.#note("The robot does not answer in time: try again.");
    this.#isTaking = false;
    return this.mine;
  }

  /** Take the command, and let the outputs move. */
  async arm() {
    this.#pilot.letGo();
    if (await this.take()) this.armAsItIs();
  }

  /** Let the outputs move for whoever holds the command. */
  armAsItIs() {
    if (!this.seen) return;
    this.#link.say("arm", { answers: this.seen.seq, emergency: this.seen.emergencies });
  }

  /** Keep the outputs at rest. */
  disarm() {
    this.#pilot.letGo();
    if (this.isDriving) this.#command();
    this.#link.say("disarm");
  }

  /** Give the robot to a program that waits for it, and arm it for that. */
  async handOver() {
    this.#pilot.letGo();
    if (this.mine) this.#link.say("release");
    const untilMs = performance.now() + TAKEN_WITHIN_MS;
    while (performance.now() < untilMs) {
      const observation = await heard(this.#link, "observation", TAKEN_WITHIN_MS);
      if (observation?.holder_role === "program") {
        this.armAsItIs();
        this.#note(`${observation.holder} drives from now on. Space stops it, E takes it back.`);
        return;
      }
    }
    this.#note("No program waits for the robot: start one, and try again while its reset waits.");
  }

  /** The person cannot steer now, such as while another window has the focus. */
  letGo() {
    this.#pilot.letGo();
    if (this.isDriving) this.#command();
  }

  /** Nobody sees the page: what this page drives stops and is disarmed; a program drives on. */
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
    this.#link.say("command", { seq: this.#seq, answers: this.seen.seq, values, scale });
  }

  #note(text) {
    this.dispatchEvent(new CustomEvent("note", { detail: text }));
  }
}

/** The next message of a kind; null when none comes in time. */
function heard(link, kind, withinMs) {
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
