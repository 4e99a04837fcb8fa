// Replays formulas as `met.trace.Formulas` stores them: numbers from numbers by name. A reference is twice a node's place,
// plus one for its negative (of a truth: its opposite). The multiply-add rounds twice here, which no picture shows.
"use strict";

MET.formulas = (() => {
  const TRUTHS = new Set(["false", "lt", "le", "eq", "and", "bit"]);
  const WORDS = { inf: Infinity, nan: NaN };
  const one = new Float64Array(1);
  const halves = new Uint32Array(one.buffer);

  const bit = (value, n) => {
    one[0] = value;
    return (halves[n >> 5] >>> (n & 31)) & 1;
  };
  const exponent = (value) => {
    one[0] = value;
    return ((halves[1] >>> 20) & 0x7ff) - 1023;
  };
  const significand = (value) => {
    one[0] = value;
    halves[1] = (halves[1] & 0xfffff) | 0x3ff00000;
    return one[0];
  };
  const rint = (value) => {
    const low = Math.floor(value);
    return value - low < 0.5 || (value - low === 0.5 && low % 2 === 0) ? low : low + 1;
  };
  const gather = (index, table) => {
    if (Number.isNaN(index)) return NaN;
    const entry = table[Math.floor(Math.min(Math.max(index, 0), table.length - 1))];
    return WORDS[entry] ?? entry;
  };

  // Operands, each operation's count of them, and last what is no operand.
  const DO = {
    false: [0, () => 0], abs: [1, Math.abs], sqrt: [1, Math.sqrt], floor: [1, Math.floor], rint: [1, rint],
    bit: [1, (a, b, c, n) => bit(a, n)], pow2: [1, (a) => 2 ** a], exponent: [1, exponent], significand: [1, significand],
    gather: [1, (a, b, c, table) => gather(a, table)],
    add: [2, (a, b) => a + b], sub: [2, (a, b) => a - b], mul: [2, (a, b) => a * b], div: [2, (a, b) => a / b],
    lt: [2, (a, b) => +(a < b)], le: [2, (a, b) => +(a <= b)], eq: [2, (a, b) => +(a === b)], and: [2, (a, b) => a && b],
    flip: [2, (a, b, c, n) => (bit(b, n) ? -a : a)], fma: [3, (a, b, c) => a * b + c], where: [3, (a, b, c) => (a ? b : c)],
  };

  // nodes, outputs: as stored; moving: names of inputs that change with the instant, others are a case's.
  function make(nodes, outputs, moving) {
    const truth = nodes.map(([op]) => TRUTHS.has(op));
    const inputs = new Map();
    const moves = [];
    const [still, changing] = [[], []];
    nodes.forEach((node, i) => {
      const op = node[0];
      moves[i] = op === "input" && moving.has(node[1]);
      if (op === "input") inputs.set(node[1], i);
      if (op === "input" || op === "const") return;
      const [count, run] = DO[op];
      const operands = node.slice(1, 1 + count);
      moves[i] = operands.some((ref) => moves[ref >> 1]);
      (moves[i] ? changing : still).push({ i, run, a: operands[0] ?? 0, b: operands[1] ?? 0, c: operands[2] ?? 0, rest: node[1 + count] });
    });
    let state;
    const read = (ref) => (ref & 1 ? (truth[ref >> 1] ? 1 - state[ref >> 1] : -state[ref >> 1]) : state[ref >> 1]);
    const evaluate = (list) => list.forEach(({ i, run, a, b, c, rest }) => { state[i] = run(read(a), read(b), read(c), rest); });

    // The state of a case. values: by name, of the inputs that are not moving.
    function begin(values) {
      state = Float64Array.from(nodes, (node, i) => (node[0] === "const" ? WORDS[node[1]] ?? node[1] : node[0] === "input" && !moves[i] ? values[node[1]] ?? NaN : 0));
      evaluate(still);
      return state;
    }

    // Its outputs where the moving inputs, in the order of their names, are these.
    const places = [...moving].map((name) => inputs.get(name) ?? -1);
    function at(own, values, out = new Float64Array(outputs.length)) {
      state = own;
      places.forEach((place, n) => { if (place >= 0) state[place] = values[n]; });
      evaluate(changing);
      outputs.forEach((ref, n) => { out[n] = read(ref); });
      return out;
    }

    return { begin, at };
  }

  return { make };
})();
