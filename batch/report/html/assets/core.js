// What all plots of a page have in common: numbers from base64, numbers in words, elements, colours, what is chosen.
// Texts of a deck come into the page as text nodes alone.
"use strict";

const MET = (() => {
  function bytes(text) {
    const letters = atob(text);
    const out = new Uint8Array(letters.length);
    for (let n = 0; n < out.length; n++) out[n] = letters.charCodeAt(n);
    return out;
  }

  // Numbers as `payload.packed` wrote them, as doubles.
  function unpack(packed) {
    if (packed.t === "c") return new Float64Array(packed.n).fill(packed.v);
    const view = new DataView(bytes(packed.b).buffer);
    const size = packed.t === "f8" ? 8 : 4;
    const read = { f8: "getFloat64", f4: "getFloat32", i4: "getInt32" }[packed.t];
    const out = new Float64Array(view.byteLength / size);
    for (let i = 0; i < out.length; i++) out[i] = view[read](i * size, true) + (packed.o || 0);
    return out;
  }

  // Four digits that mean something, as `batch.signals.number_text`.
  function number(value) {
    if (value === Infinity) return "∞";
    if (value === -Infinity) return "−∞";
    if (!Number.isFinite(value)) return "no value";
    if (value === 0) return "0";
    const size = Math.floor(Math.log10(Math.abs(value)) + 1e-12);
    if (size < -4 || size >= 7) return value.toExponential(3).replace(/\.?0+e/, "e").replace("e+", "e");
    const text = value.toFixed(Math.max(0, 3 - size));
    return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
  }

  // A tick of an axis: as many digits as tell it from its neighbours.
  function ticks(values) {
    const step = values.length > 1 ? Math.abs(values[1] - values[0]) : 1;
    const most = Math.max(...values.map(Math.abs), 1e-300);
    if (most >= 1e6 || (most < 1e-3 && most > 0)) return values.map((v) => (v === 0 ? "0" : trimmed(v, step)));
    let digits = 0;
    while (digits < 12 && Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-6 * step * 10 ** digits) digits++;
    return values.map((v) => (v === null ? "" : (v + 0).toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1").replace("-", "−")));
  }

  function trimmed(value, step) {
    const size = Math.floor(Math.log10(Math.abs(value)));
    const digits = Math.max(0, Math.min(12, size - Math.floor(Math.log10(step || 1) + 1e-9)));
    return value.toExponential(digits).replace("e+", "e").replace("-", "−");
  }

  function quantity(value, column) {
    if (column.words.length) return Number.isFinite(value) ? column.words[value] : "–";
    const unit = column.unit && Number.isFinite(value) ? ` ${column.unit}` : "";
    return (column.role === "change" ? signed(value) : number(value)) + unit;
  }

  // A change, with its sign.
  const signed = (value) => (value > 0 ? "+" : "") + number(value).replace("-", "−");

  // From low to high; of values that differ by roundings alone, as wide as of one value, for ticks cannot be told apart.
  function span(low, high) {
    const far = Math.max(Math.abs(low), Math.abs(high));
    return high - low > 1e-12 * far ? high - low : far * 0.1 || 1;
  }

  const titled = (column) => (column.unit ? `${column.label} (${column.unit})` : column.label);

  // A sentence: what stands between backticks is a program's text.
  const prose = (text) => text.split(/`([^`\n]+)`/).map((part, n) => (n % 2 ? node("code", null, part) : part));

  // A label of an axis that has room: of a long path its end, and its unit.
  function fitted(text, font, room) {
    const context = document.createElement("canvas").getContext("2d");
    context.font = font;
    let at = 0;
    const short = () => (at ? `…${text.slice(at)}` : text);
    while (at < text.length - 1 && context.measureText(short()).width > room) at++;
    return short();
  }

  // An element. Attributes that are functions are listeners; children are elements or texts.
  function node(tag, attributes, ...children) {
    const svg = tag === "svg" || tag === "path" || tag === "circle" || tag === "line";
    const made = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
    for (const [name, value] of Object.entries(attributes || {})) {
      if (value === null || value === undefined || value === false) continue;
      if (typeof value === "function") made.addEventListener(name, value);
      else if (name === "style") Object.assign(made.style, value);
      else made.setAttribute(name, value === true ? "" : value);
    }
    made.append(...children.flat(9).filter((child) => child !== null && child !== undefined));
    return made;
  }

  // Colours

  const LIGHT = ["#0a6cb0", "#c24d05", "#0a8065", "#a8478a", "#8f6a00", "#4a56c4", "#30363c"];
  const DARK = ["#62b4f0", "#f2915a", "#45c9a4", "#e39bc8", "#e0b44a", "#9aa6ff", "#dfe3e7"];
  const VIRIDIS = ["#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c", "#28ae80", "#5ec962", "#addc30", "#fde725"];
  let printing = false;

  const dark = () => !printing && matchMedia("(prefers-color-scheme: dark)").matches;
  const variable = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

  function palette() {
    const lit = !dark();
    const own = lit && printing ? { ink: "#1a1e23", muted: "#59636e", line: "#dfe3e7", faint: "#c3c9cf", paper: "#ffffff",
      accent: "#14559e", attend: "#a33a0a", soft: "#f5f6f7" } : {};
    const read = (name) => own[name] || variable(name);
    return { lines: lit ? LIGHT : DARK, ink: read("ink"), muted: read("muted"), line: read("line"), faint: read("faint"),
      paper: read("paper"), accent: read("accent"), attend: read("attend"), soft: read("soft") };
  }

  const channel = (hex, at) => parseInt(hex.slice(at, at + 2), 16);

  // A colour for a share from 0 to 1; the end that the paper swallows is left out.
  function ramp(share) {
    const [low, high] = dark() ? [0.24, 1] : [0, 0.88];
    const at = Math.min(Math.max(low + (high - low) * (share || 0), 0), 1) * (VIRIDIS.length - 1);
    const first = Math.min(Math.floor(at), VIRIDIS.length - 2);
    const mixed = [1, 3, 5].map((c) => {
      const [a, b] = [channel(VIRIDIS[first], c), channel(VIRIDIS[first + 1], c)];
      return Math.round(a + (b - a) * (at - first));
    });
    return `rgb(${mixed.join(",")})`;
  }

  // Where a value lies in a range of colours, 0 to 1; of one value alone in its middle.
  function share(value, { low, high, log }) {
    if (!(high > low)) return 0.5;
    return log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
  }

  // Its colour; what lies beyond the range has one of its own, as in `met plot`.
  const [BELOW, ABOVE] = ["#8f7ff0", "#f4724d"];
  const ROUNDED = 1e-6;  // numbers come in four bytes
  function tone(value, reach) {
    const at = share(value, reach);
    return at < -ROUNDED ? BELOW : at > 1 + ROUNDED ? ABOVE : ramp(at);
  }

  // A colour for a share from -1 to 1: blue below, the paper's at 0, orange above; both darker the further from it.
  function diverging(share) {
    const ends = dark() ? ["#2b2f34", "#6fb4f0", "#f0a56a"] : ["#f1f2f3", "#1f5f9e", "#b3510f"];
    const far = Math.min(Math.abs(share), 1) ** 0.8;
    const end = ends[share < 0 ? 1 : 2];
    return `rgb(${[1, 3, 5].map((c) => Math.round(channel(ends[0], c) + (channel(end, c) - channel(ends[0], c)) * far)).join(",")})`;
  }

  // What stands for a cell without a number, and why; while it is printed, as on light paper.
  const GREYS = { infinite: ["#c9ced3", "#4b545d"], failed: ["#828c95", "#8a949d"], lacking: ["#e9ecee", "#2a3036"] };
  const grey = (kind) => GREYS[kind][dark() ? 1 : 0];

  // Black or white, whichever is read on a colour.
  function over(colour) {
    const parts = colour[0] === "#" ? [1, 3, 5].map((at) => channel(colour, at)) : colour.match(/\d+/g);
    const [r, g, b] = parts.map((c) => {
      const s = c / 255;
      return s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.18 ? "#000000" : "#ffffff";
  }

  // What is drawn anew when colours or the paper change

  const drawn = [];
  const redraw = () => drawn.forEach((draw) => draw());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);

  const PRINTED = 660;
  const width = (element) => (printing ? PRINTED : Math.max(240, Math.floor(element.clientWidth)));

  function print(begins) {
    printing = begins;
    redraw();
  }

  // A note beside the pointer

  const tip = {
    show(x, y, ...children) {
      const box = document.getElementById("tip");
      box.replaceChildren(...children);
      box.hidden = false;
      const { width: w, height: h } = box.getBoundingClientRect();
      const right = document.documentElement.clientWidth + scrollX;
      box.style.left = `${Math.max(scrollX + 4, x + 14 + w > right ? x - 14 - w : x + 14)}px`;
      box.style.top = `${Math.max(scrollY + 4, y + 14 + h > scrollY + innerHeight ? y - 14 - h : y + 14)}px`;
    },
    hide() {
      document.getElementById("tip").hidden = true;
    },
  };

  const pairs = (list) => node("dl", null, list.map(([name, value, cls]) => [node("dt", null, name), node("dd", { class: cls }, value)]));

  // A section's data, and which case is chosen in it; `watch` is told of another.
  function model(data) {
    const watchers = [];
    const made = { data, chosen: null, watch: (told) => watchers.push(told) };
    made.choose = (number) => {
      made.chosen = number;
      watchers.forEach((told) => told(number));
    };
    const overview = data.overview;
    if (overview) {
      made.cases = unpack(overview.cases);
      made.outcome = Array.from(unpack(overview.ended), (place) => data.ended[place]);
      made.columns = overview.columns.map((column) => ({ ...column, values: unpack(column.values),
        before: column.before && unpack(column.before) }));
      made.column = (key) => made.columns.find((column) => column.key === key);
      made.places = new Map(Array.from(made.cases, (number, place) => [number, place]));
    }
    made.command = (number) => data.replay.replace("#CASE", `#${number}`);
    return made;
  }

  return { bytes, unpack, number, ticks, span, prose, fitted, quantity, titled, node, palette, ramp, share, tone, BELOW, ABOVE, diverging, signed, grey, over, drawn, width, print, tip, pairs, model,
    dark, isPrinting: () => printing };
})();
