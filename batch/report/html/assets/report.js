// Puts the plots into the page, and what else is pressed, searched and printed.
"use strict";

(() => {
  const models = [];

  // The chosen case is marked wherever it can be chosen.
  const mark = (place, chosen) => place.querySelectorAll("button[data-case]").forEach((button) => button.setAttribute("aria-pressed", String(button.dataset.case === String(chosen))));

  document.querySelectorAll("[data-section]").forEach((root) => {
    const number = root.dataset.section;
    const model = MET.model(JSON.parse(document.getElementById(`d${number}`).textContent));
    model.id = `s${number}`;
    model.root = root;
    models.push(model);
    const place = (name) => root.querySelector(`[data-plot="${name}"]`);
    if (model.data.overview) {
      MET.overview.make(place("points"), model);
      MET.overview.card(place("card"), model);
      if (place("map")) MET.map.make(place("map"), model);
    }
    model.simulation = MET.simulation ? MET.simulation.make(model) : null;
    if (place("arm")) MET.posing.make(place("arm"), model);
    if (place("signals")) MET.signals.make(place("signals"), model);
    if (place("stability")) MET.stability.make(place("stability"), model);
    model.watch((chosen) => mark(root, chosen));
    model.watch((chosen) => root.querySelectorAll("tr[data-case]").forEach((row) => row.classList.toggle("chosen", row.dataset.case === String(chosen))));
    root.addEventListener("click", (event) => {
      const pressed = event.target.closest("button[data-case]");
      if (pressed) model.choose(+pressed.dataset.case);
    });
  });

  // In the verdict a case is of the section that the verdict is about: they come in the same order. A comparison is of all sections.
  const verdicts = [...document.querySelectorAll("#verdict .verdict")];
  document.querySelectorAll(".verdict").forEach((box) => {
    const n = models.length === 1 ? 0 : verdicts.indexOf(box);
    box.addEventListener("click", (event) => {
      const pressed = event.target.closest("button[data-case]");
      if (!pressed || !models[n]) return;
      models[n].choose(+pressed.dataset.case);
      const seen = ["arm", "signals", "card"].map((name) => models[n].root.querySelector(`[data-plot="${name}"]`)).find((place) => place && place.offsetParent);
      if (seen) seen.scrollIntoView({ block: "start", behavior: matchMedia("(prefers-reduced-motion: reduce)").matches ? "auto" : "smooth" });
    });
    if (models[n]) models[n].watch((chosen) => mark(box, chosen));
  });

  document.addEventListener("click", async (event) => {
    const button = event.target.closest("button[data-copy]");
    if (!button) return;
    let said = "copied";
    try {
      await navigator.clipboard.writeText(button.dataset.copy);
    } catch {
      const words = button.parentElement.querySelector("code");
      getSelection().selectAllChildren(words);
      said = document.execCommand("copy") ? "copied" : "selected";
    }
    button.textContent = said;
    setTimeout(() => { button.textContent = "copy"; }, 1500);
  });

  // On a narrow screen the cells of a row lie under one another, each with its head beside it.
  document.querySelectorAll(".wide > table:not(.grid)").forEach((table) => {
    const heads = [...table.querySelectorAll("thead th")].map((head) => [...head.childNodes].map((part) => part.textContent).filter(Boolean).join(", "));
    table.querySelectorAll("tbody tr").forEach((row) => [...row.children].forEach((cell, n) => {
      if (heads[n]) cell.dataset.head = heads[n];
      cell.classList.toggle("empty", !cell.textContent && !cell.querySelector("svg"));
      const inner = document.createElement("div");
      inner.append(...cell.childNodes);
      cell.append(inner);
    }));
    table.classList.add("stacks");
  });

  // A table that is wider than its place lets its cells follow one another, so that none is cut off.
  function fit() {
    document.querySelectorAll(".wide > table.stacks").forEach((table) => {
      table.classList.remove("flows");
      const { scrollWidth, clientWidth } = table.parentElement;
      table.classList.toggle("flows", clientWidth > 0 && scrollWidth > clientWidth + 1);
    });
  }
  fit();
  addEventListener("resize", fit);
  document.addEventListener("toggle", fit, true);

  // Rows that have all the words.
  document.querySelectorAll("details.all").forEach((box) => {
    const [input, said] = [box.querySelector("input.search"), box.querySelector(".found")];
    const rows = [...box.querySelectorAll("tbody tr")];
    const texts = rows.map((row) => row.textContent.toLowerCase());
    input.addEventListener("input", () => {
      const words = input.value.toLowerCase().split(/[\s,]+/).filter(Boolean);
      let found = 0;
      rows.forEach((row, n) => {
        row.hidden = !words.every((word) => texts[n].includes(word));
        found += !row.hidden;
      });
      said.textContent = words.length ? `${found} of ${rows.length}` : "";
    });
  });

  // A line of the deck is shown where it is led to.
  function lead() {
    const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    const closed = target && target.closest("details:not([open])");
    if (closed) {
      closed.open = true;
      target.scrollIntoView();
    }
  }
  addEventListener("hashchange", lead);
  lead();

  // On paper everything is open, light and as wide as the paper.
  let opened = [];
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    opened.forEach((details) => { details.open = true; });
    MET.print(true);
  });
  addEventListener("afterprint", () => {
    opened.forEach((details) => { details.open = false; });
    MET.print(false);
  });

  addEventListener("scroll", MET.tip.hide, { passive: true });
  MET.models = models;
  document.documentElement.dataset.ready = "yes";
})();
