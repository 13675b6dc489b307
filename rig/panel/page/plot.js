/**
 * Lines on a canvas, made for long runs that grow: what is drawn stays, new points are added, and
 * only a change of range, size, theme or data draws everything again, thinned to what pixels show.
 */

const SLACK = 0.05; // of a step of the range

/** Ticks at 1, 2 or 5 times a power of ten, about `count` of them within [from, to]. */
export function ticks(from, to, count) {
  const span = to - from;
  if (!(span > 0)) return [];
  const raw = span / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999);
  const found = [];
  for (let i = Math.ceil(from / step - 1e-9); i * step <= to + 1e-9 * span; i += 1) found.push(i * step);
  return found;
}

/** [from, to] widened to round numbers, so that a growing run seldom changes the axis. */
export function roundRange(from, to, least) {
  if (!(from <= to)) return [0, least];
  const middle = (from + to) / 2;
  const span = Math.max(to - from, least);
  const [low, high] = to - from < least ? [middle - span / 2, middle + span / 2] : [from, to];
  const step = 10 ** Math.floor(Math.log10(span)) / 2;
  // What lies a hair beyond a round number, as noise about zero does, opens no further step.
  return [Math.floor(low / step + SLACK) * step, Math.ceil(high / step - SLACK) * step];
}

/** Smallest and largest finite value of rows [from, to) of a column; [Infinity, -Infinity] if none. */
export function extent(column, from, to) {
  let [low, high] = [Infinity, -Infinity];
  for (let i = from; i < to; i += 1) {
    if (column[i] < low) low = column[i];
    if (column[i] > high) high = column[i];
  }
  return [low, high];
}

/** A rectangle of the canvas (CSS pixels) with its two scales. */
export class Lane {
  constructor(box, xRange, yRange) {
    Object.assign(this, { box, xRange, yRange });
    this.kx = box.width / (xRange[1] - xRange[0]);
    this.ky = box.height / (yRange[1] - yRange[0]);
  }

  x(value) { return this.box.left + (value - this.xRange[0]) * this.kx; }
  y(value) { return this.box.top + this.box.height - (value - this.yRange[0]) * this.ky; }
}

/**
 * Strokes rows [from, to) and joins them to row from - 1. A gap (NaN) breaks the line. Points that
 * fall onto one pixel column are replaced by its first, lowest, highest and last, when `inOrder`
 * says that x never falls; otherwise by the first of those that fall onto one pixel.
 * Returns the number of points that were handed to the canvas.
 */
export function strokeRows(context, lane, xs, ys, from, to, inOrder) {
  context.beginPath();
  const count = (inOrder ? byColumn : byPixel)(context, lane, xs, ys, Math.max(0, from - 1), to);
  context.stroke();
  return count;
}

function byPixel(context, lane, xs, ys, from, to) {
  let [lastX, lastY, down, count] = [NaN, NaN, false, 0];
  for (let i = from; i < to; i += 1) {
    const x = Math.round(2 * lane.x(xs[i])) / 2;
    const y = Math.round(2 * lane.y(ys[i])) / 2;
    if (Number.isNaN(x) || Number.isNaN(y)) {
      down = false;
    } else if (!down || x !== lastX || y !== lastY) {
      if (down) context.lineTo(x, y);
      else context.moveTo(x, y);
      [down, lastX, lastY] = [true, x, y];
      count += 1;
    }
  }
  return count;
}

function byColumn(context, lane, xs, ys, from, to) {
  let [column, first, low, high, last, down, count] = [NaN, NaN, NaN, NaN, NaN, false, 0];
  const flush = () => {
    if (Number.isNaN(column)) return;
    for (const y of first === last && low === high ? [first] : [first, low, high, last]) {
      if (down) context.lineTo(column, y);
      else context.moveTo(column, y);
      down = true;
      count += 1;
    }
  };
  for (let i = from; i < to; i += 1) {
    const x = Math.round(lane.x(xs[i]));
    const y = lane.y(ys[i]);
    if (Number.isNaN(y)) {
      flush();
      [column, down] = [NaN, false];
    } else if (x === column) {
      low = Math.max(low, y);
      high = Math.min(high, y);
      last = y;
    } else {
      flush();
      [column, first, low, high, last] = [x, y, y, y, y];
    }
  }
  flush();
  return count;
}

/** Two canvases in a host element: `base` keeps what is drawn, `top` what moves. */
export class Surface {
  constructor(host) {
    this.host = host;
    this.canvases = [document.createElement("canvas"), document.createElement("canvas")];
    [this.base, this.top] = this.canvases.map((canvas) => canvas.getContext("2d"));
    host.replaceChildren(...this.canvases);
    this.stamp = 0; // changes with size and theme
    new ResizeObserver(() => this.resize()).observe(host);
    this.resize();
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    this.width = this.host.clientWidth;
    this.height = this.host.clientHeight;
    for (const canvas of this.canvases) {
      canvas.width = Math.max(1, Math.round(this.width * ratio));
      canvas.height = Math.max(1, Math.round(this.height * ratio));
      canvas.getContext("2d").setTransform(ratio, 0, 0, ratio, 0, 0);
    }
    this.restyle();
  }

  /** Colours and letter size from the style sheet. */
  restyle() {
    const style = getComputedStyle(this.host);
    const name = (variable) => style.getPropertyValue(variable).trim();
    this.colours = {
      ink: name("--ink"), quiet: name("--quiet"), faint: name("--faint"), now: name("--curve-now"),
      earlier: name("--curve-old"), model: name("--curve-model"), old: name("--old"),
    };
    this.letter = Math.max(12, parseFloat(style.fontSize) * 0.85);
    this.font = `${this.letter}px ${style.fontFamily}`;
    this.stamp += 1;
  }

  clear(context) {
    context.clearRect(0, 0, this.width, this.height);
  }

  /** Grid, numbers and names of the axes; `xName` may be empty where another lane shows it. */
  axes(lane, xName, yName) {
    const { base: context, letter, colours } = this;
    const { left, top, width, height } = lane.box;
    context.font = this.font;
    context.lineWidth = 1;
    context.strokeStyle = colours.faint;
    context.fillStyle = colours.quiet;
    const xs = ticks(...lane.xRange, width / (5 * letter));
    const ys = ticks(...lane.yRange, height / (2.4 * letter));
    context.beginPath();
    for (const t of xs) { context.moveTo(lane.x(t), top); context.lineTo(lane.x(t), top + height); }
    for (const t of ys) { context.moveTo(left, lane.y(t)); context.lineTo(left + width, lane.y(t)); }
    context.stroke();
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const t of ys) context.fillText(tickText(t, ys), left - 6, lane.y(t));
    context.textAlign = "center";
    context.textBaseline = "top";
    if (xName) for (const t of xs) context.fillText(tickText(t, xs), lane.x(t), top + height + 0.5 * letter);
    this.#names(lane, xName, yName);
  }

  #names(lane, xName, yName) {
    const { base: context, letter, colours } = this;
    const { left, top, width, height } = lane.box;
    context.fillStyle = colours.ink;
    context.textAlign = "right";
    if (xName) context.fillText(xName, left + width, top + height + 1.7 * letter);
    context.textAlign = "left";
    context.textBaseline = "bottom";
    context.fillText(yName, left, top - 0.25 * letter);
  }

  /** Where axes leave room; `lanes` of them one above the other. */
  boxes(lanes) {
    const { letter, width, height } = this;
    const [left, right, top, bottom, gap] = [3.9 * letter, 0.9 * letter, 1.6 * letter, 2.7 * letter, 1.8 * letter];
    const each = Math.max(10, (height - top - bottom - gap * (lanes - 1)) / lanes);
    return Array.from({ length: lanes }, (_, i) => (
      { left, top: top + i * (each + gap), width: Math.max(10, width - left - right), height: each }));
  }

  /** A ring at the newest value: filled while live, empty and grey when old. */
  dot(lane, xValue, yValue, old) {
    const [x, y] = [lane.x(xValue), lane.y(yValue)];
    if (!Number.isFinite(x) || !Number.isFinite(y)) return;
    const context = this.top;
    context.beginPath();
    context.arc(x, y, 0.5 * this.letter, 0, 2 * Math.PI);
    context.lineWidth = 3;
    context.strokeStyle = old ? this.colours.old : this.colours.ink;
    context.fillStyle = this.colours.now;
    if (!old) context.fill();
    context.stroke();
  }
}

function tickText(value, all) {
  const step = all.length > 1 ? all[1] - all[0] : Math.abs(value) || 1;
  const places = Math.max(0, Math.min(6, -Math.floor(Math.log10(step) + 1e-9)));
  return value.toFixed(places).replace(/^-(0(\.0+)?)$/, "$1").replace("-", "−");
}
