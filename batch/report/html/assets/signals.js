// Recorded signals: a plot a quantity, a colour a joint, a dash a case; time is common to all. What another archive has
// of them is wide and pale, under the lines of now; or the difference of the two is drawn. A case whose history is not in
// the page is run again, where its module is.
"use strict";

MET.signals = (() => {
  const { node, number, palette, unpack } = MET;
  const { room, pale, swatch, DASHES } = MET.timeline;
  const MOST = DASHES.length;
  const READ = 8;
  const OFFERED = 25;  // cases of a structure that are offered by name, of all that can be run again
  const [WIDE, WAS] = [1.6, 5];  // px, how wide a line is, and one of before

  function make(root, model) {
    const data = model.data.signals;
    const histories = new Map(data.histories.map((each) => [each.case, each]));
    const clocks = data.clocks.map(unpack);
    const { simulation } = model;
    const has = (case_) => histories.has(case_) || Boolean(simulation && simulation.has(case_));
    const lines = new Map();
    const timeline = MET.timeline.make(`${model.id}-time`);
    let shown = data.shown.filter(has).slice(0, MOST);
    const hidden = new Set();
    const compared = data.histories.some((each) => each.before.panels) || Boolean(simulation && simulation.structures.some((each) => each.before));
    const names = compared ? model.data.against : null;
    let how = names ? "both" : "now";
    let plots = [];
    const caseChips = node("div", { class: "chips" });
    const jointChips = node("div", { class: "chips" });
    const legend = node("div", { class: "versions" });
    const which = names ? node("select", { "aria-label": "What is drawn", class: "how", change: () => { how = which.value; draw(); } },
      node("option", { value: "both" }, "now over before"), node("option", { value: "change" }, "the difference, now − before"), node("option", { value: "now" }, "now alone")) : null;
    const controls = node("div", { class: "controls kept" }, which, names ? legend : null, caseChips, jointChips,
      node("span", { class: "hint" }, "drag to zoom, double click for all"));
    const panels = node("div");
    root.append(controls, panels);

    // What there is of a case: its history in the page, or that of its run here.
    const ran = new Map();
    function historyOf(case_) {
      if (histories.has(case_)) return histories.get(case_);
      if (!ran.has(case_)) {
        if (ran.size >= 2 * MOST) forget(ran.keys().next().value);
        const now = { run: simulation.run(case_) };
        now.clock = clockOf(now.run);
        const before = simulation.hadBefore(case_) ? { run: simulation.run(case_, true) } : {};
        if (before.run) before.clock = clockOf(before.run);
        const change = before.clock === now.clock ? { clock: now.clock, runs: [now.run, before.run] } : {};
        ran.set(case_, { case: case_, ...now, before, change });
      }
      return ran.get(case_);
    }

    // The place of a run's times among the clocks.
    function clockOf({ own: { time } }) {
      const same = clocks.findIndex((clock) => clock.length === time.length && clock.every((t, n) => t === time[n]));
      return same < 0 ? clocks.push(time) - 1 : same;
    }

    function forget(case_) {
      ran.delete(case_);
      [...lines.keys()].filter((key) => key.startsWith(`${case_}/`)).forEach((key) => lines.delete(key));
    }

    // The lines of a panel in a case, unpacked once; of: "now", "before", "change".
    function values(history, panel, of) {
      const key = `${history.case}/${panel}/${of}`;
      const { run, runs } = of === "now" ? history : history[of];
      if (!lines.has(key) && run) lines.set(key, simulation.lines(run, panel));
      if (!lines.has(key) && runs) {
        const [now, was] = runs.map((each) => simulation.lines(each, panel));
        lines.set(key, now.map((line, n) => line.map((v, at) => (v === null || was[n][at] === null ? null : v - was[n][at]))));
      }
      const panels = (of === "now" ? history : history[of]).panels || {};
      if (!lines.has(key)) lines.set(key, (panels[panel] || []).map((packed) => Array.from(unpack(packed), (v) => (Number.isNaN(v) ? null : v))));
      return lines.get(key);
    }

    const colourOf = (joint, at, colours) => {
      const place = data.joints.indexOf(joint);
      return colours.lines[(place < 0 ? at : place) % colours.lines.length];
    };

    // Series of a panel: of each case that is shown each line whose joint is not hidden.
    function series(panel, number_) {
      const alone = (joint) => panel.lines.filter((line) => line.joint === joint && !line.command).length === 1;
      const out = [];
      shown.forEach((which, nth) => {
        const history = historyOf(which);
        for (const of of { both: ["before", "now"], change: ["change"], now: ["now"] }[how]) {
          const { clock } = of === "now" ? history : history[of];
          values(history, number_, of).forEach((points, at) => {
            const line = panel.lines[at];
            if (hidden.has(line.joint) || points.every((v) => v === null)) return;
            out.push({ line, which, nth, points, clock, own: alone(line.joint), at, was: of === "before" });
          });
        }
      });
      return out.sort((a, b) => b.was - a.was);
    }

    function joined(found) {
      if (new Set(found.map((each) => each.clock)).size <= 1) {
        return [Array.from(clocks[found.length ? found[0].clock : 0]), ...found.map((each) => each.points)];
      }
      return uPlot.join(found.map((each) => [Array.from(clocks[each.clock]), each.points]), found.map(() => [1, 1]));
    }

    function draw() {
      if (!shown.length) return;
      plots.forEach((plot) => plot.u.destroy());
      plots = [];
      panels.replaceChildren();
      chips();
      const filled = data.panels.map((panel, n) => [panel, series(panel, n)]).filter(([, found]) => found.length);
      plots = filled.map(([panel, found], n) => draws(panel, found, n === filled.length - 1));
      timeline.put(plots.map(({ u }) => u));
    }

    function draws(panel, found, last) {
      const colours = palette();
      const frame = node("div", { class: "frame", tabindex: 0, role: "application" });
      const reading = node("div", { class: "reading" });
      const unit = panel.unit ? ` (${panel.unit})` : "";
      const change = how === "change";
      const strong = (each) => (each.line.command ? colours.ink : colourOf(each.own ? each.line.joint : "", each.at, colours));
      const keyed = found.filter((each) => each.nth === 0 && !each.was && !each.own && !each.line.command);  // components
      const box = node("div", { class: "panel" }, node("div", { class: "head" }, node("b", null, change ? "change of " : null, node("code", null, panel.name), unit),
        node("span", { class: "about" }, panel.about), node("span", { class: "about versions" }, ...keyed.map((each) => node("span", null, swatch(strong(each), []), each.line.label))), reading), frame);
      panels.append(box);
      roomFor(box, reading, found, MET.width(frame));
      frame.setAttribute("aria-label", `${change ? "change of " : ""}${panel.name}${unit} against time, cases ${shown.map((c) => `#${c}`).join(", ")}. Arrow keys move the reading, plus and minus zoom, Escape shows all.`);
      const flat = found.every((each) => each.points.every((v) => v === null || v === 0));
      const colour = (each) => (each.was ? pale(strong(each)) : strong(each));
      const u = new uPlot({
        width: MET.width(frame), height: (flat ? 90 : 178) + (last ? 18 : 0), padding: [8, 14, 0, 0], legend: { show: false },
        cursor: timeline.cursor,
        scales: { x: { time: false }, y: { range: (self, low, high) => (low === null ? [-1, 1] : room(low, high)) } },
        series: [{}, ...found.map((each) => ({
          stroke: colour(each), width: each.was ? WAS : WIDE, dash: each.line.command ? [3, 3] : DASHES[each.nth],
          points: { show: false }, spanGaps: false, pxAlign: 0,
        }))],
        axes: MET.timeline.axes(colours, `${change ? "Δ " : ""}${panel.name.split(".").slice(-1)[0]}${unit}`, last, flat ? () => [0] : undefined),
        hooks: {
          setCursor: [(self) => read(self, reading, found, colour)],
          setScale: [timeline.setScale],
          draw: [(self) => ends(self, found, colour)],
        },
      }, joined(found), frame);
      frame.addEventListener("keydown", (event) => timeline.keys(event, u));
      return { u, panel, frame };
    }

    // What is read at the pointer, of the first lines.
    function listed(found) {
      const now = found.filter((each) => !each.was);
      const several = shown.length > 1 && now.length <= READ;
      return now.filter((each) => several || each.nth === 0).slice(0, READ);
    }

    // As many lines of text as that needs, kept free: a plot that moved under the pointer would lose it.
    function roomFor(box, reading, found, wide) {
      const need = 90 + listed(found).length * (found.some((each) => each.was) ? 240 : 150);  // px, about
      if (need <= wide - 320) return;
      box.classList.add("many");
      reading.style.height = `${1.35 * Math.ceil(need / wide)}rem`;
    }

    // What stands at the pointer.
    function read(self, box, found, colour) {
      const at = self.cursor.idx;
      if (at === null || at === undefined || self.cursor.left < 0) return box.replaceChildren();
      if (model.seek && !pointing && self.cursor.event) model.seek(self.data[0][at]);
      const several = shown.length > 1 && found.filter((each) => !each.was).length <= READ;
      const text = (each) => { const value = each && self.data[found.indexOf(each) + 1][at]; return value === null || value === undefined ? "–" : number(value); };
      box.replaceChildren(node("span", null, "t ", node("b", null, `${number(self.data[0][at])} s`)), ...listed(found).map((each) => {
        const was = found.find((other) => other.was && other.which === each.which && other.at === each.at);
        const label = shown.length > 1 && several ? `#${each.which}` : each.line.label;  // the colour says which joint
        const words = [label, each.line.command ? "command" : ""].filter(Boolean).join(" ");
        return node("span", null, swatch(colour(each), each.line.command ? [3, 3] : DASHES[each.nth]), words,
          node("b", null, text(each)), was ? node("i", null, `before ${text(was)}`) : null);
      }));
    }

    // The cursors at a time, which the arm stands at.
    let pointing = false;
    model.point = (time) => {
      pointing = true;
      timeline.point(time);
      pointing = false;
    };

    // A cross where a case came to its end too early.
    function ends(self, found, colour) {
      const px = devicePixelRatio;
      const { ctx, bbox } = self;
      found.forEach((each, n) => {
        const points = self.data[n + 1];
        let last = points.length - 1;
        while (last >= 0 && (points[last] === null || points[last] === undefined)) last--;
        const end = clocks[each.clock][clocks[each.clock].length - 1];
        if (last < 0 || self.data[0][last] >= end) return;
        const [x, y] = [self.valToPos(self.data[0][last], "x", true), self.valToPos(points[last], "y", true)];
        if (x < bbox.left || x > bbox.left + bbox.width) return;
        ctx.save();
        ctx.strokeStyle = colour(each);
        ctx.lineWidth = 2 * px;
        ctx.beginPath();
        for (const sign of [1, -1]) {
          ctx.moveTo(x - 4 * px, y - 4 * sign * px);
          ctx.lineTo(x + 4 * px, y + 4 * sign * px);
        }
        ctx.stroke();
        ctx.restore();
      });
    }

    function chips() {
      const colours = palette();
      if (names && how === "change") legend.replaceChildren(node("span", null, `${names[1]} − ${names[0]}`));
      else if (names) legend.replaceChildren(...(how === "both" ? [node("span", null, swatch(pale(colours.ink), [], WAS), names[0])] : []), node("span", null, swatch(colours.ink, []), names[1]));
      const told = (each) => (each === data.middle ? `#${each}, the middle one` : each === data.most[0] ? `#${each}, changed most` : each === data.worst ? `#${each}, the worst` : `#${each}`);
      const several = histories.size > 1 || (simulation && simulation.structures.some(({ cases }) => cases.length > 1));
      const known = new Set([...histories.keys(), ...(simulation ? simulation.structures.flatMap(({ cases }) => cases.slice(0, OFFERED)) : [])]);
      const offered = [...known].filter((each) => !shown.includes(each));
      const any = simulation ? node("input", { type: "text", inputmode: "numeric", class: "any", placeholder: "any case: #", "aria-label": "Run a case again, by its number", change: () => {
        const wanted = Number(any.value.replace("#", "").trim() || NaN);
        if (has(wanted)) model.choose(wanted);
        else any.setCustomValidity(`no case ${any.value} in this page`);
        any.reportValidity();
      }, input: () => any.setCustomValidity("") }) : null;
      const add = node("select", { "aria-label": "Add a case", change: () => { show(+add.value); } },
        node("option", { value: "" }, "add a case"), offered.map((each) => node("option", { value: each }, told(each))));
      caseChips.replaceChildren(...(several ? [...shown.map((each, nth) => node("button", { type: "button", class: "chip", title: `Case #${each}: take it out`,
        click: () => { if (shown.length > 1) { shown = shown.filter((other) => other !== each); draw(); } } },
        swatch(colours.ink, DASHES[nth]), told(each), shown.length > 1 ? node("span", { class: "drop", "aria-hidden": "true" }, "×") : null)),
      offered.length ? add : null, any].filter(Boolean) : []));
      jointChips.replaceChildren(...(data.joints.length > 1 ? data.joints.map((joint, n) => node("button", { type: "button", class: "chip",
        "aria-pressed": String(!hidden.has(joint)), title: `${joint}: show or hide`,
        click: () => { if (!hidden.delete(joint)) hidden.add(joint); if (hidden.size === data.joints.length) hidden.clear(); draw(); } },
        swatch(colourOf(joint, n, colours), []), joint)) : []));
    }

    // A case is drawn first, the others after it.
    function show(number_) {
      if (!has(number_)) return;
      const others = shown.filter((each) => each !== number_);
      while (others.length >= MOST || (others.length > 1 && others.length >= data.shown.length)) {
        const last = others.length - 1;
        others.splice(others[last] === data.middle && last ? last - 1 : last, 1);
      }
      shown = [number_, ...others];
      draw();
    }

    if (!shown.length) panels.append(node("p", { class: "note" }, "The archive has no histories, and this reader does not run WebAssembly, by which they would be computed here."));
    if (shown.every((each) => histories.has(each))) draw();
    else new IntersectionObserver((entries, observer) => {  // what has to be computed waits until it is looked at
      if (!entries.some((entry) => entry.isIntersecting)) return;
      observer.disconnect();
      draw();
    }, { rootMargin: "300px" }).observe(root);
    MET.drawn.push(draw);
    model.watch(show);
    model.hasSignals = has;
    new ResizeObserver(() => plots.forEach(({ u, frame }) => {
      const wide = MET.width(frame);
      if (wide !== u.width) u.setSize({ width: wide, height: u.height });
    })).observe(root);
    model.signalPlots = () => plots.map((plot) => plot.u);
  }

  return { make };
})();
