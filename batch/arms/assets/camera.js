// Where a picture of an arm is seen from: turned about a target, z up; fitted round what is to be seen.
"use strict";

MET.camera = (() => {
  const { dot, cross, plus, unit } = MET.arm;
  const { field: FIELD, room: ROOM, azimuth: AZIMUTH, low: LOW, high: FLAT_FROM, flat: FLAT } = MET.look;
  const HIGH = 1.53;  // rad, at most above or below

  function make() {
    const made = { azimuth: AZIMUTH, elevation: LOW, distance: 3, target: [0, 0, 0], aspect: 1.6 };
    made.axes = () => {
      const { azimuth: a, elevation: e } = made;
      const back = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
      const right = [-Math.sin(a), Math.cos(a), 0];
      return { right, up: cross(back, right), back, eye: plus(made.target, back, made.distance) };
    };

    // Right, up and far of a point: of the picture's half height where it is `far` away.
    made.see = (p, { right, up, back, eye } = made.axes()) => {
      const v = plus(p, eye, -1);
      const far = -dot(back, v);
      return [dot(right, v) / (far * FIELD), dot(up, v) / (far * FIELD), far];
    };

    // The 16 numbers that take the world to a clip space, column by column.
    made.matrix = () => {
      const { right, up, back, eye } = made.axes();
      const [near, most] = [made.distance / 40, made.distance * 40];
      const [fx, fy] = [1 / (FIELD * made.aspect), 1 / FIELD];
      const [a, b] = [(most + near) / (near - most), (2 * most * near) / (near - most)];
      const row = (v, k) => [k * v[0], k * v[1], k * v[2], -k * dot(v, eye)];
      const [x, y, z] = [row(right, fx), row(up, fy), row(back, 1)];
      return Float32Array.from([0, 1, 2, 3].flatMap((n) => [x[n], y[n], a * z[n] + (n === 3 ? b : 0), -z[n]]));
    };

    made.orbit = (dx, dy) => {
      made.azimuth -= dx;
      made.elevation = Math.min(HIGH, Math.max(-HIGH, made.elevation + dy));
    };
    made.pan = (dx, dy) => {
      const { right, up } = made.axes();
      made.target = plus(plus(made.target, right, -dx * FIELD * made.distance), up, dy * FIELD * made.distance);
    };
    made.zoom = (factor, least, most) => { made.distance = Math.min(most, Math.max(least, made.distance * factor)); };

    // So that all these pills ({ends, radius}) are seen, the eye where it stands, below a share of the height.
    made.fit = (pills, share = 0) => {
      const { right, up, back } = made.axes();
      const [fx, fy] = [FIELD * made.aspect, FIELD * (1 - share)];
      const box = [right, up].map((axis) => {
        let [low, high] = [Infinity, -Infinity];
        pills.forEach(({ ends, radius }) => ends.forEach((p) => {
          const at = dot(axis, p);
          [low, high] = [Math.min(low, at - radius), Math.max(high, at + radius)];
        }));
        return (low + high) / 2;
      });
      const depth = pills.reduce((sum, { ends }) => sum + dot(back, ends[0]), 0) / pills.length;
      made.target = plus(plus(right.map((x) => x * box[0]), up, box[1]), back, depth);
      made.distance = ROOM * pills.reduce((far, { ends, radius }) => ends.reduce((most, p) => {
        const v = plus(p, made.target, -1);
        return Math.max(most, dot(back, v) + Math.max((Math.abs(dot(right, v)) + radius) / fx, (Math.abs(dot(up, v)) + radius) / fy));
      }, far), 0);
      made.target = plus(made.target, up, share * FIELD * made.distance);
    };

    // From where the most of these points' spread is seen; from higher where it is flat, and not along a straight arm.
    made.choose = (points) => {
      const mean = points.reduce((a, b) => plus(a, b, 1 / points.length), [0, 0, 0]);
      const spread = (u, v) => points.reduce((sum, p) => sum + dot(u, plus(p, mean, -1)) * dot(v, plus(p, mean, -1)), 0);
      const [z, [xx, yy]] = [[0, 0, 1], [[1, 0, 0], [0, 1, 0]].map((axis) => spread(axis, axis))];
      made.elevation = spread(z, z) < FLAT * (xx + yy) ? FLAT_FROM : LOW;
      let best = -1;
      for (let n = 0; n < 36; n++) {
        made.azimuth = AZIMUTH + (n * Math.PI) / 18;
        const { right, up } = made.axes();
        const area = spread(right, right) * spread(up, up) - spread(right, up) ** 2 + (1e-3 * (1 + Math.cos(made.azimuth - AZIMUTH)) * (xx + yy) + 0.01 * Math.min(spread(right, right), 0.3 * (xx + yy))) * (xx + yy);
        if (area > best) [best, made.best] = [area, made.azimuth];
      }
      made.azimuth = made.best;
    };
    return made;
  }

  return { make, unit, FIELD };
})();
