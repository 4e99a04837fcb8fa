// r of the cases against a parameter, and how large it may be.
"use strict";

MET.stability = (() => {
  const { node, number, unpack } = MET;

  function make(root, model) {
    const data = model.data.stability;
    const cases = unpack(data.cases);
    const columns = data.columns.map((column) => ({ ...column, values: unpack(column.values) }));
    const beds = data.beds.map((bed) => ({ joint: bed.joint, r: unpack(bed.r), limit: unpack(bed.limit) }));
    let [x, joint] = [start(), 0];
    if (cases.length < 2) return;
    const frame = node("div", { class: "frame" });
    const scale = node("div", { class: "scale" });
    const pick = node("select", { change: () => { joint = +pick.value; draw(); } }, beds.map((bed, n) => node("option", { value: n }, bed.joint)));
    root.append(node("div", { class: "controls" }, beds.length > 1 ? node("label", null, "Joint", pick) : null,
      MET.overview.chooser("r against", columns, x, (key) => { x = key; draw(); })), frame, scale);
    let plot = null;

    function draw() {
      if (plot) plot.destroy();
      const bed = beds[joint];
      const cx = columns.find((column) => column.key === x);
      const limits = Array.from(bed.limit).filter((v) => v > 0);
      const one = limits.length === cases.length && new Set(limits).size === 1 ? limits[0] : 0;  // the same for all: a line
      plot = MET.points.make(frame, {
        x: cx, y: { label: "r", unit: "", words: [], values: bed.r,
          limits: one ? [{ text: `unstable above ${number(one)}`, value: one, sense: "<" }] : [] }, height: 300, logY: far([...bed.r, ...limits]),
        name: `r of ${bed.joint} against ${cx.label}`, reach: limits,
        style: (place, colours) => ({ fill: bad(bed, place) ? colours.attend : colours.accent, ring: bad(bed, place), size: 4.2 }),
        marks(u, ctx, colours, at, px) {
          ctx.strokeStyle = colours.attend;
          ctx.lineWidth = 2 * px;
          bed.limit.forEach((limit, place) => {
            if (one || !(limit > 0) || !Number.isFinite(cx.values[place])) return;
            const [left, top] = at(cx.values[place], limit);
            ctx.beginPath();
            ctx.moveTo(left - 9 * px, top);
            ctx.lineTo(left + 9 * px, top);
            ctx.stroke();
          });
        },
        told: (place) => [node("p", null, node("b", null, `#${cases[place]}`)), MET.pairs([
          ...columns.filter((c) => c.role !== "case").map((c) => [c.label, MET.quantity(c.values[place], c)]), ["r", number(bed.r[place])],
          ["stable to", bed.limit[place] > 0 ? number(bed.limit[place]) : "no limit found"]])],
        choose: (place) => model.choose(cases[place]),
        chosen: () => cases.indexOf(model.chosen),
      });
      const colours = MET.palette();
      const dot = node("span", { class: "dot", style: { background: colours.accent } });
      const dash = node("svg", { viewBox: "0 0 18 8", width: 18, height: 8, "aria-hidden": "true" }, node("line", { x1: 0, x2: 18, y1: 4, y2: 4, stroke: colours.attend, "stroke-width": 2 }));
      scale.replaceChildren(node("span", { class: "item tight" }, dot, "r of a case"),
        ...(one ? [] : [limits.length ? node("span", { class: "item" }, dash, "where it becomes unstable") : node("span", null, "no limit was found")]));
    }

    // Whether values are so far apart that a logarithmic axis tells them apart better.
    const far = (values) => Math.min(...values) > 0 && Math.max(...values) > 8 * Math.min(...values);

    // Where one parameter decides r and its limit that one, else the case.
    function start() {
      const told = (column) => new Set(cases.map((_, n) => column.values[n])).size;
      const both = (column) => new Set(cases.map((_, n) => n).reduce((all, n) => [...all, [column.values[n], ...beds.flatMap((b) => [b.r[n], b.limit[n]])].join()], [])).size;
      return columns.find((column) => both(column) === told(column)).key;
    }

    const bad = (bed, place) => bed.limit[place] <= bed.r[place];
    draw();
    MET.drawn.push(draw);
    model.watch(() => plot.redraw());
    new ResizeObserver(() => {
      const wide = MET.width(frame);
      if (wide !== plot.u.width) plot.u.setSize({ width: wide, height: plot.u.height });
    }).observe(root);
  }

  return { make };
})();
