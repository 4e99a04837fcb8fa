// Draws a picture of an arm by WebGL 2: meshes of unit size, stretched and turned by what a texture lists of each solid; a
// floor with a grid and shadows on it. `make` gives null where there is no WebGL.
//   picture  {camera, solids, clear: those that one sees through, twin: the solids of a second arm, arm, ghosts: of each the arm's numbers, trace: [points], floor (its height, or null), step (of the grid, m), colours,
//            fine: it stands, and may take longer; shadow: whether the arm casts one}
// All solids of a mesh are one call, a copy of the mesh each: where a processor draws, each instance of an instanced call
// costs as much as a call, some 40 us, by which a hundred ghosts take ten times as long.
"use strict";

MET.webgl = (() => {
  const { plus, unit, along, length, dot, cross, SOLID: TINT } = MET.arm;
  const [NUMBERS, ROW] = [20, 128];  // of a solid, in five dots of a texture; solids in its row
  const [FEW, THIN] = [16, 0.4];  // ghosts; of more, limbs are thinner by this and have few faces
  const SUN = unit([-0.28, -0.18, 1]);  // where shadows come from

  // What stands in the texture of a vertex's solid: its place, axes, size and colour.
  const LISTED = `
    layout(location=0) in vec4 shape; layout(location=1) in vec3 bent;
    uniform highp sampler2D listed; uniform ivec2 run;  // the first solid of this call, vertices of its mesh
    vec3 at, x, y, z; vec4 size, tint;
    void look() {
      int n = run.x + gl_VertexID / run.y;
      ivec2 dot_ = ivec2(5 * (n % ${ROW}), n / ${ROW});
      vec4 a = texelFetch(listed, dot_, 0), b = texelFetch(listed, dot_ + ivec2(1, 0), 0), c = texelFetch(listed, dot_ + ivec2(2, 0), 0);
      at = a.xyz; x = vec3(a.w, b.xy); y = vec3(b.zw, c.x); z = c.yzw;
      size = texelFetch(listed, dot_ + ivec2(3, 0), 0); tint = texelFetch(listed, dot_ + ivec2(4, 0), 0);
    }`;

  const SOLID = [`#version 300 es
    ${LISTED}
    uniform mat4 view; uniform vec4 shadow; uniform float height;
    out vec3 normal; out vec3 place; out vec4 colour;
    void main() {
      look();
      vec3 own = shape.xyz * size.xyz + vec3(0.0, 0.0, shape.w * size.w);
      place = at + own.x * x + own.y * y + own.z * z;
      normal = bent.x * x + bent.y * y + bent.z * z;
      if (shadow.w > 0.0) place = vec3(place.xy - shadow.xy / shadow.z * (place.z - height), height);
      colour = tint;
      gl_Position = view * vec4(place, 1.0);
    }`, `#version 300 es
    precision highp float;
    in vec3 normal; in vec3 place; in vec4 colour;
    uniform vec3 eye; uniform vec3 key; uniform vec4 shadow; uniform vec4 shade;
    out vec4 done;
    void main() {
      if (shadow.w > 0.0) { done = shade; return; }
      vec3 n = normalize(gl_FrontFacing ? normal : -normal), v = normalize(eye - place);
      float lit = 0.5 + 0.5 * dot(n, key), sky = 0.5 + 0.5 * n.z;
      vec3 c = colour.rgb * (0.42 + 0.66 * lit * lit) * mix(0.84, 1.04, sky);
      c += 0.2 * pow(max(dot(n, normalize(key + v)), 0.0), 36.0);
      c += 0.1 * pow(1.0 - max(dot(n, v), 0.0), 3.0);
      done = vec4(min(c, 1.0) * colour.a, colour.a);
    }`];

  // Ghosts and paths, of which there are many: one varying, little light. What has no normals is a ribbon that faces the
  // eye: shape is its place across and along, and which end it is of.
  const GHOST = [`#version 300 es
    ${LISTED}
    uniform mat4 view; uniform vec3 back; uniform vec3 right;
    out vec4 colour;
    void main() {
      look();
      vec3 own = shape.xyz * size.xyz + vec3(0.0, 0.0, shape.w * size.w);
      vec3 place = own.x * x + own.y * y + own.z * z;
      float light = 0.9 + 0.2 * (bent.x * x.z + bent.y * y.z + bent.z * z.z);
      if (bent == vec3(0.0)) {
        vec3 across = cross(back, z);
        across = length(across) > 1e-3 ? normalize(across) : right;
        place = shape.w * size.w * z + size.x * (shape.x * across + shape.y * cross(across, back));
        light = 1.0;
      }
      colour = vec4(tint.rgb * light * tint.a, tint.a);
      gl_Position = view * vec4(at + place, 1.0);
    }`, `#version 300 es
    precision mediump float;
    in vec4 colour;
    out vec4 done;
    void main() { done = colour; }`];

  const FLOOR = [`#version 300 es
    layout(location=0) in vec4 shape;
    uniform mat4 view; uniform vec4 middle;
    out vec2 place;
    void main() {
      place = middle.xy + shape.xy * 2.0 * middle.w;
      gl_Position = view * vec4(place, middle.z, 1.0);
    }`, `#version 300 es
    precision highp float;
    in vec2 place;
    uniform vec4 middle; uniform float step_; uniform vec4 line; uniform vec4 ground;
    out vec4 done;
    float lines(float step_) {
      vec2 at = place / step_, wide = fwidth(at);
      vec2 near = abs(fract(at - 0.5) - 0.5) / max(wide, 1e-6);
      vec2 ink = (1.0 - smoothstep(0.35, 1.1, near)) * (1.0 - smoothstep(0.25, 0.8, wide));
      return max(ink.x, ink.y);
    }
    void main() {
      float far = length(place - middle.xy) / middle.w;
      float fade = 1.0 - smoothstep(0.25, 1.0, far);
      float ink = max(0.45 * lines(step_), lines(step_ * 5.0)) * line.a;
      done = vec4(mix(ground.rgb * ground.a, line.rgb, ink), mix(ground.a, 1.0, ink)) * fade * fade;
    }`];

  // A profile turned about z: rings of radius, height, end (-0.5 or 0.5), and their normals' outward and upward part.
  function lathe(rings, sides) {
    const vertices = [];
    const faces = [];
    rings.forEach(([radius, z, end, out, upward], n) => {
      for (let k = 0; k <= sides; k++) {
        const [c, s] = [Math.cos((2 * Math.PI * k) / sides), Math.sin((2 * Math.PI * k) / sides)];
        vertices.push(radius * c, radius * s, z, end, out * c, out * s, upward);
        const a = n * (sides + 1) + k;
        if (n && k < sides) faces.push(a - sides - 1, a - sides, a + 1, a - sides - 1, a + 1, a);
      }
    });
    return { vertices, faces };
  }

  function pill(sides, steps) {
    const rings = [-0.5, 0.5].flatMap((end) => Array.from({ length: steps + 1 }, (_, n) => {
      const turn = (Math.PI / 2) * (n / steps - (end < 0 ? 1 : 0));
      return [Math.cos(turn), Math.sin(turn), end, Math.cos(turn), Math.sin(turn)];
    }));
    return lathe(rings, sides);
  }

  // A pill as it is seen: a strip with round ends.
  function ribbon(steps) {
    const vertices = [0.5, -0.5].flatMap((end) => Array.from({ length: steps + 1 }, (_, n) => {
      const turn = Math.PI * (n / steps - (end > 0 ? 0.5 : -0.5));
      return [Math.sin(turn), Math.cos(turn), 0, end, 0, 0, 0];
    })).flat();
    const count = 2 * (steps + 1);
    return { vertices, faces: Array.from({ length: count - 2 }, (_, n) => [0, n + 1, n + 2]).flat() };
  }

  function can(sides) {
    const half = [[1, 0.16, -0.5, 1, 0], [1, 0.16, -0.5, 0.92, -0.38], [0.84, 0, -0.5, 0.38, -0.92], [0.84, 0, -0.5, 0, -1], [0, 0, -0.5, 0, -1]];
    return lathe([...half.slice().reverse(), ...half.map(([r, z, end, out, upward]) => [r, -z, -end, out, -upward])], sides);
  }

  // The same of few faces, with sharp edges.
  const drum = (sides) => lathe([[0, 0, -0.5, 0, -1], [1, 0, -0.5, 0, -1], [1, 0, -0.5, 1, 0], [1, 0, 0.5, 1, 0], [1, 0, 0.5, 0, 1], [0, 0, 0.5, 0, 1]], sides);

  const cone = (sides) => lathe([[0, 0, -0.5, 0, -1], [1, 0, -0.5, 0, -1], [1, 0, -0.5, 0.9, 0.43], [0, 0, 0.5, 0.9, 0.43]], sides);

  function block() {
    const vertices = [];
    const faces = [];
    for (let axis = 0; axis < 3; axis++)
      for (const side of [-1, 1]) {
        const n = vertices.length / 7;
        for (const [a, b] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
          const [p, normal] = [[0, 0, 0], [0, 0, 0]];
          [p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3], normal[axis]] = [side / 2, a / 2, b / 2, side];
          vertices.push(...p, 0, ...normal);
        }
        faces.push(...(side > 0 ? [n, n + 1, n + 2, n, n + 2, n + 3] : [n, n + 2, n + 1, n, n + 3, n + 2]));
      }
    return { vertices, faces };
  }

  // A link's mesh, smooth where its faces meet at less than an angle; they may be wound either way.
  const CREASE = Math.cos(0.6);
  function smoothed({ points, faces }) {
    const point = (n) => [points[3 * n], points[3 * n + 1], points[3 * n + 2]];
    const normals = Array.from({ length: faces.length / 3 }, (_, n) => {
      const [a, b, c] = [0, 1, 2].map((k) => point(faces[3 * n + k]));
      return cross(plus(b, a, -1), plus(c, a, -1));  // as long as the face is large
    });
    const around = new Map();
    faces.forEach((corner, n) => { if (!around.has(corner)) around.set(corner, []); around.get(corner).push(Math.floor(n / 3)); });
    const [vertices, numbers] = [[], new Map()];
    const corners = Array.from(faces, (corner, n) => {
      const own = unit(normals[Math.floor(n / 3)]);
      const normal = unit(around.get(corner).reduce((sum, face) => (dot(unit(normals[face]), own) > CREASE ? plus(sum, normals[face]) : sum), [0, 0, 0]));
      const key = `${corner} ${normal.map((x) => Math.round(20 * x))}`;
      if (!numbers.has(key)) {
        numbers.set(key, vertices.length / 7);
        vertices.push(...point(corner), 0, ...normal);
      }
      return numbers.get(key);
    });
    return { vertices, faces: corners };
  }

  // Whether a processor draws, with whose help no picture has four samples a dot in time.
  function drawnBySoftware() {
    const gl = document.createElement("canvas").getContext("webgl2", { antialias: false });
    const told = gl && gl.getExtension("WEBGL_debug_renderer_info");
    const by = gl ? String(gl.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : gl.RENDERER)) : "";
    if (gl) gl.getExtension("WEBGL_lose_context")?.loseContext();
    return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(by);
  }

  function make(canvas) {
    const software = drawnBySoftware();
    const gl = canvas.getContext("webgl2", { antialias: !software, alpha: true, stencil: true, premultipliedAlpha: true });
    if (!gl) return null;

    function program([vertex, fragment]) {
      const made = gl.createProgram();
      [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]].forEach(([kind, text]) => {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, text.trim());
        gl.compileShader(shader);
        gl.attachShader(made, shader);
      });
      gl.linkProgram(made);
      if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made) || "WebGL failed");
      const uniforms = {};
      for (let n = 0; n < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); n++) {
        const { name } = gl.getActiveUniform(made, n);
        uniforms[name] = gl.getUniformLocation(made, name);
      }
      return { made, uniforms };
    }

    const [solid, ghost, floor] = [program(SOLID), program(GHOST), program(FLOOR)];
    let lately = {};  // the path that was drawn last

    // A mesh, and room for copies of it, which are made as they are needed.
    const mesh = ({ vertices, faces }) => ({ vertices, faces, each: vertices.length / 7, array: gl.createVertexArray(), room: 0 });
    function copies(of, count) {
      gl.bindVertexArray(of.array);
      if (of.room >= count) return;
      of.room = Math.max(count, 2 * of.room);
      const [corners, faces] = [new Float32Array(of.room * of.vertices.length), new Uint32Array(of.room * of.faces.length)];
      for (let n = 0; n < of.room; n++) {
        corners.set(of.vertices, n * of.vertices.length);
        faces.set(of.faces.map((corner) => corner + n * of.each), n * of.faces.length);
      }
      gl.bindBuffer(gl.ARRAY_BUFFER, of.corners ||= gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, corners, gl.STATIC_DRAW);
      [[0, 4, 0], [1, 3, 16]].forEach(([place, numbers, at]) => {
        gl.enableVertexAttribArray(place);
        gl.vertexAttribPointer(place, numbers, gl.FLOAT, false, 28, at);
      });
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, of.ways ||= gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    }
    const fine = { pill: mesh(pill(28, 8)), can: mesh(can(36)), block: mesh(block()), cone: mesh(cone(28)) };
    const quick = { pill: mesh(pill(10, 2)), can: mesh(drum(16)), block: fine.block, cone: mesh(cone(12)) };  // while a processor draws it moving
    const coarse = { pill: mesh(pill(8, 1)), can: mesh(drum(8)), block: fine.block, cone: mesh(cone(8)) };
    const [sparse, flat] = [2, 1].map((steps) => ({ ...coarse, pill: mesh(ribbon(steps)) }));
    const skins = new WeakMap();  // the meshes of links as they are drawn
    const meshOf = (skin) => skins.get(skin) ?? skins.set(skin, mesh(smoothed(skin))).get(skin);
    const kept = software ? { frame: gl.createFramebuffer(), dots: gl.createRenderbuffer(), of: "" } : null;

    // Solids as a texture has them, those of a mesh one after another.
    const list = () => ({ texture: gl.createTexture(), numbers: new Float32Array(0), rows: 0, runs: [] });
    const [own, way, crowd, second, glass] = [list(), list(), list(), list(), list()];
    function room(into, count) {
      const rows = Math.max(1, Math.ceil(count / ROW));
      if (into.numbers.length < rows * ROW * NUMBERS) into.numbers = new Float32Array(rows * ROW * NUMBERS);
      return rows;
    }
    function upload(into, rows) {
      gl.bindTexture(gl.TEXTURE_2D, into.texture);
      if (into.rows < rows) {
        into.rows = rows;
        gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 5 * ROW, rows, 0, gl.RGBA, gl.FLOAT, into.numbers);
        [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER].forEach((which) => gl.texParameteri(gl.TEXTURE_2D, which, gl.NEAREST));
      } else gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 5 * ROW, rows, gl.RGBA, gl.FLOAT, into.numbers);
    }
    const laid = (counts) => {
      let first = 0;
      return counts.map(([name, count, skin]) => ({ name, count, skin, first: (first += count) - count }));
    };

    function fill(into, solids, colour) {
      const by = {};
      solids.forEach((each) => (by[each.mesh] ||= []).push(each));
      const rows = room(into, solids.length);
      Object.values(by).flat().forEach((each, n) => {
        const at = n * NUMBERS;
        into.numbers.set(each.at, at);
        each.axes.forEach((axis, k) => into.numbers.set(axis, at + 3 + 3 * k));
        into.numbers.set(each.size, at + 12);
        into.numbers.set(colour(each), at + TINT);
      });
      into.runs = laid(Object.entries(by).map(([name, several]) => [name, several.length, several[0].skin]));
      upload(into, rows);
    }

    // Ghosts, whose numbers go straight into the list: no joints of theirs are shown; of many, what is long is thinner.
    function fillCrowd({ arm, ghosts, colours }, thinner) {
      const by = {};
      arm.meshes.forEach((mesh, n) => { if (arm.scene.shapes[n][2] !== "joint" || mesh === "pill") (by[mesh] ||= []).push(n); });
      const all = Object.entries(by).flatMap(([mesh, shapes]) => shapes.map((n) => [n, mesh === "pill" ? thinner : 1]));
      const rows = room(crowd, all.length * ghosts.length);
      let at = 0;
      all.forEach(([n, slim]) => ghosts.forEach((numbers, g) => {
        arm.write(numbers, n, crowd.numbers, at);
        for (let k = 12; k < 15; k++) crowd.numbers[at + k] *= slim;
        crowd.numbers.set(colours.ghost(g), at + TINT);
        at += NUMBERS;
      }));
      crowd.runs = laid(Object.entries(by).map(([mesh, shapes]) => [mesh, shapes.length * ghosts.length]));
      upload(crowd, rows);
    }

    function put(meshes, { texture, runs }, { uniforms }) {
      gl.bindTexture(gl.TEXTURE_2D, texture);
      const culled = gl.isEnabled(gl.CULL_FACE);
      runs.forEach(({ name, first, count, skin }) => {
        const of = skin ? meshOf(skin) : meshes[name];
        copies(of, count);
        if (culled) gl[skin ? "disable" : "enable"](gl.CULL_FACE);
        gl.uniform2i(uniforms.run, first, of.each);
        gl.drawElements(gl.TRIANGLES, count * of.faces.length, gl.UNSIGNED_INT, 0);
      });
      if (culled) gl.enable(gl.CULL_FACE);
    }

    function drawFloor({ camera, floor: height, step, reach, colours }, view) {
      if (height === null) return;
      gl.disable(gl.DEPTH_TEST);
      gl.useProgram(floor.made);
      gl.uniformMatrix4fv(floor.uniforms.view, false, view);
      gl.uniform4f(floor.uniforms.middle, camera.target[0], camera.target[1], height, 2.6 * reach);
      gl.uniform1f(floor.uniforms.step_, step);
      gl.uniform4f(floor.uniforms.line, ...colours.grid);
      gl.uniform4f(floor.uniforms.ground, ...colours.ground);
      copies(fine.block, 1);
      gl.drawElements(gl.TRIANGLES, 6, gl.UNSIGNED_INT, 4 * 30);  // its upper side
    }

    // The floor as it was, unless it is seen from elsewhere: it has the most dots of all, and a processor is slow at them.
    function copyFloor(picture, view) {
      const of = [...view, canvas.width, canvas.height, picture.floor, ...picture.colours.grid, ...picture.colours.ground].join();
      const size = [canvas.width, canvas.height];
      if (of !== kept.of) {
        gl.bindFramebuffer(gl.FRAMEBUFFER, kept.frame);
        if (kept.size !== String(size)) {
          kept.size = String(size);
          gl.bindRenderbuffer(gl.RENDERBUFFER, kept.dots);
          gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, ...size);
          gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, kept.dots);
        }
        gl.clear(gl.COLOR_BUFFER_BIT);
        drawFloor(picture, view);
        kept.of = of;
      }
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, kept.frame);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
      gl.blitFramebuffer(0, 0, ...size, 0, 0, ...size, gl.COLOR_BUFFER_BIT, gl.NEAREST);
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    }

    function draw(picture) {
      const { camera, solids, ghosts, trace, floor: height, colours, limb } = picture;
      const { right, up, back, eye } = camera.axes();
      const view = camera.matrix();
      const detail = software && !picture.fine ? quick : fine;
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(0, 0, 0, 0);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);  // first: after a copy, all would be cleared
      if (kept) copyFloor(picture, view);
      else drawFloor(picture, view);
      gl.useProgram(solid.made);
      gl.uniformMatrix4fv(solid.uniforms.view, false, view);
      gl.uniform3f(solid.uniforms.eye, ...eye);
      gl.uniform3f(solid.uniforms.key, ...unit(plus(plus(back.map((x) => 0.75 * x), right, -0.5), up, 0.8)));
      fill(own, solids, colours.solid);
      if (picture.shadow && height !== null && eye[2] > height) {
        gl.enable(gl.STENCIL_TEST);
        gl.stencilFunc(gl.EQUAL, 0, 1);
        gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
        gl.uniform4f(solid.uniforms.shadow, ...SUN, 1);
        gl.uniform4f(solid.uniforms.shade, ...colours.shade);
        gl.uniform1f(solid.uniforms.height, height);
        put(detail === fine ? quick : coarse, own, solid);
        gl.disable(gl.STENCIL_TEST);
      }
      gl.uniform4f(solid.uniforms.shadow, 0, 0, 0, 0);
      gl.enable(gl.DEPTH_TEST);
      gl.enable(gl.CULL_FACE);
      put(detail, own, solid);
      gl.useProgram(ghost.made);
      gl.uniformMatrix4fv(ghost.uniforms.view, false, view);
      gl.uniform3f(ghost.uniforms.back, ...back);
      gl.uniform3f(ghost.uniforms.right, ...right);
      if (lately.trace !== trace || lately.of !== String(colours.trace)) {
        lately = { trace, of: String(colours.trace) };
        fill(way, threads(trace, 0.1 * limb), () => colours.trace);
      }
      put(picture.fine ? sparse : flat, way, ghost);
      if (picture.twin.length) {
        gl.depthMask(false);
        gl.enable(gl.POLYGON_OFFSET_FILL);  // behind what is solid, where they coincide
        gl.polygonOffset(2, 400);
        fill(second, picture.twin.filter(({ role }) => role !== "base"), () => colours.twin);
        put(picture.fine ? fine : quick, second, ghost);
        gl.disable(gl.POLYGON_OFFSET_FILL);
        gl.depthMask(true);
      }
      if (picture.clear.length) {
        gl.depthMask(false);
        fill(glass, picture.clear, colours.clear);
        put(picture.fine ? fine : quick, glass, ghost);
        gl.depthMask(true);
      }
      if (ghosts.length) {
        gl.depthMask(false);
        gl.enable(gl.POLYGON_OFFSET_FILL);  // behind what is solid, where they coincide
        gl.polygonOffset(2, 400);
        const many = ghosts.length > FEW;
        fillCrowd(picture, many ? THIN : 1);
        put(many ? (picture.fine ? sparse : flat) : picture.fine ? quick : coarse, crowd, ghost);
        gl.disable(gl.POLYGON_OFFSET_FILL);
        gl.depthMask(true);
      }
      gl.disable(gl.CULL_FACE);
    }

    return { software, draw, finish: () => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)), close: () => gl.getExtension("WEBGL_lose_context")?.loseContext() };
  }

  // A path as thin pills.
  const threads = (points, radius) => points.slice(1).map((p, n) => {
    const way = plus(p, points[n], -1);
    return { mesh: "pill", at: plus(points[n], way, 0.5), axes: along(way), size: [radius, radius, radius, length(way)] };
  });

  return { make };
})();
