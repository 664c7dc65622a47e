// Loads the page. What a bad radio did not bring is asked for again, by loading the page anew: a
// browser does not ask twice for a part that failed.

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
    ? "The page did not come whole. Trying again…"
    : "The page did not come whole: is the robot in reach? Load it again.";
  if (again) setTimeout(() => location.reload(), PAUSE_MS);
  else throw error;
}
