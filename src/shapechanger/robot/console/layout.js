// What each number of a command and of a state means, from the robot's layouts.

const UNITS = { 1: "", rad: "rad", "m/s": "m/s", "m/s^2": "m/s²", degC: "°C" };

/** The single numbers of a layout in order: name, unit, low and high (infinite where there is none). */
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

/** A name for people: "wheel_speed" is "wheel speed". */
export function inWords(name) {
  return name.replace(/[_/]+/g, " ");
}

/** A number with so many digits as can be read while it changes; "–" for one that nobody measures. */
export function shown(value, unit = "") {
  if (value === null || !Number.isFinite(value)) return "–";
  const digits = Math.abs(value) >= 100 ? 0 : Math.abs(value) >= 10 ? 1 : 2;
  const text = value.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace("-", "−");
  return unit ? `${text} ${unit}` : text;
}

/** A value with its sign, as for a command. */
export function signed(value) {
  if (value === undefined || !Number.isFinite(value)) return "–";
  const text = shown(value);
  return value > 0 && /[1-9]/.test(text) ? `+${text}` : text;
}

/** The difference of two times of one clock in ms; each is a Number or a BigInt of nanoseconds. */
export function msBetween(earlierNs, laterNs) {
  if (typeof earlierNs === "number" && typeof laterNs === "number") return (laterNs - earlierNs) / 1e6;
  return Number(BigInt(laterNs) - BigInt(earlierNs)) / 1e6;
}
