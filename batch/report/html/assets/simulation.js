// Cases that are run again here, by the archive's own modules, and compared with what the archive has of them to the bit.
"use strict";

MET.simulation = (() => {
  const { number, unpack } = MET;
  const KEPT = 12;  // runs that are held at once

  const doubles = (text) => new Float64Array(MET.bytes(text).buffer);

  // Numbers as `payload.exact` wrote them.
  function exact({ b, n }) {
    const each = doubles(b);
    return n === undefined ? each : Float64Array.from(new Uint16Array(MET.bytes(n).buffer), (which) => each[which]);
  }

  // Whether this reader runs modules at all: there are some that do not, or forbid it.
  function allowed() {
    try {
      return Boolean(new WebAssembly.Module(new Uint8Array([0, 97, 115, 109, 1, 0, 0, 0])));
    } catch {
      return false;
    }
  }

  // model: of a section. Null where it has no module, or where this reader runs none.
  function make(model) {
    const data = model.data.simulation;
    if (!data || !allowed()) return null;
    const made = (told) => {
      const cases = Array.from(unpack(told.cases));
      const every = told.kernel.record_divisor / told.kernel.base_hz;
      return { ...told, cases, row: new Map(cases.map((case_, row) => [case_, row])), runner: null,
        time: Float64Array.from({ length: told.rows }, (_, row) => row * every), inputs: told.inputs.map(exact), status: unpack(told.status),
        metrics: told.metrics.map((each) => ({ ...each, values: exact(each.values) })), before: told.before && made(told.before) };
    };
    const structures = data.structures.map(made);
    const places = new Map(structures.flatMap(({ cases }, n) => cases.map((case_) => [case_, n])));
    const kept = new Map();
    const has = (case_) => places.has(case_);
    const hadBefore = (case_) => has(case_) && Boolean(structures[places.get(case_)].before?.row.has(case_));

    // A case, run again: its rows until it ended or failed, and the metrics that are not the archive's. was: as the other
    // archive has it.
    function run(case_, was = false) {
      const key = `${case_}${was ? " before" : ""}`;
      if (kept.has(key)) return kept.get(key);
      const structure = places.get(case_);
      const own = was ? structures[structure].before : structures[structure];
      const row = own.row.get(case_);
      own.runner ??= METKernel.make(MET.bytes(MET.modules[own.module]), own.kernel);
      const values = own.inputs.map((column) => column[row]);
      const begun = performance.now();
      const { rows: numbers, outputs } = own.runner.run([values], own.ticks);
      const tick = METKernel.failed(outputs, own.failure);
      const failed = tick !== null;
      const rows = failed ? Math.ceil(tick / own.kernel.record_divisor) : own.rows;
      const done = own.status[row] === 0;
      const wrong = done && !failed ? own.metrics.filter(({ output, values: archived }) => !Object.is(outputs[output], archived[row])).map(({ name }) => name) : [];
      const found = { case: case_, structure, own, values, numbers, rows, tick, failed, wrong, other: failed === done, took: performance.now() - begun };
      kept.set(key, found);
      if (kept.size > KEPT) kept.delete(kept.keys().next().value);
      return found;
    }

    // The lines of a panel, as the plots take them.
    function lines(found, panel) {
      const { own } = found;
      const { columns } = own.kernel;
      const { scale } = model.data.signals.panels[panel];
      return own.panels[panel].map((column) => Array.from(own.time, (_, row) => {
        const value = column < 0 || row >= found.rows ? NaN : found.numbers[row * columns + column] / scale;
        return Number.isFinite(value) ? value : null;
      }));
    }

    // Whose numbers these are: the archive's, where every metric has the bits that stand there.
    function tell(found) {
      const { own } = found;
      const name = `Case #${found.case}`;
      const code = own.sameCode ? "" : ", by other code than the archive was made with";
      const when = found.failed ? `; it fails at ${number(found.tick / own.kernel.base_hz)} s` : "";
      const how = `run again here${code} in ${number(found.took)} ms${when}.`;
      if (found.other || found.wrong.length) {
        const which = found.wrong.length ? ` in ${found.wrong.join(", ")}` : "";
        return { bad: true, words: `${name} has other numbers here than in the archive${which}: ${how}` };
      }
      if (found.failed) return { bad: false, words: `${name} fails here, as in the archive: ${how}` };
      const count = own.metrics.length;
      if (!count) return { bad: false, words: `${name} has no metric to compare: ${how}` };
      return { bad: false, words: `${name} has the archive's bits in ${count === 1 ? "its metric" : `all ${count} metrics`}: ${how}` };
    }

    return { has, structureOf: (case_) => places.get(case_), hadBefore, run, lines, tell, structures };
  }

  return { make };
})();
