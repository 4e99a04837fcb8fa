// Sliders of a page that simulates, of numbers that a sweep varies: dragged, moved by arrow keys, or typed in the deck's
// unit. Texts of a deck come into the page as text nodes alone.
"use strict";

MET.knobs = (() => {
  const { node, number } = MET;
  const NEAR = 0.01;  // of a slider's way, within which it takes a value of the archive's
  const STEP = 0.02;  // of it, by an arrow key: out of the reach of the value where it stands
  const ALIKE = 1e-9;  // of a value of the archive's, within which what is typed is that value

  // An arrow key moves a slider so far that it leaves a value that it takes when it is near.
  function stepped(slider) {
    slider.addEventListener("keydown", (event) => {
      const way = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
      if (!way || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      slider.value = Number(slider.value) + way * STEP;
      slider.dispatchEvent(new Event("input"));
    });
    return slider;
  }

  // label, unit, scale: of the number as the deck has it; own: its values in the archive, SI, from small to large; changed:
  // is told of another, SI.
  function make({ label, unit, scale, own }, changed) {
    const [low, high] = [own[0], own[own.length - 1]];
    const nearest = (at) => own.reduce((a, b) => (Math.abs(b - at) < Math.abs(a - at) ? b : a));
    const said = (value) => `${number(value / scale)} ${unit}`.trim();
    const slider = stepped(node("input", { type: "range", min: 0, max: 1, step: 0.001, "aria-label": label, input: () => {
      const at = low + Number(slider.value) * (high - low);
      give(Math.abs(nearest(at) - at) <= NEAR * (high - low) ? nearest(at) : at);
    } }));
    const typed = node("input", { type: "text", inputmode: "decimal", autocomplete: "off", spellcheck: "false", "aria-label": `${label}, typed`, change: () => {
      const at = typed.value.trim() === "" ? NaN : Number(typed.value) * scale;
      const value = Math.abs(nearest(at) - at) <= ALIKE * Math.abs(nearest(at)) ? nearest(at) : at;
      if (value >= Math.min(low, high) && value <= Math.max(low, high)) give(value);
      else refused.textContent = Number.isNaN(value) ? `${typed.value} is no number` : `${typed.value} ${unit} is beyond what the sweep has: from ${said(low)} to ${said(high)}`;
    } });
    const refused = node("p", { class: "refused", role: "alert" });

    function give(value) {
      refused.textContent = "";
      changed(value);
    }

    // Where it stands.
    function put(value, moved = true) {
      if (moved) slider.value = (value - low) / (high - low);
      typed.value = number(value / scale);
    }
    return { put, box: node("div", null, node("label", { class: "knob" }, node("code", null, label), slider, node("span", { class: "typed" }, typed, " ", node("span", { class: "unit" }, unit))), refused) };
  }

  return { make, stepped };
})();
