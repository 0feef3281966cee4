// A pose as a picture: a box with the names of its faces, in the pose to be held, seen from the front, right and above.

import { element } from "./sphere.js";

// Half the edges along x, y and z: flat, like a board.
const HALF = [1, 1, 0.55];
// Direction of view, degrees to the right of the front and above, by the number of faces that point upwards, so that all of those are visible.
const ASIDE = [32, 45, 0], ABOVE = [24, 50, 54];
const SCALE = 46, MIDDLE = [110, 112];

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, s) => a.map((v) => v * s);
const sum = (a, b) => a.map((v, k) => v + b[k]);
const unit = (a) => scaled(a, 1 / Math.hypot(...a));
const axis = (k, sign = 1) => [0, 1, 2].map((i) => (i === k ? sign : 0));

/** Up, front and right in the body frame: the given direction is up, and the face that leans most to the front is in front. */
function frame(up) {
  const order = [0, 1, 2].sort((a, b) => Math.abs(up[b]) - Math.abs(up[a]));
  // If a face points straight up, the others do not lean to the front: then the next axis is in front, as in the sketch of the command.
  const second = Math.abs(up[order[1]]) > 0.3 ? order[1] : (order[0] + 1) % 3;
  const towards = axis(second, up[second] < -0.3 ? -1 : 1);
  const front = unit(sum(towards, scaled(up, -dot(towards, up))));
  return [up, front, cross(up, front)];
}

/** The drawing of the pose with `up` upwards, called `words`. */
export function pose(up, words) {
  const [top, front, right] = frame(unit(up));
  const largest = Math.max(...up.map(Math.abs));
  const upwards = up.filter((part) => Math.abs(part) > largest / 3).length - 1;
  const [a, e] = [ASIDE, ABOVE].map((angles) => (angles[upwards] * Math.PI) / 180);
  const across = sum(scaled(right, Math.cos(a)), scaled(front, -Math.sin(a)));
  const towards = sum(scaled(right, Math.sin(a)), scaled(front, Math.cos(a)));
  const seen = sum(scaled(towards, Math.cos(e)), scaled(top, Math.sin(e)));
  const upright = cross(seen, across);
  const place = (at) => [MIDDLE[0] + SCALE * dot(at, across), MIDDLE[1] - SCALE * dot(at, upright)];
  const svg = element("svg", { viewBox: "0 0 220 210", role: "img", "aria-label": `A box with ${words}`, class: "pose-picture" });
  for (let k = 0; k < 3; k++) {
    for (const sign of [1, -1]) {
      const normal = axis(k, sign), facing = dot(normal, seen);
      if (facing < 0.02) continue;
      const middle = scaled(normal, HALF[k]);
      const [p, q] = [(k + 1) % 3, (k + 2) % 3].map((i) => axis(i, HALF[i]));
      const corners = [[1, 1], [1, -1], [-1, -1], [-1, 1]].map(([i, j]) => place(sum(middle, sum(scaled(p, i), scaled(q, j)))));
      const lies = dot(normal, top) > 0.3 ? "face up" : "face";
      svg.append(element("polygon", { class: lies, points: corners.map((c) => c.map((v) => v.toFixed(1)).join(",")).join(" ") }));
      const [x, y] = place(middle);
      if (facing > 0.12) svg.append(element("text", { class: "heading", x, y: y + 5, "text-anchor": "middle" }, `${sign < 0 ? "−" : "+"}${"xyz"[k]}`));
    }
  }
  svg.append(element("path", { class: "upwards", d: "M200 60V18M194 28l6-12l6 12" }), element("text", { class: "tick", x: 200, y: 76, "text-anchor": "middle" }, "up"));
  return svg;
}
