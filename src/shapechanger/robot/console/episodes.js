// Recordings: shows an episode, and marks a range of its steps as bad or good.

import { find, label, make, setText } from "./dom.js";
import { Episode } from "./episode.js";
import { displayName, formatSigned } from "./layout.js";
import { draw } from "./picture.js";

const PLAY_MS = 50;

export class Episodes {
  #link;
  #dialog = find("episodes");
  #canvas = find("episode-picture");
  #context = this.#canvas.getContext("2d", { alpha: false });
  #scrub = find("scrub");
  #summaries = [];
  #actions = [];
  #episode = null;
  #range = [0, 0];
  #timer = 0;
  #isFetching = false;
  #drawing = 0;

  /** `opened` is called before the dialog covers the robot's picture. */
  constructor(link, opened) {
    this.#link = link;
    find("browse").addEventListener("click", () => {
      opened();
      this.#open();
    });
    find("episodes-close").addEventListener("click", () => this.#dialog.close());
    this.#dialog.addEventListener("close", () => this.#forget());
    this.#scrub.addEventListener("input", () => this.#look());
    find("play").addEventListener("click", () => this.#play(!this.#timer));
    find("range-from").addEventListener("click", () => this.#setRange(0));
    find("range-to").addEventListener("click", () => this.#setRange(1));
    find("judge-bad").addEventListener("click", () => this.#judge(false));
    find("judge-good").addEventListener("click", () => this.#judge(true));
    link.addEventListener("recordings", ({ detail }) => this.#list(detail));
    link.addEventListener("piece", ({ detail }) => this.#take(detail));
    link.addEventListener("refused", ({ detail }) => {
      if (!this.#dialog.open || detail.seq !== null) return;
      this.#isFetching = false;
      setText(find("episodes-state"), detail.reason);
    });
  }

  /** Set the names of the robot's actions. */
  begin(actions) {
    this.#actions = actions;
    this.#isFetching = false;
  }

  /** Close the dialog after the connection ended. */
  close() {
    this.#dialog.close();
  }

  #open() {
    this.#forget();
    this.#summaries = [];
    find("episode-list").replaceChildren();
    find("viewer").hidden = true;
    setText(find("episodes-state"), "Looking…");
    this.#dialog.showModal();
    this.#link.send("browse");
  }

  #forget() {
    this.#play(false);
    this.#episode = null;
    this.#isFetching = false;
  }

  #list({ episodes, more }) {
    if (!this.#dialog.open) return;
    const judged = episodes.length === 1 && this.#summaries.find(({ id }) => id === episodes[0].id);
    if (judged) {
      Object.assign(judged, episodes[0]);
    } else {
      this.#summaries = [...this.#summaries, ...episodes];
    }
    const items = this.#summaries.map((each) => make("li", {}, this.#button(each)));
    if (more) items.push(make("li", {}, this.#older()));
    find("episode-list").replaceChildren(...items);
    if (!judged) {
      const count = this.#summaries.length;
      const words = count === 1 ? "1 episode." : `${count} episodes, newest first.`;
      setText(find("episodes-state"), count ? words : "No episodes yet.");
    }
  }

  #button(summary) {
    const { id, steps, kept, seconds, created, driver, outcome, closed } = summary;
    const when = Number.isNaN(Date.parse(created)) ? id : new Date(created).toLocaleString();
    const facts = [`${seconds.toFixed(0)} s`, `${kept} of ${steps} steps good`, driver, outcome];
    if (!closed) facts.push("not closed");
    const words = facts.filter(Boolean).join(" · ");
    const button = make("button", { type: "button" }, make("strong", {}, when), make("span", {}, words));
    button.setAttribute("aria-pressed", String(this.#episode?.id === id));
    button.addEventListener("click", () => this.#show(summary, button));
    return button;
  }

  #older() {
    const button = make("button", { type: "button" }, "Older episodes");
    button.addEventListener("click", () => this.#link.send("browse", { before: this.#summaries.at(-1).id }));
    return button;
  }

  #show({ id, steps }, button) {
    this.#forget();
    for (const other of find("episode-list").querySelectorAll("button")) {
      other.setAttribute("aria-pressed", String(other === button));
    }
    this.#episode = new Episode(id, this.#actions);
    this.#range = [0, Math.max(0, steps - 1)];
    this.#scrub.max = Math.max(0, steps - 1);
    this.#scrub.value = 0;
    this.#context.clearRect(0, 0, this.#canvas.width, this.#canvas.height);
    find("viewer").hidden = false;
    this.#look();
    this.#fetch();
  }

  #fetch() {
    const missing = this.#episode?.missing(this.#scrub.valueAsNumber);
    if (!missing || this.#isFetching || !this.#dialog.open) return;
    this.#isFetching = this.#link.send("fetch", { episode: this.#episode.id, ...missing });
  }

  #take(piece) {
    this.#isFetching = false;
    if (piece.episode !== this.#episode?.id || !piece.lines.length) return;
    this.#episode.add(piece);
    const share = Math.floor(100 * this.#episode.share);
    setText(find("episodes-state"), share < 100 ? `Loading, ${share} %.` : "Loaded.");
    this.#scrub.max = Math.max(this.#scrub.max, this.#episode.steps.length - 1);
    this.#look();
    this.#fetch();
  }

  async #look() {
    const episode = this.#episode;
    if (!episode) return;
    const step = this.#scrub.valueAsNumber;
    setText(find("scrub-label"), `Step ${step} of ${Number(this.#scrub.max) + 1}`);
    this.#showRange();
    const seen = episode.steps[step];
    if (!seen) {
      setText(find("step-state"), "Loading…");
      this.#fetch();
      return;
    }
    const action = (values) =>
      values?.map((value, i) => `${displayName(episode.actions[i] ?? `${i}`)} ${formatSigned(value)}`).join(", ");
    const parts = [`${seen.driver}: ${action(seen.action)}`];
    if (seen.applied) parts.push(`applied: ${action(seen.applied)}`);
    if (seen.wanted) parts.push(`policy wanted: ${action(seen.wanted)}`);
    if (episode.isBad(step)) parts.push("bad");
    if (episode.marks.has(step)) parts.push(`marked ${episode.marks.get(step)}`.trim());
    if (seen.stop_reason) parts.push(seen.stop_reason);
    setText(find("step-state"), parts.join(" · "));
    await this.#draw(episode.picture(step));
  }

  async #draw(picture) {
    if (!picture) return;
    this.#drawing += 1;
    const mine = this.#drawing;
    try {
      const bitmap = await createImageBitmap(picture);
      if (mine === this.#drawing) draw(this.#canvas, this.#context, bitmap);
      else bitmap.close();
    } catch {
      setText(find("step-state"), "The picture of this step is damaged.");
    }
  }

  #play(isOn) {
    clearInterval(this.#timer);
    this.#timer = 0;
    find("play").setAttribute("aria-pressed", String(isOn));
    label(find("play"), isOn ? "Pause" : "Play");
    if (!isOn) return;
    if (this.#scrub.value === this.#scrub.max) this.#scrub.value = 0;
    this.#timer = setInterval(() => {
      if (!this.#episode?.steps[this.#scrub.valueAsNumber]) return; // Wait for the pending pieces.
      if (this.#scrub.value === this.#scrub.max) this.#play(false);
      this.#scrub.value = this.#scrub.valueAsNumber + 1;
      this.#look();
    }, PLAY_MS);
  }

  #setRange(end) {
    this.#range[end] = this.#scrub.valueAsNumber;
    if (this.#range[0] > this.#range[1]) this.#range[1 - end] = this.#range[end];
    this.#showRange();
  }

  #showRange() {
    const [first, last] = this.#range;
    setText(find("range-text"), `Range: steps ${first} to ${last}.`);
    const most = Math.max(1, Number(this.#scrub.max) + 1);
    const span = (element, from, to) => {
      element.style.left = `${(100 * from) / most}%`;
      element.style.width = `${(100 * (to + 1 - from)) / most}%`;
    };
    span(find("range-now"), first, last);
    const bars = (this.#episode?.bad ?? []).map(([from, to]) => {
      const bar = make("span");
      span(bar, from, to);
      return bar;
    });
    find("range-bad").replaceChildren(...bars);
  }

  #judge(keep) {
    const { id } = this.#episode ?? {};
    if (!id) return;
    const [first, last] = this.#range;
    if (!this.#link.send("judge", { episode: id, first, last, keep })) return;
    setText(find("episodes-state"), `Steps ${first} to ${last} are ${keep ? "good again" : "bad"}.`);
    // The robot appends a line to the episode for the new mark.
    this.#link.addEventListener("recordings", () => this.#again(id), { once: true });
  }

  /** Fetch the appended lines. */
  #again(id) {
    if (this.#episode?.id !== id) return;
    this.#episode.grow();
    this.#fetch();
  }
}
