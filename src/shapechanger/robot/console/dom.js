// Finding and filling elements.

/** The element of an id; the page has them all. */
export function find(id) {
  const found = document.getElementById(id);
  if (!found) throw new Error(`The page has no #${id}.`);
  return found;
}

/** A new element with its attributes and what is in it. */
export function make(name, attributes = {}, ...inside) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...inside);
  return made;
}

/** Set a text, and touch the page only if it is another one: a screen reader would read it again. */
export function tell(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Set the words of a button that also shows its key. */
export function label(button, text) {
  const words = button.firstChild;
  if (words.nodeValue.trim() !== text) words.nodeValue = button.childElementCount ? `${text} ` : text;
}
