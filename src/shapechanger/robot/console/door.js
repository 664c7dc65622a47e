// The form for the key, and where a key may come from: the address, this tab, or a person.

import { find, tell } from "./dom.js";
import { parseKey } from "./proof.js";

const KEPT = "shapechanger-key";

/** The key in the address, which is taken out of it at once; "" for none. */
export function keyFromAddress() {
  const fields = new URLSearchParams(location.hash.slice(1));
  const key = fields.get("key") ?? "";
  if (location.hash) history.replaceState(null, "", location.pathname + location.search);
  return key;
}

/** The key that this tab keeps; "" for none. */
export function keptKey() {
  return sessionStorage.getItem(KEPT) ?? "";
}

/** Keep a key in this tab until it is closed; "" for no more. */
export function keepKey(key) {
  if (key) sessionStorage.setItem(KEPT, key);
  else sessionStorage.removeItem(KEPT);
}

/** Who this is, if they do not say. */
export function someName() {
  const isPhone = matchMedia("(pointer: coarse)").matches;
  return isPhone ? "Somebody with a phone" : "Somebody at a computer";
}

export class Door {
  #key = find("key");

  /** `enter` is called with a key and a name; it may throw an Error in words. */
  constructor(enter) {
    find("name").value = someName();
    find("key-form").addEventListener("submit", (event) => {
      event.preventDefault();
      const key = this.#key.value;
      try {
        parseKey(key);
        tell(find("key-trouble"), "");
        if (find("remember").checked) keepKey(key);
        enter(key, find("name").value.trim() || someName());
      } catch (error) {
        this.complain(error.message);
      }
    });
  }

  /** Show the form, with what was typed before still in it. */
  show(key = "") {
    if (key) this.#key.value = key;
    find("enter").disabled = false;
    this.#key.focus();
  }

  /** Say what is wrong with the key. */
  complain(text) {
    tell(find("key-trouble"), text);
    this.#key.setAttribute("aria-invalid", "true");
    this.#key.focus();
  }

  /** Nobody can come in from here, and why. */
  bar(text) {
    find("key-form").hidden = true;
    find("no-way").hidden = false;
    tell(find("no-way"), text);
  }
}
