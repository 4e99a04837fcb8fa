// Two parameters that make a grid, as a table whose cells are coloured by a metric.
"use strict";

MET.map = (() => {
  const { node, number, titled, unpack } = MET;
  const MANY = 14;

  function make(root, model) {
    const maps = model.data.overview.maps;
    const metrics = model.columns.filter((c) => c.role === "metric" || c.role === "change");
    const first = model.data.overview.start[1];
    let [which, metric] = [0, (metrics.find((c) => c.key === `change:${first}`) || { key: first }).key];
    const name = (map) => `${model.column(map.x).label} × ${model.column(map.y).label}`;
    const pick = node("select", { change: () => { which = +pick.value; draw(); } }, maps.map((map, n) => node("option", { value: n }, name(map))));
    const box = node("div", { class: "wide", tabindex: 0, role: "region", "aria-label": "Map" });
    const scale = node("div", { class: "scale" });
    root.append(node("h4", null, "Two parameters at once"), node("div", { class: "controls" },
      MET.overview.chooser("Metric", metrics, metric, (key) => { metric = key; draw(); }),
      maps.length > 1 ? node("label", null, "over", pick) : null), box, scale);

    function draw() {
      const map = maps[which];
      const [x, y, m] = [model.column(map.x), model.column(map.y), model.column(metric)];
      const [values, cases, missed] = ["values", "cases", "missed"].map((part) => unpack(map.of[metric][part]));
      const counts = unpack(map.counts);
      const finite = values.filter(Number.isFinite);
      const far = m.role === "change" ? finite.reduce((a, b) => Math.max(a, Math.abs(b)), 0) || 1 : 0;
      const low = finite.reduce((a, b) => Math.min(a, b), Infinity);
      const high = finite.reduce((a, b) => Math.max(a, b), -Infinity);
      const across = map.xLevels.length;
      const many = across > MANY || map.yLevels.length > 24;
      const every = many ? Math.ceil(across / 8) : 1;
      const heads = map.xLevels.map((level, n) => node("th", { scope: "col" }, n % every ? "" : level.split(" … ")[0]));
      const rows = map.yLevels.map((level, row) => node("tr", null, node("th", { scope: "row" }, many && row % 3 ? "" : level.split(" … ")[0]),
        map.xLevels.map((_, column) => cell(row * across + column))));
      const longest = Array.from(values, (v) => (far ? MET.signed(v) : number(v)).length).reduce((a, b) => Math.max(a, b), 0);
      const wide = many ? 0.85 : Math.max(3.6, 0.62 * longest);
      const table = node("table", { class: many ? "grid many" : "grid", style: { minWidth: `${11 + across * wide}rem` } },
        node("thead", null, node("tr", null, node("th", { class: "axis" }, `${titled(y)} ↓`), node("th", { colspan: across }, `${titled(x)} →`)),
          node("tr", null, node("td", { class: "corner" }), heads)), node("tbody", null, rows.reverse()));
      box.replaceChildren(table);
      const rule = m.limits.length ? `the worst of its cases by ${m.limits[0].text}` : "the middle one of its cases";
      const judged = far ? model.column(metric.slice("change:".length)).limits.map((l) => `${l.text} asks for ${l.sense === "<" ? "less" : "more"}`) : [];
      const most = counts.reduce((a, b) => Math.max(a, b), 0);
      scale.replaceChildren(...[node("span", null, `${titled(m)}:`), !(low <= high) ? "no value" : far ? MET.overview.divide(far) : MET.overview.gradient(low, high),
        ...judged.map((words) => node("span", null, words)), most > 1 ? node("span", null, `each cell shows ${rule}`) : null,
        missed.some((n) => n > 0) ? node("span", { class: "bad-text" }, many ? "a corner: a case misses" : "✗ a case misses") : null].filter(Boolean));

      function cell(n) {
        if (!counts[n]) return node("td", { class: "void", "aria-label": "no case" });
        const value = values[n];
        const share = high > low ? (value - low) / (high - low) : 0.5;
        const colour = !Number.isFinite(value) ? null : far ? MET.diverging(value / far) : MET.ramp(share);
        const text = `${far ? MET.signed(value) : number(value)}${missed[n] ? " ✗" : ""}`;
        const style = colour ? { background: colour, color: MET.over(colour) } : {};
        if (many && missed[n]) style.backgroundImage = `linear-gradient(225deg, ${MET.over(colour || "rgb(255,255,255)")} 28%, transparent 29%)`;
        const tell = () => [node("p", null, node("b", null, titled(m))), MET.pairs([
          [x.label, `${map.xLevels[n % across]} ${x.unit}`], [y.label, `${map.yLevels[Math.floor(n / across)]} ${y.unit}`],
          [m.label, MET.quantity(value, m)], ["cases", String(counts[n])],
          ...(missed[n] ? [["missed by", String(missed[n]), "bad-text"]] : []), ...(cases[n] >= 0 ? [["shown", `#${cases[n]}`]] : [])])];
        const choose = () => { if (cases[n] >= 0) model.choose(cases[n]); };
        return node("td", { style, tabindex: many ? null : 0, class: cases[n] >= 0 && cases[n] === model.chosen ? "chosen" : null, "data-case": cases[n],
          mousemove: (event) => MET.tip.show(event.pageX, event.pageY, ...tell()), mouseleave: MET.tip.hide,
          click: choose, keydown: (event) => { if (event.key === "Enter") choose(); } }, text);
      }
    }

    draw();
    MET.drawn.push(draw);
    model.watch((chosen) => box.querySelectorAll("td").forEach((td) => td.classList.toggle("chosen", td.dataset.case === String(chosen))));
  }

  return { make };
})();
