// The arm on a page: a view that is turned, moved and zoomed by mouse, touch and keys, and the clock that it has in common
// with the signals. The chosen case is solid, others are ghosts. Texts come into the page as text nodes alone.
"use strict";

MET.stage = (() => {
  const { node, number, palette } = MET;
  const [FITTED, FITTED_OF_GHOSTS] = [48, 5];  // instants of a run that are fitted into the view
  const BAR = 44;  // px of the view's upper edge where words and buttons stand
  const FAR = 1e4;  // reaches, farther than which nothing is fitted
  const [REST, SLOW] = [120, 45];  // ms after which a picture that stands is drawn fine; of a picture, more than which is slow
  const PAUSE = 100;  // ms between which plots follow an arm that plays, where a processor draws
  const TRACED = 240;  // points of the tip's path
  const FILM = 6;  // pictures on paper
  const rgb = (hex, alpha = 1) => [...[1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255), alpha];
  const BODY = { light: MET.look.colours, dark: ["#aab6c3", "#66717d", "#e0b44a"] };
  const KEYS = [["drag, arrow keys", "turn the view"], ["shift and drag or arrow keys, two fingers", "move it"], ["wheel, pinch, + −", "zoom, once it is in use"],
    ["double click, 0", "all in view"], ["space", "play or stop"], [", .", "an instant back or on"], ["g", "other cases"], ["b", "what stands beside"], ["f", "frames of the links"],
    ["a l c p o", "joint forces, loads, contact, plumes, payloads"]];
  const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 50];
  const APART = ["payload", "plume", "force"];  // roles of what may be far from the arm
  const LONG = 20;  // s, longer than which nobody looks at a run

  // A step of the grid: 1, 2 or 5 of a power of ten, about a share of the reach.
  function stepOf(reach) {
    const [wanted, power] = [reach / 4, 10 ** Math.floor(Math.log10(reach / 4))];
    return power * [1, 2, 5, 10].reduce((a, b) => (Math.abs(b * power - wanted) < Math.abs(a * power - wanted) ? b : a));
  }

  // What an arm is drawn on; null where there is no WebGL.
  function surfaceOf(canvas) {
    try {
      const renderer = MET.webgl.make(canvas);
      return renderer && { canvas, renderer };
    } catch {
      return null;  // a driver that cannot; SVG can
    }
  }

  // drawn: an arm with a scene, as `batch.arms.drawn.drawn_json` has it. seen: is told of each instant that is shown.
  // surface: what the view was drawn on whose place it takes.
  function make(root, drawn, { seen = () => {}, surface = null } = {}) {
    const { scene, acting, reactions } = drawn;
    surface ||= surfaceOf(node("canvas"));
    const arm = MET.arm.make(scene);
    const camera = MET.camera.make();
    const step = stepOf(arm.reach);
    let [chosen, others, floor, time, playing, rate, end] = [null, [], null, 0, false, 1, 0];
    let [frames, ghostly, fresh, asked, touched, moved, before] = [false, true, true, false, false, false, 0];
    let [path, still, rest, pace, coarse, inks, saidAt] = [[], true, 0, 0, 1, null, 0];
    let meshed = arm.skins.length > 0;
    let [twin, twinned] = [null, true];  // another arm beside the chosen case: its solids at a time
    const legend = MET.acting.legend(arm, () => redraw());
    const acts = acting ? MET.acting.make(acting, arm) : null;
    const fingers = new Map();  // and mice: places where the view is held, by pointer

    const paper = node("div", { class: "paper" });
    const told = node("div", { class: "told" });
    const scaled = node("div", { class: "scaled" }, `grid ${number(step)} m`);
    const toggle = (words, title, pressed, act) => {
      const made = node("button", { type: "button", class: "chip", "aria-pressed": String(pressed), title, click: () => {
        made.setAttribute("aria-pressed", String(act()));
        redraw();
      } }, words);
      return made;
    };
    const withFrames = toggle("frames", "Axes of the links' frames: x red, y green, z blue (f)", frames, () => (frames = !frames));
    const withOthers = toggle("", "The other cases, pale; in the colour of a warning those that fail or miss a requirement (g)", ghostly, () => (ghostly = !ghostly));
    const withMeshes = toggle("meshes", "The links as their files have them, or as plain shapes (m)", meshed, () => (meshed = !meshed));
    withMeshes.hidden = !meshed;
    const withTwin = toggle("", "What stands beside the run", true, () => (twinned = !twinned));
    withTwin.hidden = true;
    const whole = node("button", { type: "button", class: "chip", title: "Everything in view (0)", click: () => { home(); redraw(); } }, "fit");
    const help = toggle("?", "Keys and mouse (?)", false, () => !(keys.hidden = !keys.hidden));
    const keys = node("dl", { class: "keys", hidden: true }, [...KEYS, ...(meshed ? [["m", "meshes of the links"]] : [])].map(([key, does]) => [node("dt", null, key), node("dd", null, does)]));
    const triad = MET.triad.make(arm, scene.gravity);
    const view = node("div", { class: "view", tabindex: 0, role: "application", "aria-label": "The arm in 3D. Space plays, comma and full stop step, arrows turn, with shift they move, plus and minus zoom, 0 shows all." },
      surface?.canvas, paper, told, scaled, triad.box, node("div", { class: "tools" }, withTwin, withOthers, withMeshes, withFrames, whole, help), keys);
    const sign = node("path", { d: "M3 1.5 L14 8 L3 14.5 Z" });
    const play = node("button", { type: "button", class: "play", "aria-label": "Play", click: () => run(!playing) }, node("svg", { viewBox: "0 0 16 16", "aria-hidden": "true" }, sign));
    const scrub = node("input", { type: "range", min: 0, max: 1, step: "any", "aria-label": "Time", input: () => { run(false); seek(Number(scrub.value) * end); } });
    const clock = node("output", { class: "clock" });
    const speed = node("select", { "aria-label": "Speed", change: () => { rate = Number(speed.value); } }, SPEEDS.map((each) => node("option", { value: each }, `${number(each)} ×`)));
    const film = node("div", { class: "film printed" });
    root.append(node("div", { class: "stage" }, view, node("div", { class: "transport" }, play, scrub, clock, speed), legend.box, ...[MET.acting.note(acting), drawn.meshes && node("p", { class: "note" }, `${drawn.meshes}.`)].filter(Boolean), film));
    const ending = new AbortController();
    if (surface?.renderer.software) view.classList.add("plain");
    surface?.canvas.addEventListener("webglcontextlost", () => {
      surface.canvas.remove();
      surface = null;
      redraw();
    }, { signal: ending.signal });

    function inksOf() {
      const mine = palette();
      const [link, base, payload] = BODY[MET.dark() ? "dark" : "light"];
      const by = { link: rgb(link), base: rgb(base), rail: rgb(base), joint: rgb(base) };
      Object.entries(MET.acting.inks()).forEach(([kind, colour]) => { by[kind] = rgb(colour); });
      [by.payload, by.flying, by.grip] = [payload, MET.dark() ? "#8d7c55" : "#f0d9a6", payload].map((each) => rgb(each));
      Object.entries(MET.triad.AXES).forEach(([axis, colour]) => { by[axis] = rgb(colour); });
      const joints = mine.lines.map((each) => rgb(each));
      const faint = Math.min(0.2, Math.max(0.06, 2 / Math.max(1, others.length)));
      const [plain, bad] = [mine.muted, mine.attend].map((each) => rgb(each, faint));
      return {
        solid: (each) => (each.role === "joint" && each.joint >= 0 ? joints[each.joint % joints.length] : by[each.role]),
        ghost: (n) => (others[n] && others[n].bad ? bad : plain),
        clear: (each) => [...by[each.role].slice(0, 3), 0.3],
        trace: rgb(mine.accent), twin: rgb(mine.accent, 0.5), grid: rgb(MET.dark() ? "#5d6873" : "#aab3bc", 0.9), ground: rgb(mine.paper, MET.dark() ? 0.16 : 0.55),
        shade: MET.dark() ? [0, 0, 0, 0.42] : [0.02, 0.028, 0.036, 0.17],
      };
    }

    function picture(at, all = true, fine = still, plain = !surface || !meshed) {
      const numbers = chosen.at(at);
      const around = legend.solids(at, numbers);
      const own = arm.solids(numbers, plain).filter(({ role }) => role !== "payload" || legend.shown("payload"))
        .map((each) => (each.role === "payload" && around.flying?.has(each.body) ? { ...each, role: "flying" } : each));
      const solids = [...own, ...(frames ? arm.frames(numbers) : []), ...around.solids];
      const shown = all && ghostly ? others : [];
      const second = twin && twinned ? twin(at) : [];
      return { camera, solids, clear: around.clear, words: around.words, arm, ghosts: shown.map((each) => each.at(at)), twin: second, trace: path, floor, step, reach: arm.reach, limb: arm.limb, colours: (inks ||= inksOf()), fine, shadow: !scene.moves };
    }

    // Everything that a case comes to, as pills. What has run away is left out, and a payload or a nozzle that is more than a
    // reach from the box round all that the arm comes to: it comes into view.
    const near = ({ ends }) => ends.flat().every((x) => Math.abs(x) < FAR * arm.reach);
    const pills = (each, count) => inView((at) => arm.solids(each.at(at)), count);
    const chosenPills = () => inView((at) => [...arm.solids(chosen.at(at)), ...legend.nozzles(at), ...legend.forces(at, chosen.at(at))], FITTED);
    const inView = (solids, count) => {
      const all = Array.from({ length: count }, (_, n) => solids((end * n) / (count - 1))).flat()
        .map((one) => ({ ...MET.arm.ends(one), own: !APART.includes(one.role), isForce: one.role === "force" })).filter(near);
      const box = [0, 1, 2].map((axis) => all.filter((one) => one.own).flatMap(({ ends }) => ends.map((p) => p[axis])))
        .map((places) => [places.reduce((a, b) => Math.min(a, b), Infinity), places.reduce((a, b) => Math.max(a, b), -Infinity)]);
      const close = (p) => Math.hypot(...box.map(([low, high], axis) => Math.max(low - p[axis], p[axis] - high, 0))) <= arm.reach;
      return all.filter((one) => one.own || close(one.ends[0]));
    };

    function ground(all) {
      const lowest = all.filter(({ isForce }) => !isForce).reduce((low, { ends, radius }) => Math.min(low, ends[0][2] - radius, ends[1][2] - radius), Infinity);
      floor = scene.moves ? lowest - 0.25 * arm.reach : Math.min(0, lowest);
    }

    // Everything in view, seen from where most is seen of the chosen case.
    function home() {
      const all = chosenPills();
      if (!all.length) return;
      ground(all);
      camera.choose(all.filter(({ isForce }) => !isForce).flatMap(({ ends }) => ends));
      camera.fit([...all, ...(twin && twinned ? inView(twin, FITTED_OF_GHOSTS) : []), ...(ghostly ? others.flatMap((each) => pills(each, FITTED_OF_GHOSTS)) : [])], BAR / view.clientHeight);
    }

    // Dots of the canvas; fine: as many as make edges smooth.
    function sized(fine) {
      const { canvas, renderer } = surface;
      const dots = Math.min((devicePixelRatio || 1) * (fine ? (renderer.software ? 2 : 1) : coarse), 2);
      const [w, h] = [view.clientWidth, view.clientHeight].map((side) => Math.round(side * dots));
      if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
    }

    function paint() {
      asked = false;
      if (!chosen) return;
      const { clientWidth: wide, clientHeight: high } = view;
      if (!wide) return;
      camera.aspect = wide / high;
      if (fresh && !(fresh = false)) home();
      const shown = picture(time);
      if (surface) {
        sized(still);
        surface.renderer.draw(shown);
      } else paper.replaceChildren(MET.painter.draw(shown, wide, high));
      legend.say(shown.words);
      triad.turn(camera.axes());
      scrub.value = end ? time / end : 0;
      clock.textContent = `${time.toFixed(end < 10 ? 2 : 1)} s`;
    }

    // While pictures follow one another, those that software draws are coarser.
    function redraw() {
      if (!asked) requestAnimationFrame(paint);
      [asked, still] = [true, false];
      clearTimeout(rest);
      if (!playing && !fingers.size) rest = setTimeout(() => requestAnimationFrame(() => {
        if (asked || playing || fingers.size) return;  // it goes on
        still = true;
        paint();
      }), REST);
    }

    function seek(to, quietly = false) {
      time = Math.min(Math.max(to, 0), end);
      if (!quietly && (!playing || time >= end || performance.now() - saidAt >= (surface && !surface.renderer.software ? 0 : PAUSE))) {
        saidAt = performance.now();
        seen(time);
      }
      redraw();
    }

    function run(on) {
      playing = on;
      sign.setAttribute("d", on ? "M3 2 H6.5 V14 H3 Z M9.5 2 H13 V14 H9.5 Z" : "M3 1.5 L14 8 L3 14.5 Z");
      play.setAttribute("aria-label", on ? "Pause" : "Play");
      if (!on) {
        redraw();
        return;
      }
      if (time >= end) time = 0;
      before = 0;
      requestAnimationFrame(tick);
    }

    function tick(now) {
      if (!playing) return;
      if (before) {
        seek(time + Math.min(0.1, (now - before) / 1000) * rate);
        pace += 0.1 * (now - before - pace);
        if (pace > SLOW) [coarse, pace] = [Math.max(0.5, 0.8 * coarse), 0];  // fewer dots, until it stands
      }
      before = now;
      if (time >= end) run(false);
      else requestAnimationFrame(tick);
    }

    // Mouse, touch and keys.
    const spread = () => { const [a, b] = [...fingers.values()]; return b ? Math.hypot(a.x - b.x, a.y - b.y) : 0; };
    const least = 0.2 * arm.reach;
    const zoom = (factor) => { camera.zoom(factor, least, 60 * arm.reach); redraw(); };
    view.addEventListener("pointerdown", (event) => {
      if (event.target.closest("button")) return;
      view.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    });
    view.addEventListener("pointermove", (event) => {
      const held = fingers.get(event.pointerId);
      if (!held) return;
      const [dx, dy, wide] = [event.clientX - held.x, event.clientY - held.y, spread()];
      [held.x, held.y] = [event.clientX, event.clientY];
      const high = view.clientHeight;
      if (fingers.size > 1) {
        if (wide) zoom(wide / spread());
        camera.pan(dx / high, dy / high);
      } else if (event.shiftKey || event.buttons & 6) camera.pan((2 * dx) / high, (2 * dy) / high);
      else camera.orbit((dx / high) * 3, (dy / high) * 3);
      touched = moved = true;
      redraw();
    });
    ["pointerup", "pointercancel"].forEach((kind) => view.addEventListener(kind, (event) => {
      fingers.delete(event.pointerId);
      redraw();
    }));
    view.addEventListener("contextmenu", (event) => event.preventDefault());
    view.addEventListener("wheel", (event) => {
      if (!touched && document.activeElement !== view && !event.ctrlKey) return;  // a page that is scrolled goes on
      event.preventDefault();
      zoom(Math.exp(0.0012 * event.deltaY));
    }, { passive: false });
    view.addEventListener("pointerleave", () => { touched = false; });
    view.addEventListener("dblclick", () => { home(); redraw(); });
    view.addEventListener("keydown", (event) => {
      const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      if (event.target !== view || event.ctrlKey || event.metaKey || event.altKey) return;
      moved ||= Boolean(moves);
      if (moves && event.shiftKey) camera.pan(-0.08 * moves[0], -0.08 * moves[1]);
      else if (moves) camera.orbit(0.1 * moves[0], 0.1 * moves[1]);
      else if (event.key === " ") run(!playing);
      else if (event.key === "," || event.key === ".") seek(time + (event.key === "," ? -1 : 1) * (end / 100));
      else if (event.key === "+" || event.key === "=") zoom(0.85);
      else if (event.key === "-") zoom(1 / 0.85);
      else if (event.key === "0" || event.key === "Home") home();
      else if (event.key === "b" && !withTwin.hidden) withTwin.click();
      else if (legend.key(event.key)) return;
      else if (event.key === "?") help.click();
      else if (event.key === "m" && !withMeshes.hidden) withMeshes.click();
      else if (event.key === "f") withFrames.click();
      else if (event.key === "g" && !withOthers.hidden) withOthers.click();
      else return;
      event.preventDefault();
      redraw();
    });

    // A case that is a ghost. run: its numbers, as `MET.arm.columns` takes them.
    const take = (run) => arm.take(run.values, run.time, MET.arm.columns(run, drawn.columns));

    // The case that is solid, with what acts on it; label: what it is called.
    function show(run, label) {
      const around = acts && acts.take(run.values, run.time, MET.arm.columns(run, acting.columns));
      legend.show(around, acts, MET.acting.reactions(run, reactions));
      const first = !chosen;
      chosen = take(run);
      end = chosen.end;
      time = Math.min(time, end);
      told.textContent = label;
      path = Array.from({ length: TRACED }, (_, n) => chosen.tip((end * n) / (TRACED - 1)));
      if (first) {
        rate = SPEEDS.find((each) => end / each <= LONG) ?? SPEEDS[SPEEDS.length - 1];
        if (rate < 1) rate = end < 0.5 ? rate : 1;
        speed.value = rate;
      }
      redraw();
    }

    // Cases that are ghosts: {taken, bad}; words: what they are called.
    function haunt(list, words = list.length === 1 ? "1 other case" : `${list.length} other cases`) {
      others = list.map(({ taken, bad }) => ({ at: taken.at, bad }));
      inks = null;
      withOthers.hidden = !list.length;
      const bad = list.filter((each) => each.bad).length;
      withOthers.replaceChildren(...(bad ? [node("i", { class: "swatch bad" })] : []), bad ? `${words}, ${bad} ${bad === 1 ? "misses" : "miss"}` : words);
      redraw();
    }
    haunt([]);

    // An arm beside the chosen case, of other numbers or measured. solids: at a time, null where there is none.
    function accompany(solids, name) {
      twin = solids;
      withTwin.hidden = !solids;
      withTwin.replaceChildren(node("i", { class: "swatch" }), name);
      redraw();
    }

    // All ghosts are there: they too come into view, unless somebody has looked round.
    function settle() {
      if (!moved) fresh = true;
      redraw();
    }

    addEventListener("beforeprint", () => {
      if (!chosen) return;
      const { distance, target, aspect } = camera;
      camera.aspect = 4 / 3;
      camera.fit(chosenPills());
      film.replaceChildren(...Array.from({ length: FILM }, (_, n) => (end * n) / (FILM - 1)).map((at) =>
        node("figure", null, MET.painter.draw(picture(at, false, true, true), 400, 300), node("figcaption", null, `${number(at)} s`))));
      Object.assign(camera, { distance, target, aspect });
    }, { signal: ending.signal });
    const sides = new ResizeObserver(redraw);
    sides.observe(view);
    const anew = () => { inks = null; legend.tell(); redraw(); };
    MET.drawn.push(anew);

    // Another view takes this one's place: it stops, and gives back what it was drawn on.
    function close() {
      [playing, chosen] = [false, null];
      ending.abort();
      sides.disconnect();
      legend.close();
      MET.drawn.splice(MET.drawn.indexOf(anew), 1);
      return surface;
    }

    // Where it is seen from and at which instant; and back there, on a page that takes another's place.
    const seenFrom = ({ azimuth, elevation, distance, target }) => ({ azimuth, elevation, distance, target });
    const kept = () => ({ camera: seenFrom(camera), time, playing, rate, frames, meshed, ghostly, legend: legend.kept(), twinned });

    function resume(before) {
      const all = chosen ? chosenPills() : [];
      if (all.length) ground(all);
      [fresh, moved, rate] = [false, true, before.rate];
      Object.assign(camera, seenFrom(before.camera));
      speed.value = rate;
      if (before.frames !== frames) withFrames.click();
      if (before.meshed === false && meshed) withMeshes.click();
      if (before.ghostly !== ghostly) withOthers.click();
      legend.resume(before.legend);
      if (before.twinned !== twinned) withTwin.click();
      seek(before.time);
      if (before.playing) run(true);
    }

    // How long a picture of many takes, ms, everything drawn.
    function measure(count = 20) {
      if (surface) sized(false);
      const begun = performance.now();
      for (let n = 0; n < count; n++) {
        const made = picture((end * n) / count, true, false);
        if (surface) { surface.renderer.draw(made); surface.renderer.finish(); } else MET.painter.draw(made, view.clientWidth, view.clientHeight);
      }
      return (performance.now() - begun) / count;
    }
    return { take, legend, around: () => { const { solids, clear } = legend.solids(time, chosen.at(time)); return [...solids, ...clear]; }, show, haunt, accompany, settle, seek, kept, resume, close, play: run, measure, camera, redraw, time: () => time, isStill: () => still && !asked, isPlaying: () => playing, finish: () => surface?.renderer.finish(), ghosts: () => others.length, drawsBy: () => (surface ? "webgl" : "svg") };
  }

  return { make };
})();
