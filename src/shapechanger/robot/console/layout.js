// Features of commands and states, from the robot's layouts.

const UNITS = { 1: "", rad: "rad", "m/s": "m/s", "m/s^2": "m/s²", degC: "°C" };

/** Return name, unit, low and high (infinite if unbounded) of each number of a layout. */
export function features(json) {
  if (!json) return [];
  return JSON.parse(json).features.flatMap((feature) => {
    const { name, unit, low = -Infinity, high = Infinity, shape = [] } = feature;
    const size = shape.reduce((product, n) => product * n, 1);
    const shown = UNITS[unit] ?? unit;
    if (size === 1) return [{ name, unit: shown, low, high }];
    return Array.from({ length: size }, (_, i) => ({ name: `${name} ${i + 1}`, unit: shown, low, high }));
  });
}

/** Return a display name: "wheel_speed" is "wheel speed". */
export function displayName(name) {
  return name.replace(/[_/]+/g, " ");
}

/** Format a changing number with few digits; "–" for NaN. */
export function formatNumber(value, unit = "") {
  if (value === null || !Number.isFinite(value)) return "–";
  const digits = Math.abs(value) >= 100 ? 0 : Math.abs(value) >= 10 ? 1 : 2;
  const text = value.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace("-", "−");
  return unit ? `${text} ${unit}` : text;
}

/** Format a value with its sign. */
export function formatSigned(value) {
  if (value === undefined || !Number.isFinite(value)) return "–";
  const text = formatNumber(value);
  return value > 0 && /[1-9]/.test(text) ? `+${text}` : text;
}

/** Return the difference, ms, of two times of one clock, ns, which are Numbers or BigInts. */
export function msBetween(earlierNs, laterNs) {
  if (typeof earlierNs === "number" && typeof laterNs === "number") return (laterNs - earlierNs) / 1e6;
  return Number(BigInt(laterNs) - BigInt(earlierNs)) / 1e6;
}
