// One recorded episode, which is fetched in pieces, beginning around the step that is shown.

const AT_ONCE = 40; // Number of lines in a piece: about two seconds.

export class Episode {
  #lines = [];
  #pictures = new Map();
  #total = null;
  #verdicts = null;

  /** Fetched steps, indexed by their number. */
  steps = [];

  /** Marks, keyed by the number of their step. */
  marks = new Map();

  constructor(id, actions) {
    this.id = id;
    this.actions = actions; // Names of the actions, until the header has arrived.
  }

  /** Return the next range of lines to fetch, nearest to a step; null if all are fetched. */
  missing(place) {
    if (this.#total === null) return { first: 0, count: AT_ONCE };
    const from = (start) => {
      for (let line = start; line < this.#total; line += 1) if (!this.#lines[line]) return line;
      return null;
    };
    const first = from(Math.min(place, this.#total - 1)) ?? from(0);
    return first === null ? null : { first, count: AT_ONCE };
  }

  /** Note that there is at least one more line. */
  grow() {
    if (this.#total !== null) this.#total += 1;
  }

  /** The fetched share, 0 to 1. */
  get share() {
    return this.#total ? this.#lines.reduce((sum) => sum + 1, 0) / this.#total : this.#total === 0 ? 1 : 0;
  }

  /** Add a piece. */
  add(piece) {
    this.#total = piece.total;
    this.#verdicts = null;
    if (piece.header) this.actions = names(piece.header) ?? this.actions;
    piece.lines.forEach((text, i) => {
      const line = JSON.parse(text);
      this.#lines[piece.first + i] = line;
      const jpeg = piece.frames[i];
      if (line.kind === "step") {
        this.steps[line.step] = line;
        if (jpeg) this.#pictures.set(line.frame[0], new Blob([jpeg], { type: "image/jpeg" }));
      } else if (line.kind === "mark") {
        this.marks.set(line.step, line.text);
      }
    });
  }

  /** Return true if a step is dropped. */
  isBad(step) {
    this.#verdicts ??= this.#judged();
    return this.#verdicts[step] ?? false;
  }

  /** Return ranges of dropped steps, as pairs of first and last. */
  get bad() {
    const bad = [];
    this.steps.forEach((_, step) => {
      if (!this.isBad(step)) return;
      const newest = bad.at(-1);
      if (newest?.[1] === step - 1) newest[1] = step;
      else bad.push([step, step]);
    });
    return bad;
  }

  #judged() {
    const verdicts = new Array(this.steps.length).fill(false);
    this.#lines.forEach(({ kind, first, last }) => {
      if (kind === "drop" || kind === "keep") verdicts.fill(kind === "drop", first, last + 1);
    });
    return verdicts;
  }

  /** Return the frame of a step as a Blob; null if it has none or it is not fetched yet. */
  picture(step) {
    const name = this.steps[step]?.frame?.[0];
    return (name && this.#pictures.get(name)) || null;
  }
}

function names(header) {
  const layout = JSON.parse(header).action_layout;
  if (!layout) return null;
  return (typeof layout === "string" ? JSON.parse(layout) : layout).features.map(({ name }) => name);
}
