// What acts on an arm at an instant: arrows of forces and moments, collars of joints in touch, cones of gas, and who holds
// which payload; and the legend of these, a switch for each kind. Texts come into the page as text nodes alone.
"use strict";

MET.acting = (() => {
  const { node, number } = MET;
  const { plus, cross, along, unit, length } = MET.arm;
  const [ARROW, JET, PAYLOAD] = [6, 17, 4];  // numbers of each
  const LONGEST = 0.35;  // of the reach: the longest arrow of a kind and unit
  const [PLUME, WIDEST] = [0.4, 1.05];  // of the reach: the length of a cone of gas; rad: half its angle at most
  const SLICE = 24;  // ms of work between which the page answers
  const UNITS = { N: "N", "N*m": "N·m" };
  const STAGES = [(name) => `${name} free`, (name, link) => `${name} on ${link}`, (name) => `${name} released`];
  // Of each kind its colour in light and dark, its key, what its switch is called, and what it says of itself.
  const KINDS = {
    force: ["#b5127f", "#ff7ad1", "a", "joint forces", "Forces of the joints on their links, as the run records them (a)"],
    load: ["#00807a", "#35d0c5", "l", "loads", "Forces and, with two heads, moments of the environment, where they act (l)"],
    contact: ["#cc2a12", "#ff4f4f", "c", "contact", "Joints that touch a stop, and bodies that touch each other: what is done to them there (c)"],
    plume: ["#6b46d6", "#b39bff", "p", "plumes", "Gas of thrusters while they fire, and what it does; a cone's edge has half the density of its axis (p)"],
    payload: ["#e0a02a", "#e0b44a", "o", "payloads", "Payloads: pale while they fly, with a line to the place where their link holds them (o)"],
  };

  // The recorded forces of joints on their links: at a time, and the largest, N; null without any. run: as of
  // `MET.arm.columns`; places: of each body and the columns of its force.
  function reactions({ time, numbers, width }, places) {
    if (!places.length) return null;
    const rows = time.length;
    const of = (row) => places.map(([body, ...columns]) => [body, ...columns.map((column) => numbers[row * width + column])]);
    let most = 0;
    for (let row = 0; row < rows; row++) of(row).forEach(([, ...force]) => { most = Math.max(most, length(force)); });
    const step = rows > 1 ? time[rows - 1] / (rows - 1) : 1;
    return { most, at: (t) => of(Math.min(rows - 1, Math.round(t / step))) };
  }

  // acting: as `batch.arms.drawn.acting_json` has it, or nothing; arm: as `MET.arm.make` makes it of its scene.
  function make(acting, arm) {
    const { arrows, jets, payloads, channels } = acting;
    const formulas = MET.formulas.make(acting.nodes, acting.outputs, new Set(["time", ...channels]));
    const three = (numbers, at) => [numbers[at], numbers[at + 1], numbers[at + 2]];
    const [jet, payload] = [ARROW * arrows.length, ARROW * arrows.length + JET * jets.length];

    // A case; values, time, columns: as of an arm's. most: by kind and unit the largest of the rows that were looked at.
    function take(values, time, columns) {
      const state = formulas.begin(values);
      const out = new Float64Array(acting.outputs.length);
      const inputs = new Float64Array(channels.length + 1);
      const most = {};
      let row = 0;
      const at = (t) => formulas.at(state, MET.arm.between(time, columns, t, inputs), out);

      // Looks at rows for so long; true once all of them were.
      function look(ms = SLICE) {
        const begun = performance.now();
        for (; row < time.length && performance.now() - begun < ms; row++)
          acts(at(time[row])).forEach(({ kind, unit: of, vector }) => { most[`${kind} ${of}`] = Math.max(most[`${kind} ${of}`] ?? 0, length(vector) || 0); });
        return row === time.length;
      }
      return { look, most, at };
    }

    const acts = (numbers) => arrows.map(([kind, name, of], n) => ({ kind, name, unit: of, at: three(numbers, ARROW * n), vector: three(numbers, ARROW * n + 3) }));
    const gas = (numbers) => jets.map((name, n) => {
      const at = jet + JET * n;
      return { name, at: three(numbers, at), axis: three(numbers, at + 3), fires: numbers[at + 6], exponent: numbers[at + 7], plate: [8, 11, 14].map((of) => three(numbers, at + of)) };
    });
    const held = (numbers) => payloads.map(([name, link, body], n) => ({ name, link, body, stage: numbers[payload + PAYLOAD * n], at: three(numbers, payload + PAYLOAD * n + 1) }));

    return { take, acts, gas, held, payloads: payloads.length, jets: jets.length };
  }

  // Half the angle of a cone at whose edge gas is half as dense as on its axis.
  const half = (exponent) => Math.min(WIDEST, exponent > 0 ? Math.acos(0.5 ** (1 / exponent)) : WIDEST);

  // The legend and switches of an arm, and the solids of all that they show. redraw: asks for a new picture.
  function legend(arm, redraw) {
    const on = Object.fromEntries(Object.keys(KINDS).map((kind) => [kind, true]));
    let [taken, made, forces, seen] = [null, null, null, 0];
    const chips = Object.fromEntries(Object.entries(KINDS).map(([kind, [, , , words, title]]) => {
      const swatch = node("i", { class: "swatch" });
      const said = node("span");
      const box = node("button", { type: "button", class: `chip kind ${kind}`, hidden: true, "aria-pressed": "true", title, click: () => press(kind) }, swatch, words, said);
      return [kind, { box, swatch, said }];
    }));
    const box = node("div", { class: "legend" }, Object.values(chips).map((chip) => chip.box));

    function press(kind) {
      on[kind] = !on[kind];
      chips[kind].box.setAttribute("aria-pressed", String(on[kind]));
      redraw();
    }
    const most = (kind, of) => (kind === "force" ? (forces && of === "N" ? forces.most : 0) : taken?.most[`${kind} ${of}`] ?? 0);

    // What stands beside each kind: its longest arrow, of the case that is shown.
    function tell() {
      const dark = MET.dark() ? 1 : 0;
      Object.entries(chips).forEach(([kind, { box: chip, swatch, said }]) => {
        swatch.style.background = KINDS[kind][dark];
        const longest = Object.keys(UNITS).filter((of) => most(kind, of) > 0).map((of) => `${number(most(kind, of))} ${UNITS[of]}`);
        if (kind === "payload") {
          chip.hidden = !made?.payloads;
          return;
        }
        chip.hidden = !longest.length && !(kind === "plume" && made?.jets);
        said.textContent = longest.length ? `longest ${longest.join(", ")}` : "";
      });
    }

    // The case that is shown. acts: what `take` made of it; of: what `make` made; reactions: {at: of a time, most: N} of
    // recorded forces, [body, x, y, z] each.
    function show(acts, of, reactions) {
      const turn = ++seen;
      [taken, made, forces] = [acts, of, reactions && reactions.most > 0 ? reactions : null];
      (function next() {
        if (turn !== seen) return;
        const done = !taken || taken.look();
        tell();
        redraw();
        if (!done) setTimeout(next);
      })();
    }

    const ball = (at) => ({ mesh: "pill", role: "plume", joint: -1, at, axes: along([0, 0, 1]), size: [...Array(3).fill(0.8 * arm.limb), 0] });

    // At a time the solids, and those that one sees through. numbers: the arm's.
    function solids(t, numbers) {
      const out = [];
      const clear = [];
      const far = LONGEST * arm.reach;
      out.push(...reacting(t, numbers));
      if (!taken) return { solids: out, clear };
      const { limb } = arm;
      const own = taken.at(t);
      made.acts(own).filter(({ kind }) => on[kind]).forEach(({ kind, unit: of, at, vector }) => {
        const [begin, way, size] = [arm.up(at), arm.up(vector), length(vector)];
        if (!(size > 0)) return;
        out.push(...arm.arrow(begin, way, (far * size) / most(kind, of), kind, of === "N" ? 1 : 2));
        if (kind === "contact") out.push({ mesh: "can", role: kind, joint: -1, at: begin, axes: along(way), size: [3 * limb, 3 * limb, 0.2 * limb, 0.6 * limb] });
      });
      if (on.plume) made.gas(own).forEach(({ plate }) => {
        const [middle, width, height] = plate.map(arm.up);
        const [x, y] = [unit(width), unit(height)];
        clear.push({ mesh: "block", role: "plume", joint: -1, at: middle, axes: [x, y, cross(x, y)], size: [length(width), length(height), 0.3 * limb, 0] });
      });
      if (on.plume) made.gas(own).filter(({ fires }) => fires > 0).forEach(({ at, axis, exponent }) => {
        const [begin, way] = [arm.up(at), unit(arm.up(axis))];
        const long = PLUME * arm.reach;
        const wide = long * Math.tan(half(exponent));
        out.push(ball(begin));
        clear.push({ mesh: "cone", role: "plume", joint: -1, at: plus(begin, way, long / 2), axes: along(way.map((x) => -x)), size: [wide, wide, 0, long] });
      });
      const carried = made.held(own);
      const words = carried.map(({ name, link, stage }) => STAGES[stage](name, link)).join(", ");
      if (on.payload) carried.filter(({ stage, body }) => stage === 1 && body >= 0).forEach(({ at, body }) => {
        const [begin, end] = [arm.up(at), arm.at(numbers, body)];
        const way = plus(end, begin, -1);
        out.push({ mesh: "pill", role: "grip", joint: -1, at: plus(begin, way, 0.5), axes: along(way), size: [0.6 * limb, 0.6 * limb, 0.6 * limb, length(way)] });
      });
      return { solids: out, clear, words, flying: new Set(carried.filter(({ stage }) => stage !== 1).map(({ body }) => body)) };
    }

    // What becomes of payloads at the instant that is shown, as `solids` words it.
    function say(words = "") {
      if (chips.payload.said.textContent !== words) chips.payload.said.textContent = words;
    }

    // Nozzles, firing or not, which come into view with the arm.
    const nozzles = (t) => (taken ? made.gas(taken.at(t)) : []).map(({ at }) => ball(arm.up(at)));

    // The recorded forces of joints as arrows.
    const reacting = (t, numbers) => (forces && on.force ? arm.arrows(numbers, forces.at(t), (LONGEST * arm.reach) / forces.most) : []);

    // No further rows are looked at.
    const close = () => { seen++; };

    return { box, show, close, tell, say, solids, nozzles, forces: reacting, shown: (kind) => on[kind],
      key: (key) => Object.keys(KINDS).find((kind) => KINDS[kind][2] === key && !chips[kind].box.hidden && (press(kind), true)) !== undefined,
      kept: () => ({ ...on }), resume: (before) => Object.keys(on).forEach((kind) => { if (before && before[kind] !== undefined && before[kind] !== on[kind]) press(kind); }),
      reactions: (t) => (forces ? forces.at(t) : []), looked: () => !taken || taken.look(0), now: (t) => (taken ? made.acts(taken.at(t)) : []), most };
  }

  // Colours of what acts, by role.
  const inks = () => Object.fromEntries(Object.entries(KINDS).map(([kind, [light, dark]]) => [kind, MET.dark() ? dark : light]));

  // What is not drawn, and what to record for it, as a note; null where all is.
  function note(acting) {
    if (!acting || !acting.notDrawn.length) return null;
    const wanted = [...new Set(acting.notDrawn.flatMap(([, , signals]) => signals))];
    const told = acting.notDrawn.map(([what, name, signals]) => `${what} ${name}${signals.length ? "" : " (too many operations for a page)"}`);
    return node("p", { class: "note" }, `Not drawn: ${told.join(", ")}.`, ...(wanted.length ? [" For all that, the run must record ", node("code", null, `record += [${wanted.join(", ")}];`)] : []));
  }

  return { make, reactions, legend, inks, note };
})();
