// Policies on the robot's computer: their names, the one that runs, and its state.

import { find, label, make, setText } from "./dom.js";

export class Policies {
  #link;
  #log;
  #state = { names: [], running: "", text: "" };

  constructor(link, log) {
    this.#link = link;
    this.#log = log;
    find("policy-run").addEventListener("click", () => this.#toggle());
    link.addEventListener("policystate", ({ detail }) => this.#show(detail));
  }

  /** Begin a connection; a robot with policies then sends their names. */
  begin() {
    find("policies").hidden = true;
    this.#state = { names: [], running: "", text: "" };
  }

  #toggle() {
    const { running } = this.#state;
    this.#link.send("runpolicy", { policy: running ? "" : find("policy-name").value });
  }

  #show(state) {
    const before = this.#state;
    this.#state = state;
    find("policies").hidden = false;
    const choice = find("policy-name");
    if (state.names.join("\n") !== before.names.join("\n")) {
      choice.replaceChildren(...state.names.map((name) => make("option", { value: name }, name)));
    }
    if (state.running) choice.value = state.running;
    choice.disabled = Boolean(state.running);
    const button = find("policy-run");
    label(button, state.running ? "End policy" : "Start policy");
    button.disabled = !state.running && !state.names.length;
    const none = state.names.length ? "None runs." : "The robot's folder has no policy.";
    setText(find("policy-state"), state.running ? `${state.running}: ${state.text}` : state.text || none);
    if (!state.running && state.text && state.text !== before.text) this.#log.add(state.text, "trouble");
  }
}
