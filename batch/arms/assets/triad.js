// The world's axes in the corner of a picture, with their letters, and where gravity pulls.
"use strict";

MET.triad = (() => {
  const { node } = MET;
  const { dot, unit, length } = MET.arm;
  const AXES = { x: "#d8434e", y: "#3a9d4f", z: "#3d6fe0" };
  const [SIDE, ARM, LETTER] = [76, 24, 32];  // px: of the corner, of an axis, and of its letter from the middle

  // arm: as `MET.arm.make` made it; gravity: in the world, m/s^2, or null where a case decides it or there is none.
  function make(arm, gravity) {
    const ways = Object.entries(AXES).map(([name, colour], n) => [name, colour, arm.up([0, 1, 2].map((axis) => (axis === n ? 1 : 0)))]);
    if (gravity && length(gravity) > 0) ways.push(["g", null, unit(arm.up(gravity))]);
    const drawn = ways.map(([name, colour, way]) => {
      const line = node("path", { "stroke-width": 2, "stroke-linecap": "round", fill: "none", stroke: colour ?? "currentColor", "stroke-dasharray": colour ? null : "2 3" });
      const letter = node("span", null, name);
      if (colour) letter.style.color = colour;
      return { line, letter, way };
    });
    const said = gravity && length(gravity) > 0 ? `Axes of the world; gravity pulls along g, ${MET.number(length(gravity))} m/s²` : "Axes of the world";
    const box = node("div", { class: "triad", title: said }, node("svg", { viewBox: `0 0 ${SIDE} ${SIDE}`, "aria-hidden": "true" }, drawn.map(({ line }) => line)), drawn.map(({ letter }) => letter));

    // As the camera, of which these are the axes, sees them: the nearest last.
    function turn({ right, up, back }) {
      drawn.forEach(({ line, letter, way }) => {
        const [x, y] = [dot(right, way), -dot(up, way)];
        const own = way === ways[3]?.[2] ? 0.7 : 1;  // gravity's, beside the axis that it lies on
        line.setAttribute("d", `M${SIDE / 2} ${SIDE / 2}L${(SIDE / 2 + ARM * own * x).toFixed(1)} ${(SIDE / 2 + ARM * own * y).toFixed(1)}`);
        letter.style.left = `${(SIDE / 2 + LETTER * own * x).toFixed(1)}px`;
        letter.style.top = `${(SIDE / 2 + LETTER * own * y).toFixed(1)}px`;
        letter.style.opacity = 0.65 + 0.35 * dot(back, way);
      });
    }
    return { box, turn };
  }

  return { make, AXES };
})();
