// The cases as points: a metric against a parameter, in the colours of another; and about the one that is chosen.
"use strict";

MET.overview = (() => {
  const { node, number, quantity, titled } = MET;
  const FEW = 8;
  const STEMS = 600;  // cases, of more it is not drawn at first where each was
  const BAD = ["missed", "unknown", "failed", "timed out", "lost"];

  function chooser(name, columns, start, changed, none) {
    const options = columns.map((c) => node("option", { value: c.key, selected: c.key === start }, titled(c)));
    if (none) options.push(node("option", { value: "", selected: start === "" }, none));
    const select = node("select", { change: () => changed(select.value) }, options);
    return node("label", null, name, select);
  }

  function make(root, model) {
    const metrics = model.columns.filter((c) => c.role === "metric");
    const changes = model.columns.filter((c) => c.role === "change");
    const against = model.columns.filter((c) => c.role !== "metric" && c.role !== "change");
    let stems = changes.length > 0 && model.cases.length < STEMS;
    let [x, y, by] = model.data.overview.start;
    const frame = node("div", { class: "frame" });
    const scale = node("div", { class: "scale" });
    const tick = node("input", { type: "checkbox", class: "stems", checked: stems, change: () => { stems = tick.checked; draw(); } });
    const controls = node("div", { class: "controls" },
      chooser("Metric", [...metrics, ...changes], y, (key) => { y = key; draw(); }),
      chooser("against", [...against, ...metrics], x, (key) => { x = key; draw(); }),
      chooser("coloured by", [...against, ...metrics, ...changes], by, (key) => { by = key; draw(); }, "nothing"),
      changes.length ? node("label", null, tick, "values before") : null);
    root.append(controls, frame, scale);
    let plot = null;

    function draw() {
      if (plot) plot.destroy();
      const [cx, cy, cb] = [model.column(x), model.column(y), by ? model.column(by) : null];
      const colour = cb ? colours(cb) : null;
      tick.disabled = !cy.before;
      const size = model.cases.length < 400 ? 4.2 : model.cases.length < 4000 ? 2.8 : 1.8;
      const rings = model.cases.length < 4000;
      plot = MET.points.make(frame, {
        x: cx, y: cy, height: 380, logY: cy.role === "change" ? false : undefined, name: `${titled(cy)} against ${titled(cx)}, ${model.cases.length} cases`,
        style: (place, palette) => ({
          fill: colour ? colour.of(cb.values[place], palette) : palette.accent,
          ring: rings && BAD.includes(model.outcome[place]), size,
        }),
        marks: stems && cy.before ? (u, ctx, palette, at, px) => was(ctx, palette, at, px, cx, cy, size) : null,
        reach: stems && cy.before ? Array.from(cy.before).filter(Number.isFinite) : cy.role === "change" ? [0] : [],
        told: (place) => note(model, place, [cx, cy, cb]),
        choose: (place) => model.choose(model.cases[place]),
        chosen: () => (model.places.has(model.chosen) ? model.places.get(model.chosen) : -1),
      });
      model.plot = plot;
      legend(scale, colour, cb, rings && model.outcome.some((each) => BAD.includes(each)), model, stems && cy.before);
    }

    draw();
    MET.drawn.push(draw);
    model.watch(() => plot.redraw());
    new ResizeObserver(() => {
      const wide = MET.width(frame);
      if (wide !== plot.u.width) plot.u.setSize({ width: wide, height: plot.u.height });
    }).observe(root);
  }

  // Of each case where the metric was, as a short bar, and a thin line from there to its point.
  function was(ctx, palette, at, px, cx, cy, size) {
    ctx.strokeStyle = palette.muted;
    cy.before.forEach((before, place) => {
      const [x, y] = [cx.values[place], cy.values[place]];
      if (!Number.isFinite(x) || !Number.isFinite(before) || y === before) return;
      const [left, top] = at(x, before);
      ctx.lineWidth = 1.6 * px;
      ctx.beginPath();
      ctx.moveTo(left - 1.3 * size * px, top);
      ctx.lineTo(left + 1.3 * size * px, top);
      ctx.stroke();
      if (!Number.isFinite(y)) return;
      ctx.lineWidth = 0.8 * px;
      ctx.beginPath();
      ctx.moveTo(left, top);
      ctx.lineTo(...at(x, y));
      ctx.stroke();
    });
  }

  // Colours of a column's values: of few a step each, of many a ramp.
  function colours(column) {
    const levels = [...new Set(Array.from(column.values).filter(Number.isFinite))].sort((a, b) => a - b);
    const discrete = levels.length <= FEW;
    const place = new Map(levels.map((level, n) => [level, n]));
    const reach = column.reach;
    if (column.role === "change" && reach) {
      return { levels, discrete: false, reach, parting: true, of: (value, palette) => (Number.isFinite(value) ? MET.diverging(visible(value / reach.high)) : palette.muted) };
    }
    const share = (value) => (discrete ? place.get(value) / Math.max(1, levels.length - 1) : MET.share(value, reach));
    return { levels, discrete, reach, share, of: (value, palette) => (Number.isFinite(value) ? (discrete ? MET.ramp(share(value)) : MET.tone(value, reach)) : palette.muted) };
  }

  // A point of no change is not to be lost on the paper.
  const visible = (share) => Math.sign(share || 1) * Math.max(Math.abs(share), 0.12);

  function legend(box, colour, column, rings, model, stems) {
    const items = [];
    if (colour) {
      items.push(node("span", null, `${titled(column)}:`));
      if (colour.discrete) {
        for (const level of colour.levels) {
          const dot = node("span", { class: "dot", style: { background: MET.ramp(colour.share(level)) } });
          items.push(node("span", { class: "item tight" }, dot, column.words.length ? column.words[level] : number(level)));
        }
      } else if (colour.reach) items.push(...scale(colour.reach, colour.parting));
    }
    if (rings) {
      const filled = node("span", { class: "dot", style: { background: "currentColor" } });
      const ring = node("span", { class: "dot", style: { border: "1.5px solid currentColor" } });
      const good = model.outcome.includes("done") ? "reached its end" : "meets all";
      items.push(node("span", { class: "item" }, node("span", null, filled, good), node("span", null, ring, good === "meets all" ? "does not" : "did not")));
    }
    if (stems) {
      const bar = node("svg", { viewBox: "0 0 14 12", width: 14, height: 12, "aria-hidden": "true" },
        node("line", { x1: 1, x2: 13, y1: 3, y2: 3, stroke: "currentColor", "stroke-width": 1.6 }), node("line", { x1: 7, x2: 7, y1: 3, y2: 12, stroke: "currentColor", "stroke-width": 0.8 }));
      items.push(node("span", { class: "item" }, bar, `in ${model.data.against[0]}`));
    }
    box.replaceChildren(...items, node("span", { class: "hint" }, "drag to zoom, double click for all, click to choose a case"));
  }

  // Colours from end to end, and how many values lie beyond; of changes from less to more.
  function scale(reach, parting, counted = (n) => n.toLocaleString("en")) {
    const stops = [...Array(9).keys()].map((n) => (parting ? MET.diverging(n / 4 - 1) : MET.ramp(n / 8))).join(",");
    const beyond = (words, sign, colour) => (words ? node("span", { class: "item tight" }, node("span", { class: "beyond", style: { color: colour } }, sign), words) : null);
    const [low, high] = [reach.low, reach.high].map(parting ? MET.signed : number);
    const count = (n, words, value) => n && `${counted(n)} ${words} ${number(value)}`;
    return [beyond(count(reach.below, "below, down to", reach.least), "◀", parting ? MET.diverging(-1) : MET.BELOW),
      node("span", { class: "item" }, low, node("span", { class: "ramp", style: { background: `linear-gradient(90deg,${stops})` } }), high),
      beyond(count(reach.above, "above, up to", reach.most), "▶", parting ? MET.diverging(1) : MET.ABOVE), reach.log ? "logarithmic" : null].filter(Boolean);
  }

  // A value, and what it was before.
  function compared(column, place) {
    const before = column.before ? column.before[place] : NaN;
    const now = quantity(column.values[place], column);
    return !column.before || Number.isNaN(before) || before === column.values[place] ? now : `${now}, before ${number(before)}`;
  }

  function note(model, place, shown) {
    const plain = model.columns.filter((c) => c.role !== "change");
    const columns = [...new Set([...shown.filter(Boolean), ...plain])].slice(0, 9);
    const outcome = model.outcome[place];
    return [
      node("p", null, node("b", null, `#${model.cases[place]} `), node("code", null, model.data.overview.ids[place]), "  ",
        node("span", { class: BAD.includes(outcome) ? "bad-text" : "" }, outcome === "done" ? "" : outcome)),
      MET.pairs(columns.filter((c) => c.role !== "case").map((c) => [c.label, compared(c, place)])),
    ];
  }

  // All about the chosen case.
  function card(box, model) {
    model.watch((chosen) => {
      const place = model.places.get(chosen);
      const command = model.command(chosen);
      if (place === undefined) {
        box.replaceChildren(node("div", { class: "top" }, node("b", null, `Case #${chosen}`), "is not among those that are drawn."), run(command));
        return;
      }
      const outcome = model.outcome[place];
      const cause = model.data.overview.causes[place];
      const values = model.columns.filter((c) => c.role !== "case" && c.role !== "change").map((c) => {
        const missed = (c.limits || []).some((l) => (l.sense === "<" ? c.values[place] > l.value : c.values[place] < l.value));
        return node("div", null, node("dt", null, c.label), node("dd", { class: missed ? "bad" : "" }, compared(c, place)));
      });
      const history = model.hasSignals && model.hasSignals(chosen);
      box.replaceChildren(
        node("div", { class: "top" }, node("b", null, `Case #${chosen}`), node("code", null, model.data.overview.ids[place]),
          outcome === "done" ? null : node("span", { class: BAD.includes(outcome) ? "bad" : "good" }, outcome),
          cause ? node("span", null, MET.prose(cause)) : null,
          history ? node("a", { href: `#${model.id}-signals`, class: "hint" }, "its signals are below") : null),
        node("dl", { class: "values" }, values), run(command));
    });
    box.setAttribute("aria-live", "polite");
  }

  const run = (command) => node("div", { class: "command" },
    node("button", { type: "button", class: "copy", "data-copy": command, "aria-label": `Copy ${command}` }, "copy"), " ", node("code", null, command));

  return { make, card, chooser, scale };
})();
