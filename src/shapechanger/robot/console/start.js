// Loads the page. If a part fails to load over a bad radio, the page is reloaded, because a browser
// does not request a failed part again.

const MOST_TRIES = 5;
const PAUSE_MS = 1_000;
const TRIES = "tries";

const tries = Number(sessionStorage.getItem(TRIES));

try {
  await import("./main.js");
  sessionStorage.removeItem(TRIES);
} catch (error) {
  const again = tries < MOST_TRIES;
  sessionStorage.setItem(TRIES, again ? tries + 1 : 0);
  document.getElementById("connection").textContent = again
    ? "Part of the page failed to load. Trying again…"
    : "Part of the page failed to load. Is the robot in reach? Reload the page.";
  if (again) setTimeout(() => location.reload(), PAUSE_MS);
  else throw error;
}
