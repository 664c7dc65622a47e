// Letters of the person's keyboard, which are shown for the positions of keys.

import { find, setText } from "./dom.js";

let layout = null;

const SIGNS = { Equal: "=", Minus: "-" };

/** Return the letter at a position, such as "Z" for "KeyW" on AZERTY; QWERTY by default. */
export function letterAt(code) {
  const letter = layout?.get(code) ?? SIGNS[code] ?? code.replace(/^Key/, "");
  return letter.length === 1 ? letter.toUpperCase() : letter;
}

/** Show the keys of an element; their codes are separated by spaces. */
export function showKeys(element, codes = element.dataset.keys) {
  element.dataset.keys = codes;
  const letters = codes.split(" ").map(letterAt);
  element.setAttribute("aria-keyshortcuts", letters.join(" "));
  const shown = element.querySelector("kbd");
  if (shown) setText(shown, letters[0]);
}

/** Show the letters of the present keyboard layout, if the browser reports it. */
export async function learnLetters() {
  try {
    layout = (await navigator.keyboard?.getLayoutMap?.()) ?? null;
  } catch {
    return; // The browser may refuse to report the layout.
  }
  for (const element of document.querySelectorAll("[data-keys]")) showKeys(element);
  const drives = ["KeyW", "KeyA", "KeyS", "KeyD"].map(letterAt).join(" ");
  find("stage").setAttribute("aria-label", `Driving: ${drives} or the arrow keys drive, Space stops everything`);
}
