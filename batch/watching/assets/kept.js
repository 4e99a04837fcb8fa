// A run that takes another's place in the page around it: it is looked at where that was. Then what came of its cases,
// which are run behind it: points and maps, and the numbers that it compares its own with.
"use strict";

globalThis.metKept = (() => {
  const { node } = MET;
  const { page, shown: stage } = MET;
  const names = () => page.inputs().map((input) => input.name);
  const place = node("section", { class: "came-of", hidden: true });
  const drawn = node("div", { class: "of-cases" });
  let model = null;
  document.querySelector(".answers").after(place);
  document.querySelector("main").append(drawn);

  // Where this page stands: case and sliders, clock and camera, the stretch of time that is zoomed to, and how far down.
  function take() {
    const found = page.position();
    return { run: page.data.description.name, case: found < 0 ? null : page.data.positions[found], values: Object.fromEntries(names().map((name, n) => [name, page.values()[n]])),
      stage: stage && stage.kept(), zoom: zoom(), scroll: [scrollX, scrollY] };
  }

  // Of another run, which may be of another arm, no more than how far down one has read.
  function put(before) {
    if (before.run !== page.data.description.name) {
      scrollTo(...before.scroll);
      return;
    }
    const at = page.data.positions.indexOf(before.case);
    let values = page.values();
    if (before.case !== null && at >= 0) values = page.data.description.cases.inputs[at].slice();
    else if (before.case === null) values = values.map((value, n) => before.values[names()[n]] ?? value);
    if (values.some((value, n) => !Object.is(value, page.values()[n]))) page.put(values);
    if (stage && before.stage) stage.resume(before.stage);
    zoomTo(before.zoom);
    scrollTo(...before.scroll);
  }

  function zoom() {
    const [plot] = page.plots();
    if (!plot) return null;
    const { min, max } = plot.scales.x;
    const [time] = plot.data;
    return min > time[0] || max < time[time.length - 1] ? [min, max] : null;
  }

  function zoomTo(stretch) {
    if (stretch) page.plots().forEach((plot) => plot.setScale("x", { min: stretch[0], max: stretch[1] }));
  }

  const cases = (count) => `${count.toLocaleString("en")} case${count === 1 ? "" : "s"}`;

  function arrive(found) {
    const before = zoom();
    page.arrive({ status: found.status, metrics: found.metrics });
    zoomTo(before);
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

  function draw(data) {
    MET.drawn.length = stageDrawn;
    drawn.replaceChildren();
    if (!data.overview) return;
    model = MET.model(data);
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

  const stageDrawn = MET.drawn.length;
  return { take, put, arrive };
})();
