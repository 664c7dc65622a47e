// Helpers to find and fill elements.

/** Return the element of an id, which must exist. */
export function find(id) {
  const found = document.getElementById(id);
  if (!found) throw new Error(`The page has no #${id}.`);
  return found;
}

/** Make an element with attributes and children. */
export function make(name, attributes = {}, ...inside) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...inside);
  return made;
}

/** Set a text, unless it is the same: a screen reader would read it again. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Set the text of a button that also shows its key. */
export function label(button, text) {
  const words = button.firstChild;
  if (words.nodeValue.trim() !== text) words.nodeValue = button.childElementCount ? `${text} ` : text;
}
