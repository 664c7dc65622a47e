// Commanded, applied and suggested values: a line for each action, and marks on the stick.

import { find, make, setText } from "./dom.js";
import { displayName, formatSigned } from "./layout.js";
import { Pilot } from "./pilot.js";
import { place } from "./stick.js";

const UNMOVED_LOOKS = 10; // Observations without an effect after which a hint is shown.

export class Actions {
  #pilot;
  #rows;
  #names;
  #unmoved;
  #knob = find("knob");
  #wantedDot = find("wanted-dot");
  #appliedDot = find("applied-dot");

  constructor(features, pilot, changed) {
    this.#pilot = pilot;
    this.#names = features.map(({ name }) => name);
    this.#rows = features.map((feature, index) => row(feature, index, pilot, changed));
    find("actions").replaceChildren(...this.#rows.map(({ element }) => element));
    find("pad").hidden = !pilot.hasStick;
    this.#unmoved = features.map(() => 0);
    setText(find("pad-info"), "");
  }

  /** Show the person's command, from any device, on the stick. */
  showAsked() {
    const { steering, throttle } = this.#pilot.asked;
    place(this.#knob, steering, throttle);
  }

  /** Show an observation; `driving` is true while the person sets the sliders. */
  show(observation, driving) {
    const { action_applied: applied, commanded, suggested, holder_role: role } = observation;
    const isByProgram = !observation.mine && role === "program";
    // While a program drives, its command is shown as its suggestion.
    const wanted = suggested.length ? suggested : isByProgram ? commanded : [];
    const by = suggested.length ? observation.suggested_by : isByProgram ? observation.holder : "";
    this.#rows.forEach((each, index) => {
      each.show(observation.mine ? commanded[index] : undefined, applied[index], wanted[index]);
      if (each.slider && !driving) each.follow(this.#pilot.held(index));
    });
    find("legend-wanted").hidden = !wanted.length;
    if (wanted.length) setText(find("wanted-by"), by || "program");
    this.#hint(observation);
    this.#mark(this.#appliedDot, applied);
    this.#mark(this.#wantedDot, wanted);
  }

  /** Show a hint if a command has no effect and no refusal, for example below a threshold. */
  #hint({ mine, armed, stop_reason: reason, commanded, action_applied: applied }) {
    const isQuiet = mine && armed && !reason;
    let hint = "";
    this.#names.forEach((name, i) => {
      const asked = commanded[i] ?? 0;
      const isUnmoved = isQuiet && asked !== 0 && applied[i] === 0 && !Pilot.hasSlider(name);
      this.#unmoved[i] = isUnmoved ? this.#unmoved[i] + 1 : 0;
      if (this.#unmoved[i] < UNMOVED_LOOKS) return;
      hint = `A ${name} of ${formatSigned(asked)} moves nothing here: raise the cap.`;
    });
    setText(find("pad-info"), hint);
  }

  #mark(dot, values) {
    const steering = values[this.#names.indexOf("steering")];
    const throttle = values[this.#names.indexOf("throttle")];
    dot.hidden = steering === undefined && throttle === undefined;
    if (!dot.hidden) place(dot, steering ?? 0, throttle ?? 0);
  }
}

function row({ name, unit, low, high }, index, pilot, changed) {
  const least = Number.isFinite(low) ? low : -1;
  const most = Number.isFinite(high) ? high : 1;
  const words = displayName(name);
  const marks = Object.fromEntries(
    ["you", "applied", "wanted"].map((kind) => [kind, make("span", { class: `mark ${kind}`, hidden: "" })]),
  );
  const numbers = make("span", { class: "numbers" });
  const track = make("span", { class: "track", "aria-hidden": "true" }, ...Object.values(marks));
  const id = `action-${index}`;
  const slider = Pilot.hasSlider(name)
    ? make("input", { type: "range", id, min: least, max: most, step: (most - least) / 200 })
    : null;
  const label = make(slider ? "label" : "span", { class: "name", ...(slider && { for: id }) }, words);
  slider?.addEventListener("input", () => {
    pilot.hold(index, slider.valueAsNumber);
    changed();
  });
  const middle = least < 0 && most > 0 ? " centred" : "";
  const element = make("div", { class: `action${slider ? " slides" : middle}` }, label, track, numbers);
  if (slider) track.after(slider);
  return {
    element,
    slider,
    follow(value) {
      if (document.activeElement !== slider || !slider.matches(":active")) slider.value = value;
    },
    show(you, applied, wanted) {
      for (const [kind, value] of Object.entries({ you, applied, wanted })) {
        marks[kind].hidden = value === undefined;
        if (value === undefined) continue;
        const share = Math.max(0, Math.min(1, (value - least) / (most - least)));
        marks[kind].style.left = `${100 * share}%`;
      }
      const parts = [you, applied].map(formatSigned);
      const text = `${parts[0]} → ${parts[1]}${unit ? ` ${unit}` : ""}`;
      setText(numbers, wanted === undefined ? text : `${text} ◇ ${formatSigned(wanted)}`);
    },
  };
}
