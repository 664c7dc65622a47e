// Numbers of the state, with their units and sources.

import { find, make, setText } from "./dom.js";
import { displayName, formatNumber } from "./layout.js";

export class Readings {
  #features;
  #cells = new Map();

  constructor(features) {
    this.#features = features;
    const list = find("readings");
    list.replaceChildren();
    features.forEach(({ name }, index) => {
      if (name.endsWith("/applied")) return; // Shown with the actions.
      const value = make("dd");
      list.append(make("div", {}, make("dt", {}, displayName(name)), value));
      this.#cells.set(index, value);
    });
    find("sensed").hidden = this.#cells.size === 0;
  }

  show({ state, sources }) {
    for (const [index, cell] of this.#cells) {
      const { name } = this.#features[index];
      setText(cell, formatValue(state[index], this.#features[index]));
      const source = sources[name] ?? "";
      cell.dataset.source = source;
      cell.title = source === "absent" ? "Not measured." : source && `from ${source}`;
    }
    const battery = this.#features.findIndex(({ name }) => name === "battery");
    find("battery-fact").hidden = battery < 0;
    if (battery >= 0) setText(find("battery"), formatNumber(state[battery], this.#features[battery].unit));
  }
}

/** Format a number with its unit, and a yes-or-no value as a word. */
function formatValue(value, { unit, low, high }) {
  if (!unit && low === 0 && high === 1 && (value === 0 || value === 1)) return value ? "yes" : "no";
  return formatNumber(value, unit);
}
