// The arm of a section: the chosen case solid, others as ghosts, or the same case as another archive has it; its clock is
// that of the signals.
"use strict";

MET.posing = (() => {
  const { node } = MET;
  const MOST_GHOSTS = 60;
  const [SLICE, PATIENCE] = [24, 6000];  // ms of work between which the page answers, and of work for ghosts in all

  function make(root, model) {
    const { simulation } = model;
    if (!simulation) {
      if (model.data.simulation) root.append(node("p", { class: "note" }, "This reader does not run WebAssembly: the arm is not drawn, and no case can be run again here."));
      return;
    }
    const rooms = simulation.structures.map((own) => ({ own, box: node("div", { hidden: true }), stage: null, ghosts: [], earlier: earlierArm(own), wanted: ghostsOf(own) }));
    const said = node("p", { class: "computed", role: "status" }, "\u00a0");  // a line of text from the first
    root.append(...rooms.map(({ box }) => box), said);
    let shown = null;  // the room of the chosen case
    let chosen = null;
    let seen = false;

    // The worst and the best come first among a structure's cases; then some of all others.
    function ghostsOf({ cases }) {
      const first = cases.slice(0, MOST_GHOSTS / 2);
      const rest = cases.slice(first.length);
      const count = Math.min(rest.length, MOST_GHOSTS - first.length);
      return [...first, ...Array.from({ length: count }, (_, n) => rest[Math.floor((n * rest.length) / count)])];
    }

    // The numbers of a case, as the arm takes them.
    const runOf = ({ own, values, rows, numbers }) => ({ values: Object.fromEntries(own.names.map((name, n) => [name, values[n]])), time: own.time.subarray(0, rows), numbers, width: own.kernel.columns });

    // An arm of the other archive that has the same bodies and shapes, whatever their sizes; else null.
    function earlierArm({ arm: { scene }, before }) {
      const was = before && before.arm.scene;
      const alike = was && scene && ["bodies", "shapes"].every((each) => JSON.stringify(scene[each]) === JSON.stringify(was[each]));
      return alike ? MET.arm.make(was) : null;
    }

    function bad(case_, found) {
      const place = model.places ? model.places.get(case_) : undefined;
      return place === undefined ? found.failed : !["met", "done"].includes(model.outcome[place]);
    }

    // The room of a structure is shown, and no other; its arm is there from the first, so that nothing moves down later.
    function enter(room) {
      if (shown === room) return;
      shown = room;
      rooms.forEach((each) => { each.box.hidden = each !== room; });
      const { arm } = room.own;
      if (arm.scene) room.stage ??= MET.stage.make(room.box, arm, { seen: (time) => model.point && model.point(time) });
      else if (!room.box.firstChild) {
        room.box.append(node("p", { class: "note" }, `The arm is not drawn, for the run does not record ${arm.lacking.join(", ")}: `, node("code", null, `record += [${arm.lacking.join(", ")}];`)));
      }
    }

    function choose(case_) {
      if (!simulation.has(case_)) {
        said.textContent = `Case #${case_} is not among those that can be run again in this page.`;
        return;
      }
      const found = simulation.run(case_);
      const room = rooms[found.structure];
      const { bad: wrong, words } = simulation.tell(found);
      chosen = case_;
      said.classList.toggle("bad", wrong);
      said.textContent = words;
      enter(room);
      if (!room.stage) return;
      if (found.rows) room.stage.show(runOf(found), `case #${case_}`);
      haunt(room);
      if (seen) gather(room);
    }

    function haunt(room) {
      if (!room.earlier || !simulation.hadBefore(chosen)) {
        room.stage.haunt(room.ghosts.filter((each) => each.case !== chosen));
        return;
      }
      const was = simulation.run(chosen, true);
      room.stage.haunt(was.rows ? [{ bad: false, taken: earlierTaken(room, was) }] : [], `in ${model.data.against[0]}`);
    }

    function earlierTaken(room, was) {
      const run = runOf(was);
      return room.earlier.take(run.values, run.time, MET.arm.columns(run, was.own.arm.columns));
    }

    // Ghosts are run one after another, while the page is looked at.
    function gather(room) {
      if (!room.stage || room.gathering) return;
      room.gathering = true;
      if (room.earlier) room.wanted = [];
      let spent = 0;
      (function next() {
        const begun = performance.now();
        while (room.wanted.length && performance.now() - begun < SLICE) {
          const case_ = room.wanted.shift();
          const found = simulation.run(case_);
          if (found.rows) room.ghosts.push({ case: case_, bad: bad(case_, found), taken: room.stage.take(runOf(found)) });
        }
        spent += performance.now() - begun;
        haunt(room);
        if (room.wanted.length && spent < PATIENCE) setTimeout(next);
        else {
          room.stage.settle();
          root.dataset.haunted = "yes";
        }
      })();
    }

    model.stage = () => (shown ? shown.stage : null);
    model.seek = (time) => { if (shown && shown.stage) shown.stage.seek(time, true); };
    model.watch(choose);
    const { opens, shown: drawn } = model.data.signals;
    const armOf = (case_) => simulation.structures[simulation.structureOf(case_)].arm;
    const able = [...(opens === null ? [] : [opens]), ...drawn].filter(simulation.has);
    const first = able.find((case_) => armOf(case_).scene) ?? able[0];
    if (first !== undefined) enter(rooms[simulation.structureOf(first)]);
    const begin = () => {
      if (chosen !== null || first === undefined) return;
      choose(first);
      if (opens === null || first === opens) return;
      const why = simulation.has(opens) ? `its arm is not drawn, for the run does not record ${armOf(opens).lacking.join(", ")}` : "it is not among those that can be run again in this page";
      said.textContent = `Case #${opens} would be shown first, but ${why}. ${said.textContent}`;
    };
    new IntersectionObserver((entries, observer) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      observer.disconnect();
      seen = true;
      begin();
      if (chosen !== null) gather(shown);
    }, { rootMargin: "300px" }).observe(root);
    addEventListener("beforeprint", begin);
  }

  return { make };
})();
