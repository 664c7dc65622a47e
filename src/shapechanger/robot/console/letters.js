// Letters of the person's keyboard, to show for keys that have a meaning by their place.

import { find, setText } from "./dom.js";

let layout = null;

const SIGNS = { Equal: "=", Minus: "-" };

/** Return the letter at a place, such as "Z" for "KeyW" on AZERTY; of QWERTY if it is unknown. */
export function letterAt(code) {
  const letter = layout?.get(code) ?? SIGNS[code] ?? code.replace(/^Key/, "");
  return letter.length === 1 ? letter.toUpperCase() : letter;
}

/** Show the keys of an element, or change them; the codes are separated by spaces. */
export function showKeys(element, codes = element.dataset.keys) {
  element.dataset.keys = codes;
  const letters = codes.split(" ").map(letterAt);
  element.setAttribute("aria-keyshortcuts", letters.join(" "));
  const shown = element.querySelector("kbd");
  if (shown) setText(shown, letters[0]);
}

/** Show the letters of the present layout, where the browser tells it. */
export async function learnLetters() {
  try {
    layout = (await navigator.keyboard?.getLayoutMap?.()) ?? null;
  } catch {
    return; // The browser may withhold it.
  }
  for (const element of document.querySelectorAll("[data-keys]")) showKeys(element);
  const drives = ["KeyW", "KeyA", "KeyS", "KeyD"].map(letterAt).join(" ");
  find("stage").setAttribute("aria-label", `Driving: ${drives} or the arrow keys drive, Space stops everything`);
}
