// Points over an axis that may be zoomed, with strips above for what is no finite number. uPlot has the axes, the zoom
// and the pointer; the points are drawn here, since each has a colour and a shape of its own.
"use strict";

MET.points = (() => {
  const { node, palette, ticks } = MET;
  const STRIPS = [["∞", (v) => v === Infinity], ["−∞", (v) => v === -Infinity], ["no value", (v) => Number.isNaN(v)]];
  const STRIP = 17;
  const REACH = 26;
  const COUNTS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1e3, 2e3, 5e3, 1e4, 2e4, 5e4, 1e5, 2e5, 5e5, 1e6, 2e6, 5e6, 1e7, 1e8, 1e9];

  // A plot in `frame`. `plot` has
  //   x, y     columns: values, words, label, unit, log; y may have limits
  //   style    (place, colours) -> { fill, ring, size } of a point
  //   marks    (u, context, colours, at) draws more; at(x, y) is a point of the canvas
  //   told     place -> children of the note beside it;  choose  place -> nothing
  //   reach    numbers that the y axis should reach;  chosen  () -> place or -1;  height, name
  function make(frame, plot) {
    const order = Uint32Array.from(plot.x.values.keys()).sort((a, b) => rank(plot.x.values[a]) - rank(plot.x.values[b]) || a - b);
    const kept = order.filter((place) => Number.isFinite(plot.x.values[place]));
    const xs = Array.from(kept, (place) => plot.x.values[place]);
    const ys = Array.from(kept, (place) => (Number.isFinite(plot.y.values[place]) ? plot.y.values[place] : null));
    const strips = STRIPS.filter(([, is]) => kept.some((place) => is(plot.y.values[place])));
    const at = { x: new Float64Array(kept.length), y: new Float64Array(kept.length) };
    const logX = Boolean(plot.x.log) && xs.every((v) => v > 0);
    const logY = plot.logY ?? (Boolean(plot.y.log) && ys.every((v) => v === null || v > 0));
    let hovered = -1;

    function options() {
      const colours = palette();
      const font = "12px " + getComputedStyle(document.body).fontFamily;
      const axis = { stroke: colours.muted, font, labelFont: font, labelSize: 20, labelGap: 2,
        grid: { stroke: colours.line, width: 1 }, ticks: { stroke: colours.faint, width: 1, size: 4 } };
      const words = plot.x.words;
      const counts = xs.every(Number.isInteger);
      const few = words.length || logX ? null : apart([...new Set(xs)], MET.width(frame) - 90);
      return {
        width: MET.width(frame), height: plot.height, padding: [8 + STRIP * strips.length, 14, 0, 0],
        legend: { show: false }, cursor: { x: false, y: false, points: { show: false }, drag: { x: true, y: true, uni: 18 } },
        scales: {
          x: { time: false, distr: logX ? 3 : 1, range: (u, low, high) => (whole(u, low, high) ? wide(xs, logX, words.length) : [low, high]) },
          y: { distr: logY ? 3 : 1, range: () => wide(reached(ys, plot, logY), logY) },
        },
        series: [{}, { scale: "y", paths: () => null, points: { show: false } }],
        axes: [
          { ...axis, label: (u) => MET.fitted(MET.titled(plot.x), font, u.width - 90), size: 34, space: 64, incrs: counts ? COUNTS : undefined, ...(few ? { splits: () => few, values: labels(true) } : words.length ? { splits: () => words.map((_, n) => n),
            values: () => words.map((word) => (word.length > 18 ? word.slice(0, 17) + "…" : word)) } : { values: labels(logX), ...(logX ? logarithmic : {}) }) },
          { ...axis, label: MET.fitted(MET.titled(plot.y), font, plot.height - 50), size: 58, values: labels(logY), ...(logY ? logarithmic : {}) },
        ],
        hooks: { draw: [draw], setCursor: [hover] },
      };
    }

    const whole = (u, low, high) => low === xs[0] && high === xs[xs.length - 1];

    function draw(u) {
      const colours = palette();
      const { ctx, bbox } = u;
      const px = devicePixelRatio;
      ctx.save();
      const across = (x) => u.valToPos(x, "x", true);
      const up = (y) => u.valToPos(y, "y", true);
      const stripAt = (n) => bbox.top - (n + 0.5) * STRIP * px - 3 * px;
      ctx.font = `${11 * px}px ${getComputedStyle(document.body).fontFamily}`;
      ctx.fillStyle = colours.muted;
      ctx.textAlign = "right";
      ctx.textBaseline = "middle";
      strips.forEach(([name], n) => {
        ctx.fillText(name, bbox.left - 8 * px, stripAt(n));
        ctx.fillStyle = colours.soft;
        ctx.fillRect(bbox.left, stripAt(n) - (STRIP / 2 - 1) * px, bbox.width, (STRIP - 2) * px);
        ctx.fillStyle = colours.muted;
      });
      limits(u, ctx, colours, up, px);
      ctx.beginPath();
      ctx.rect(bbox.left - 4 * px, bbox.top - (STRIP * strips.length + 4) * px, bbox.width + 8 * px, bbox.height + (STRIP * strips.length + 8) * px);
      ctx.clip();
      if (plot.marks) plot.marks(u, ctx, colours, (x, y) => [across(x), up(y)], px);
      for (let n = 0; n < kept.length; n++) {
        const y = plot.y.values[kept[n]];
        const strip = Number.isFinite(y) ? -1 : strips.findIndex(([, is]) => is(y));
        const [left, top] = [across(xs[n]), strip < 0 ? up(y) : stripAt(strip)];
        at.x[n] = left / px - bbox.left / px;
        at.y[n] = top / px - bbox.top / px;
        if (strip < 0 && (top < bbox.top - 1 || top > bbox.top + bbox.height + 1)) { at.x[n] = NaN; continue; }
        if (left < bbox.left - 1 || left > bbox.left + bbox.width + 1) { at.x[n] = NaN; continue; }
        point(ctx, left, top, plot.style(kept[n], colours), px);
      }
      names(u, ctx, colours, up, px);
      const chosen = plot.chosen ? kept.indexOf(plot.chosen()) : -1;
      for (const [n, colour] of [[chosen, colours.accent], [hovered, colours.ink]]) {
        if (n < 0 || Number.isNaN(at.x[n])) continue;
        ctx.beginPath();
        ctx.arc((at.x[n] + bbox.left / px) * px, (at.y[n] + bbox.top / px) * px, 8 * px, 0, 7);
        ctx.lineWidth = 2 * px;
        ctx.strokeStyle = colour;
        ctx.stroke();
      }
      ctx.restore();
    }

    const beyond = (u, line) => (line < u.bbox.top - 1 ? "↑" : line > u.bbox.top + u.bbox.height + 1 ? "↓" : "");

    function limits(u, ctx, colours, up, px) {
      ctx.save();
      ctx.lineWidth = 1.5 * px;
      ctx.setLineDash([6 * px, 4 * px]);
      ctx.strokeStyle = colours.attend;
      for (const limit of plot.y.limits || []) {
        const line = up(limit.value);
        if (beyond(u, line)) continue;
        ctx.beginPath();
        ctx.moveTo(u.bbox.left, line);
        ctx.lineTo(u.bbox.left + u.bbox.width, line);
        ctx.stroke();
      }
      ctx.restore();
    }

    // Beside each limit its text, where it covers the fewest points.
    function names(u, ctx, colours, up, px) {
      const { bbox } = u;
      ctx.save();
      ctx.font = `${11.5 * px}px ${getComputedStyle(document.body).fontFamily}`;
      ctx.textBaseline = "middle";
      ctx.textAlign = "left";
      ctx.lineJoin = "round";
      ctx.lineWidth = 4 * px;
      for (const limit of plot.y.limits || []) {
        const line = up(limit.value);
        const text = `${limit.text} ${beyond(u, line)}`.trim();
        const width = ctx.measureText(text).width;
        const edge = { "↑": [bbox.top + 9 * px], "↓": [bbox.top + bbox.height - 9 * px], "": [line - 9 * px, line + 10 * px] }[beyond(u, line)];
        const rows = edge.filter((y) => y > bbox.top && y < bbox.top + bbox.height);
        const places = [1, 0, 0.5, 0.25, 0.75].flatMap((share) => (rows.length ? rows : edge).map((y) => [bbox.left + 6 * px + share * (bbox.width - width - 12 * px), y]));
        const covered = ([left, y]) => kept.reduce((sum, _, n) => {
          const [x, top] = [at.x[n] * px + bbox.left, at.y[n] * px + bbox.top];
          return sum + (x > left - 8 * px && x < left + width + 8 * px && Math.abs(top - y) < 13 * px);
        }, 0);
        const counts = kept.length < 20000 ? places.map(covered) : places.map(() => 0);
        const [left, y] = places[counts.indexOf(Math.min(...counts))];
        ctx.strokeStyle = colours.paper;
        ctx.fillStyle = colours.attend;
        ctx.strokeText(text, left, y);
        ctx.fillText(text, left, y);
      }
      ctx.restore();
    }

    function nearest(left, top) {
      let [best, found] = [REACH * REACH, -1];
      for (let n = 0; n < kept.length; n++) {
        const far = (at.x[n] - left) ** 2 + (at.y[n] - top) ** 2;
        if (far <= best) [best, found] = [far, n];
      }
      return found;
    }

    function show(n) {
      if (n === hovered) return;
      hovered = n;
      u.redraw(false);
      if (n < 0) return MET.tip.hide();
      const box = u.over.getBoundingClientRect();
      MET.tip.show(box.left + scrollX + at.x[n], box.top + scrollY + at.y[n], ...plot.told(kept[n]));
    }

    function hover(self) {
      const { left, top } = self.cursor;
      show(left < 0 ? -1 : nearest(left, top));
    }

    // The strips lie outside of the area that uPlot watches.
    function outside(event) {
      if (event.target === u.over || !strips.length) return;
      const box = u.over.getBoundingClientRect();
      show(nearest(event.clientX - box.left, event.clientY - box.top));
    }

    function keys(event) {
      const seen = [...kept.keys()].filter((n) => !Number.isNaN(at.x[n]));
      if (!seen.length) return;
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (step) {
        const place = seen.indexOf(hovered);
        show(seen[(place < 0 && step < 0 ? 0 : place) + step < 0 ? seen.length - 1 : (place + step) % seen.length]);
      } else if (event.key === "Enter" || event.key === " ") {
        if (hovered >= 0) plot.choose(kept[hovered]);
      } else if (event.key === "Escape") {
        show(-1);
        reset();
      } else return;
      event.preventDefault();
    }

    function reset() {
      u.setData([xs, ys]);
    }

    const u = new uPlot(options(), [xs, ys], frame);
    u.over.addEventListener("click", () => {
      const n = nearest(u.cursor.left, u.cursor.top);
      if (n >= 0) plot.choose(kept[n]);
    });
    const pressed = (event) => { if (event.target !== u.over && hovered >= 0) plot.choose(kept[hovered]); };
    const left = () => show(-1);
    frame.addEventListener("mousemove", outside);
    frame.addEventListener("mouseleave", left);
    frame.addEventListener("click", pressed);
    frame.addEventListener("keydown", keys);
    frame.addEventListener("blur", left);
    frame.tabIndex = 0;
    frame.setAttribute("role", "application");
    frame.setAttribute("aria-label", `${plot.name}. Arrow keys go from case to case, Enter chooses one, Escape shows all.`);
    return {
      u, redraw: () => u.redraw(false), where: (place) => { const n = kept.indexOf(place); return [at.x[n], at.y[n]]; },
      destroy() {
        frame.removeEventListener("mousemove", outside);
        frame.removeEventListener("mouseleave", left);
        frame.removeEventListener("click", pressed);
        frame.removeEventListener("keydown", keys);
        frame.removeEventListener("blur", left);
        u.destroy();
      },
    };
  }

  const rank = (value) => (Number.isFinite(value) ? value : Infinity);
  const labels = (log) => (u, values) => (log ? values.map((v) => (v === null ? "" : MET.number(v))) : ticks(values));

  // Of a logarithmic axis: ticks at one digit times a power of ten, by equal steps where it is short, and numbers at as
  // many of them as have room: at all, at 1, 2 and 5, at 1 and 3, or at powers of ten.
  const DIGITS = [[1, 2, 3, 4, 5, 6, 7, 8, 9], [1, 2, 5], [1, 3], [1]];
  const logarithmic = {
    splits: (u, axis, low, high, step) => {
      const found = [];
      for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) DIGITS[0].forEach((digit) => found.push(+`${digit}e${power}`));
      const within = found.filter((v) => v >= low && v <= high);
      return within.length > 2 ? within : even(low, high);
    },
    filter: (u, splits, axis) => {
      const upright = axis === 1;
      const at = (v) => u.valToPos(v, upright ? "y" : "x");
      const room = (v) => (upright ? 22 : 6.8 * MET.number(v).length + 14);
      const clear = (some) => some.every((v, n) => !n || Math.abs(at(v) - at(some[n - 1])) >= (room(v) + room(some[n - 1])) / 2);
      const sets = DIGITS.map((digits) => splits.filter((v) => digits.includes(+v.toExponential(0)[0])));
      const shown = [splits, ...sets].find((some) => some.length > 1 && clear(some)) || splits.filter((v, n) => n === 0 || n === splits.length - 1);
      return splits.map((v) => (shown.includes(v) ? v : null));
    },
  };

  // Round numbers by equal steps, five to twelve of them.
  function even(low, high) {
    const size = 10 ** Math.floor(Math.log10((high - low) / 5));
    const step = [5, 2, 1].map((n) => n * size).find((each) => (high - low) / each >= 5);
    const found = [];
    for (let n = Math.ceil(low / step); n * step <= high; n++) found.push(n * step);
    return found;
  }

  // Few values that stand well apart are the ticks themselves; else none.
  function apart(values, width) {
    const span = values[values.length - 1] - values[0];
    const near = values.some((value, n) => n && ((value - values[n - 1]) / span) * width < 48);
    return values.length > 1 && values.length <= 12 && !near ? values : null;
  }

  // The range of an axis: of the values, with room beside.
  function wide(values, log, words) {
    if (words) return [-0.5, words - 0.5];
    let [low, high] = [Infinity, -Infinity];
    for (const v of values) if (v !== null) [low, high] = [Math.min(low, v), Math.max(high, v)];
    if (low > high) [low, high] = log ? [1, 10] : [0, 1];
    if (log) {
      const room = (high / low) ** 0.05 || 1.1;
      return low === high ? [low / 2, high * 2] : [low / room, high * room];
    }
    const span = MET.span(low, high);
    return [low - 0.05 * span, high + 0.07 * span];
  }

  // The values, and of limits those that do not squeeze them.
  function reached(values, plot, log) {
    const numbers = values.filter((v) => v !== null);
    const limits = (plot.y.limits || []).map((limit) => limit.value);
    const reach = (plot.reach || []).filter((v) => !log || v > 0);
    if (!numbers.length) return [...limits, ...reach];
    const [low, high] = wide(numbers, false);
    const span = high - low;
    const near = limits.filter((v) => v > low - 1.2 * span && v < high + 1.2 * span && !(log && v <= 0));
    return [...numbers, ...near, ...reach];
  }

  function point(ctx, left, top, style, px) {
    ctx.beginPath();
    ctx.arc(left, top, style.size * px, 0, 7);
    if (style.ring) {
      ctx.lineWidth = 1.6 * px;
      ctx.strokeStyle = style.fill;
      ctx.stroke();
    } else {
      ctx.fillStyle = style.fill;
      ctx.fill();
    }
  }

  return { make };
})();
