// An arm to be drawn: where its bodies are at an instant of a case, and its shapes as solids in the world, each a mesh that
// is stretched: a block (edges), a can (radius, length) or a pill (radius, length; a ball where it has no length).
"use strict";

MET.arm = (() => {
  const POSE = 12;  // numbers of a body: the rows of its rotation, its origin
  const SHAPE = 9;  // of a shape: middle, axis, size
  const PIN = 0.55;  // of a joint's size, on a link with a mesh
  const SOLID = 16;  // of a solid: place, three axes, size
  const { joint: JOINT, cube: CUBE, rail: RAIL, foot: FOOT } = MET.look;
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const plus = (a, b, k = 1) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
  const size = (a) => Math.hypot(a[0], a[1], a[2]);
  const unit = (a) => a.map((each) => each / (size(a) || 1));

  // Three axes of which the last is along a direction.
  function along(axis) {
    const z = unit(axis);
    const x = unit(cross(Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0], z));
    return [x, cross(z, x), z];
  }

  // Numbers at a time into `inputs`: the time, then those of the columns; between rows along a straight line.
  function between(time, columns, t, inputs) {
    const last = time.length - 1;
    const [first, step] = [time[0], last > 0 ? (time[last] - time[0]) / last : 1];
    const place = Math.min(Math.max((t - first) / step, 0), last);
    const row = Math.min(Math.floor(place + 1e-9), Math.max(last - 1, 0));
    const share = last > 0 ? Math.min(Math.max(place - row, 0), 1) : 0;
    inputs[0] = Math.min(t, time[last]);
    columns.forEach((rows, n) => { inputs[n + 1] = share < 1e-9 ? rows[row] : rows[row] + share * (rows[row + 1] - rows[row]); });
    return inputs;
  }

  // Columns of a run: {values: of what the sweep varies, by path; time: of its rows; numbers: row after row; width: of a row}.
  const columns = ({ time, numbers, width }, places) => places.map((place) => Float64Array.from(time, (_, row) => numbers[row * width + place]));

  // scene: as `batch.arms.scene.scene_json` has it.
  function make(scene) {
    const moving = new Set(["time", ...scene.channels]);
    const formulas = MET.formulas.make(scene.nodes, scene.outputs, moving);
    const turned = along(scene.up);
    const up = scene.up[2] === 1 ? (v) => v : (v) => turned.map((axis) => dot(axis, v));  // the world, seen with z up
    const count = scene.bodies.length;
    const { limb } = scene;

    // A case. values: of what the sweep varies, by path; time: of its rows; columns: of each channel, by row.
    function take(values, time, columns) {
      const ends = {};
      scene.joints.forEach((joint) => {
        const rows = columns[scene.channels.indexOf(`${joint}.q`)];
        ends[`low:${joint}`] = rows.reduce((a, b) => Math.min(a, b), 0);
        ends[`high:${joint}`] = rows.reduce((a, b) => Math.max(a, b), 0);
      });
      const state = formulas.begin({ ...values, ...ends });
      const out = new Float64Array(scene.outputs.length);
      const inputs = new Float64Array(scene.channels.length + 1);
      const at = (t) => formulas.at(state, between(time, columns, t, inputs), out);
      const tip = (t) => up(vector(at(t), out.length - 3));
      return { at, tip, end: time[time.length - 1] };
    }

    const vector = (numbers, at) => [numbers[at], numbers[at + 1], numbers[at + 2]];
    const rows = (numbers, body) => [0, 3, 6].map((at) => vector(numbers, POSE * body + at));
    const origin = (numbers, body) => vector(numbers, POSE * body + 9);
    const [upX, upY, upZ] = scene.up[2] === 1 ? [[1, 0, 0], [0, 1, 0], [0, 0, 1]] : turned;

    // Puts a direction of a body, or with `from` a point, into the world, z up, at a place of `out`.
    function put(numbers, body, x, y, z, out, at, from) {
      const b = POSE * body;
      const wx = numbers[b] * x + numbers[b + 1] * y + numbers[b + 2] * z + (from ? numbers[b + 9] : 0);
      const wy = numbers[b + 3] * x + numbers[b + 4] * y + numbers[b + 5] * z + (from ? numbers[b + 10] : 0);
      const wz = numbers[b + 6] * x + numbers[b + 7] * y + numbers[b + 8] * z + (from ? numbers[b + 11] : 0);
      out[at] = upX[0] * wx + upX[1] * wy + upX[2] * wz;
      out[at + 1] = upY[0] * wx + upY[1] * wy + upY[2] * wz;
      out[at + 2] = upZ[0] * wx + upZ[1] * wy + upZ[2] * wz;
    }

    const meshes = scene.shapes.map(([, kind]) => (kind === "box" ? "block" : kind === "cylinder" ? "can" : "pill"));

    // The numbers of a shape's solid into `out`: its place, its three axes, its size; as `solids` has them.
    function write(numbers, n, out, to) {
      const [body, kind, role] = scene.shapes[n];
      const first = POSE * count + SHAPE * n;
      const [ax, ay, az] = [numbers[first + 3], numbers[first + 4], numbers[first + 5]];
      const half = kind === "line" ? 0.5 : 0;
      put(numbers, body, numbers[first] + half * ax, numbers[first + 1] + half * ay, numbers[first + 2] + half * az, out, to, true);
      if (kind === "box") [0, 1, 2].forEach((k) => put(numbers, body, +(k === 0), +(k === 1), +(k === 2), out, to + 3 + 3 * k, false));
      else {  // three axes of which the last is along the shape's, as `along`
        const far = Math.hypot(ax, ay, az) || 1;
        const [zx, zy, zz] = [ax / far, ay / far, az / far];
        const steep = Math.abs(zz) >= 0.9;
        let [xx, xy, xz] = steep ? [0, -zz, zy] : [-zy, zx, 0];
        const wide = Math.hypot(xx, xy, xz) || 1;
        [xx, xy, xz] = [xx / wide, xy / wide, xz / wide];
        put(numbers, body, xx, xy, xz, out, to + 3, false);
        put(numbers, body, zy * xz - zz * xy, zz * xx - zx * xz, zx * xy - zy * xx, out, to + 6, false);
        put(numbers, body, zx, zy, zz, out, to + 9, false);
      }
      const [sx, sy, sz] = [numbers[first + 6], numbers[first + 7], numbers[first + 8]];
      let [x, y, z, length] = [limb, limb, limb, 0];
      if (kind === "line") length = Math.hypot(ax, ay, az);
      else if (kind === "rod") length = sz;
      else if (kind === "sphere") [x, y, z] = [sx, sy, sz];
      else if (kind === "box") [x, y, z] = role === "joint" ? [CUBE * limb, CUBE * limb, CUBE * limb] : [sx, sy, sz];
      else [x, y, z, length] = role === "joint" ? [JOINT[0] * limb, JOINT[0] * limb, JOINT[0] * limb, JOINT[1] * limb] : [sx, sx, sx, sz];
      if (role === "rail") [x, y, z] = [RAIL * limb, RAIL * limb, RAIL * limb];
      [out[to + 12], out[to + 13], out[to + 14], out[to + 15]] = [x, y, z, length];
    }

    // The links' meshes, which are drawn in the place of their shapes.
    const skins = (MET.meshes?.[scene.meshes] ?? scene.meshes ?? []).map(skin);
    const skinned = new Set(skins.map(({ body }) => body));

    // The solids: {mesh, role, joint, at, axes (of the mesh, in the world), size}; with `skin`, one of the links' meshes,
    // unless they are to be plain.
    const own = new Float64Array(SOLID);
    function solids(numbers, plain = false) {
      const out = plain ? [] : skins.map((worn, n) => ({ mesh: `skin ${n}`, skin: worn, role: "link", joint: -1, body: worn.body, at: up(origin(numbers, worn.body)),
        axes: [0, 1, 2].map((which) => up(rows(numbers, worn.body).map((row) => row[which]))), size: [1, 1, 1, 0] }));
      scene.shapes.forEach(([body, , role, joint], n) => {
        if (!plain && skinned.has(body) && ["link", "base"].includes(role)) return;
        write(numbers, n, own, 0);
        if (!plain && skinned.has(body) && role === "joint") [12, 13, 14].forEach((k) => { own[k] *= PIN; });
        out.push({ mesh: meshes[n], role, joint, body, at: vector(own, 0), axes: [3, 6, 9].map((at) => vector(own, at)), size: [...vector(own, 12), own[15]] });
      });
      if (!scene.moves && (plain || !skinned.has(0))) out.push({ mesh: "can", role: "base", joint: -1, at: [0, 0, FOOT[1] * limb / 2], axes: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], size: [FOOT[0] * limb, FOOT[0] * limb, 0.4 * limb, FOOT[1] * limb] });
      return out;
    }

    // The axes of all frames, as solids of role "x", "y", "z".
    const frames = (numbers) => scene.bodies.flatMap((_, body) => [0, 1, 2].map((which) => {
      const far = 3.6 * limb;
      const axis = up(rows(numbers, body).map((row) => row[which]));
      return { mesh: "can", role: "xyz"[which], joint: -1, at: plus(up(origin(numbers, body)), axis, far / 2), axes: along(axis), size: [0.2 * limb, 0.2 * limb, 0.2 * limb, far] };
    }));

    // An arrow of a role from a point along a vector, both seen with z up, far m long; a moment has two heads.
    const [SHAFT, HEAD] = [[0.22], [0.6, 1.9]];  // radius and, of the head, length, in limbs
    function arrow(begin, vector, far, role, heads = 1) {
      if (!(far > 0.2 * limb)) return [];
      const axes = along(vector);
      const head = Math.min(HEAD[1] * limb, (0.6 * far) / heads);
      const part = (mesh, radius, at, length) => ({ mesh, role, joint: -1, at: plus(begin, axes[2], at), axes, size: [radius * limb, radius * limb, mesh === "can" ? 0.1 * limb : 0, length] });
      return [part("can", SHAFT[0], (far - head) / 2, far - head), ...Array.from({ length: heads }, (_, n) => part("cone", HEAD[0], far - (n + 0.5) * head, head))];
    }

    // Forces as arrows from the origins of their bodies' frames. forces: [body, x, y, z], in the body's axes, N; metres: of
    // a newton.
    const arrows = (numbers, forces, metres) => forces.flatMap(([body, ...force]) =>
      arrow(up(origin(numbers, body)), up(rows(numbers, body).map((row) => dot(row, force))), metres * size(force), "force"));

    return { skins, take, solids, arrow, arrows, up, at: (numbers, body) => up(origin(numbers, body)), write, meshes, frames, scene, limb, reach: scene.reach };
  }

  // A link's mesh, as `batch.arms.meshes.meshes_json` has it: points, in its body's frame, and places of corners of faces.
  function skin({ body, low, edge, points, faces }) {
    const cells = new Uint16Array(MET.bytes(points).buffer);
    const places = Float32Array.from(cells, (cell, n) => low[n % 3] + edge * cell);
    const far = [0, 1, 2].map((axis) => low[axis] + edge * cells.reduce((most, cell, n) => (n % 3 === axis ? Math.max(most, cell) : most), 0));
    return { body, points: places, faces: new Uint16Array(MET.bytes(faces).buffer), low, far };
  }

  // Ends and radius of a link's mesh as if it were a pill: along the longest side of the box round it.
  function endsOfSkin({ low, far }, at, axes) {
    const half = low.map((x, k) => (far[k] - x) / 2);
    const middle = axes.reduce((p, axis, k) => plus(p, axis, low[k] + half[k]), at);
    const longest = half.indexOf(Math.max(...half));
    const others = half.filter((_, k) => k !== longest);
    return { ends: [-1, 1].map((side) => plus(middle, axes[longest], side * half[longest])), radius: Math.hypot(...others) };
  }

  // Ends and radius of a solid as if it were a pill, by which it is fitted into a picture.
  function ends({ mesh, skin, at, axes, size: [x, y, z, length] }) {
    if (skin) return endsOfSkin(skin, at, axes);
    const half = mesh === "block" ? z / 2 : length / 2;
    return { ends: [plus(at, axes[2], -half), plus(at, axes[2], half)], radius: mesh === "block" ? Math.hypot(x, y) / 2 : x };
  }

  return { make, columns, between, ends, dot, cross, plus, unit, along, length: size, SOLID };
})();
