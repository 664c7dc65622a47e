// The form for the key, which may also come from the address or from this tab.

import { find, tell } from "./dom.js";
import { parseKey } from "./proof.js";

const KEPT = "shapechanger-key";

/** Take the key out of the address; "" for none. */
export function keyFromAddress() {
  const fields = new URLSearchParams(location.hash.slice(1));
  const key = fields.get("key") ?? "";
  if (location.hash) history.replaceState(null, "", location.pathname + location.search);
  return key;
}

/** Return the key that this tab keeps; "" for none. */
export function keptKey() {
  return sessionStorage.getItem(KEPT) ?? "";
}

/** Keep a key in this tab until it is closed; "" deletes it. */
export function keepKey(key) {
  if (key) sessionStorage.setItem(KEPT, key);
  else sessionStorage.removeItem(KEPT);
}

/** Return the default name of the person. */
export function someName() {
  const isPhone = matchMedia("(pointer: coarse)").matches;
  return isPhone ? "Phone" : "Computer";
}

export class Door {
  #key = find("key");

  /** `enter` is called with a key and a name; it may throw an Error to show. */
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

  /** Show the form, with the text of the last attempt. */
  show(key = "") {
    if (key) this.#key.value = key;
    find("enter").disabled = false;
    this.#key.focus();
  }

  /** Show the error in the key. */
  complain(text) {
    tell(find("key-trouble"), text);
    this.#key.setAttribute("aria-invalid", "true");
    this.#key.focus();
  }

  /** Show why this page cannot connect at all. */
  bar(text) {
    find("key-form").hidden = true;
    find("no-way").hidden = false;
    tell(find("no-way"), text);
  }
}
