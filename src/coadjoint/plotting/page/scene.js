"use strict";
// The scene in space, drawn by three.js (WebGL). Everything stands in the axes of the run under `world`, which turns them upright.

/** The player's view by WebGL, or null where the browser has none. */
function solid() {
  const T = THREE, sheet = document.getElementById("view");
  const tried = document.createElement("canvas");
  const gl = tried.getContext("webgl2");
  if (!gl) return null;
  const by = gl.getExtension("WEBGL_debug_renderer_info"), slow = by && /swiftshader|llvmpipe|software/i.test(gl.getParameter(by.UNMASKED_RENDERER_WEBGL));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  const renderer = new T.WebGLRenderer({ canvas: sheet, antialias: !slow && (window.devicePixelRatio || 1) < 2, powerPreference: "low-power" });
  const stage = new T.Scene(), eye = new T.PerspectiveCamera(45, 1, 0.1, 1000);
  const world = new T.Group(), tall = new T.Group(), target = new T.Vector3(), point = new T.Vector3(), place = [0, 0, 0], turned = [0, 0, 0, 1];
  // z down: north away from the reader, east to the right; z up: x to the right, y away.
  world.matrixAutoUpdate = false;
  if (given.down) world.matrix.makeBasis(new T.Vector3(0, 0, -1), new T.Vector3(1, 0, 0), new T.Vector3(0, -1, 0));
  else world.matrix.makeBasis(new T.Vector3(1, 0, 0), new T.Vector3(0, 0, -1), new T.Vector3(0, 1, 0));
  const sun = new T.DirectionalLight("#ffffff", 1.6); sun.position.set(0.4, 1, 0.6);
  stage.add(new T.HemisphereLight("#ffffff", "#6b7f8f", 1.7), sun, world); world.add(tall);

  const painted = [];  // [material, the CSS variable or the member's colour]
  function paint(material, colour) { painted.push([material, colour]); return material; }
  const lambert = (colour, more) => paint(new T.MeshLambertMaterial({ side: T.DoubleSide, ...more }), colour);
  const stroke = (colour, more) => paint(new T.LineMaterial({ linewidth: 2, ...more }), colour);
  function fat(list, material) {
    const shape = new T.LineGeometry(); shape.setPositions(list);
    const line = new T.Line2(shape, material); line.frustumCulled = false;
    if (material.dashed) line.computeLineDistances();
    return line;
  }
  function thin(list, colour) {
    const shape = new T.BufferGeometry().setAttribute("position", new T.Float32BufferAttribute(list, 3));
    const line = new T.LineSegments(shape, paint(new T.LineBasicMaterial(), colour)); line.frustumCulled = false;
    return line;
  }

  const pale = colour => () => new T.Color(standingOut(colour)).lerp(new T.Color(css("--ground")), 0.5);

  /** The numbers of the nodes without which a path would be off by more than `least`, m (Douglas and Peucker, 1973). */
  function corners(path, least) {
    const kept = new Set([0, path.length / 3 - 1]), open = [[0, path.length / 3 - 1]];
    while (open.length) {
      const [a, b] = open.pop(), chord = [0, 1, 2].map(k => path[3 * b + k] - path[3 * a + k]), long = Math.hypot(...chord) || 1e-12;
      let far = least, where = -1;
      for (let i = a + 1; i < b; i++) {
        const [x, y, z] = [0, 1, 2].map(k => path[3 * i + k] - path[3 * a + k]), along = clamp((x * chord[0] + y * chord[1] + z * chord[2]) / long ** 2, 0, 1);
        const off = Math.hypot(x - along * chord[0], y - along * chord[1], z - along * chord[2]);
        if (off > far) [far, where] = [off, i];
      }
      if (where > 0) { kept.add(where); open.push([a, where], [where, b]); }
    }
    return [...kept].sort((a, b) => a - b);
  }
  /** A path: pale as a whole, and as far as the body has come, to where it is now. */
  function trail(body, colour) {
    const nodes = corners(body.place, extent.size / 2000), points = nodes.flatMap(i => [...body.place.slice(3 * i, 3 * i + 3)]);
    const pairs = nodes.slice(1).flatMap((_, k) => points.slice(3 * k, 3 * k + 6));
    const whole = thin(pairs, pale(colour)), done = fat(points, stroke(colour, { linewidth: 3.5 })), data = done.geometry.attributes.instanceStart.data;
    whole.material.depthWrite = false; whole.renderOrder = -1; tall.add(whole, done);
    let now = 0;
    return member => {
      data.array.set(pairs.slice(6 * now + 3, 6 * now + 6), 6 * now + 3);
      for (now = 0; now < nodes.length - 2 && nodes[now + 1] <= member.index; now++);
      data.array.set(place, 6 * now + 3); data.needsUpdate = true;
      done.geometry.instanceCount = now + 1;
    };
  }

  // The surroundings: squares at the surface or the floor, the water's surface, the bottom, way points.
  const cell = spacing(Math.max(extent.wide, 1e-6)), floor = given.down ? (given.surface ? 0 : extent.high[2]) : extent.low[2];
  const ends = [0, 1].map(k => [Math.floor(extent.low[k] / cell - 0.5) * cell, Math.ceil(extent.high[k] / cell + 0.5) * cell]);
  const rim = [0, 1].map(e => [ends[0][e], ends[1][e]]);
  // Sides of squares one by one: long lines that begin behind the eye are left out by some renderers.
  function squares(low, high, side, z, colour) {
    const list = [], [m, n] = [0, 1].map(k => Math.round((high[k] - low[k]) / side));
    for (let i = 0; i <= m; i++) for (let j = 0; j <= n; j++) {
      const x = low[0] + i * side, y = low[1] + j * side;
      if (i < m) list.push(x, y, z, x + side, y, z);
      if (j < n) list.push(x, y, z, x, y + side, z);
    }
    return thin(list, colour);
  }
  function plane(z, colour, more) {
    const flat = new T.Mesh(new T.PlaneGeometry(ends[0][1] - ends[0][0], ends[1][1] - ends[1][0]), paint(new T.MeshBasicMaterial({ side: T.DoubleSide, ...more }), colour));
    flat.position.set((ends[0][0] + ends[0][1]) / 2, (ends[1][0] + ends[1][1]) / 2, z);
    return flat;
  }
  tall.add(squares(...rim, cell, floor, "--grid"));
  if (given.surface) tall.add(plane(0, "--water", { transparent: true, opacity: 0.22, depthWrite: false }));
  if (given.bottom !== null) tall.add(plane(given.bottom, "--bed", { polygonOffset: true, polygonOffsetFactor: 1 }), squares(...rim, cell, given.bottom, "--faint"));
  // Squares of a few lengths under the body that is followed, so that its motion is seen; they stay where they are in space.
  const least = Math.min(...members.map(m => Math.max(...m.bodies.map(b => b.size)))), near = spacing(12 * least), beneath = new T.Group();
  beneath.add(squares([-10 * near, -10 * near], [10 * near, 10 * near], near, 0, "--grid")); tall.add(beneath);
  const under = given.bottom !== null ? given.bottom : given.down ? extent.high[2] + least : extent.low[2] - least;
  const balls = [];
  if (given.wayPoints.length) {
    tall.add(fat(given.wayPoints.length > 1 ? given.wayPoints.flat() : [...given.wayPoints[0], ...given.wayPoints[0]], stroke("--faint", { dashed: true, dashSize: cell / 12, gapSize: cell / 12 })));
    given.wayPoints.forEach(p => { const ball = new T.Mesh(new T.SphereGeometry(1, 12, 8), lambert("--faint")); ball.position.set(...p); tall.add(ball); balls.push(ball); });
  }

  // Labels: texts at points of the scene; `at` puts the point, in space, into its argument, and returns it.
  const labels = [];
  function label(text, at, shown = () => true) {
    const tag = document.createElement("span");
    tag.textContent = text; document.getElementById("names").append(tag); labels.push({ tag, at, shown });
    return tag;
  }
  given.wayPoints.forEach((p, k) => label(String(k + 1), v => v.set(p[0], p[1], camera.tall * p[2]).applyMatrix4(world.matrix)));

  // Axes of space, at the pivot or the origin, and of the bodies; through a pivot the vertical.
  const framed = [];
  function triad(length, into, texts) {
    ["#D55E00", "#009E73", "#0072B2"].forEach((colour, k) => {
      const end = [0, 1, 2].map(i => i === k ? length : 0), line = thin([0, 0, 0, ...end], colour);
      into.add(line); framed.push(line);
      label(texts[k], v => into.localToWorld(v.set(...end)), () => camera.frames);
    });
  }
  const fixed = new T.Group(), reach = given.pivot ? 0.9 * members[0].bodies[0].size : 0.25 * extent.wide;
  triad(reach, fixed, given.down ? ["north", "east", "down"] : ["x", "y", "z"]); world.add(fixed);
  if (given.pivot) {
    const ball = new T.Mesh(new T.SphereGeometry(0.04 * reach, 16, 10), lambert("--ink"));
    const upright = fat([0, 0, -1.1 * reach, 0, 0, 1.1 * reach], stroke("--faint", { dashed: true, dashSize: reach / 14, gapSize: reach / 14 }));
    fixed.position.set(...given.pivot); fixed.add(ball, upright);
  }

  // Bodies.
  const geometry = {
    box: s => new T.BoxGeometry(...s.size),
    ellipsoid: s => new T.SphereGeometry(1, 32, 20).scale(...s.axes),
    rod(s) { const [a, b] = [new T.Vector3(...s.from), new T.Vector3(...s.to)]; const way = b.clone().sub(a);
      return new T.CylinderGeometry(s.radius, s.radius, way.length(), 20).applyQuaternion(new T.Quaternion().setFromUnitVectors(new T.Vector3(0, 1, 0), way.normalize())).translate(...a.add(b).multiplyScalar(0.5).toArray()); },
    // A body of revolution: half an ellipsoid ahead, a straight middle, a tail that narrows as a parabola.
    torpedo(s) {
      const outline = [], r = s.diameter / 2, L = s.length, nose = Math.min(0.14 * L, 1.4 * s.diameter), tail = Math.min(0.3 * L, 2.6 * s.diameter);
      for (let k = 0; k <= 10; k++) { const u = k / 10; outline.push(new T.Vector2(r * (1 - 0.85 * (1 - u) ** 2), -L / 2 + tail * u)); }
      for (let k = 0; k <= 10; k++) { const u = k / 10; outline.push(new T.Vector2(r * Math.sqrt(Math.max(1 - u * u, 0)), L / 2 - nose * (1 - u))); }
      outline.unshift(new T.Vector2(0, -L / 2));
      return new T.LatheGeometry(outline, 28).rotateZ(-Math.PI / 2);
    },
    mesh(s) {
      const shape = new T.BufferGeometry().setAttribute("position", new T.Float32BufferAttribute(s.vertices, 3));
      shape.setIndex(s.faces); shape.computeVertexNormals();
      return shape;
    },
    plate(s) { return new T.BoxGeometry(s.chord, s.span, Math.min(s.chord, s.span) / 8).translate(-s.chord / 4, 0, 0); },
    blades(s) {
      const list = [], r = s.diameter / 2, w = 0.16 * r;
      for (let k = 0; k < 3; k++) { const a = 2 * Math.PI * k / 3, [c, d] = [Math.cos(a), Math.sin(a)]; for (const [u, v, x] of [[0.1, -w, 0], [1, -2 * w, w], [1, 2 * w, -w], [0.1, -w, 0], [1, 2 * w, -w], [0.1, w, 0]]) list.push(x, r * u * c - v * d, r * u * d + v * c); }
      const shape = new T.BufferGeometry().setAttribute("position", new T.Float32BufferAttribute(list, 3)); shape.computeVertexNormals();
      return shape;
    },
    duct: s => new T.CylinderGeometry(s.diameter / 2, s.diameter / 2, s.diameter / 2, 16, 1, true).rotateZ(-Math.PI / 2),
    jet: s => new T.ConeGeometry(s.diameter / 3, 1, 10).translate(0, -0.5, 0).rotateZ(-Math.PI / 2),
  };
  /** A turn that brings x along `axis` and, where it is given, y along `span`. */
  function facing(axis, span) {
    const x = new T.Vector3(...axis).normalize(), y = new T.Vector3(...(span || (Math.abs(axis[2]) < 0.9 ? [0, 0, 1] : [0, 1, 0])));
    y.addScaledVector(x, -x.dot(y)).normalize();
    return new T.Quaternion().setFromRotationMatrix(new T.Matrix4().makeBasis(x, y, x.clone().cross(y)));
  }
  function solidShape(shape, look) {
    const mesh = new T.Mesh(geometry[shape.kind](shape), look);
    if (shape.at) mesh.position.set(...shape.at);
    if (shape.axis) mesh.quaternion.copy(facing(shape.axis, shape.span_axis));
    return mesh;
  }
  const drawn = members.map(member => {
    const colour = member.colour, look = lambert(colour, { flatShading: false }), dim = lambert("--faint"), through = lambert("--ink", { depthTest: false, transparent: true, opacity: 0.8 });
    const pole = thin([0, 0, 0, 0, 0, 0], "--faint"), arrow = member.current && new T.ArrowHelper(new T.Vector3(1, 0, 0), new T.Vector3(), 1);
    if (arrow) { world.add(arrow); paint(arrow.line.material, "--water"); paint(arrow.cone.material, "--water"); }
    if (given.surface) tall.add(pole);
    const bodies = member.bodies.map(body => {
      const group = new T.Group(), path = body.track ? trail(body, colour) : null;
      body.shapes.forEach(s => group.add(solidShape(s, s.dim ? dim : look)));
      const moving = body.moving.map(m => {
        const held = new T.Group(), inner = solidShape(m.shape, m.motion === "slide" ? through : m.motion === "push" ? paint(new T.MeshBasicMaterial({ transparent: true, opacity: 0.75 }), "--water") : dim);
        held.position.set(...m.at); held.quaternion.copy(facing(m.axis, m.span_axis)); held.add(inner); group.add(held);
        return { ...m, inner };
      });
      triad(0.7 * body.size, group, ["body x", "body y", "body z"]); world.add(group);
      return { body, group, path, moving };
    });
    if (members.length > 1) label(member.label, v => bodies[0].group.getWorldPosition(v));
    const told = arrow && label("current", v => v.copy(arrow.position).applyMatrix4(world.matrix), () => arrow.visible);
    return { member, bodies, pole, arrow, told };
  });
  const move = {  // what a moving part does with its value: rad, m, or a share of its largest
    hinge: (m, x) => m.inner.rotation.y = x,
    spin: (m, x) => m.inner.rotation.x = x,
    slide: (m, x) => m.inner.position.x = x,
    push(m, x) { m.inner.visible = Math.abs(x) > 0.01; m.inner.scale.set(x * m.reach, 1, 1); },
  };

  // Hulls that would be dots are drawn larger; `enlarged` says how much.
  let enlarged = 1;
  /** From how far all tracks and bodies are in the picture, of whose width the share `free` is theirs. */
  function distance(stretch, free) {
    const [a, b] = [camera.yaw, camera.pitch], [c, d] = [Math.cos(b), Math.sin(b)];
    const right = new T.Vector3(Math.cos(a), 0, -Math.sin(a)), back = new T.Vector3(c * Math.sin(a), d, c * Math.cos(a)), up = back.clone().cross(right);
    const half = 0.84 * Math.tan(Math.PI / 8), wide = half * eye.aspect * free;
    const sides = [0, 1, 2].map(k => ((extent.high[k] - extent.low[k]) / 2 + 0.2 * least) * (k === 2 ? stretch : 1));
    let away = 1e-6;
    for (let k = 0; k < 8; k++) {
      point.set(...sides.map((x, i) => k >> i & 1 ? x : -x)).applyMatrix4(world.matrix);
      away = Math.max(away, point.dot(back) + Math.max(Math.abs(point.dot(right)) / wide, Math.abs(point.dot(up)) / half));
    }
    return away;
  }
  function aim() {
    const followed = drawn[camera.follow], stretch = camera.tall;
    if (followed) placeOf(followed.member, followed.bodies[0].body, place); else extent.middle.forEach((x, k) => place[k] = x);
    target.set(place[0], place[1], place[2] * stretch).applyMatrix4(world.matrix);
    // The readings stand on the left: where there is room, the middle of the scene is to their right.
    const [w, h] = [sheet.clientWidth, sheet.clientHeight], taken = w > 700 ? document.getElementById("read").offsetWidth / 2 : 0;
    const whole = followed ? 3.4 * followed.bodies[0].body.size / Math.min(1, 0.75 * eye.aspect) : distance(stretch, 1 - 2 * taken / w);
    const away = whole / camera.zoom, flat = Math.cos(camera.pitch) * away;
    eye.position.set(target.x + flat * Math.sin(camera.yaw), target.y + away * Math.sin(camera.pitch), target.z + flat * Math.cos(camera.yaw));
    eye.lookAt(target);
    eye.setViewOffset(w, h, -taken, 0, w, h);
    eye.near = away / 200; eye.far = away * 4 + 6 * stretch * extent.size; eye.updateProjectionMatrix();
    enlarged = given.enlarge ? Math.max(1, 0.08 * away / least) : 1;
    balls.forEach(ball => { const r = Math.max(0.08 * least, away / 150); ball.scale.set(r, r, r / stretch); });
    tall.scale.set(1, 1, stretch);
    beneath.visible = Boolean(followed) && near < cell;
    beneath.position.set(Math.round(place[0] / near) * near, Math.round(place[1] / near) * near, under);
  }
  function draw() {
    aim();
    framed.forEach(line => line.visible = camera.frames);
    drawn.forEach(one => {
      one.bodies.forEach(({ body, group, path, moving }) => {
        placeOf(one.member, body, place); turnOf(one.member, body, turned);
        group.position.set(place[0], place[1], camera.tall * place[2]);
        group.quaternion.set(...turned); group.scale.setScalar(enlarged);
        if (path) path(one.member);
        moving.forEach(m => move[m.motion](m, between(m.values, one.member)));
      });
      placeOf(one.member, one.bodies[0].body, place);
      one.pole.geometry.attributes.position.array.set([...place, place[0], place[1], 0]); one.pole.geometry.attributes.position.needsUpdate = true;
      if (one.arrow) flow(one);
    });
    renderer.render(stage, eye);
    names();
  }
  function flow({ member, arrow, told }) {
    const size = enlarged * member.bodies[0].size, v = [0, 1, 2].map(k => between(member.current[k], member)), speed = Math.hypot(...v);
    arrow.visible = speed > 1e-4; told.textContent = `current ${speed.toFixed(2)} m/s`;
    if (!arrow.visible) return;
    arrow.position.set(place[0], place[1], camera.tall * place[2] - (given.down ? 0.6 : -0.6) * size);
    arrow.setDirection(point.set(...v).divideScalar(speed));
    arrow.setLength(size * clamp(4 * speed, 0.3, 4), 0.25 * size, 0.12 * size);
  }
  function names() {
    labels.forEach(({ tag, at, shown }) => {
      at(point).project(eye);
      tag.hidden = !shown() || point.z > 1 || Math.abs(point.x) > 1 || Math.abs(point.y) > 1;
      tag.style.transform = `translate(${(point.x + 1) / 2 * sheet.clientWidth + 10}px, ${(1 - point.y) / 2 * sheet.clientHeight - 24}px)`;
    });
  }
  function recolour() {
    stage.background = new T.Color(css("--ground"));
    painted.forEach(([material, colour]) => material.color.set(typeof colour === "function" ? colour() : colour.startsWith("--") ? css(colour) : standingOut(colour)));
  }
  recolour();
  return {
    draw, recolour, flat: false, renderer, eye, drawn,
    resize() {
      const [w, h] = [Math.max(sheet.clientWidth, 1), Math.max(sheet.clientHeight, 1)];
      renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2)); renderer.setSize(w, h, false);
      eye.aspect = w / h;
    },
    note: () => `a square is ${+(beneath.visible ? near : cell).toPrecision(6)} m` + (enlarged > 1.05 ? `; bodies drawn ${enlarged.toPrecision(2)} times as large` : "") + (camera.tall > 1 ? `; vertical × ${camera.tall}` : ""),
  };
}
