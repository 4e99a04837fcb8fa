// Signals of a page that simulates: a plot a signal, read at the cursor beside each line's name; limits that requirements
// put on them, and where the value that is judged fell. What stands beside the run is wide and pale, under the lines.
// Texts of a deck come into the page as text nodes alone.
"use strict";

MET.traces = (() => {
  const { node, number, palette } = MET;
  const { swatch, pale, room, DASHES } = MET.timeline;
  const [WIDE, BESIDE] = [1.6, 6];  // px of a line, and of one beside
  const STILL = 4;  // px, within which a pointer that was pressed and let go has clicked
  const CLOSE = 0.01;  // of what a plot spans: a row as near as that to the judged value is where it fell
  // By the metric's model, what of a signal it looks at: a limit of these is one of the signal.
  const LOOKS_AT = { max: (v) => v, min: (v) => v, final: (v) => v, peak: Math.abs };

  // data: as `batch.portable.page` wrote it; time: of its rows; beside: whether something stands there; seek: is told of an
  // instant that is clicked at; now: the instant that is shown.
  function make(root, data, time, { beside, seek, now }) {
    const { columns, metrics, requirements } = data.description;
    const timeline = MET.timeline.make("time");
    const hidden = new Set();  // channels
    let [plots, lines, under, judged, pointed] = [[], [], [], () => null, false];

    // A plot a signal, of unlike units one a unit: the columns of each, but for the springs of booms.
    const plotted = (n) => `${columns[n].signal}\n${data.columnUnits[n]}`;
    const signals = [...new Set(columns.map((_, n) => plotted(n)))].map((which) => columns.flatMap((_, n) => (plotted(n) === which && !data.springs.includes(columns[n].channel) ? [n] : [])));
    const drawn = (group) => [time, ...(beside ? group.map((n) => under[n]) : []), ...group.map((n) => lines[n])];

    // The limits of requirements on a group's columns, in their unit.
    const limits = signals.map((group) => requirements.flatMap((each) => {
      const m = metrics.findIndex((metric) => metric.name === each.metric);
      const [model, of] = m < 0 ? [] : data.watched[m];
      const n = group.find((column) => columns[column].channel === of && columns[column].unit === metrics[m].unit);
      if (n === undefined || !LOOKS_AT[model]) return [];
      const at = each.limit / data.columnScales[n];
      return [{ n, m, model, text: each.text, at: model === "peak" ? [at, -at] : [at], requirement: each }];
    }));

    // Of each column its colour, a joint's as on the arm, and its dash, by which lines of one colour are told apart.
    function looks(group, colours) {
      const joints = data.arm.scene ? data.arm.scene.joints : [];
      const used = new Map();
      return group.map((n, nth) => {
        const { channel, signal } = columns[n];
        const joint = joints.findIndex((name) => channel === `${name}.${signal}` || channel.startsWith(`${name}.${signal}.`));
        const colour = colours.lines[(joint < 0 ? nth : joint) % colours.lines.length];
        used.set(colour, (used.get(colour) ?? -1) + 1);
        return { colour, dash: DASHES[used.get(colour) % DASHES.length] };
      });
    }

    // A line's name: its channel without what all lines of the plot have.
    function named(n) {
      const { channel, signal } = columns[n];
      const at = `.${channel}.`.lastIndexOf(`.${signal}.`);
      const words = at < 0 ? channel : `${channel.slice(0, Math.max(0, at - 1))}${channel.slice(at + signal.length)}`;
      return words.replace(/^\./, "") || channel;
    }

    function draw() {
      const colours = palette();
      plots.forEach((plot) => plot.destroy());
      root.replaceChildren();
      const panels = signals.map((group, nth) => draws(group, colours, limits[nth], nth === signals.length - 1));
      const wide = panels.length ? MET.width(panels[0].frame) : 0;  // of all, asked for once, when all are there
      plots = panels.map(({ plot }) => plot(wide));
      timeline.put(plots);
      follow();
    }

    // The panel of a group: its frame, and what draws the plot in it, so wide.
    function draws(group, colours, limited, last) {
      const { signal } = columns[group[0]];
      const unit = data.columnUnits[group[0]] ? ` (${data.columnUnits[group[0]]})` : "";
      const inks = looks(group, colours);
      const frame = node("div", { class: "frame", tabindex: 0, role: "application",
        "aria-label": `${signal}${unit} against time. Arrow keys move the reading, Enter takes the arm there, plus and minus zoom, Escape shows all.` });
      const values = group.map(() => node("b"));
      const instant = node("span", { class: "instant" });
      const chips = group.map((n, nth) => {
        const { channel } = columns[n];
        const chip = node("button", { type: "button", class: "chip", title: `${channel}: show or hide`, "aria-pressed": String(!hidden.has(channel)), click: () => {
          if (!hidden.delete(channel)) hidden.add(channel);
          chip.setAttribute("aria-pressed", String(!hidden.has(channel)));
          (beside ? [nth, nth + group.length] : [nth]).forEach((line) => made.setSeries(line + 1, { show: !hidden.has(channel) }));
        } }, swatch(inks[nth].colour, inks[nth].dash), named(n), values[nth]);
        return chip;
      });
      const about = data.signalAbout[signal];
      root.append(node("div", { class: "panel" }, node("div", { class: "head" }, node("b", null, node("code", null, signal), unit),
        about ? node("span", { class: "about" }, about) : null, instant), node("div", { class: "chips lines" }, chips), frame));
      const show = (n) => !hidden.has(columns[n].channel);
      const line = { points: { show: false }, spanGaps: false, pxAlign: 0 };
      let made = null;
      const plot = (wide) => new uPlot({ width: wide, height: last ? 208 : 190, padding: [8, 14, 0, 0], legend: { show: false },
        scales: { x: { time: false }, y: { range: (self, low, high) => (low === null ? [-1, 1] : spanned(low, high, limited.filter(({ n }) => show(n)))) } },
        cursor: timeline.cursor,
        hooks: { setCursor: [(self) => read(self, group, values, instant)], setScale: [timeline.setScale], draw: [(self) => limited.forEach((each) => show(each.n) && mark(self, each, colours))] },
        series: [{}, ...(beside ? group.map((n, nth) => ({ ...line, stroke: pale(inks[nth].colour), width: BESIDE, show: show(n) })) : []),
          ...group.map((n, nth) => ({ ...line, stroke: inks[nth].colour, dash: inks[nth].dash, width: WIDE, show: show(n) }))],
        axes: MET.timeline.axes(colours, null, last),
      }, drawn(group), frame);
      frame.addEventListener("keydown", (event) => {
        if (event.key === "Enter" && made.cursor.idx !== null) seek(time[made.cursor.idx]);
        else timeline.keys(event, made);
      });
      return { frame, plot: (wide) => { clicks(made = plot(wide)); return made; } };
    }

    // A limit comes into view where it is less than a plot's span away.
    function spanned(low, high, limited) {
      const far = MET.span(low, high);
      const near = limited.flatMap(({ at }) => at).filter((y) => y >= low - far && y <= high + far);
      return room(Math.min(low, ...near), Math.max(high, ...near));
    }

    // Pointing at a plot reads it; a click takes the arm there.
    function clicks(u) {
      let from = null;
      u.over.addEventListener("pointerdown", (event) => { from = event.clientX; });
      u.over.addEventListener("click", (event) => {
        if (from === null || Math.abs(event.clientX - from) > STILL || u.cursor.idx === null) return;
        seek(time[u.cursor.idx]);
      });
      u.over.addEventListener("mouseenter", () => { pointed = true; });
      u.over.addEventListener("mouseleave", () => { pointed = false; follow(); });
    }

    // What stands at the cursor, beside each line's name.
    function read(self, group, values, instant) {
      const at = self.cursor.left < 0 ? null : self.cursor.idx;
      instant.textContent = at === null || at === undefined ? "" : `t = ${number(time[at])} s`;
      group.forEach((n, nth) => {
        const value = at === null || at === undefined ? undefined : lines[n]?.[at];
        const text = value === undefined ? "" : value === null ? "–" : number(value);
        if (values[nth].textContent !== text) values[nth].textContent = text;
      });
    }

    // A limit as a line with its words, and a ring where the value that is judged fell.
    function mark(self, { n, m, model, at, text, requirement }, colours) {
      const { ctx, bbox } = self;
      const px = devicePixelRatio;
      const found = judged(m, requirement);
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
      ctx.strokeStyle = ctx.fillStyle = found && !found.met ? colours.attend : colours.muted;
      ctx.lineWidth = px;
      ctx.setLineDash([5 * px, 4 * px]);
      at.forEach((y, nth) => {
        const top = self.valToPos(y, "y", true);
        ctx.beginPath();
        ctx.moveTo(bbox.left, top);
        ctx.lineTo(bbox.left + bbox.width, top);
        ctx.stroke();
        if (nth) return;
        ctx.font = `${11 * px}px ${getComputedStyle(document.body).fontFamily}`;
        ctx.textAlign = "right";
        const below = top - bbox.top < 16 * px;
        ctx.textBaseline = below ? "top" : "bottom";
        ctx.fillText(text, bbox.left + bbox.width - 4 * px, top + (below ? 2 : -2) * px);
      });
      const row = found ? rowOf(n, model, found.value / data.columnScales[n], self) : -1;
      if (row >= 0) {
        ctx.setLineDash([]);
        ctx.lineWidth = 2 * px;
        ctx.beginPath();
        ctx.arc(self.valToPos(time[row], "x", true), self.valToPos(lines[n][row], "y", true), 5 * px, 0, 2 * Math.PI);
        ctx.stroke();
      }
      ctx.restore();
    }

    // The recorded row that is nearest to the judged value; -1 where none is near, as between rows.
    function rowOf(n, model, value, self) {
      const of = LOOKS_AT[model];
      const far = (row) => (lines[n][row] === null ? Infinity : Math.abs(of(lines[n][row]) - value));
      let best = model === "final" ? lines[n].length - 1 : 0;
      if (model !== "final") for (let row = 1; row < lines[n].length; row++) if (far(row) < far(best)) best = row;
      return far(best) <= CLOSE * (self.scales.y.max - self.scales.y.min) ? best : -1;
    }

    // When the value that a metric judges fell, s; null where that is not known.
    function when(m, value) {
      const [model, of] = data.watched[m];
      const n = columns.findIndex((column) => column.channel === of && column.unit === metrics[m].unit);
      if (n < 0 || !LOOKS_AT[model] || model === "final") return null;
      const [low, high] = [lines[n].reduce((a, b) => (b === null ? a : Math.min(a, b)), Infinity), lines[n].reduce((a, b) => (b === null ? a : Math.max(a, b)), -Infinity)];
      const row = rowOf(n, model, value / data.columnScales[n], { scales: { y: { min: low, max: high } } });
      return row < 0 ? null : time[row];
    }

    function follow() {
      if (!pointed) requestAnimationFrame(() => { if (!pointed && now() !== null) timeline.point(now()); });
    }

    // found: of each column its numbers; beside: of what stands there; of: what a metric comes to and whether it meets a
    // requirement, {value: SI, met}, or null.
    function show(found, beside_, of) {
      [lines, under, judged] = [found, beside_, of];
      if (!plots.length) return draw();
      plots.forEach((u, n) => u.batch(() => {
        const { min, max } = u.scales.x;
        u.setData(drawn(signals[n]), false);
        u.setScale("x", { min, max });  // the stretch of time that is zoomed to stays
      }));
      follow();
    }

    function close() {
      plots.forEach((plot) => plot.destroy());
      plots = [];
    }
    return { show, draw, when, close, point: (at) => { if (!pointed) timeline.point(at); }, plots: () => plots };
  }

  return { make };
})();
