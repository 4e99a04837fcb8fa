// What is shown beside a run: another archive's run with the same numbers, computed by that archive's module, or a log.
// Its numbers are in SI, of the page's columns and at the page's rows; not a number where there are none.
"use strict";

MET.beside = (() => {
  const { bytes } = MET;

  // given: as `batch.portable.page` wrote it; data, time: the page's own, and the times of its rows.
  function make(given, data, time) {
    const own = data.description.columns.map(({ channel }) => channel);
    const made = given.page ? ofArchive(given.page, own, data.description, time) : ofLog(given, own, data, time);
    return { name: given.name, ...made };
  }

  // The arm where its numbers are known: its solids at a time, none before and after. columns: of each channel.
  function drawn(arm, values, time, columns) {
    const known = (row) => columns.every((each) => !Number.isNaN(each[row]));
    let [first, last] = [0, time.length - 1];
    while (first <= last && !known(first)) first++;
    while (last >= first && !known(last)) last--;
    if (last < first) return null;
    const taken = arm.take(values, time.subarray(first, last + 1), columns.map((each) => each.subarray(first, last + 1)));
    return (t) => (t < time[first] || t > time[last] ? [] : arm.solids(taken.at(t)));
  }

  function ofArchive(page, own, { inputs, metrics: ours }, time) {
    const asked = Object.fromEntries(ours.map(({ name, unit }) => [name, unit]));
    const told = page.description;
    const kernel = METKernel.make(bytes(page.module), told.kernel);
    const arm = page.arm.scene ? MET.arm.make(page.arm.scene) : null;
    const places = own.map((channel) => told.columns.findIndex((column) => column.channel === channel));
    const units = own.map((_, n) => places[n] < 0 || told.columns[places[n]].unit === page.own[n]);
    const step = told.kernel.record_divisor / told.kernel.base_hz;

    // values: of the page's inputs. What the other has besides is as in its first case.
    function at(values) {
      const given = told.inputs.map(({ name }, n) => {
        const mine = inputs.findIndex((input) => input.name === name);
        return mine < 0 ? told.cases.inputs[0][n] : values[mine];
      });
      const found = kernel.run([given], told.ticks);
      const tick = METKernel.failed(found.outputs, told.failure);
      const rows = tick === null ? told.rows : Math.ceil(tick / told.kernel.record_divisor);
      const width = told.columns.length;
      const theirs = (column) => Float64Array.from({ length: rows }, (_, row) => found.rows[row * width + column]);
      const columns = places.map((place, n) => (place < 0 || !units[n] || !rows ? null : resampled(theirs(place), step, time)));
      const moving = arm ? page.arm.columns.map(theirs) : [];
      const times = Float64Array.from({ length: rows }, (_, row) => row * step);
      const named = Object.fromEntries(told.inputs.map(({ name }, n) => [name, given[n]]));
      const metrics = Object.fromEntries(told.metrics.filter(({ name, unit }) => asked[name] === unit).map(({ name, output }) => [name, tick === null ? found.outputs[output] : NaN]));
      return { columns, metrics, solids: arm && rows ? drawn(arm, named, times, moving) : null };
    }
    const code = page.same_code ? "the code that it was made with" : "other code than it was made with";
    return { at, hasMetrics: true, note: `the same numbers, computed here by ${code}` };
  }

  // Numbers of rows that follow one another by a step, at other times.
  function resampled(numbers, step, time) {
    const last = numbers.length - 1;
    return Float64Array.from(time, (t) => {
      const place = t / step;
      if (place > last + 1e-9) return NaN;
      const row = Math.min(Math.floor(place + 1e-9), last);
      const share = place - row;
      return share < 1e-9 || row === last ? numbers[row] : numbers[row] + share * (numbers[row + 1] - numbers[row]);
    });
  }

  function ofLog(given, own, data, time) {
    const columns = given.values.map((text) => (text === null ? null : new Float64Array(bytes(text).buffer)));
    const { scene } = data.arm;
    const arm = scene ? MET.arm.make(scene) : null;
    const moving = scene ? scene.channels.map((name) => columns[own.indexOf(name)] ?? null) : [];
    const lacking = scene ? scene.channels.filter((_, n) => moving[n] === null) : [];
    const at = (values) => ({
      columns,
      solids: arm && !lacking.length ? drawn(arm, Object.fromEntries(data.description.inputs.map(({ name }, n) => [name, values[n]])), time, moving) : null,
    });
    const without = lacking.length ? `; it has no arm, without ${lacking.join(", ")}` : "";
    const unused = given.unused.length ? `; not shown: ${given.unused.join(", ")}` : "";
    return { at, note: `a log of ${given.told.join(", ")}${without}${unused}` };
  }

  return { make };
})();
