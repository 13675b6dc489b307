/** The arm from above, and where and which way the screw pushes. */

import { byId, makeSvg, onChange } from "./dom.js";
import { isNumber, vector } from "./format.js";

const WIDTH = 600, HEIGHT = 400, MARGIN = 70, ARROW = 105;
// Without the pose's joint positions: a bent arm as a sign, dashed, and said to be schematic.
const SCHEMATIC = [[0, 0, 0], [0, 0, 180], [380, 260, 500], [750, 0, 300]];

/** Screen coordinates of base-frame points (mm), x to the right and y up, as seen from +z. */
export function fit(points) {
  const xs = points.map((p) => p[0]);
  const ys = points.map((p) => p[1]);
  const [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const scale = Math.min((WIDTH - 2 * MARGIN) / Math.max(x1 - x0, 300), (HEIGHT - 2 * MARGIN) / Math.max(y1 - y0, 300));
  return (p) => [
    WIDTH / 2 + (p[0] - (x0 + x1) / 2) * scale,
    HEIGHT / 2 - (p[1] - (y0 + y1) / 2) * scale,
  ];
}

const draw = onChange(({ points, unit, direction }) => {
  const svg = byId("arm");
  const known = Array.isArray(points) && points.length > 1;
  const line = known ? points : SCHEMATIC;
  const at = fit(line);
  const screen = line.map(at);
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  svg.setAttribute("aria-label", label(unit, direction, known));
  svg.replaceChildren(
    makeSvg("polyline", { class: known ? "link" : "link schematic", points: screen.join(" ") }),
    ...screen.slice(0, -1).map(([x, y], i) => makeSvg("circle", { class: "joint", cx: x, cy: y, r: i ? 9 : 24 })),
    ...axes(screen[0]),
    ...push(screen[screen.length - 1], unit),
  );
  if (!known) svg.append(makeSvg("text", { x: WIDTH - 8, y: HEIGHT - 10, "text-anchor": "end", class: "axis-name" }, "schematic"));
});

export function drawArm(state, plan) {
  const { pose, direction, unit_vector: unit } = state.run;
  draw({ points: plan?.arms?.[pose], unit, direction });
}

function label(unit, direction, known) {
  if (!isVector(unit)) return "The arm from above; no direction yet";
  const drawn = known ? "The arm from above" : "A schematic arm from above";
  return `${drawn}; the screw pushes it along ${direction || ""} ${vector(unit)} of the base frame`;
}

const isVector = (unit) => Array.isArray(unit) && unit.length === 3 && unit.every(isNumber);

/** The base frame where the arm stands. */
function axes([x, y]) {
  return [
    makeSvg("path", { class: "axis", d: `M${x} ${y - 92}V${y}H${x + 92}M${x - 7} ${y - 78}l7-14 7 14M${x + 78} ${y - 7}l14 7-14 7` }),
    makeSvg("text", { x: x + 98, y: y + 24, class: "axis-name" }, "x"),
    makeSvg("text", { x: x - 26, y: y - 76, class: "axis-name" }, "y"),
    makeSvg("text", { x, y: y + 52, "text-anchor": "middle", class: "axis-name" }, "base"),
  ];
}

/** An arrow that ends at the loaded point; along z a ring with a dot (up) or a cross (down). */
function push([x, y], unit) {
  if (!isVector(unit)) return [];
  const flat = Math.hypot(unit[0], unit[1]);
  if (flat < 0.3) return pushAlongZ(x, y, unit[2]);
  const [ex, ey] = [unit[0] / flat, -unit[1] / flat];
  const [tx, ty] = [x - 14 * ex, y - 14 * ey];
  const [bx, by] = [tx - 38 * ex, ty - 38 * ey];
  const head = [[tx, ty], [bx - 22 * ey, by + 22 * ex], [bx + 22 * ey, by - 22 * ex]];
  return [
    makeSvg("line", { class: "push", x1: tx - ARROW * ex, y1: ty - ARROW * ey, x2: bx, y2: by }),
    makeSvg("polygon", { class: "push-head", points: head.join(" ") }),
    makeSvg("circle", { class: "joint", cx: x, cy: y, r: 11 }),
  ];
}

function pushAlongZ(x, y, z) {
  const ring = makeSvg("circle", { class: "push", cx: x, cy: y, r: 30 });
  const sign = z > 0
    ? makeSvg("circle", { class: "push-head", cx: x, cy: y, r: 10 })
    : makeSvg("path", { class: "push", d: `M${x - 18} ${y - 18}l36 36m0-36l-36 36` });
  return [ring, sign, makeSvg("text", { x: x + 44, y: y + 10 }, z > 0 ? "up" : "down")];
}
