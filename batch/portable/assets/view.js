// A page that simulates: a slider for each number that the sweep varies; each time one moves, the run is computed here, by
// the archive's own module, and its signals, metrics and verdicts are shown. What stands in the archive is compared.
// Texts of a deck come into the page as text nodes alone.
"use strict";

// data: as `batch.portable.page` wrote it; back: of a second module, the archive's. Of the simulation whose place it takes,
// seen: where the arm was looked at from; surface: what it was drawn on.
MET.simulate = (data, back, { seen = null, surface = null } = {}) => {
  const { bytes, node, number } = MET;
  const { description: told } = data;
  const kernel = METKernel.make(bytes(data.module), told.kernel);
  const cases = told.cases.inputs;
  const { source } = data;  // what the numbers are compared with: an archive, or the run of a deck that is watched
  let archived = data.metrics.map((text) => new Float64Array(bytes(text).buffer));
  const time = Float64Array.from({ length: told.rows }, (_, n) => (n * told.kernel.record_divisor) / told.kernel.base_hz);
  const main = document.querySelector("main");
  const came = node("p", { class: "came", role: "status" });
  const answers = node("tbody");
  const panels = node("div");
  const room = node("div");
  const MOST_GHOSTS = 100;
  const MOST_VALUES = 4;  // that the list of cases shows of each
  const SLICE = 24;  // ms of work between which the page answers
  const others = [];
  const ending = new AbortController();
  let turn = 0;  // of computing them
  const addressed = Boolean(data.report) && cases.length > 1;  // the page's address says which case is shown
  let [noted, moved] = [0, false];
  let values = (data.stood || (addressed && asked()) || cases[data.opens ?? 0]).slice();
  let lines = [];
  let pale = [];  // of what stands beside, under them
  let theirs = null;  // metrics of what stands beside, by name, SI
  let measured = [];  // metrics of what is shown; not a number where it failed
  let again = () => {};  // says again whose numbers these are
  const other = data.beside ? MET.beside.make(data.beside, data, time) : null;
  const free = data.limits ? data.free || (data.free = MET.numbers.make(data, (found) => data.give(found))) : null;
  data.give = (found) => { values = found; update(); };

  // The case, or the numbers between cases, that the page's address asks for; nothing where it asks for none that there is.
  function asked() {
    const [, kind, text] = /^#(case|at)=([-+.,e\d]{1,4000})$/.exec(location.hash) ?? [];
    if (kind === "case") return cases[data.positions.indexOf(Number(text))];
    const found = (text ?? "").split(",").map(Number);
    const fits = (value, n) => value >= Math.min(...cases.map((each) => each[n])) && value <= Math.max(...cases.map((each) => each[n]));
    return found.length === told.inputs.length && found.every(fits) ? found : undefined;
  }

  function address(which) {
    clearTimeout(noted);
    noted = setTimeout(() => history.replaceState(null, "", which < 0 ? `#at=${values.join(",")}` : `#case=${data.positions[which]}`), 300);
  }

  // Sliders, and which case of the archive they stand at.
  const knobs = free ? [] : told.inputs.map((input, n) => {
    const own = [...new Set(cases.map((each) => each[n]))].sort((a, b) => a - b);
    if (input.is !== "coordinate" || own.length < 2) return null;
    const made = MET.knobs.make({ label: data.labels[n], unit: data.units[n], scale: input.scale, own }, (value) => {
      values[n] = value;
      update();
    });
    return { put: (moved) => made.put(values[n], moved), box: made.box };
  }).filter(Boolean);

  const chosen = node("select", { "aria-label": `Case of the ${source}`, change: () => {
    place(cases[chosen.value].slice());
  } }, node("option", { value: "", disabled: true }, `none of the ${source}'s`), ...cases.map((_, n) => node("option", { value: n }, `#${data.positions[n]}`)));

  // Each case with what is varied in it, what it misses, and which is best and worst by the requirement that is hardest on
  // it: as far as the archive has its metrics.
  function list() {
    const varied = told.inputs.flatMap((input, n) => (input.is === "coordinate" && cases.some((each) => each[n] !== cases[0][n]) ? [n] : []));
    const names = [...told.metrics, ...told.not_computed].map((metric) => metric.name);
    const found = cases.map((each, n) => {
      const slack = told.requirements.map((required) => {
        const value = archived[names.indexOf(required.metric)][n];
        return { text: required.text, met: judged(required, value), by: (required.comparison[0] === "<" ? 1 : -1) * (required.limit - value) / (Math.abs(required.limit) || 1) };
      });
      return { misses: slack.filter(({ met }) => !met).map(({ text }) => text), least: Math.min(...slack.map(({ by }) => by)), known: data.status[n] === 0 && slack.length && slack.every(({ by }) => !Number.isNaN(by)) };
    });
    const known = found.filter((each) => each.known).map(({ least }) => least);
    const [worst, best] = [Math.min(...known), Math.max(...known)];
    found.forEach(({ misses, least, known: is }, n) => {
      const own = varied.slice(0, MOST_VALUES).map((at) => `${number(cases[n][at] / told.inputs[at].scale)} ${data.units[at]}`.trim());
      const verdict = data.status[n] > 0 ? "✗ fails" : !is ? "" : misses.length ? `✗ misses ${misses[0]}${misses.length > 1 ? ` and ${misses.length - 1} more` : ""}` : "✓";
      const rank = !is || worst === best ? "" : least === best ? "(best)" : least === worst ? "(worst)" : "";
      chosen.options[n + 1].textContent = [`#${data.positions[n]}`, own.length ? `${own.join(", ")}${varied.length > own.length ? ", …" : ""}` : "", verdict, rank].filter(Boolean).join("  ");
    });
  }

  const same = (a, b) => a.every((value, n) => Object.is(value, b[n]));
  const position = () => cases.findIndex((each) => same(each, values));  // among the cases; -1 between them

  function update() {
    const begun = performance.now();
    const found = kernel.run([values], told.ticks);
    const took = performance.now() - begun;
    const { tick, failed, rows } = ended(found.outputs);
    const width = told.columns.length;
    lines = told.columns.map((_, c) => Array.from(time, (_t, row) => (row < rows ? found.rows[row * width + c] / data.columnScales[c] : null)));
    if (other) accompany();
    const which = position();
    if (addressed && moved) address(which);
    moved = true;
    chosen.value = which < 0 ? "" : which;
    knobs.forEach((knob) => knob.put(false));
    measured = told.metrics.map((metric) => (failed ? NaN : found.outputs[metric.output]));
    traces.show(lines, pale, (m, requirement) => (Number.isNaN(measured[m]) ? null : { value: measured[m], met: judged(requirement, measured[m]) }));
    (again = () => tell(which, found.outputs, failed, tick, took))();
    if (stage && rows) stage.show(runOf(values, found.rows, rows), free ? (free.isOwn() ? "the deck's numbers" : "other numbers") : which < 0 ? `not in the ${source}` : `case #${data.positions[which]}`);
    if (stage) stage.haunt(others.filter((each) => each.n !== which));
  }

  // What stands beside the run, with the same numbers.
  function accompany() {
    const { columns, solids, metrics } = other.at(values);
    theirs = metrics;
    pale = columns.map((numbers, c) => Array.from(time, (_, row) => (numbers && !Number.isNaN(numbers[row]) ? numbers[row] / data.columnScales[c] : null)));
    if (stage) stage.accompany(solids, other.name);
  }

  // How a case ended, and how many rows it has.
  function ended(outputs) {
    const tick = METKernel.failed(outputs, told.failure);
    return { tick, failed: tick !== null, rows: tick === null ? told.rows : Math.ceil(tick / told.kernel.record_divisor) };
  }

  // The arm: the case that is shown, and the archive's others, which are computed here one after another.
  const stage = data.arm.scene ? MET.stage.make(room, data.arm, { seen: point, surface }) : null;
  if (!stage && surface) surface.renderer.close();
  if (!stage) room.append(node("p", { class: "note" }, `The arm is not shown, for the run does not record ${data.arm.lacking.join(", ")}: `, node("code", null, `record += [${data.arm.lacking.join(", ")}];`)));

  // The numbers of a case, as the arm takes them.
  const runOf = (inputs, numbers, rows) => ({ values: Object.fromEntries(told.inputs.map((input, n) => [input.name, inputs[n]])), time: time.subarray(0, rows), numbers, width: told.columns.length });

  function haunt() {
    if (ending.signal.aborted) return;
    const count = Math.min(cases.length, MOST_GHOSTS + 1);
    const chosen = Array.from({ length: count }, (_, n) => Math.floor((n * cases.length) / count));
    const mine = ++turn;
    let done = 0;
    others.length = 0;
    (function next() {
      if (mine !== turn) return;
      const begun = performance.now();
      while (done < chosen.length && performance.now() - begun < SLICE) {
        const n = chosen[done++];
        const found = kernel.run([cases[n]], told.ticks);
        const { failed, rows } = ended(found.outputs);
        const bad = failed || told.requirements.some((each) => missed(each, n, found.outputs));
        if (rows) others.push({ n, bad, taken: stage.take(runOf(cases[n], found.rows, rows)) });
      }
      stage.haunt(others.filter((each) => !same(cases[each.n], values)));
      if (done < chosen.length) setTimeout(next);
      else {
        stage.settle();
        document.documentElement.dataset.haunted = "yes";
      }
    })();
  }

  // A metric of an archive's case: computed here, or as the archive has it.
  function numberOf(name, n, outputs) {
    const own = told.metrics.find((metric) => metric.name === name);
    return own ? outputs[own.output] : archived[told.metrics.length + told.not_computed.findIndex((metric) => metric.name === name)][n];
  }

  // Whether a case misses a requirement; what is not known of a case that has yet to be run is no miss.
  function missed(requirement, n, outputs) {
    const value = numberOf(requirement.metric, n, outputs);
    return !judged(requirement, value) && !(data.status[n] < 0 && Number.isNaN(value));
  }

  function judged({ comparison, limit }, value) {
    return { "<": (a, b) => a < b, "<=": (a, b) => a <= b, ">": (a, b) => a > b, ">=": (a, b) => a >= b }[comparison](value, limit);
  }

  // One clock: the plots' cursors stand at the arm's time, and the arm at that of a plot that is clicked at.
  const traces = MET.traces.make(panels, data, time, { beside: Boolean(other), seek: (t) => stage && stage.seek(t), now: () => (stage ? stage.time() : null) });

  function point(at) {
    traces.point(at);
  }

  // Whose numbers these are: the archive's, where every metric has the bits that stand there.
  function tell(which, outputs, failed, tick, took) {
    const speed = `computed here in ${number(took)} ms`;
    came.title = kernel.fused ? "with this machine's fused multiply-add, which rounds as the archive's does" : "with the module's own fused multiply-add";
    const name = which < 0 ? "" : data.count > 1 ? `Case #${data.positions[which]}` : "The run";
    const awaited = which >= 0 && data.status[which] < 0;  // of a deck that is watched: `met` has yet to run it
    const wrong = which < 0 || data.status[which] !== 0 ? [] : told.metrics.filter((_, m) => !Object.is(measured[m], archived[m][which]));
    const bad = wrong.length > 0 || (which >= 0 && !awaited && failed !== (data.status[which] !== 0));
    let words = `Not in the ${source}: `;
    if (free) words = "By another program than the archive's, so that last digits may differ: ";
    else if (awaited) words = `${name}, before it is compared: `;
    else if (bad) words = `Other numbers than the ${source} has for ${name[0].toLowerCase()}${name.slice(1)}${wrong.length ? ` (${wrong.map((metric) => metric.name).join(", ")})` : ""}: `;
    else if (which >= 0 && failed) words = `${name} fails, as in the ${source}: `;
    else if (which >= 0) words = measured.length ? `${name}, with the ${source}'s bits in ${measured.length === 1 ? "its metric" : `all ${measured.length} metrics`}: ` : `${name}; it has no metric to compare: `;
    const end = failed ? `; it fails at ${number(tick / told.kernel.base_hz)} s` : "";
    came.classList.toggle("bad", bad);
    came.textContent = `${words}${speed}${end}.`;
    // Metrics of linear answers are not computed here: the archive's cases have them from the archive.
    const given = [...measured, ...told.not_computed.map((_, n) => (which < 0 || awaited ? null : archived[measured.length + n][which]))];
    answers.replaceChildren(...[...told.metrics, ...told.not_computed].map((metric, m) => {
      const unknown = given[m] === null || Number.isNaN(given[m]);
      const verdicts = told.requirements.filter((each) => each.metric === metric.name).map((each) => {
        if (unknown) return node("div", null, `${each.text}: not known`);
        const met = judged(each, given[m]);
        return node("div", { class: met ? "met" : "missed" }, `${each.text}: ${met ? "met" : `missed${why(each, metric, m, given[m], outputs)}`}`);
      });
      const value = given[m] === null ? "not computed here" : `${number(given[m] / data.metricScales[m])} ${data.metricUnits[m]}`.trim();
      const compared = theirs ? beside(metric.name, m, given[m]) : [];
      const whose = given[m] === null || m < measured.length ? "" : `, from the ${source}`;
      return node("tr", null, node("td", null, node("code", null, metric.name)), node("td", null, value + whose), compared, node("td", { class: "about" }, data.metricAbout[m]), node("td", null, verdicts));
    }));
  }

  // A metric of what stands beside the run, with the same numbers, and how far it is from this one.
  function beside(name, m, ours) {
    const value = theirs[name] ?? NaN;
    const change = ours === null ? NaN : value === ours ? 0 : value - ours;
    const text = (found, words) => (Number.isNaN(found) ? "–" : `${words(found / data.metricScales[m])} ${data.metricUnits[m]}`.trim());
    return [[other.name, text(value, number)], [`${other.name} − this`, text(change, MET.signed)]].map(([head, words]) => node("td", { "data-head": head }, words));
  }

  // By how much a requirement is missed, when, and at which limit of a machine.
  function why({ limit }, metric, m, value, outputs) {
    const far = Math.abs(value - limit) / data.metricScales[m];
    const when = m < measured.length ? traces.when(m, value) : null;
    const extreme = told.kernel.outputs.indexOf(`extreme:${metric.name}:at_limit`);
    const reached = extreme < 0 ? undefined : (data.atLimits[metric.name] ?? [])[outputs[extreme] - 1];
    return [far > 0 && Number.isFinite(far) ? ` by ${number(far)} ${data.metricUnits[m]}`.trimEnd() : "",
      when === null ? "" : `, at ${number(when)} s`, reached ? `, while ${reached} was reached` : ""].join("");
  }

  const heads = other && other.hasMetrics ? [node("thead", null, node("tr", null, ["", "this", other.name, `${other.name} − this`, "", ""].map((head) => node("th", null, head))))] : [];
  delete document.documentElement.dataset.haunted;
  main.replaceChildren(room,
    ...(back || data.numbers ? [node("p", null, node("label", null, node("input", { type: "checkbox", class: "other-numbers", checked: Boolean(back), change: () => leave() }), " other numbers"))] : []),
    ...(free ? [node("div", { class: "knobs" }, free.box)] : []),
    ...(cases.length > 1 ? [node("div", { class: "knobs" }, node("label", { class: "knob" }, "Case", chosen, node("output", null, `of ${data.count}`)), knobs.map((knob) => knob.box))] : []),
    came, ...(other ? [node("p", { class: "note" }, "Beside it, wide and pale: ", node("b", null, other.name), `, ${other.note}.`)] : []), node("table", { class: heads.length ? "answers against" : "answers" }, heads, answers),
    ...(data.report ? [node("p", { class: "note" }, "All cases in one page, which miss and why, as points and maps: ", node("code", null, data.report))] : []), panels);
  if (data.head) entitle(data.head);
  knobs.forEach((knob) => knob.put());
  list();
  update();
  if (stage && seen) stage.resume(seen);
  if (stage && cases.length > 1) requestAnimationFrame(() => setTimeout(haunt));
  else document.documentElement.dataset.haunted = "yes";
  MET.shown = stage;
  // For who puts a page in the place of another, or has numbers later: batch/watching/assets/kept.js.
  MET.page = { data, inputs: () => told.inputs, values: () => values, position, plots: traces.plots, put: place, arrive, close };

  function place(given) {
    values = given;
    knobs.forEach((knob) => knob.put());
    update();
  }

  function arrive(found) {
    Object.assign(data, found);
    archived = data.metrics.map((text) => new Float64Array(bytes(text).buffer));
    list();
    again();
    if (stage && told.not_computed.length && cases.length > 1) haunt();
  }

  // Another simulation takes this one's place: it ends, and hands over what that goes on with.
  function close() {
    turn++;
    clearTimeout(noted);
    ending.abort();
    traces.close();
    return stage ? { seen: stage.kept(), surface: stage.close() } : {};
  }

  function leave() {
    data.stood = values;
    const [other, { scene }] = [data.numbers?.arm, data.arm];  // its arm is this one, which has the meshes
    if (scene?.meshes && other?.scene && JSON.stringify(other.scene.bodies) === JSON.stringify(scene.bodies)) [other.scene.meshes, other.meshes] = [scene.meshes, data.arm.meshes];
    MET.simulate(back || data.numbers, back ? null : data, close());
  }

  function entitle({ kicker, name, lede }) {
    document.title = name;
    [[".kicker", kicker], ["h1", name], [".lede", lede]].forEach(([which, text]) => { document.querySelector(`header ${which}`).replaceChildren(...(which === ".lede" ? MET.prose(text) : [text])); });
  }
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", traces.draw, { signal: ending.signal });
  addEventListener("resize", traces.draw, { signal: ending.signal });
};
