// Runs a module under node for `met.backends.wasm.module`: the question comes on stdin, the answer goes to stdout.
//
//   question  one line of JSON (description, last, first, record, cases, machine, bytes of the module, whether a state
//             follows); the module; inputs [case][input]; the state
//   answer    rows, outputs, state, all doubles; on stderr one line of JSON
"use strict";

// Browsers have had it since 2023; a node before 21 has it only when it is told, a later one does not know the word.
require("v8").setFlagsFromString("--experimental-wasm-relaxed-simd");

const { readFileSync, writeSync } = require("fs");
const METKernel = require("./kernel.js");

function put(numbers) {
  const bytes = new Uint8Array(numbers.buffer, numbers.byteOffset, numbers.byteLength);
  for (let at = 0; at < bytes.length;) {
    try {
      at += writeSync(1, bytes, at, Math.min(bytes.length - at, 1 << 20));
    } catch (error) {
      if (error.code !== "EAGAIN") throw error;
    }
  }
}

const question = readFileSync(0);
const end = question.indexOf(10);
const asked = JSON.parse(question.subarray(0, end).toString());
const { description, first, last, record, cases, machine } = asked;
const code = new Uint8Array(question.subarray(end + 1, end + 1 + asked.bytes));
const numbers = new Float64Array(new Uint8Array(question.subarray(end + 1 + asked.bytes)).buffer);
const width = description.inputs.length;
const inputs = Array.from({ length: cases }, (_, c) => numbers.subarray(c * width, (c + 1) * width));
const begun = performance.now();
const kernel = METKernel.make(code, description, machine ?? undefined);
const made = performance.now();
let state = asked.state ? numbers.slice(cases * width) : null;
let found;
const times = [];
for (let n = 0; n < (asked.times ?? 1); n++) {
  const before = performance.now();
  found = kernel.run(inputs, last, { first, record, state });
  times.push(performance.now() - before);
}
if (record) put(found.rows);
put(found.outputs);
put(found.state);
process.stderr.write(JSON.stringify({ fused: kernel.fused, compile_ms: made - begun, run_ms: times }) + "\n");
