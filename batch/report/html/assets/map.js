// Two parameters that make a grid, coloured by a metric: few cells as a table with their numbers, many as a drawing.
"use strict";

MET.map = (() => {
  const { node, number, titled, unpack } = MET;
  const PADDING = 10;  // px on both sides of a table
  const MANY = [14, 24];  // columns, rows: of more, no number has room in a cell

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
    let drawn = null;

    function draw() {
      const map = maps[which];
      const [x, y, m] = [model.column(map.x), model.column(map.y), model.column(metric)];
      const of = map.of[metric];
      const found = { map, x, y, m, reach: of.reach, across: map.xLevels.length, up: map.yLevels.length,
        values: unpack(of.values), cases: unpack(of.cases), missed: unpack(of.missed), counts: unpack(map.counts), failed: unpack(map.failed) };
      found.kind = (n) => kind(found, n);
      found.colour = (n) => (m.role === "change" ? MET.diverging(found.values[n] / found.reach.high) : MET.tone(found.values[n], found.reach));
      found.tell = (n) => tell(found, n);
      const many = found.across > MANY[0] || found.up > MANY[1] || least(found) > MET.width(box) - PADDING;
      box.classList.toggle("drawn", many);
      drawn = (many ? MET.cells : table)(box, found, model);
      legend(found, many);
    }

    function legend({ m, map, reach, counts, values, missed, kind: of }, many) {
      const change = m.role === "change";
      const judged = change ? model.column(metric.slice("change:".length)).limits.map((l) => `${l.text} asks for ${l.sense === "<" ? "less" : "more"}`) : [];
      const rule = m.limits.length ? `the worst of its cases by ${m.limits[0].text}` : "the middle one of its cases";
      const several = counts.some((count) => count > 1);
      const kinds = Array.from(values, (_, n) => of(n));
      const greys = [["infinite", "infinite"], ["failed", "failed"], ["lacking", "no value"], ["void", "no case"]].map(([key, words]) => {
        const count = kinds.filter((each) => each === key).length;
        return count ? node("span", { class: "item tight" }, node("span", { class: `patch ${key}` }), `${words} (${cells(count)})`) : null;
      });
      const bad = missed.reduce((sum, n) => sum + (n > 0), 0);
      const [misses, all] = [missed, counts].map((each) => each.reduce((sum, n) => sum + n, 0));
      const filled = counts.reduce((sum, n) => sum + (n > 0), 0);
      const told = several ? `${grouped(misses)} of ${grouped(all)} cases miss, in ${grouped(bad)} of ${cells(filled)}` : `missed (${grouped(misses)} of ${grouped(all)} cases)`;
      scale.replaceChildren(...[node("span", null, `${titled(m)}:`), ...(reach ? MET.overview.scale(reach, change, several ? cells : grouped) : ["no value"]),
        ...judged.map((words) => node("span", null, words)), ...greys,
        bad ? node("span", { class: "item tight bad-text" }, many ? node("span", { class: "patch striped" }) : "✗ ", told) : null,
        several ? node("span", null, `each cell shows ${rule}`) : null].filter(Boolean));
    }

    draw();
    MET.drawn.push(draw);
    model.watch((chosen) => drawn.choose(chosen));
    new ResizeObserver(() => { if (drawn.wide !== MET.width(box)) draw(); }).observe(root);
  }

  const grouped = (count) => count.toLocaleString("en");
  const cells = (count) => `${grouped(count)} cell${count === 1 ? "" : "s"}`;

  // What a cell holds: a number, or why it has none.
  function kind({ counts, values, failed }, n) {
    if (!counts[n]) return "void";
    if (Number.isFinite(values[n])) return "number";
    return Number.isNaN(values[n]) ? (failed[n] ? "failed" : "lacking") : "infinite";
  }

  function tell({ map, x, y, m, across, values, cases, missed, counts, failed }, n) {
    return [node("p", null, node("b", null, titled(m))), MET.pairs([
      [x.label, `${map.xLevels[n % across]} ${x.unit}`], [y.label, `${map.yLevels[Math.floor(n / across)]} ${y.unit}`],
      [m.label, MET.quantity(values[n], m)], ["cases", String(counts[n])],
      ...(missed[n] ? [["missed by", String(missed[n]), "bad-text"]] : []), ...(failed[n] ? [["failed", String(failed[n]), "bad-text"]] : []),
      ...(cases[n] >= 0 ? [["shown", `#${cases[n]}`]] : [])])];
  }

  const text = (found, n) => (found.kind(n) === "failed" ? "failed" : (found.m.role === "change" ? MET.signed : number)(found.values[n])) + (found.missed[n] ? " ✗" : "");
  const rem = (count) => count * parseFloat(getComputedStyle(document.documentElement).fontSize);

  // How wide a cell with its number is, in rem.
  const wide = (found) => Math.max(3.6, 0.62 * Array.from(found.values, (_, n) => text(found, n).length).reduce((a, b) => Math.max(a, b), 0));

  // How wide a table of all is at least, px; its first column is narrower on a narrow page.
  const least = (found) => rem((matchMedia("(max-width: 46rem)").matches ? 7 : 11) + found.across * wide(found));

  // Few cells, each with its number.
  function table(box, found, model) {
    const { map, x, y, across, cases } = found;
    const heads = map.xLevels.map((level) => node("th", { scope: "col" }, level));
    const rows = map.yLevels.map((level, row) => node("tr", null, node("th", { scope: "row" }, level),
      map.xLevels.map((_, column) => cell(row * across + column))));
    box.replaceChildren(node("table", { class: "grid", style: { minWidth: `${least(found)}px` } },
      node("thead", null, node("tr", null, node("th", { class: "axis" }, `${titled(y)} ↓`), node("th", { colspan: across }, `${titled(x)} →`)),
        node("tr", null, node("td", { class: "corner" }), heads)), node("tbody", null, rows.reverse())));

    function cell(n) {
      if (found.kind(n) === "void") return node("td", { class: "void", "aria-label": "no case" });
      const colour = found.kind(n) === "number" ? found.colour(n) : null;
      const choose = () => { if (cases[n] >= 0) model.choose(cases[n]); };
      return node("td", { style: colour ? { background: colour, color: MET.over(colour) } : {}, tabindex: 0,
        class: [found.kind(n), cases[n] >= 0 && cases[n] === model.chosen ? "chosen" : ""].join(" ").trim(), "data-case": cases[n],
        mousemove: (event) => MET.tip.show(event.pageX, event.pageY, ...found.tell(n)), mouseleave: MET.tip.hide,
        click: choose, keydown: (event) => { if (event.key === "Enter") choose(); } }, text(found, n));
    }

    return { wide: MET.width(box), choose: (chosen) => box.querySelectorAll("td").forEach((td) => td.classList.toggle("chosen", td.dataset.case === String(chosen))) };
  }

  return { make };
})();
