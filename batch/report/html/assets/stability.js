// r of the cases against a parameter, and how large, and how small, it may be.
"use strict";

MET.stability = (() => {
  const { node, number, unpack } = MET;

  function make(root, model) {
    const data = model.data.stability;
    const cases = unpack(data.cases);
    const columns = data.columns.map((column) => ({ ...column, values: unpack(column.values) }));
    const beds = data.beds.map((bed) => ({ joint: bed.joint, r: unpack(bed.r), ends: [unpack(bed.lower), unpack(bed.limit)], unstable: unpack(bed.unstable) }));
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
      const known = bed.ends.map((end) => Array.from(end).filter((v) => v > 0));
      const limits = known.flat();
      const same = known.map((end) => (end.length === cases.length && new Set(end).size === 1 ? end[0] : 0));  // for all: a line
      const single = bed.ends.map((end, n) => n).filter((n) => !same[n] && known[n].length);
      plot = MET.points.make(frame, {
        x: cx, y: { label: "r", unit: "", words: [], values: bed.r,
          limits: [["below", ">"], ["above", "<"]].map(([side, sense], n) => ({ text: `unstable ${side} ${number(same[n])}`, value: same[n], sense })).filter((limit) => limit.value > 0) }, height: 300, logY: far([...bed.r, ...limits]),
        name: `r of ${bed.joint} against ${cx.label}`, reach: limits,
        style: (place, colours) => ({ fill: bed.unstable[place] ? colours.attend : colours.accent, ring: bed.unstable[place] > 0, size: 4.2 }),
        marks(u, ctx, colours, at, px) {
          ctx.strokeStyle = colours.attend;
          ctx.lineWidth = 2 * px;
          single.forEach((n) => bed.ends[n].forEach((limit, place) => {
            if (!(limit > 0) || !Number.isFinite(cx.values[place])) return;
            const [left, top] = at(cx.values[place], limit);
            ctx.beginPath();
            ctx.moveTo(left - 9 * px, top);
            ctx.lineTo(left + 9 * px, top);
            ctx.stroke();
          }));
        },
        told: (place) => [node("p", null, node("b", null, `#${cases[place]}`)), MET.pairs([
          ...columns.filter((c) => c.role !== "case").map((c) => [c.label, MET.quantity(c.values[place], c)]), ["r", number(bed.r[place])],
          stable(...bed.ends.map((end) => end[place]))])],
        choose: (place) => model.choose(cases[place]),
        chosen: () => cases.indexOf(model.chosen),
      });
      const colours = MET.palette();
      const dot = node("span", { class: "dot", style: { background: colours.accent } });
      const dash = node("svg", { viewBox: "0 0 18 8", width: 18, height: 8, "aria-hidden": "true" }, node("line", { x1: 0, x2: 18, y1: 4, y2: 4, stroke: colours.attend, "stroke-width": 2 }));
      scale.replaceChildren(node("span", { class: "item tight" }, dot, "r of a case"),
        ...(limits.length && !single.length ? [] : [limits.length ? node("span", { class: "item" }, dash, "where it becomes unstable") : node("span", null, "no limit was found")]));
    }

    // Whether values are so far apart that a logarithmic axis tells them apart better.
    const far = (values) => Math.min(...values) > 0 && Math.max(...values) > 8 * Math.min(...values);

    // Where one parameter decides r and its limit that one, else the case.
    function start() {
      const told = (column) => new Set(cases.map((_, n) => column.values[n])).size;
      const both = (column) => new Set(cases.map((_, n) => n).reduce((all, n) => [...all, [column.values[n], ...beds.flatMap((b) => [b.r[n], ...b.ends.map((end) => end[n])])].join()], [])).size;
      return columns.find((column) => both(column) === told(column)).key;
    }

    // Where it is: not a number is an end that was not found; up to 0 is nowhere.
    function stable(lower, limit) {
      if (limit === 0) return ["stable", "nowhere"];
      if (lower > 0) return limit > 0 ? ["stable at", `${number(lower)} to ${number(limit)}`] : ["stable from", number(lower)];
      return ["stable to", limit > 0 ? number(limit) : "no limit found"];
    }

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
