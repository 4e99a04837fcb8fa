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

  // Operations by number, and how many operands each has; after these stands what is no operand.
  const CODES = ["false", "abs", "sqrt", "floor", "rint", "bit", "pow2", "exponent", "significand", "gather",
    "add", "sub", "mul", "div", "lt", "le", "eq", "and", "flip", "fma", "where"];
  const COUNTS = [0, 1, 1, 1, 1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2, 2, 3, 3];
  const STEP = 5;  // numbers of an operation in a list: code, place, three operands
  const [NEGATIVE, NOT] = [1, 2];  // what becomes of an operand, in the lowest two bits of its reference

  // Numbers instead of functions, and one switch: a hundred ghosts replay some 30,000 operations a picture.
  function evaluate(list, rests, state) {
    const read = (ref) => {
      const value = state[ref >> 2];
      return (ref & 3) === 0 ? value : ref & NEGATIVE ? -value : 1 - value;
    };
    for (let k = 0; k < list.length; k += STEP) {
      const [i, a] = [list[k + 1], read(list[k + 2])];
      switch (list[k]) {
        case 0: state[i] = 0; break;
        case 1: state[i] = Math.abs(a); break;
        case 2: state[i] = Math.sqrt(a); break;
        case 3: state[i] = Math.floor(a); break;
        case 4: state[i] = rint(a); break;
        case 5: state[i] = bit(a, rests[i]); break;
        case 6: state[i] = 2 ** a; break;
        case 7: state[i] = exponent(a); break;
        case 8: state[i] = significand(a); break;
        case 9: state[i] = gather(a, rests[i]); break;
        case 10: state[i] = a + read(list[k + 3]); break;
        case 11: state[i] = a - read(list[k + 3]); break;
        case 12: state[i] = a * read(list[k + 3]); break;
        case 13: state[i] = a / read(list[k + 3]); break;
        case 14: state[i] = +(a < read(list[k + 3])); break;
        case 15: state[i] = +(a <= read(list[k + 3])); break;
        case 16: state[i] = +(a === read(list[k + 3])); break;
        case 17: state[i] = a && read(list[k + 3]); break;
        case 18: state[i] = bit(read(list[k + 3]), rests[i]) ? -a : a; break;
        case 19: state[i] = a * read(list[k + 3]) + read(list[k + 4]); break;
        case 20: state[i] = a ? read(list[k + 3]) : read(list[k + 4]); break;
      }
    }
  }

  // nodes, outputs: as stored; moving: names of inputs that change with the instant, others are a case's.
  function make(nodes, outputs, moving) {
    const truth = nodes.map(([op]) => TRUTHS.has(op));
    const operand = (ref) => (ref === undefined ? 0 : ((ref >> 1) << 2) | (ref & 1 ? (truth[ref >> 1] ? NOT : NEGATIVE) : 0));
    const inputs = new Map();
    const moves = [];
    const rests = [];
    const [first, each] = [[], []];
    nodes.forEach((node, i) => {
      const op = node[0];
      moves[i] = op === "input" && moving.has(node[1]);
      if (op === "input") inputs.set(node[1], i);
      if (op === "input" || op === "const") return;
      const code = CODES.indexOf(op);
      if (code < 0) throw new Error(`no operation ${op}`);
      const operands = node.slice(1, 1 + COUNTS[code]);
      moves[i] = operands.some((ref) => moves[ref >> 1]);
      rests[i] = node[1 + COUNTS[code]];
      (moves[i] ? each : first).push(code, i, ...[0, 1, 2].map((n) => operand(operands[n])));
    });
    const [still, changing, given] = [first, each, outputs.map(operand)].map((list) => Int32Array.from(list));

    // The state of a case. values: by name, of the inputs that are not moving.
    function begin(values) {
      const state = Float64Array.from(nodes, (node, i) => (node[0] === "const" ? WORDS[node[1]] ?? node[1] : node[0] === "input" && !moves[i] ? values[node[1]] ?? NaN : 0));
      evaluate(still, rests, state);
      return state;
    }

    // Its outputs where the moving inputs, in the order of their names, are these.
    const places = [...moving].map((name) => inputs.get(name) ?? -1);
    function at(state, values, out = new Float64Array(outputs.length)) {
      places.forEach((place, n) => { if (place >= 0) state[place] = values[n]; });
      evaluate(changing, rests, state);
      for (let n = 0; n < given.length; n++) {
        const value = state[given[n] >> 2];
        out[n] = (given[n] & 3) === 0 ? value : given[n] & NEGATIVE ? -value : 1 - value;
      }
      return out;
    }

    return { begin, at };
  }

  return { make };
})();
