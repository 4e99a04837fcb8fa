// Runs a module of WebAssembly that MET wrote: cases from the first tick to the last, or on from where they stand.
//
//   const kernel = METKernel.make(bytes, description);    met/backends/wasm/module.py says what these are
//   const { rows, outputs } = kernel.run([[0.1, 2.0]], 5000);
//
// A case's numbers are the same bits whatever runs it. For that each multiply-add must be rounded once. The module's own
// does that anywhere, in many operations; where the machine's relaxed one proves to do it too, it takes its place.
"use strict";

const METKernel = (() => {
  const SITES = "met.fma";
  const MADD = [0xfd, 0x87, 0x02];  // f64x2.relaxed_madd
  const LINE = 64;  // bytes to which numbers are aligned
  const ROOM = 1 << 26;  // bytes of rows that one call into the module writes at most
  const aligned = (at) => Math.ceil(at / LINE) * LINE;

  // A module whose function `f` is the first lane of f64x2.relaxed_madd.
  function probe() {
    const body = [0, 0x20, 0, 0xfd, 20, 0x20, 1, 0xfd, 20, 0x20, 2, 0xfd, 20, ...MADD, 0xfd, 33, 0, 0x0b];
    return new Uint8Array([0, 97, 115, 109, 1, 0, 0, 0, 1, 8, 1, 96, 3, 124, 124, 124, 1, 124, 3, 2, 1, 0,
      7, 5, 1, 1, 102, 0, 0, 10, body.length + 2, 1, body.length, ...body]);
  }

  // Whether the machine's multiply-add rounds once. (1 + 2^-30)^2 - (1 + 2^-29) is 2^-60 then, and 0 where it rounds twice.
  function fuses() {
    const bytes = probe();
    if (!WebAssembly.validate(bytes)) return false;
    const { f } = new WebAssembly.Instance(new WebAssembly.Module(bytes)).exports;
    return f(1 + 2 ** -30, 1 + 2 ** -30, -(1 + 2 ** -29)) === 2 ** -60;
  }

  // The module with the machine's multiply-add for its own.
  function fused(bytes, module) {
    const made = bytes.slice();
    for (const section of WebAssembly.Module.customSections(module, SITES)) {
      const steps = new Uint8Array(section);
      for (let i = 0, at = 0; i < steps.length;) {
        let step = 0, shift = 0, byte;
        do {
          byte = steps[i++];
          step |= (byte & 0x7f) << shift;
          shift += 7;
        } while (byte & 0x80);
        at += step;
        made.set(MADD, at);
      }
    }
    return made;
  }

  // bytes: the module, Uint8Array; description: what stands in its JSON file.
  // machine: whether to use the machine's multiply-add; left out, it is found out.
  function make(bytes, description, machine = fuses()) {
    let module = new WebAssembly.Module(bytes);
    if (machine) module = new WebAssembly.Module(fused(bytes, module));
    return new Kernel(new WebAssembly.Instance(module).exports, description, machine);
  }

  class Kernel {
    constructor(exports, description, machine) {
      this.description = description;
      this.fused = machine;
      this.memory = exports.memory;
      this.entry = exports[description.entry];
    }

    // Rows that ticks first to last record, both done.
    rows(first, last) {
      const every = this.description.record_divisor;
      return Math.max(0, Math.floor(last / every) - Math.ceil(first / every) + 1);
    }

    // Runs cases from tick `first` to tick `last`, both done. inputs: [case][input], numbers in the order of the
    // description. state: of one block, [cell][lane], as an earlier call left it; without it tick 0 is the first.
    // Gives rows, [case][row][column], or null without `record`; outputs, [case][output]; and the last block's state.
    run(inputs, last, { first = 0, record = true, state = null } = {}) {
      const { lanes, columns, inputs: given, cells, outputs: put } = this.description;
      const count = inputs.length;
      const width = this.rows(first, last) * columns;
      const rows = record ? new Float64Array(count * width) : null;
      const outputs = new Float64Array(count * put.length);
      const most = Math.max(1, Math.floor(ROOM / (8 * lanes * Math.max(1, width)))) * lanes;
      let left = state;
      for (let begin = 0; begin < count; begin += most) {
        const some = inputs.slice(begin, begin + most);
        const blocks = Math.ceil(some.length / lanes);
        let at = this.description.heap;
        const place = (numbers) => {
          const here = at;
          at = aligned(at + 8 * Math.max(1, numbers));
          return here;
        };
        const places = [blocks * given.length * lanes, cells.length * lanes, record ? some.length * width : 0,
          blocks * Math.max(1, put.length) * lanes].map(place);
        this.room(at);
        const view = (n, length) => new Float64Array(this.memory.buffer, places[n], length);
        const packed = view(0, blocks * given.length * lanes);
        for (let block = 0; block < blocks; block++)
          for (let lane = 0; lane < lanes; lane++) {
            const one = some[Math.min(block * lanes + lane, some.length - 1)];
            for (let i = 0; i < given.length; i++) packed[(block * given.length + i) * lanes + lane] = one[i];
          }
        if (left) view(1, cells.length * lanes).set(left);
        this.entry(places[0], places[1], record && width ? places[2] : 0, places[3], BigInt(blocks), BigInt(first), BigInt(last),
          BigInt(some.length), BigInt(width), 0n);
        // the module may have let its memory grow, which leaves views of before empty
        if (record) rows.set(view(2, some.length * width), begin * width);
        const results = view(3, blocks * put.length * lanes);
        for (let c = 0; c < some.length; c++)
          for (let i = 0; i < put.length; i++)
            outputs[(begin + c) * put.length + i] = results[(Math.floor(c / lanes) * put.length + i) * lanes + (c % lanes)];
        left = view(1, cells.length * lanes).slice();
      }
      return { rows, outputs, state: left };
    }

    // Makes memory at least so large.
    room(bytes) {
      const more = Math.ceil((bytes - this.memory.buffer.byteLength) / 65536);
      if (more > 0) this.memory.grow(more);
    }
  }

  // The tick at which a case has failed, null where it has not: what its program tells, and what it only watches. outputs:
  // of the case; of: places among them, as the JSON file's `failure` has them.
  function failed(outputs, of) {
    let tick = outputs[of.failure] !== 0 ? outputs[of.tick] : null;
    for (const [place, at] of [[of.too_fast, (seen) => seen], [of.unheld, () => 0]]) {
      if (place === null || outputs[place] === 0) continue;
      if (tick === null || tick > at(outputs[place])) tick = at(outputs[place]);
    }
    return tick;
  }

  return { make, fuses, failed };
})();

if (typeof module !== "undefined") module.exports = METKernel;
