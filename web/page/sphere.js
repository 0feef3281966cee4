// The sphere of poses, as two hemispheres of equal area: what has been shown, and what another pose would add.

const NAMESPACE = "http://www.w3.org/2000/svg";
const RADIUS = 92, MIDDLE = [110, 330], ACROSS = 122;

export function element(name, attributes, text) {
  const made = document.createElementNS(NAMESPACE, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

/** Where a direction is drawn. */
function place([x, y, z]) {
  const below = z < 0 ? 1 : 0;
  const distance = RADIUS * Math.sqrt(Math.max(1 - Math.abs(z), 0));
  const across = Math.max(Math.hypot(x, y), 1e-9);
  return [MIDDLE[below] + (distance * x) / across, ACROSS - (distance * y) / across];
}

/** The drawing of `view`: its map of gains, its poses and the next one. */
export function sphere({ poses, map, cell, next }) {
  const label = `${poses.length} poses on the sphere of directions` + (next ? `; most would be added by ${next.words}` : "");
  const svg = element("svg", { viewBox: "0 0 448 236", role: "img", "aria-label": label, class: "sphere-of-poses" });
  // Scaled from the least to the largest gain, so that an even map has no shade.
  const gains = map.map((at) => at[3]);
  const least = Math.min(...gains), range = Math.max(Math.max(...gains) - least, 1e-12);
  const clip = element("clipPath", { id: "hemispheres" });
  clip.append(...MIDDLE.map((cx) => element("circle", { cx, cy: ACROSS, r: RADIUS })));
  const cells = element("g", { "clip-path": "url(#hemispheres)", "shape-rendering": "crispEdges" });
  const side = RADIUS * cell;
  for (const at of map) {
    const [x, y] = place(at);
    const share = (0.75 * (at[3] - least)) / range;
    cells.append(element("rect", { x: x - side / 2, y: y - side / 2, width: side, height: side, class: "gain", "fill-opacity": share.toFixed(3) }));
  }
  svg.append(clip, cells);
  MIDDLE.forEach((x, k) => {
    svg.append(
      element("circle", { class: "sphere", cx: x, cy: ACROSS, r: RADIUS }),
      element("path", { class: "grid", d: `M${x - RADIUS} ${ACROSS}h${2 * RADIUS}M${x} ${ACROSS - RADIUS}v${2 * RADIUS}` }),
      element("text", { class: "heading", x: x - RADIUS, y: 16 }, ["z up", "z down"][k]),
      element("text", { class: "tick", x: x + RADIUS + 4, y: ACROSS + 4 }, "+x"),
      element("text", { class: "tick", x, y: ACROSS - RADIUS - 5, "text-anchor": "middle" }, "+y"),
    );
  });
  for (const pose of poses) {
    const [cx, cy] = place(pose);
    svg.append(element("circle", { cx, cy, r: 3, class: "pose" }));
  }
  if (next) {
    const [cx, cy] = place(next.up);
    svg.append(element("circle", { cx, cy, r: 8, class: "next" }));
    svg.append(element("path", { d: `M${cx - 4} ${cy}h8M${cx} ${cy - 4}v8`, class: "next" }));
  }
  return svg;
}
