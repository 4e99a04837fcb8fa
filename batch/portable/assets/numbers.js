// Other numbers: one of the deck's at a time, by a slider about the deck's value or typed, in the unit in which the deck
// writes it; the others are the deck's. What is shown is what is computed: a decimal in that unit, in SI rounded once, as
// `met run --vary` reads it. Texts of a deck come into the page as text nodes alone.
"use strict";

MET.numbers = (() => {
  const { node } = MET;
  const DIGITS = 6;  // of what a slider gives
  const NEAR = 0.01;  // of a slider's way, within which it takes the deck's value
  const BITS = 66;  // of a quotient before it is rounded, more than a double has
  const [MANTISSA, LEAST] = [53, 1074];  // bits of a double; 2^-1074 is the least one

  // over / under, rounded once to a double, half to even. Both are whole numbers, under is above zero.
  function divided(over, under) {
    if (over === 0n) return 0;
    const length = (whole) => whole.toString(2).length;
    const shift = BITS - length(over) + length(under);
    const [above, below] = shift >= 0 ? [over << BigInt(shift), under] : [over, under << BigInt(-shift)];
    const [quotient, rest] = [above / below, above % below];
    const dropped = BigInt(Math.max(length(quotient) - MANTISSA, shift - LEAST));
    const [kept, half, left] = [quotient >> dropped, 1n << (dropped - 1n), quotient & ((1n << dropped) - 1n)];
    const up = left > half || (left === half && (rest || kept & 1n)) ? 1n : 0n;
    return scaled(Number(kept + up), Number(dropped) - shift);
  }

  // value * 2^power, for powers beyond those of doubles, too.
  function scaled(value, power) {
    let found = value;
    for (let left = power; left !== 0;) {
      const step = Math.max(-1000, Math.min(1000, left));
      found *= 2 ** step;
      left -= step;
    }
    return found;
  }

  // A decimal in a unit that is over / under SI units, in SI; not a number where the text is none.
  function inSI(text, [over, under]) {
    const found = /^\s*([-+]?)(\d*)\.?(\d*)(?:[eE]([-+]?\d{1,3}))?\s*$/.exec(text);
    if (!found || !(found[2] + found[3])) return NaN;
    const power = Number(found[4] || 0) - found[3].length;
    const digits = BigInt(found[2] + found[3]);
    const size = divided(digits * BigInt(over) * 10n ** BigInt(Math.max(power, 0)), BigInt(under) * 10n ** BigInt(Math.max(-power, 0)));
    return found[1] === "-" ? -size : size;
  }

  // The shortest decimal in a unit that is this SI value; of twelve digits, where none is it to the bit.
  function written(value, scale, exact) {
    for (let digits = 1; digits <= 17; digits++) {
      const text = String(Number((value / scale).toPrecision(digits)));
      if (Object.is(inSI(text, exact), value)) return text;
    }
    return String(Number((value / scale).toPrecision(12)));
  }

  // data: of the second module; changed: is told of all values.
  function make(data, changed) {
    const { inputs } = data.description;
    const own = data.description.cases.inputs[0];
    const told = own.map((value, i) => written(value, inputs[i].scale, data.exact[i]));  // the deck's, in its units
    let [n, text] = [0, told[0]];
    const slider = MET.knobs.stepped(node("input", { type: "range", min: 0, max: 1, step: 0.001, "aria-label": "value", input: () => {
      const [low, high] = ends();
      const at = low + Number(slider.value) * (high - low);
      const inside = Math.min(high, Math.max(low, at));
      if (Math.abs(at - own[n]) <= NEAR * (high - low)) give(told[n]);
      else give(String(Number((inside / inputs[n].scale).toPrecision(DIGITS))));
    } }));
    const typed = node("input", { type: "text", inputmode: "decimal", autocomplete: "off", spellcheck: "false", "aria-label": "value, typed", change: () => give(typed.value) });
    const unit = node("span", { class: "unit" });
    const refused = node("p", { class: "refused", role: "alert" });
    const which = node("select", { "aria-label": "Number of the deck", change: () => {
      n = Number(which.value);
      give(told[n]);
    } }, data.labels.map((label, i) => node("option", { value: i }, label)));
    const left = data.leftOut.length ? node("details", { class: "note" }, node("summary", null, `${data.leftOut.length} of the deck's numbers cannot be moved here`),
      node("p", null, "They have no effect on this run, decide its program, were given by `--set`, or are beyond the first that a page takes: ", data.leftOut.flatMap((path, i) => [i ? ", " : "", node("code", null, path)]))) : null;

    function ends() {
      const { low, high } = data.limits[n];
      const kept = (value) => Math.min(high, Math.max(low, value));
      const [one, value] = [inputs[n].scale, own[n]];
      return value === 0 ? [kept(-one), kept(one)] : [kept(Math.min(0, 2 * value)), kept(Math.max(0, 2 * value))];
    }

    function values() {
      const found = own.slice();
      found[n] = text === told[n] ? own[n] : inSI(text, data.exact[n]);
      return found;
    }

    function put() {
      const [low, high] = ends();
      slider.value = high > low ? (values()[n] - low) / (high - low) : 0;
      typed.value = text;
      which.value = n;
      unit.textContent = data.units[n];
    }

    function give(asked) {
      const { low, high, below, above } = data.limits[n];
      const value = asked === told[n] ? own[n] : inSI(asked, data.exact[n]);
      const why = Number.isNaN(value) ? "it is no number" : value < low ? below : value > high ? above : "";
      refused.textContent = why ? `${asked} ${data.units[n]} is refused: ${why}` : "";
      if (why) return;
      text = asked;
      put();
      changed(values());
    }

    put();
    return { box: node("div", { class: "other" }, node("label", { class: "knob" }, which, slider, node("span", { class: "typed" }, typed, " ", unit)), refused, left), isOwn: () => values().every((value, i) => Object.is(value, own[i])) };
  }

  return { make, inSI, written };
})();
