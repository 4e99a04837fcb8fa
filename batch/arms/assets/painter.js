// Draws a picture of an arm (webgl.js says what it is) as SVG, the farthest first: for paper, and where there is no WebGL.
"use strict";

MET.painter = (() => {
  const { dot, plus, unit, ends } = MET.arm;
  const { node } = MET;
  const ROUND = 20;  // points of a circle
  const BEHIND = 1e6;  // m: ghosts are drawn before what is solid

  function draw(picture, width, height) {
    const { camera, solids, arm, ghosts, trace, floor, step, reach, colours } = picture;
    const axes = camera.axes();
    const half = height / 2;
    const seen = (p) => {
      const [x, y, far] = camera.see(p, axes);
      return [width / 2 + x * half, half - y * half, far];
    };
    const scale = (far) => half / (far * MET.camera.FIELD);  // px of a metre there
    const css = ([r, g, b], by = 1) => `rgb(${[r, g, b].map((c) => Math.round(255 * Math.min(1, c * by))).join(",")})`;
    const d = (points, closed = true) => points.map(([x, y], n) => `${n ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("") + (closed ? "Z" : "");
    const key = unit(plus(plus(axes.back, axes.right, -0.7), axes.up, 1));
    const shade = (normal) => 0.62 + 0.42 * (0.5 + 0.5 * dot(normal, key));
    const items = [];
    const path = (far, attributes) => items.push([far, node("path", { fill: "none", "stroke-linejoin": "round", "stroke-linecap": "round", ...attributes })]);

    function solid(each, colour, opacity) {
      const { ends: two, radius } = ends(each);
      const [a, b] = two.map(seen);
      const far = (a[2] + b[2]) / 2 + (opacity < 1 ? BEHIND : 0);
      const edge = css(colour, 0.55);
      const line = { stroke: edge, "stroke-width": 0.8, opacity };
      if (each.mesh === "block") {
        each.axes.forEach((axis, k) => [1, -1].forEach((sign) => {
          const normal = axis.map((x) => sign * x);
          const middle = plus(each.at, normal, each.size[k] / 2);
          if (dot(normal, plus(axes.eye, middle, -1)) <= 0) return;
          const [u, v] = [(k + 1) % 3, (k + 2) % 3];
          const corners = [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([i, j]) => seen(plus(plus(middle, each.axes[u], (i * each.size[u]) / 2), each.axes[v], (j * each.size[v]) / 2)));
          path(far, { d: d(corners), fill: css(colour, shade(normal)), ...line });
        }));
        return;
      }
      if (each.mesh === "cone") {
        path(far, { d: d(hull([...ring(two[0], each.axes, radius).map(seen), b])), fill: css(colour, 0.9), ...line });
        return;
      }
      if (each.mesh === "can") {
        const rings = two.map((end) => ring(end, each.axes, radius).map(seen));
        path(far, { d: d(hull(rings.flat())), fill: css(colour, 0.86), ...line });
        const [near, normal] = dot(each.axes[2], plus(axes.eye, each.at, -1)) > 0 ? [1, each.axes[2]] : [0, each.axes[2].map((x) => -x)];
        path(far - 1e-9, { d: d(rings[near]), fill: css(colour, shade(normal)), ...line });
        return;
      }
      const wide = 2 * radius * scale((a[2] + b[2]) / 2);
      const way = d([a, [b[0] + 0.01, b[1]]], false);
      path(far, { d: way, stroke: edge, "stroke-width": wide.toFixed(2), opacity });
      path(far - 1e-9, { d: way, stroke: css(colour, 0.94), "stroke-width": Math.max(wide - 1.6, 0.5 * wide).toFixed(2), opacity });
      const light = [-0.22 * wide, -0.22 * wide];
      if (opacity === 1) path(far - 2e-9, { d: d([a, b].map((p) => [p[0] + light[0], p[1] + light[1]]), false), stroke: "#ffffff", "stroke-opacity": 0.3, "stroke-width": (0.22 * wide).toFixed(2) });
    }

    const under = [];
    if (floor !== null) {
      const [count, [x, y]] = [Math.ceil((1.2 * reach) / step), camera.target.map((t) => Math.round(t / step) * step)];
      const lines = Array.from({ length: 2 * count + 1 }, (_, n) => (n - count) * step);
      const across = lines.flatMap((at) => [[[x + at, y - count * step], [x + at, y + count * step]], [[x - count * step, y + at], [x + count * step, y + at]]]);
      under.push(node("path", { d: across.map((line) => d(line.map(([px, py]) => seen([px, py, floor])), false)).join(""), stroke: css(colours.grid), "stroke-opacity": 0.5, "stroke-width": 0.7, fill: "none" }));
      const down = ([px, py]) => seen([px, py, floor]);
      if (picture.shadow) under.push(node("svg", { opacity: colours.shade[3] }, solids.map((each) => {
        const { ends: two, radius } = ends(each);
        if (each.mesh !== "pill") return node("path", { d: d(hull(outline(each).map(down))), fill: css(colours.shade) });
        const [a, b] = two.map(down);
        return node("path", { d: d([a, [b[0] + 0.01, b[1]]], false), stroke: css(colours.shade), "stroke-linecap": "round", "stroke-width": (2 * radius * scale((a[2] + b[2]) / 2)).toFixed(1) });
      })));
    }
    ghosts.forEach((numbers, n) => arm.solids(numbers, true).forEach((one) => solid(one, colours.ghost(n), Math.min(1, 1.5 * colours.ghost(n)[3]))));
    picture.twin.filter(({ role }) => role !== "base").forEach((each) => solid(each, colours.twin, colours.twin[3]));
    picture.clear.forEach((each) => solid(each, colours.clear(each), colours.clear(each)[3]));
    if (trace.length > 1) path(1e9, { d: d(trace.map(seen), false), stroke: css(colours.trace), "stroke-width": 1.6 });  // under the arm
    solids.forEach((each) => solid(each, colours.solid(each), 1));
    items.sort((a, b) => b[0] - a[0]);
    return node("svg", { viewBox: `0 0 ${width} ${height}`, width: "100%", role: "img", "aria-label": "The arm" }, under, items.map(([, drawn]) => drawn));
  }

  const ring = (centre, [x, y], radius) => Array.from({ length: ROUND }, (_, n) => {
    const t = (2 * Math.PI * n) / ROUND;
    return plus(plus(centre, x, radius * Math.cos(t)), y, radius * Math.sin(t));
  });

  // Points of a can or a block, between which all of it lies.
  function outline(each) {
    const { ends: two, radius } = ends(each);
    if (each.mesh === "can") return two.flatMap((end) => ring(end, each.axes, radius));
    const half = (axis, sign) => each.axes[axis].map((x) => (sign * x * each.size[axis]) / 2);
    return two.flatMap((end) => [[1, 1], [1, -1], [-1, 1], [-1, -1]].map(([i, j]) => plus(plus(end, half(0, i)), half(1, j))));
  }

  // The points round all others (Andrew's monotone chain).
  function hull(points) {
    const sorted = points.slice().sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const side = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    const chain = (list) => list.reduce((out, p) => {
      while (out.length > 1 && side(out[out.length - 2], out[out.length - 1], p) <= 0) out.pop();
      return [...out, p];
    }, []).slice(0, -1);
    return [...chain(sorted), ...chain(sorted.reverse())];
  }

  return { draw };
})();
