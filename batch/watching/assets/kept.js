// The run of a deck that is watched. Each run takes the place of the one before, and is looked at where that was. Then what
// came of its cases, which are run behind it: points and maps, and the numbers that it compares its own with.
"use strict";

globalThis.metKept = (() => {
  const { node } = MET;
  const place = node("section", { class: "came-of", hidden: true });
  const drawn = node("div", { class: "of-cases" });
  const main = document.querySelector("main");
  let stageDrawn = 0;  // what is drawn anew without what came of the cases
  main.replaceChildren();

  // Where this page stands: case and sliders, clock and camera, the stretch of time that is zoomed to, and how far down.
  function take() {
    const { page, shown: stage } = MET;
    const found = page.position();
    return { run: page.data.description.name, case: found < 0 ? null : page.data.positions[found], values: Object.fromEntries(page.inputs().map(({ name }, n) => [name, page.values()[n]])),
      stage: stage && stage.kept(), zoom: zoom(), scroll: [scrollX, scrollY] };
  }

  // The inputs of a run that takes the place of one that stood there; nothing where it has no such case.
  function standing(before, { positions, description: { inputs, cases } }) {
    if (before.case === null) return inputs.map(({ name }, n) => before.values[name] ?? cases.inputs[0][n]);
    return cases.inputs[positions.indexOf(before.case)];
  }

  // data: as `batch.watching.answers.page` wrote it. Of another run, which may be of another arm, no more stays than how far
  // down one has read.
  function become(data) {
    const before = MET.page ? take() : null;
    const stays = before && before.run === data.description.name;
    const held = document.activeElement?.classList.contains("view");
    forget();
    const from = MET.page ? MET.page.close() : {};
    if (stays) data.stood = standing(before, data);
    MET.simulate(data, null, { seen: stays ? from.seen : null, surface: from.surface });
    stageDrawn = MET.drawn.length;
    document.querySelector(".answers").after(place);
    main.append(drawn);
    if (stays) zoomTo(before.zoom);
    if (held) document.querySelector(".stage .view")?.focus({ preventScroll: true });
    if (before) scrollTo(...before.scroll);
  }

  function zoom() {
    const [plot] = MET.page.plots();
    if (!plot) return null;
    const { min, max } = plot.scales.x;
    const [time] = plot.data;
    return min > time[0] || max < time[time.length - 1] ? [min, max] : null;
  }

  function zoomTo(stretch) {
    if (stretch) MET.page.plots().forEach((plot) => plot.setScale("x", { min: stretch[0], max: stretch[1] }));
  }

  const cases = (count) => `${count.toLocaleString("en")} case${count === 1 ? "" : "s"}`;

  function arrive(found) {
    const { page } = MET;
    page.arrive({ status: found.status, metrics: found.metrics });
    if (page.data.count < 2 && !found.failed && !found.doubtful.length) return;
    const all = page.data.count;
    const failed = found.failed ? `${found.failed} did not reach their end` : "all reached their end";
    place.hidden = false;
    place.replaceChildren(node("h2", null, "All cases"), node("p", null, `${found.done < all ? `${found.done} of ` : ""}${cases(all)} run: ${failed}.`),
      node("ul", null,
        found.verdicts.map(([text, met, missed, unknown]) => node("li", { class: missed ? "missed" : "" }, node("code", null, text), `: ${met} met, ${missed} missed${unknown ? `, ${unknown} not known` : ""}`)),
        found.failures.map(([count, cause, first]) => node("li", { class: "missed" }, `${cases(count)}, #${first} first: ${cause}`)),
        found.doubtful.map((text) => node("li", null, `doubtful: ${text}`))));
    draw(found.cases);
  }

  // Of what came of the cases nothing stays.
  function forget() {
    MET.drawn.length = stageDrawn;
    place.hidden = true;
    drawn.replaceChildren();
  }

  function draw(data) {
    MET.drawn.length = stageDrawn;
    drawn.replaceChildren();
    if (!data.overview) return;
    const { page } = MET;
    const model = MET.model(data);
    const points = node("div");
    const maps = node("div");
    drawn.append(points, maps);
    MET.overview.make(points, model);
    if (data.overview.maps.length) MET.map.make(maps, model);
    model.watch((number) => {
      const at = page.data.positions.indexOf(number);
      if (at >= 0) page.put(page.data.description.cases.inputs[at].slice());
    });
  }

  return { take, become, arrive, MET };
})();
