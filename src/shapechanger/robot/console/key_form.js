// The form for the key, which may also be in the page's address or stored in this tab.

import { find, setText } from "./dom.js";
import { parseKey } from "./proof.js";

const KEPT = "shapechanger-key";

/** Remove the key from the page's address, and return it; "" for none. */
export function keyFromAddress() {
  const fields = new URLSearchParams(location.hash.slice(1));
  const key = fields.get("key") ?? "";
  if (location.hash) history.replaceState(null, "", location.pathname + location.search);
  return key;
}

/** Return the key that is stored in this tab; "" for none. */
export function keptKey() {
  return sessionStorage.getItem(KEPT) ?? "";
}

/** Store a key in this tab until the tab is closed; "" deletes the stored key. */
export function keepKey(key) {
  if (key) sessionStorage.setItem(KEPT, key);
  else sessionStorage.removeItem(KEPT);
}

/** Return the default name of the person. */
export function defaultName() {
  const isPhone = matchMedia("(pointer: coarse)").matches;
  return isPhone ? "Phone" : "Computer";
}

export class KeyForm {
  #key = find("key");

  /** `enter` is called with a key and a name. It may throw an Error, whose message is shown. */
  constructor(enter) {
    find("name").value = defaultName();
    find("key-form").addEventListener("submit", (event) => {
      event.preventDefault();
      const key = this.#key.value;
      try {
        parseKey(key);
        setText(find("key-trouble"), "");
        if (find("remember").checked) keepKey(key);
        enter(key, find("name").value.trim() || defaultName());
      } catch (error) {
        this.showError(error.message);
      }
    });
  }

  /** Show the form with a key, and the reason why the connection ended. */
  show(key = "", why = "") {
    if (key) this.#key.value = key;
    setText(find("key-trouble"), why);
    find("enter").disabled = false;
    this.#key.focus();
  }

  /** Show the error in the key. */
  showError(text) {
    setText(find("key-trouble"), text);
    this.#key.setAttribute("aria-invalid", "true");
    this.#key.focus();
  }

  /** Show why this page cannot connect at all. */
  block(text) {
    find("key-form").hidden = true;
    find("blocked").hidden = false;
    setText(find("blocked"), text);
  }
}
