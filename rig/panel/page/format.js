/** Numbers as a person reads them from two metres: fixed places, a true minus, a dash for nothing. */

const NOTHING = "–";

export function isNumber(value) {
  return typeof value === "number" && Number.isFinite(value);
}

export function number(value, places) {
  if (!isNumber(value)) return NOTHING;
  const text = Math.abs(value).toFixed(places);
  // What rounds to zero has no sign: a flickering minus would look like news.
  return value < 0 && Number(text) !== 0 ? `−${text}` : text;
}

/** Three significant digits or so, for values of any size. */
export function short(value) {
  if (!isNumber(value)) return NOTHING;
  return rounded(value).replace(/(\.\d*?)0+$/, "$1").replace(/\.$/, "");
}

function rounded(value) {
  const size = Math.abs(value);
  if (size >= 100) return number(value, 0);
  if (size >= 10) return number(value, 1);
  return number(value, size === 0 || size >= 1 ? 2 : 3);
}

/** "3.2 s", "48 s", "3 min", "2 h". */
export function age(seconds) {
  if (!isNumber(seconds)) return NOTHING;
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 120) return `${Math.round(seconds)} s`;
  if (seconds < 7200) return `${Math.round(seconds / 60)} min`;
  return `${Math.round(seconds / 3600)} h`;
}

/** Local time of day, hh:mm:ss. */
export function clock(date) {
  const two = (part) => String(part).padStart(2, "0");
  return `${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}`;
}

/** A unit vector in words: "+x", "−y", or its components. */
export function vector(v) {
  if (!Array.isArray(v) || v.length !== 3 || !v.every(isNumber)) return NOTHING;
  const axis = v.findIndex((part) => Math.abs(Math.abs(part) - 1) < 1e-6);
  if (axis >= 0) return (v[axis] > 0 ? "+" : "−") + "xyz"[axis];
  return `(${v.map((part) => number(part, 2)).join(", ")})`;
}
