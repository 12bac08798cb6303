// A policy at work in 3-D: the server says where everything is, WebGL draws it.
"use strict";

{
const VERTEX = `#version 300 es
in vec3 place; in vec3 normal;
uniform mat4 view; uniform mat3 turn; uniform vec3 at, sun; uniform float flat_, ground;
out vec3 world, facing, own;
void main() {
  own = normal; facing = turn * normal; world = turn * place + at;
  if (flat_ > .5) { world -= sun * ((world.z - ground) / sun.z); world.z = ground; }
  gl_Position = view * vec4(world, 1.);
  if (flat_ > .5) gl_Position.z -= 1e-4 * gl_Position.w;
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 world, facing, own;
uniform vec4 colour; uniform vec3 sun, eye, stone, tile, seam, haze; uniform float kind, side, far;
out vec4 pixel;
void main() {
  if (kind > 2.5) { pixel = vec4(.09, .1, .13, .55); return; }
  vec3 base = colour.rgb;
  if (kind > 1.5) base = mix(base, .5 + .5 * own, .6);
  vec3 n = normalize(facing), v = normalize(eye - world);
  if (dot(n, v) < 0.) n = -n;
  float lit = max(0., dot(n, -sun));
  if (kind > .5 && kind < 1.5) {
    vec2 where = world.xy / side, width = fwidth(where), edge = abs(fract(where - .5) - .5) / width;
    vec2 cell = floor(where);
    base = mix(stone, tile, mod(cell.x + cell.y, 2.));
    base = mix(base, seam, (1. - min(1., min(edge.x, edge.y))) * (1. - min(1., max(width.x, width.y) * 2.)));
  }
  vec3 shade = base * (.42 + .18 * max(0., dot(n, v)) + .62 * lit);
  if (kind < .5) shade += .18 * pow(max(0., dot(reflect(sun, n), v)), 24.);
  float off = kind > .5 && kind < 1.5 ? smoothstep(.15, 1., length(world - eye) / far) : 0.;
  pixel = vec4(mix(shade, haze, off), colour.a);
}`;

/** A surface of revolution about z from [radius, height, normal outwards, normal up]. */
function revolve(profile, around = 28) {
  const places = [], normals = [], faces = [];
  for (const [radius, z, out, up] of profile) {
    for (let i = 0; i <= around; i++) {
      const angle = (2 * Math.PI * i) / around, x = Math.cos(angle), y = Math.sin(angle);
      places.push(radius * x, radius * y, z);
      normals.push(out * x, out * y, up);
    }
  }
  for (let row = 0; row + 1 < profile.length; row++) {
    for (let i = 0; i < around; i++) {
      const a = row * (around + 1) + i, b = a + around + 1;
      faces.push(a, a + 1, b, a + 1, b + 1, b);
    }
  }
  return { places, normals, faces };
}

const arc = (from, to, radius, shift) => Array.from({ length: 9 }, (_, i) => {
  const angle = from + ((to - from) * i) / 8, out = Math.cos(angle), up = Math.sin(angle);
  return [radius * out, shift + radius * up, out, up];
});

function box([x, y, z]) {
  const places = [], normals = [], faces = [];
  for (const axis of [0, 1, 2]) for (const sign of [-1, 1]) {
    const start = places.length / 3;
    for (const [u, v] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
      const unit = [0, 0, 0], normal = [0, 0, 0];
      unit[axis] = normal[axis] = sign;
      unit[(axis + 1) % 3] = u;
      unit[(axis + 2) % 3] = v;
      places.push(unit[0] * x, unit[1] * y, unit[2] * z);
      normals.push(...normal);
    }
    faces.push(start, start + 1, start + 2, start, start + 2, start + 3);
  }
  return { places, normals, faces };
}

/** Normals of a mesh, of the faces around each corner. */
function smooth(places, faces) {
  const normals = new Float32Array(places.length);
  for (let i = 0; i < faces.length; i += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => 3 * faces[i + k]);
    const edge = (from, to) => [0, 1, 2].map((k) => places[to + k] - places[from + k]);
    const [u, v] = [edge(a, b), edge(a, c)];
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    for (const corner of [a, b, c]) for (const k of [0, 1, 2]) normals[corner + k] += n[k];
  }
  return { places, normals, faces };
}

function shape({ type, size: [a, b, c], mesh }, meshes, reach) {
  const quarter = Math.PI / 2;
  if (type === "plane") return box([reach, reach, 0]);
  if (type === "box") return box([a, b, c]);
  if (type === "capsule") return revolve([...arc(-quarter, 0, a, -b), ...arc(0, quarter, a, b)]);
  if (type === "cylinder") return revolve([[0, -b, 0, -1], [a, -b, 0, -1], [a, -b, 1, 0], [a, b, 1, 0], [a, b, 0, 1], [0, b, 0, 1]]);
  if (type === "mesh") return meshes[mesh];
  const ball = revolve([...arc(-quarter, 0, 1, 0), ...arc(0, quarter, 1, 0)]);
  const size = type === "ellipsoid" ? [a, b, c] : [a, a, a];
  return {
    places: ball.places.map((value, i) => value * size[i % 3]), normals: ball.normals.map((value, i) => value / size[i % 3]),
    faces: ball.faces,
  };
}

const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;

/** Draws what it is given on a canvas, seen from where a person turns it. */
class Scene {
  constructor(canvas, scene) {
    const gl = canvas.getContext("webgl2", { antialias: true, stencil: true });
    if (!gl) throw new Error("This browser has no WebGL.");
    Object.assign(this, { canvas, gl, scene, turned: 0, raised: 0, nearer: 1, poses: null });
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(`WebGL: ${gl.getProgramInfoLog(program)}`);
    gl.useProgram(program);
    this.at = (name) => gl.getUniformLocation(program, name);
    this.far = 40 * scene.radius;
    const meshes = Array.from({ length: scene.meshes }, (_, i) =>
      smooth(new Float32Array(bytes(scene[`vertices ${i}`])), new Uint32Array(bytes(scene[`faces ${i}`]))));
    this.shapes = scene.geoms.map((geom) => this.upload(shape(geom, meshes, 2 * this.far), program));
    const { ground, tile, seam, haze, side } = scene.floor;
    for (const [name, value] of [["stone", ground], ["tile", tile], ["seam", seam], ["haze", haze], ["sun", scene.sun]])
      gl.uniform3fv(this.at(name), value);
    gl.uniform1f(this.at("side"), side);
    gl.uniform1f(this.at("far"), this.far);
    gl.clearColor(...haze, 1);
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  upload({ places, normals, faces }, program) {
    const { gl } = this, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    for (const [name, values] of [["place", places], ["normal", normals]]) {
      const where = gl.getAttribLocation(program, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
      gl.enableVertexAttribArray(where);
      gl.vertexAttribPointer(where, 3, gl.FLOAT, false, 0, 0);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(faces), gl.STATIC_DRAW);
    return { array, count: faces.length };
  }

  /** Where the eye is, and the matrix that leads from the world to the picture. */
  look(aspect) {
    const [x, y, z, distance] = this.poses, { azimuth, elevation, fovy } = this.scene.eye;
    const a = (azimuth * Math.PI) / 180 + this.turned;
    const e = Math.max(-1.5, Math.min(-.02, (elevation * Math.PI) / 180 + this.raised));
    const f = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)], r = [Math.sin(a), -Math.cos(a), 0];
    const u = [r[1] * f[2] - r[2] * f[1], r[2] * f[0] - r[0] * f[2], r[0] * f[1] - r[1] * f[0]];
    const d = distance * this.nearer, eye = [x - d * f[0], y - d * f[1], z - d * f[2]];
    const h = 1 / Math.tan((fovy * Math.PI) / 360), w = h / aspect, near = .05 * d, far = 2 * this.far;
    const p = (far + near) / (near - far), q = (2 * far * near) / (near - far);
    const dot = (v) => v[0] * eye[0] + v[1] * eye[1] + v[2] * eye[2];
    const rows = [[...r.map((v) => w * v), -w * dot(r)], [...u.map((v) => h * v), -h * dot(u)], [...f.map((v) => -p * v), p * dot(f) + q], [...f, -dot(f)]];
    return { eye, view: [0, 1, 2, 3].flatMap((k) => rows.map((row) => row[k])) };
  }

  draw() {
    const { gl, canvas, scene, poses } = this;
    if (!poses || !this.changed) return;
    this.changed = false;
    const scale = Math.min(2, devicePixelRatio), width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    const { eye, view } = this.look(width / height);
    gl.uniformMatrix4fv(this.at("view"), false, view);
    gl.uniform3fv(this.at("eye"), eye);
    const floor = scene.geoms.findIndex(({ type }) => type === "plane");
    gl.uniform1f(this.at("ground"), floor < 0 ? 0 : poses[12 * (floor + 1) + 2]);
    const put = (index, kind) => {
      const pose = poses.subarray(12 * (index + 1), 12 * (index + 2)), m = pose.subarray(3);
      gl.uniform3fv(this.at("at"), pose.subarray(0, 3));
      gl.uniformMatrix3fv(this.at("turn"), false, [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]]);
      gl.uniform4fv(this.at("colour"), scene.geoms[index].colour);
      gl.uniform1f(this.at("kind"), kind);
      gl.bindVertexArray(this.shapes[index].array);
      gl.drawElements(gl.TRIANGLES, this.shapes[index].count, gl.UNSIGNED_INT, 0);
    };
    const every = [...scene.geoms.keys()], seen = (i) => scene.geoms[i].colour[3] >= 1, solid = (i) => scene.geoms[i].type !== "plane";
    gl.disable(gl.BLEND);
    gl.uniform1f(this.at("flat_"), 0);
    for (const i of every.filter(seen)) put(i, solid(i) ? (scene.geoms[i].lettered && scene.geoms[i].type === "box" ? 2 : 0) : 1);
    gl.enable(gl.BLEND);
    gl.enable(gl.STENCIL_TEST);  // where two shadows meet it is no darker
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    gl.uniform1f(this.at("flat_"), 1);
    if (floor >= 0) for (const i of every.filter((i) => seen(i) && solid(i))) put(i, 3);
    gl.disable(gl.STENCIL_TEST);
    gl.uniform1f(this.at("flat_"), 0);
    for (const i of every.filter((i) => !seen(i))) put(i, 0);
  }
}

function turnable(scene) {
  const { canvas } = scene;
  const turn = (x, y) => { scene.turned -= x; scene.raised -= y; scene.changed = true; };
  const move = (by) => { scene.nearer = Math.max(.3, Math.min(4, scene.nearer * by)); scene.changed = true; };
  canvas.onpointerdown = ({ pointerId }) => canvas.setPointerCapture(pointerId);
  canvas.onpointermove = ({ buttons, movementX, movementY }) => { if (buttons) turn(movementX / 200, movementY / 200); };
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return;  // the page is scrolled, unless the picture was clicked
    event.preventDefault();
    move(Math.exp(event.deltaY / 800));
  }, { passive: false });
  canvas.onkeydown = (event) => {
    const keys = { ArrowLeft: () => turn(-.1, 0), ArrowRight: () => turn(.1, 0), ArrowUp: () => turn(0, -.1), ArrowDown: () => turn(0, .1), "+": () => move(.9), "-": () => move(1.1) };
    if (keys[event.key]) { event.preventDefault(); keys[event.key](); }
  };
}

function play(panel) {
  const address = panel.dataset.play, start = panel.querySelector("[data-do=start]"), said = panel.querySelector("[role=status]");
  const stage = panel.querySelector(".scene"), value = (name) => panel.querySelector(`[name=${name}]`).value;
  let source = null;

  const end = (why) => {
    source?.close();
    source = null;
    stage.hidden = true;
    start.textContent = "Start";
    said.textContent = why;
  };
  const tell = (words) => source && fetch(address, { method: "POST", body: new URLSearchParams(words) });
  const scale = () => tell({ do: "scale", mass: value("mass"), friction: value("friction") });

  const begin = () => {
    start.textContent = "Stop";
    said.textContent = "Building its world.";
    // A canvas keeps the context it had: each start gets a new one.
    const old = panel.querySelector("canvas"), canvas = old.cloneNode();
    old.replaceWith(canvas);
    let scene = null;
    source = new EventSource(address);
    source.addEventListener("scene", ({ data }) => {
      try {
        stage.hidden = false;
        scene = new Scene(canvas, JSON.parse(data));
      } catch (error) {
        end(error.message);
        return;
      }
      turnable(scene);
      scale();
      said.textContent = "Drag to turn the view.";
    });
    source.addEventListener("frame", ({ data }) => {
      if (!source) return;
      // A browser that draws slowly leaves pictures out; it does not fall behind.
      if (!scene.poses) requestAnimationFrame(function again() { if (source) { scene.draw(); requestAnimationFrame(again); } });
      Object.assign(scene, { poses: new Float32Array(bytes(JSON.parse(data))), changed: true });
      panel.dataset.frames = Number(panel.dataset.frames ?? 0) + 1;
    });
    source.addEventListener("end", ({ data }) => end(JSON.parse(data)));
    source.onerror = () => end(scene ? "The policy has stopped." : "It could not start: its policy or the server is gone.");
  };

  panel.addEventListener("click", ({ target }) => {
    const wish = target.dataset.do;
    if (wish === "start") { if (source) end("Watch its policy in 3-D, push it, change its world."); else begin(); }
    if (wish === "push") tell({ do: "push", speed: value("speed"), angle: target.dataset.angle });
    if (wish === "restart") tell({ do: "restart" });
  });
  panel.addEventListener("input", ({ target }) => { target.parentElement.querySelector("b").textContent = target.value; });
  panel.addEventListener("change", ({ target }) => { if (target.name !== "speed") scale(); });
  document.addEventListener("visibilitychange", () => { if (document.hidden && source) end("Stopped while this tab was hidden."); });
  addEventListener("pagehide", () => source?.close());
}

eureka.play = play;
document.querySelectorAll("[data-play]").forEach(play);
}
