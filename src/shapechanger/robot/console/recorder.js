// Recorder: on and off, marks, and undo of the last five seconds.

import { find, label, setText } from "./dom.js";

const UNDO_S = 5;

export class Recorder {
  #link;
  #log;
  #state = null;

  constructor(link, log) {
    this.#link = link;
    this.#log = log;
    find("record").addEventListener("click", () => this.toggle());
    find("mark").addEventListener("click", () => this.mark());
    find("undo").addEventListener("click", () => this.undo());
    link.addEventListener("recorderstate", ({ detail }) => this.#show(detail));
  }

  /** Begin a connection; the robot may be unable to record. */
  begin(canRecord) {
    find("recording").hidden = !canRecord;
    this.#show({ episode: "", recording: false, steps: 0, dropped: 0, seconds: 0, marks: 0, text: "" });
  }

  toggle() {
    if (!find("recording").hidden) this.#link.send("record", { on: !this.#state.recording });
  }

  mark() {
    if (this.#state?.recording) this.#link.send("mark");
  }

  undo() {
    if (this.#state?.recording) this.#link.send("undo", { seconds: UNDO_S });
  }

  #show(state) {
    if (state.text && state.text !== this.#state?.text) this.#log.add(state.text, "trouble");
    this.#state = state;
    const button = find("record");
    button.setAttribute("aria-pressed", String(state.recording));
    label(button, state.recording ? "End recording" : "Record");
    find("mark").disabled = !state.recording;
    find("undo").disabled = !state.recording;
    document.body.dataset.recording = String(state.recording);
    // Screen readers do not announce the numbers, which change each second.
    find("recorder-state").setAttribute("aria-live", state.recording ? "off" : "polite");
    const counts = [`${state.steps} steps`, `${state.seconds.toFixed(0)} s`];
    if (state.dropped) counts.push(`${state.dropped} undone`);
    if (state.marks) counts.push(state.marks === 1 ? "1 mark" : `${state.marks} marks`);
    const what = state.recording ? "Recording" : state.episode ? "Recorded" : "";
    setText(find("recorder-state"), what ? `${what}: ${counts.join(" · ")}` : "Not recording.");
  }
}
