// Keys other than those that drive. Space and Escape stop the robot with the focus anywhere.

import { isTyping } from "./keys.js";

const STOPS = new Set(["Space", "Escape"]);

/** `actions` maps keys to functions; `stop` is called for Space and Escape while `isLive()`. */
export function listen(stop, isLive, actions) {
  const stops = (event) => isLive() && STOPS.has(event.code) && !isTyping(event);
  // Capture the key before any element: Space on a button must stop the robot.
  addEventListener(
    "keydown",
    (event) => {
      if (!stops(event)) return;
      if (event.code === "Space") {
        event.preventDefault();
        event.stopPropagation();
      }
      if (!event.repeat) stop(event.code === "Space" ? "Space was pressed." : "Escape was pressed.");
    },
    { capture: true },
  );
  addEventListener(
    "keyup",
    (event) => {
      if (stops(event) && event.code === "Space") event.preventDefault(); // Firefox clicks on key-up.
    },
    { capture: true },
  );
  addEventListener("keydown", (event) => {
    const { key, repeat, ctrlKey, metaKey, altKey } = event;
    if (!isLive() || repeat || ctrlKey || metaKey || altKey || isTyping(event)) return;
    if (document.querySelector("dialog[open]")) return;
    const action = actions[key.length === 1 ? key.toLowerCase() : key];
    if (!action) return;
    event.preventDefault();
    action();
  });
}
