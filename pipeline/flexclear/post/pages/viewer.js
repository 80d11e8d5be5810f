"use strict";
// A small viewer of moving and vibrating bodies: no library, no request. One `Viewer` for each element `.viewer`.
(() => {
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const floats = (text) => new Float32Array(bytes(text).buffer);
  const wholes = (text) => new Uint32Array(bytes(text).buffer);
  // numbers stored as 16 bits between -1 and 1, times the largest number
  const scaled = ({ data, largest }) => Float32Array.from(new Int16Array(bytes(data).buffer), (v) => (v / 32767) * largest);

  const VERTEX = `
    attribute vec3 position, normal, tint; uniform mat4 model, view; uniform mat4 lens; varying vec3 n, c, p;
    void main() { vec4 at = view * model * vec4(position, 1.0); p = at.xyz; n = mat3(view) * mat3(model) * normal; c = tint;
      gl_Position = lens * at; }`;
  const FRAGMENT = `
    precision mediump float; varying vec3 n, c, p; uniform float opacity;
    void main() { vec3 m = normalize(n); if (dot(m, p) > 0.0) m = -m;
      float light = 0.42 + 0.5 * max(dot(m, normalize(vec3(-0.35, 0.65, 0.68))), 0.0)
        + 0.18 * max(dot(m, normalize(vec3(0.8, -0.1, 0.4))), 0.0);
      gl_FragColor = vec4(c * min(light, 1.08), opacity); }`;
  // viridis at nine values, from dark to bright
  const SCALE = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99],
    [170, 220, 50], [253, 231, 37]].map((c) => c.map((v) => v / 255));
  const colour = (fraction) => {
    const at = Math.min(Math.max(fraction, 0), 1) * (SCALE.length - 1), k = Math.min(Math.floor(at), SCALE.length - 2);
    return [0, 1, 2].map((i) => SCALE[k][i] + (at - k) * (SCALE[k + 1][i] - SCALE[k][i]));
  };
  const hex = (text) => [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16) / 255);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const minus = (a, b) => a.map((v, k) => v - b[k]);
  const unit = (a) => { const size = Math.hypot(...a) || 1; return a.map((v) => v / size); };
  const turned = (v, axis, angle) => { // Rodrigues
    const s = Math.sin(angle), c = Math.cos(angle), w = cross(axis, v), d = dot(axis, v) * (1 - c);
    return v.map((x, k) => x * c + w[k] * s + axis[k] * d);
  };
  const placed = (t, k) => { // a track's row: position, quaternion w x y z, stretch along z -> matrix by columns
    const [x, y, z, w, a, b, c, s] = t.subarray(8 * k, 8 * k + 8);
    return [1 - 2 * (b * b + c * c), 2 * (a * b + w * c), 2 * (a * c - w * b), 0,
      2 * (a * b - w * c), 1 - 2 * (a * a + c * c), 2 * (b * c + w * a), 0,
      s * 2 * (a * c + w * b), s * 2 * (b * c - w * a), s * (1 - 2 * (a * a + b * b)), 0, x, y, z, 1];
  };
  const UNMOVED = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  const shown = (value) => Number(value.toPrecision(3)).toString();

  class Viewer {
    constructor(root, before) {
      this.root = root;
      this.data = JSON.parse(root.querySelector("script").textContent);
      this.canvas = root.querySelector("canvas");
      this.gl = this.canvas.getContext("webgl", { antialias: true, alpha: true, preserveDrawingBuffer: true });
      if (!this.gl) {
        root.querySelector(".viewer-state").textContent = "This browser draws no WebGL: the view cannot be turned.";
        return;
      }
      this.part = (name) => root.querySelector(`[data-part=${name}]`);
      this.frame = 0; this.phase = 0; this.playing = false; this.shape = 0; this.factor = 1;
      this.ruler = root.querySelector(".viewer-ruler"); this.names = root.querySelector(".viewer-names");
      this.labels = (this.data.labels || []).map((label) => {
        const text = document.createElement("span"), detail = document.createElement("small");
        text.textContent = label.text; detail.textContent = ` ${label.detail}`; text.style.color = label.color;
        text.append(detail); this.names.append(text);
        return { ...label, text };
      });
      this.home();
      if (before) this.resume(before);
      this.build();
      this.listen();
      this.choose(0);
      new ResizeObserver(() => this.draw()).observe(this.canvas);
      root.viewer = this;
      const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
      if (!still && root.dataset.play === "yes") this.play(true);
    }
    home() {
      this.eye = this.data.eye.slice(); this.focus = this.data.focus.slice(); this.up = unit(this.data.up);
      this.reach = this.data.reach; this.moved = false;
    }
    // new content in the place of an earlier viewer: a camera that was moved stays, and what was chosen
    resume(before) {
      if (before.moved) for (const name of ["eye", "focus", "up", "reach", "moved"]) this[name] = before[name];
      for (const name of ["names", "time", "factor"]) {
        const [old, part] = [before.part(name), this.part(name)];
        if (old && part) { part.checked = old.checked; part.value = old.value; }
      }
      if (this.part("time")) this.frame = this.progress = Number(this.part("time").value);
      if (this.part("factor")) this.factor = before.factor;
      if (before.playing) this.root.dataset.play = "yes";
      before.playing = false;
      const lost = before.gl.getExtension("WEBGL_lose_context"); // browsers keep few contexts
      if (lost) lost.loseContext();
    }
    build() {
      const gl = this.gl, program = gl.createProgram();
      for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, text); gl.compileShader(shader); gl.attachShader(program, shader);
      }
      gl.linkProgram(program); gl.useProgram(program); gl.getExtension("OES_element_index_uint");
      gl.enable(gl.DEPTH_TEST); gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      this.at = Object.fromEntries(["position", "normal", "tint"].map((n) => [n, gl.getAttribLocation(program, n)]));
      this.in = Object.fromEntries(["model", "view", "lens", "opacity"].map((n) => [n, gl.getUniformLocation(program, n)]));
      Object.values(this.at).forEach((k) => gl.enableVertexAttribArray(k));
      this.tracks = (this.data.tracks || []).map(floats);
      this.meshes = this.data.meshes.map((data) => this.mesh(data));
      this.meshes.sort((a, b) => b.opacity - a.opacity); // translucent meshes are drawn last
    }
    mesh(data) {
      const gl = this.gl, points = floats(data.points), index = wholes(data.triangles), tint = new Float32Array(points.length);
      const base = hex(data.color);
      for (let k = 0; k < tint.length; k++) tint[k] = base[k % 3];
      const mesh = { ...data, base, points, index, tint, now: points.slice(), normal: data.normals ? floats(data.normals) : new Float32Array(points.length) };
      mesh.fields = (data.fields || []).map(scaled);
      mesh.weights = data.weights ? floats(data.weights) : null;
      mesh.levels = data.levels ? bytes(data.levels) : null;
      mesh.buffers = Object.fromEntries(["position", "normal", "tint"].map((n) => [n, gl.createBuffer()]));
      mesh.order = gl.createBuffer();
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.order); gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, index, gl.STATIC_DRAW);
      if (!data.normals) this.normals(mesh);
      this.fill(mesh);
      return mesh;
    }
    fill(mesh) {
      const gl = this.gl;
      for (const [name, data] of [["position", mesh.now], ["normal", mesh.normal], ["tint", mesh.tint]]) {
        gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffers[name]); gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
      }
    }
    normals(mesh) {
      const p = mesh.now, n = mesh.normal.fill(0), t = mesh.index;
      for (let k = 0; k < t.length; k += 3) {
        const [a, b, c] = [3 * t[k], 3 * t[k + 1], 3 * t[k + 2]];
        const u = [p[b] - p[a], p[b + 1] - p[a + 1], p[b + 2] - p[a + 2]], v = [p[c] - p[a], p[c + 1] - p[a + 1], p[c + 2] - p[a + 2]];
        const w = cross(u, v);
        for (const at of [a, b, c]) for (let i = 0; i < 3; i++) n[at + i] += w[i];
      }
    }
    // now = points + sum of fields times weights; colours show levels, or the displacement of each point
    bend(mesh, weights, factor, largest) {
      const { points, now, fields, tint } = mesh;
      now.set(points);
      fields.forEach((field, k) => {
        const w = factor * weights[k];
        if (w) for (let i = 0; i < now.length; i++) now[i] += w * field[i];
      });
      const count = now.length / 3, first = this.frame * count;
      if (mesh.levels) for (let i = 0; i < count; i++) tint.set(colour(mesh.levels[first + i] / 255), 3 * i);
      else if (largest > 0 && !mesh.plain) for (let i = 0; i < now.length; i += 3) {
        const size = Math.hypot(now[i] - points[i], now[i + 1] - points[i + 1], now[i + 2] - points[i + 2]);
        tint.set(colour(size / (factor * largest)), i);
      }
      this.normals(mesh);
      this.fill(mesh);
    }
    update() {
      const data = this.data;
      for (const mesh of this.meshes) {
        if (!mesh.fields.length) continue;
        if (data.shapes) {
          const shape = data.shapes[this.shape], w = new Float32Array(mesh.fields.length), [re, im] = shape.fields;
          w[re] = Math.cos(this.phase); if (im !== null) w[im] = -Math.sin(this.phase);
          this.bend(mesh, w, this.factor * shape.scale, shape.largest);
        } else {
          const m = mesh.fields.length;
          this.bend(mesh, mesh.weights.subarray(this.frame * m, this.frame * m + m), this.factor * data.exaggeration, mesh.largest);
        }
      }
      this.report();
      this.draw();
    }
    report() {
      const data = this.data, state = this.root.querySelector(".viewer-state");
      if (data.shapes) {
        const shape = data.shapes[this.shape];
        state.textContent = `${shape.label}; drawn with its coordinate at ${shown(this.factor * shape.scale * data.unit)}`;
      } else if (data.state !== undefined) {
        state.textContent = data.state;
      } else {
        const bent = this.meshes.some((mesh) => mesh.fields.length);
        state.textContent = `t = ${(1e3 * data.times[this.frame]).toFixed(2)} ms`
          + (bent ? `, deformation ${shown(this.factor * data.exaggeration)} times larger` : "")
          + (data.readings || []).map((r) => `, ${r.label} ${shown(r.values[this.frame])} ${r.unit}`).join("");
      }
    }
    draw() {
      const gl = this.gl, canvas = this.canvas, ratio = Math.min(devicePixelRatio || 1, 2);
      const width = Math.max(Math.round(canvas.clientWidth * ratio), 1), height = Math.max(Math.round(canvas.clientHeight * ratio), 1);
      if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
      gl.viewport(0, 0, width, height); gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      const back = minus(this.eye, this.focus), far = Math.hypot(...back), z = unit(back), x = unit(cross(this.up, z)), y = cross(z, x);
      const view = [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, this.eye), -dot(y, this.eye), -dot(z, this.eye), 1];
      // everything fits, in narrow and in wide pictures
      const [across, upright] = this.reach, near = 0.02 * far, end = 6 * far;
      const f = 0.93 * Math.min(1 / upright, width / height / across);
      const lens = [f * height / width, 0, 0, 0, 0, f, 0, 0, 0, 0, (end + near) / (near - end), -1, 0, 0, 2 * end * near / (near - end), 0];
      gl.uniformMatrix4fv(this.in.view, false, view); gl.uniformMatrix4fv(this.in.lens, false, lens);
      for (const mesh of this.meshes) {
        gl.uniformMatrix4fv(this.in.model, false, mesh.track < 0 ? UNMOVED : placed(this.tracks[mesh.track], this.frame));
        gl.uniform1f(this.in.opacity, mesh.opacity);
        mesh.opacity < 1 ? gl.enable(gl.BLEND) : gl.disable(gl.BLEND);
        for (const [name, buffer] of Object.entries(mesh.buffers)) {
          gl.bindBuffer(gl.ARRAY_BUFFER, buffer); gl.vertexAttribPointer(this.at[name], 3, gl.FLOAT, false, 0, 0);
        }
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.order);
        gl.drawElements(gl.TRIANGLES, mesh.index.length, gl.UNSIGNED_INT, 0);
      }
      const wide = canvas.clientWidth, high = canvas.clientHeight;
      this.measure(0.5 * f * high / far);
      this.label((at) => {
        const p = minus(at, this.eye), depth = -dot(z, p);
        return [0.5 * wide + 0.5 * f * high * dot(x, p) / depth, 0.5 * high - 0.5 * f * high * dot(y, p) / depth];
      }, wide, high);
    }
    // the bar: a round length in the plane through the focus, where a metre has so many pixels
    measure(pixels) {
      if (!this.ruler) return;
      const most = 120 / pixels, ten = 10 ** Math.floor(Math.log10(most)), metres = ten * [5, 2, 1].find((k) => k * ten <= most);
      const [size, unit] = metres >= 1 ? [1, "m"] : metres >= 1e-3 ? [1e-3, "mm"] : [1e-6, "µm"];
      this.ruler.querySelector("i").style.width = `${metres * pixels}px`;
      this.ruler.querySelector("span").textContent = `${shown(metres / size)} ${unit}`;
    }
    // names at their points, moved up or down where another name is; names without space are hidden until one zooms in
    label(project, wide, high) {
      const taken = [], off = this.part("names") && !this.part("names").checked;
      for (const { at, text } of this.labels) {
        const [px, py] = project(at), [w, h] = [text.offsetWidth, 17];
        const left = Math.min(px + 6, wide - w - 2);
        const free = [-0.5, -1.6, 0.6, -2.7, 1.7, -3.8, 2.8].map((k) => py + k * h).find((top) =>
          top > 0 && top + h < high && taken.every(([l, t, r]) => left > r || left + w < l || top >= t + h || top + h <= t));
        text.style.visibility = off || free === undefined || px < 0 || px > wide ? "hidden" : "visible";
        if (free === undefined) continue;
        taken.push([left, free, left + w]); text.style.left = `${left}px`; text.style.top = `${free}px`;
      }
    }
    turn(across, upwards) {
      const back = minus(this.eye, this.focus), side = unit(cross(this.up, back));
      const tilted = turned(back, side, upwards), lean = Math.abs(dot(unit(tilted), this.up));
      const moved = turned(lean < 0.995 ? tilted : back, this.up, across);
      this.eye = this.focus.map((v, k) => v + moved[k]); this.moved = true;
      this.draw();
    }
    zoom(factor) { this.eye = this.focus.map((v, k) => v + factor * (this.eye[k] - v)); this.moved = true; this.draw(); }
    choose(k) {
      this.shape = k; this.phase = 0;
      const data = this.data, bar = this.root.querySelector(".viewer-scale");
      const bent = this.meshes.find((mesh) => mesh.fields.length && !mesh.plain);
      if (bar) {
        bar.hidden = !bent;
        bar.querySelector("span").textContent = data.shapes ? "largest displacement" : bent && bent.top ? bent.top : `${shown(1e6 * (bent ? bent.largest : 0))} µm`;
      }
      this.update();
    }
    play(on) {
      if (!this.part("play")) return; // a pose that does not move
      this.playing = on;
      this.part("play").textContent = on ? "Pause" : "Play";
      this.part("play").setAttribute("aria-pressed", String(on));
      if (on) { this.last = null; requestAnimationFrame((now) => this.tick(now)); }
    }
    tick(now) {
      if (!this.playing) return;
      const passed = this.last === null ? 0 : Math.min((now - this.last) / 1e3, 0.1);
      this.last = now;
      if (this.data.shapes) this.phase += 2 * Math.PI * 0.7 * passed;
      else {
        this.progress = ((this.progress || this.frame) + this.data.rate * passed) % this.data.times.length;
        this.frame = Math.floor(this.progress);
        this.part("time").value = this.frame;
      }
      this.update();
      requestAnimationFrame((next) => this.tick(next));
    }
    listen() {
      const canvas = this.canvas, pointers = new Map();
      canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); pointers.set(e.pointerId, [e.clientX, e.clientY]); });
      for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => pointers.delete(e.pointerId));
      canvas.addEventListener("pointermove", (e) => {
        const from = pointers.get(e.pointerId);
        if (!from) return;
        const others = [...pointers].filter(([id]) => id !== e.pointerId).map(([, at]) => at);
        if (others.length) {
          const distance = (at) => Math.hypot(at[0] - others[0][0], at[1] - others[0][1]) || 1;
          this.zoom(distance(from) / distance([e.clientX, e.clientY]));
        } else this.turn(-0.008 * (e.clientX - from[0]), -0.008 * (e.clientY - from[1]));
        pointers.set(e.pointerId, [e.clientX, e.clientY]);
      });
      canvas.addEventListener("wheel", (e) => { if (!e.ctrlKey && !e.shiftKey && document.activeElement !== canvas) return;
        e.preventDefault(); this.zoom(Math.exp(0.0012 * e.deltaY)); }, { passive: false });
      canvas.addEventListener("keydown", (e) => {
        const keys = { ArrowLeft: () => this.turn(0.1, 0), ArrowRight: () => this.turn(-0.1, 0), ArrowUp: () => this.turn(0, 0.1),
          ArrowDown: () => this.turn(0, -0.1), "+": () => this.zoom(0.9), "-": () => this.zoom(1.1), " ": () => this.play(!this.playing) };
        if (keys[e.key]) { e.preventDefault(); keys[e.key](); }
      });
      const on = (name, event, act) => { const part = this.part(name); if (part) part.addEventListener(event, () => act(part)); };
      on("play", "click", () => this.play(!this.playing));
      on("home", "click", () => { this.home(); this.draw(); });
      on("time", "input", (part) => { this.play(false); this.frame = this.progress = Number(part.value); this.update(); });
      on("names", "change", () => this.draw());
      on("shape", "change", (part) => this.choose(Number(part.value)));
      on("factor", "input", (part) => { this.factor = 10 ** Number(part.value); this.update(); });
    }
  }
  window.Viewer = Viewer; // for pages that replace their views
  document.querySelectorAll(".viewer").forEach((root) => new Viewer(root));
})();
