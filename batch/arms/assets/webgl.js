// Draws a picture of an arm by WebGL 2: meshes of unit size, stretched and turned instance by instance; a floor with a grid
// and shadows on it. `make` gives null where there is no WebGL.
//   picture  {camera, solids, ghosts: [solids], trace: [points], floor (its height, or null), step (of the grid, m), colours,
//            fine: it stands, and may take longer; shadow: whether the arm casts one}
"use strict";

MET.webgl = (() => {
  const { plus, unit, along, length } = MET.arm;
  const NUMBERS = 20;  // of an instance
  const [FEW, THIN] = [16, 0.4];  // ghosts; of more, limbs are thinner by this and have few faces
  const SUN = unit([-0.28, -0.18, 1]);  // where shadows come from

  const SOLID = [`#version 300 es
    layout(location=0) in vec4 shape; layout(location=1) in vec3 bent;
    layout(location=2) in vec3 at; layout(location=3) in vec3 x; layout(location=4) in vec3 y; layout(location=5) in vec3 z;
    layout(location=6) in vec4 size; layout(location=7) in vec4 tint;
    uniform mat4 view; uniform vec4 shadow; uniform float height;
    out vec3 normal; out vec3 place; out vec4 colour;
    void main() {
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
      vec3 n = normalize(normal), v = normalize(eye - place);
      float lit = 0.5 + 0.5 * dot(n, key), sky = 0.5 + 0.5 * n.z;
      vec3 c = colour.rgb * (0.42 + 0.66 * lit * lit) * mix(0.84, 1.04, sky);
      c += 0.2 * pow(max(dot(n, normalize(key + v)), 0.0), 36.0);
      c += 0.1 * pow(1.0 - max(dot(n, v), 0.0), 3.0);
      done = vec4(min(c, 1.0) * colour.a, colour.a);
    }`];

  // Ghosts and paths, of which there are many: one varying, little light. What has no normals is a ribbon that faces the
  // eye: shape is its place across and along, and which end it is of.
  const GHOST = [`#version 300 es
    layout(location=0) in vec4 shape; layout(location=1) in vec3 bent;
    layout(location=2) in vec3 at; layout(location=3) in vec3 x; layout(location=4) in vec3 y; layout(location=5) in vec3 z;
    layout(location=6) in vec4 size; layout(location=7) in vec4 tint;
    uniform mat4 view; uniform vec3 back; uniform vec3 right;
    out vec4 colour;
    void main() {
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
    const instances = gl.createBuffer();
    let lately = {};  // the path that was drawn last

    function mesh({ vertices, faces }) {
      const array = gl.createVertexArray();
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, Float32Array.from(vertices), gl.STATIC_DRAW);
      [[0, 4, 0], [1, 3, 16]].forEach(([place, count, at]) => {
        gl.enableVertexAttribArray(place);
        gl.vertexAttribPointer(place, count, gl.FLOAT, false, 28, at);
      });
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, Uint16Array.from(faces), gl.STATIC_DRAW);
      return { array, count: faces.length };
    }
    const fine = { pill: mesh(pill(28, 8)), can: mesh(can(36)), block: mesh(block()) };
    const quick = { pill: mesh(pill(14, 3)), can: mesh(can(18)), block: fine.block };  // while a processor draws it moving
    const coarse = { pill: mesh(pill(10, 2)), can: mesh(can(10)), block: fine.block };
    const sparse = { ...coarse, pill: mesh(ribbon(2)) };
    const kept = software ? { frame: gl.createFramebuffer(), dots: gl.createRenderbuffer(), of: "" } : null;

    // Instances by mesh, their numbers one after another.
    function packed(groups) {
      const out = {};
      for (const { solids, colour } of groups)
        for (const each of solids) (out[each.mesh] ||= []).push(...each.at, ...each.axes[0], ...each.axes[1], ...each.axes[2], ...each.size, ...colour(each));
      return Object.entries(out).map(([name, numbers]) => [name, Float32Array.from(numbers)]);
    }

    function put(meshes, packs) {
      packs.forEach(([name, numbers]) => {
        gl.bindVertexArray(meshes[name].array);
        gl.bindBuffer(gl.ARRAY_BUFFER, instances);
        gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STREAM_DRAW);
        [3, 3, 3, 3, 4, 4].reduce((at, count, n) => {
          gl.enableVertexAttribArray(2 + n);
          gl.vertexAttribPointer(2 + n, count, gl.FLOAT, false, 4 * NUMBERS, at);
          gl.vertexAttribDivisor(2 + n, 1);
          return at + 4 * count;
        }, 0);
        gl.drawElementsInstanced(gl.TRIANGLES, meshes[name].count, gl.UNSIGNED_SHORT, 0, numbers.length / NUMBERS);
      });
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
      gl.bindVertexArray(fine.block.array);
      gl.drawElements(gl.TRIANGLES, 6, gl.UNSIGNED_SHORT, 2 * 30);  // its upper side
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
      const own = packed([{ solids, colour: colours.solid }]);
      if (picture.shadow && height !== null && eye[2] > height) {
        gl.enable(gl.STENCIL_TEST);
        gl.stencilFunc(gl.EQUAL, 0, 1);
        gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
        gl.uniform4f(solid.uniforms.shadow, ...SUN, 1);
        gl.uniform4f(solid.uniforms.shade, ...colours.shade);
        gl.uniform1f(solid.uniforms.height, height);
        put(detail === fine ? quick : coarse, own);
        gl.disable(gl.STENCIL_TEST);
      }
      gl.uniform4f(solid.uniforms.shadow, 0, 0, 0, 0);
      gl.enable(gl.DEPTH_TEST);
      gl.enable(gl.CULL_FACE);
      put(detail, own);
      gl.useProgram(ghost.made);
      gl.uniformMatrix4fv(ghost.uniforms.view, false, view);
      gl.uniform3f(ghost.uniforms.back, ...back);
      gl.uniform3f(ghost.uniforms.right, ...right);
      if (lately.trace !== trace || lately.of !== String(colours.trace))
        lately = { trace, of: String(colours.trace), packs: packed([{ solids: threads(trace, 0.1 * limb), colour: () => colours.trace }]) };
      put(sparse, lately.packs);
      if (ghosts.length) {
        gl.depthMask(false);
        gl.enable(gl.POLYGON_OFFSET_FILL);  // behind what is solid, where they coincide
        gl.polygonOffset(2, 400);
        const many = ghosts.length > FEW;
        put(many ? sparse : picture.fine ? quick : coarse, packed(ghosts.map((each, n) => ({ solids: (many ? thin : plain)(each), colour: () => colours.ghost(n) }))));
        gl.disable(gl.POLYGON_OFFSET_FILL);
        gl.depthMask(true);
      }
      gl.disable(gl.CULL_FACE);
    }

    return { software, draw, finish: () => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)) };
  }

  // What is shown of a ghost: no joints; of many, what is long is thinner.
  const plain = (solids) => solids.filter(({ role, mesh }) => role !== "base" && (role !== "joint" || mesh === "pill"));
  const thin = (solids) => plain(solids).map((each) => (each.mesh === "pill" ? { ...each, size: each.size.map((x, n) => (n < 3 ? THIN * x : x)) } : each));

  // A path as thin pills.
  const threads = (points, radius) => points.slice(1).map((p, n) => {
    const way = plus(p, points[n], -1);
    return { mesh: "pill", at: plus(points[n], way, 0.5), axes: along(way), size: [radius, radius, radius, length(way)] };
  });

  return { make };
})();
