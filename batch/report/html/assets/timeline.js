// Plots whose axis is time, in the report and on a page that simulates: zoomed together, by a drag or by keys, read at one
// cursor, and what their lines and axes look like.
"use strict";

MET.timeline = (() => {
  const { node, ticks } = MET;
  const DASHES = [[], [7, 4], [2, 3], [10, 3, 2, 3]];
  const CLOSEST = 1e-9;  // of all time, what is shown at least

  // Of what happens to the pointer, only that it moves is told to the other plots: zooms are handed on by `follow`.
  const moves = (type) => type === "mousemove" || type === "mouseleave" || type === "mouseenter";

  // id: of these plots, in the page.
  function make(id) {
    const { key } = uPlot.sync(id);
    let [plots, range] = [[], null];

    function put(given) {
      plots = given;
      if (range) zoom(range);
    }

    // A plot was zoomed: the others go with it.
    function follow(self) {
      if (!plots.includes(self)) return;
      const { min, max } = self.scales.x;
      const all = self.data[0];
      range = min <= all[0] && max >= all[all.length - 1] ? null : [min, max];
      zoom([min, max]);
    }

    function zoom([min, max]) {
      plots.forEach((u) => {
        if (u.scales.x.min !== min || u.scales.x.max !== max) u.setScale("x", { min, max });
      });
    }

    function keys(event, u) {
      const { min, max } = u.scales.x;
      const all = u.data[0];
      const [first, last] = [all[0], all[all.length - 1]];
      const held = u.cursor.idx ?? Math.floor(all.length / 2);
      const middle = all[held] >= min && all[held] <= max ? all[held] : (min + max) / 2;
      const to = (low, high) => {
        if (high - low > CLOSEST * (last - first)) u.setScale("x", { min: Math.max(first, low), max: Math.min(last, high) });
      };
      if (event.key === "+" || event.key === "=") to(middle - (middle - min) / 2, middle + (max - middle) / 2);
      else if (event.key === "-") to(middle - (middle - min) * 2, middle + (max - middle) * 2);
      else if (event.key === "Escape") to(first, last);
      else if (event.key === "ArrowRight" || event.key === "ArrowLeft") {
        const step = Math.max(1, Math.round((max - min) / (last - first) * all.length / 100)) * (event.key === "ArrowLeft" ? -1 : 1);
        const next = Math.min(Math.max(held + step, 0), all.length - 1);
        u.setCursor({ left: u.valToPos(all[next], "x"), top: u.over.clientHeight / 2 });
      } else return;
      event.preventDefault();
    }

    // The cursors at a time, which the arm stands at. Nothing is asked of the page's layout, which each cursor changes.
    function point(time) {
      plots.forEach((u) => u.setCursor({ left: u.valToPos(time, "x"), top: u.bbox.height / devicePixelRatio / 2 }, true, false));
    }

    const cursor = { y: false, points: { size: 6 }, drag: { x: true, y: false }, focus: { prox: -1 },
      sync: { key, setSeries: false, filters: { pub: moves, sub: moves } } };
    const setScale = (self, which) => { if (which === "x") follow(self); };
    return { put, keys, point, cursor, setScale };
  }

  // The axes of a plot: of time, which is named under the last one, and of the values.
  function axes(colours, label, last, splits) {
    const font = "12px " + getComputedStyle(document.body).fontFamily;
    const axis = { stroke: colours.muted, font, labelFont: font, labelSize: 18, labelGap: 2, values: (self, v) => ticks(v),
      grid: { stroke: colours.line, width: 1 }, ticks: { stroke: colours.faint, width: 1, size: 4 } };
    return [{ ...axis, label: last ? "time (s)" : null, size: 26 }, { ...axis, label, size: 62, space: 32, splits }];
  }

  function room(low, high) {
    const span = MET.span(low, high);
    return [low - 0.07 * span, high + 0.07 * span];
  }

  const pale = (colour) => (/^#[0-9a-f]{6}$/i.test(colour) ? `${colour}55` : colour);

  function swatch(colour, dash, width = 2) {
    return node("svg", { viewBox: "0 0 22 8", "aria-hidden": "true" }, node("line", { x1: 0, x2: 22, y1: 4, y2: 4, stroke: colour, "stroke-width": width,
      "stroke-dasharray": dash.length ? dash.join(" ") : null }));
  }

  return { make, axes, room, pale, swatch, DASHES };
})();
