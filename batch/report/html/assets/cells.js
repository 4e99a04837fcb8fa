// Many cells of a map, drawn: stripes where a case misses, greys where there is no number, signs as far apart as is read.
"use strict";

MET.cells = (() => {
  const { node, titled } = MET;
  const HIGH = 420;
  const CELL = [4, 26];  // px, the least and the greatest height of a cell
  const APART = 40;  // px from sign to sign
  const LETTER = 6.6;

  // Draws the cells in `box`; gives what chooses a case, and how wide the drawing is.
  function make(box, found, model) {
    const { x, y, map, across, up } = found;
    const wide = MET.width(box);
    const px = devicePixelRatio;
    const high = Math.round(Math.min(Math.max(HIGH / up, CELL[0]), CELL[1]) * up);
    const rows = fitting(map.yRuler.ticks, high, () => 18);
    const left = Math.min(0.3 * wide, 12 + LETTER * Math.max(...rows.map(([, text]) => text.length)));
    const columns = fitting(map.xRuler.ticks, wide - left - 2, (text) => LETTER * text.length + 16);
    const canvas = node("canvas", { tabindex: 0, role: "application", style: { width: `${wide}px`, height: `${high + 22}px` },
      "aria-label": `${titled(found.m)} over ${titled(x)} and ${titled(y)}. Arrow keys go from cell to cell, Enter chooses the case that one shows.` });
    [canvas.width, canvas.height] = [wide * px, (high + 22) * px];
    box.replaceChildren(node("div", { class: "axes" }, node("span", null, `${titled(y)} ↑`), node("span", null, `${titled(x)} →`)), canvas);
    const area = (n) => {
      const [column, row] = [n % across, Math.floor(n / across)];
      const [l, r] = [0, 1].map((one) => Math.round((left + map.xRuler.edges[column + one] * (wide - left - 2)) * px));
      const [b, t] = [0, 1].map((one) => Math.round((1 - map.yRuler.edges[row + one]) * high * px));
      return [l, t, r - l, b - t];
    };
    let at = -1;

    function draw() {
      const colours = MET.palette();
      const ctx = canvas.getContext("2d");
      ctx.clearRect(0, 0, canvas.width, canvas.height);
      const greys = { infinite: MET.grey("infinite"), failed: MET.grey("failed"), lacking: MET.grey("lacking") };
      const stripes = { "#ffffff": stripe(ctx, "#ffffff", px), "#000000": stripe(ctx, "#1a1e23", px) };
      const signs = [];
      for (let n = 0; n < across * up; n++) {
        const kind = found.kind(n);
        if (kind === "void") continue;
        const colour = kind === "number" ? found.colour(n) : greys[kind];
        ctx.fillStyle = colour;
        ctx.fillRect(...area(n));
        if (found.missed[n]) {
          ctx.fillStyle = stripes[MET.over(colour)];
          ctx.fillRect(...area(n));
        }
        const sign = kind === "infinite" ? (found.values[n] > 0 ? "∞" : "−∞") : found.failed[n] ? "×" : "";
        if (sign) signs.push([n, sign]);
      }
      write(ctx, signs, colours);
      ticks(ctx, colours);
      const chosen = found.cases.indexOf(model.chosen);
      for (const [n, colour] of [[model.chosen === null ? -1 : chosen, colours.accent], [at, colours.ink]]) {
        if (n < 0) continue;
        const [l, t, w, h] = area(n);
        for (const [width, tone] of [[4, colours.paper], [2, colour]]) {
          ctx.lineWidth = width * px;
          ctx.strokeStyle = tone;
          ctx.strokeRect(l - px, t - px, w + 2 * px, h + 2 * px);
        }
      }
    }

    // In each stretch of the map one sign of a kind.
    function write(ctx, signs, colours) {
      ctx.font = `${12 * px}px ${getComputedStyle(document.body).fontFamily}`;
      ctx.textAlign = "center";
      ctx.textBaseline = "middle";
      ctx.lineJoin = "round";
      ctx.lineWidth = 3 * px;
      const there = new Set();
      for (const [n, sign] of signs) {
        const [l, t, w, h] = area(n);
        const [centre, middle] = [l + w / 2, t + h / 2];
        const stretch = `${sign}/${Math.floor(centre / (APART * px))}/${Math.floor(middle / (APART * px))}`;
        if (there.has(stretch)) continue;
        there.add(stretch);
        ctx.strokeStyle = MET.grey(sign === "×" ? "failed" : "infinite");
        ctx.fillStyle = colours.ink;
        ctx.strokeText(sign, centre, middle);
        ctx.fillText(sign, centre, middle);
      }
    }

    // The values that have room beside the cells, and below them.
    function ticks(ctx, colours) {
      ctx.font = `${11 * px}px ${getComputedStyle(document.body).fontFamily}`;
      ctx.fillStyle = colours.muted;
      ctx.textAlign = "right";
      ctx.textBaseline = "middle";
      for (const [at, text] of rows) ctx.fillText(text, (left - 6) * px, (1 - at) * high * px);
      ctx.textBaseline = "top";
      ctx.textAlign = "center";
      for (const [at, text] of columns) {
        const half = ctx.measureText(text).width / 2;
        ctx.fillText(text, Math.min(Math.max((left + at * (wide - left - 2)) * px, half), canvas.width - half), (high + 7) * px);
      }
    }

    function cellAt(event) {
      const frame = canvas.getBoundingClientRect();
      const column = within(map.xRuler.edges, (event.clientX - frame.left - left) / (wide - left - 2));
      const row = within(map.yRuler.edges, 1 - (event.clientY - frame.top) / high);
      return column < 0 || column >= across || row < 0 || row >= up ? -1 : row * across + column;
    }

    function go(n, pageX, pageY) {
      if (n === at) return;
      at = n;
      draw();
      if (n < 0 || !found.counts[n]) return MET.tip.hide();
      const frame = canvas.getBoundingClientRect();
      const [l, t, w, h] = area(n).map((v) => v / px);
      MET.tip.show(pageX ?? frame.left + scrollX + l + w, pageY ?? frame.top + scrollY + t + h, ...found.tell(n));
    }

    const choose = (n) => { if (n >= 0 && found.cases[n] >= 0) model.choose(found.cases[n]); };

    canvas.addEventListener("mousemove", (event) => go(cellAt(event), event.pageX, event.pageY));
    canvas.addEventListener("mouseleave", () => go(-1));
    canvas.addEventListener("blur", () => go(-1));
    canvas.addEventListener("click", (event) => choose(cellAt(event)));
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (step) {
        const [column, row] = at < 0 ? [0, 0] : [at % across + step[0], Math.floor(at / across) + step[1]];
        if (column >= 0 && column < across && row >= 0 && row < up) go(row * across + column);
      } else if (event.key === "Enter") choose(at);
      else if (event.key === "Escape") go(-1);
      else return;
      event.preventDefault();
    });
    draw();
    return { choose: draw, wide };
  }

  // Between which edges something lies; -1 beyond them.
  const within = (edges, at) => (at < edges[0] || at >= edges[edges.length - 1] ? -1 : edges.findIndex((edge) => edge > at) - 1);

  // The densest choice of ticks that have room; else every second, third ... of the last one.
  function fitting(choices, size, room) {
    const clear = (ticks) => ticks.every(([at, text], n) => !n || (at - ticks[n - 1][0]) * size >= (room(text) + room(ticks[n - 1][1])) / 2);
    const found = choices.find(clear);
    if (found) return found;
    const last = choices[choices.length - 1];
    for (let every = 2; ; every++) {
      const some = last.filter((_, n) => n % every === 0);
      if (clear(some)) return some;
    }
  }

  // Stripes that run through neighbouring cells.
  function stripe(ctx, colour, px) {
    const size = Math.round(6 * px);
    const tile = node("canvas", { width: size, height: size });
    const on = tile.getContext("2d");
    on.strokeStyle = colour;
    on.globalAlpha = 0.75;
    on.lineWidth = 0.8 * px;
    on.beginPath();
    for (const shift of [-size, 0, size]) {
      on.moveTo(shift - 1, size + 1);
      on.lineTo(shift + size + 1, -1);
    }
    on.stroke();
    return ctx.createPattern(tile, "repeat");
  }

  return make;
})();
