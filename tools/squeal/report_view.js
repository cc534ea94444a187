// The 3D view of tools/report: parts, motions and contact of a run by three.js. startView(element, runs) draws them into an element.
"use strict";

const AMPLITUDE = [[0, "#dfe4ea"], [0.33, "#f6c65b"], [0.66, "#e8662c"], [1, "#a3102a"]];
const PRESSURE = [[0, "#440154"], [0.25, "#3b528b"], [0.5, "#21918c"], [0.75, "#5ec962"], [1, "#fde725"]];
const PLAIN = "#e3e6ea", ARROW = "#111820", ROUND = 2400; // ROUND: milliseconds of a period
const BY = { motion: "how much it moves", parts: "part", pressure: "pressure in steady sliding", state: "open, stick, slip" };

function make(kind, options = {}, ...inside) {
  const element = Object.assign(document.createElement(kind), options);
  element.append(...inside);
  return element;
}

function option(value, words) {
  return make("option", { value, textContent: words });
}

// A colour of a scale of [place, colour] at a value from 0 to 1.
function colourAt(scale, value) {
  const k = Math.max(1, scale.findIndex(([place]) => place >= value) < 0 ? scale.length - 1 : scale.findIndex(([place]) => place >= value));
  const [low, high] = [scale[k - 1], scale[k]];
  return new THREE.Color(low[1]).lerp(new THREE.Color(high[1]), Math.min(1, Math.max(0, (value - low[0]) / (high[0] - low[0]))));
}

function quantity(value, unit) {
  for (const [size, prefix] of [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""]])
    if (Math.abs(value) >= size || size === 1) return `${Number((value / size).toPrecision(3))} ${prefix}${unit}`;
}

// Displacements of all nodes at a phase [rad], added to where they rest.
function displace(motion, base, phase, factor, out) {
  out.set(base);
  const values = motion.values, count = base.length;
  for (let k = 0; k < motion.harmonics; ++k) {
    const c = factor * Math.cos((k + 1) * phase), s = factor * Math.sin((k + 1) * phase), start = 2 * k * count;
    for (let i = 0; i < count; ++i) out[i] += c * values[start + 2 * i] - s * values[start + 2 * i + 1];
  }
}

// How far each node moves at most over a period, over the largest of all.
function amplitudes(motion, count) {
  const largest = new Float32Array(count), zero = new Float32Array(3 * count), at = new Float32Array(3 * count);
  for (let j = 0; j < 48; ++j) {
    displace(motion, zero, 2 * Math.PI * j / 48, 1, at);
    for (let i = 0; i < count; ++i) largest[i] = Math.max(largest[i], Math.hypot(at[3 * i], at[3 * i + 1], at[3 * i + 2]));
  }
  const top = largest.reduce((a, b) => Math.max(a, b), 1e-300);
  return largest.map(value => value / top);
}

class View {
  constructor(element, runs) {
    this.runs = runs;
    this.renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true }); // throws without WebGL
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setClearColor("#ffffff");
    this.camera = new THREE.OrthographicCamera(-1, 1, 1, -1, -100, 100);
    this.camera.up.set(0, 0, 1);
    this.light = new THREE.DirectionalLight("#ffffff", 0.42);
    this.controls = new THREE.OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener("change", () => this.draw());
    this.build(element);
    new ResizeObserver(() => this.resize()).observe(this.stage);
    this.playing = false;
  }

  build(element) {
    this.stage = make("div", { className: "stage" });
    this.stage.append(this.renderer.domElement);
    this.renderer.domElement.setAttribute("aria-label", "3D view: drag to turn, wheel to come near");
    this.legend = make("div", { className: "legend" });
    this.words = make("p", { className: "words" });
    const pick = (name, title, change) => {
      this[name] = make("select", { title, onchange: change });
      return make("label", { textContent: `${title} ` }, this[name]);
    };
    const slide = (name, title, more, change) => {
      this[name] = make("input", { type: "range", title, ...more, oninput: change });
      return make("label", { className: "slide", textContent: `${title} ` }, this[name]);
    };
    this.play = make("button", { textContent: "▶ play", onclick: () => this.setPlaying(!this.playing) });
    this.time = make("output");
    const run = pick("run", "run", () => this.load(this.runs.findIndex(r => r.run === this.run.value)));
    run.hidden = this.runs.length < 2;
    this.run.append(...this.runs.map(r => option(r.run, r.run)));
    const tick = (name, words, checked) => {
      this[name] = make("input", { type: "checkbox", checked, onchange: () => this.draw() });
      return make("label", {}, this[name], ` ${words}`);
    };
    this.list = make("div", { className: "parts" });
    this.sides = make("div", { className: "sides" });
    element.append(this.stage, this.legend, make("div", { className: "controls" }, run,
      pick("motion", "motion", () => this.choose(Number(this.motion.value))), pick("by", "colour by", () => this.paint()),
      make("div", { className: "row" }, this.play, slide("phase", "phase", { min: 0, max: 1, step: 0.005, value: 0 }, () => { this.setPlaying(false); this.move(); }), this.time),
      slide("size", "exaggeration", { min: 0, max: 3, step: 0.05, value: 1 }, () => this.move()),
      make("div", { className: "row" }, tick("edges", "edges of elements", true), tick("marks", "rotation and edges of pads", true)),
      this.list, this.sides, this.words));
  }

  async load(place) {
    const run = this.runs[place], numbers = async (text, Kind) => new Kind(await inflate(text)), Index = run.nodes < 65536 ? Uint16Array : Uint32Array;
    this.run.value = run.run;
    this.data = run;
    this.base = await numbers(run.positions, Float32Array);
    this.position = new THREE.BufferAttribute(this.base.slice(), 3);
    this.colour = new THREE.BufferAttribute(new Float32Array(this.base.length), 3);
    this.scene = new THREE.Scene();
    this.scene.add(new THREE.AmbientLight("#ffffff", 0.56), this.light);
    this.parts = [];
    for (const part of run.parts) this.addPart(part, await numbers(part.triangles, Index), await numbers(part.edges, Index));
    for (const motion of run.motions) motion.values = await numbers(motion.shape, Float32Array);
    const contact = run.contact;
    if (contact.pairs) {
      this.pressure = await numbers(contact.pressure, Float32Array);
      this.pairs = await numbers(contact.pairs, Int32Array);
      this.status = contact.status ? await numbers(contact.status, Uint8Array) : null;
    }
    this.markContacts(contact.contacts || []);
    this.offer();
    this.choose(0);
    this.whole();
  }

  addPart(part, triangles, edges) {
    const surface = new THREE.BufferGeometry(), lines = new THREE.BufferGeometry();
    for (const geometry of [surface, lines]) geometry.setAttribute("position", this.position);
    surface.setAttribute("color", this.colour);
    surface.setIndex(new THREE.BufferAttribute(triangles, 1));
    lines.setIndex(new THREE.BufferAttribute(edges, 1));
    const material = new THREE.MeshPhongMaterial({ flatShading: true, side: THREE.DoubleSide, vertexColors: THREE.VertexColors, specular: "#000000",
      polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    const mesh = new THREE.Mesh(surface, material);
    const net = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ color: "#4d5761", transparent: true, opacity: 0.35 }));
    mesh.frustumCulled = net.frustumCulled = false;
    this.scene.add(mesh, net);
    this.parts.push({ name: part.name, colour: part.colour, mesh, net, triangles, opacity: 1 });
  }

  // The lists and buttons that this run has something for.
  offer() {
    const { motions, contact, left_out } = this.data;
    this.motion.replaceChildren(...motions.map((motion, k) => option(k, motion.name)), ...(motions.length ? [] : [option(-1, "none: no mode grows")]));
    const kinds = Object.keys(BY).filter(kind => kind === "parts" || (kind === "motion" ? motions.length : kind === "pressure" ? contact.pairs : this.cycle() >= 0 && contact.status));
    this.by.replaceChildren(...kinds.map(kind => option(kind, BY[kind])));
    this.list.replaceChildren(...this.parts.map(part => this.partRow(part)));
    const side = contact => make("button", { textContent: `contact side: ${contact.name}`, onclick: () => this.look(contact) });
    this.sides.replaceChildren(make("button", { textContent: "whole", onclick: () => this.whole() }), ...(contact.contacts || []).map(side));
    this.leftOut = left_out.length ? ` No room for the shapes of modes ${left_out.join(", ")}.` : "";
  }

  partRow(part) {
    part.shown = make("input", { type: "checkbox", checked: true, onchange: () => this.draw() });
    part.clear = make("input", { type: "range", min: 0.1, max: 1, step: 0.05, value: 1, title: `opacity of ${part.name}`, oninput: () => this.draw() });
    return make("div", {}, make("label", {}, part.shown, make("span", { className: "chip", style: `background:${part.colour}` }), part.name), part.clear);
  }

  cycle() {
    return this.data.motions.findIndex(motion => motion.mode === 0);
  }

  choose(place) {
    this.chosen = this.data.motions[place] || null;
    this.motion.value = this.chosen ? place : -1;
    if (this.chosen && !this.chosen.amplitude) this.chosen.amplitude = amplitudes(this.chosen, this.data.nodes);
    if (this.by.value === "state" && this.chosen && this.chosen.mode !== 0) this.by.value = "motion";
    this.words.textContent = (this.chosen && this.chosen.words ? `${this.chosen.name}: ${this.chosen.words}.` : "") + this.leftOut;
    this.paint();
    this.move();
  }

  // Shows a mode, or the cycle as mode 0, of a run; false where its shape is not there.
  async show(run, mode) {
    const place = this.runs.findIndex(r => r.run === run);
    if (place < 0) return false;
    if (this.data !== this.runs[place]) await this.load(place);
    const motion = this.data.motions.findIndex(m => m.mode === mode);
    if (motion < 0) return false;
    this.choose(motion);
    this.setPlaying(true);
    return true;
  }

  setPlaying(playing) {
    const before = this.playing;
    this.playing = playing && Boolean(this.chosen);
    this.play.textContent = this.playing ? "❚❚ stop" : "▶ play";
    if (!this.playing || before) return;
    let last = performance.now();
    const step = now => {
      if (!this.playing) return;
      this.phase.value = (Number(this.phase.value) + (now - last) / ROUND) % 1;
      last = now;
      this.move();
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  move() {
    const phase = Number(this.phase.value), motion = this.chosen;
    if (motion) displace(motion, this.base, 2 * Math.PI * phase, motion.scale * Number(this.size.value), this.position.array);
    else this.position.array.set(this.base);
    this.position.needsUpdate = true;
    this.time.textContent = motion && motion.mode === 0 ? `t = ${phase.toFixed(2)} T` : `${Math.round(360 * phase)}°`;
    if (this.by.value === "state") this.paintStates(phase);
    this.draw();
  }

  fill(node, colour) {
    colour.toArray(this.colour.array, 3 * node);
  }

  paint() {
    const by = this.by.value, plain = new THREE.Color(by === "parts" ? "#ffffff" : PLAIN);
    if (by === "state" && this.chosen && this.chosen.mode !== 0) return this.choose(this.cycle());
    for (let i = 0; i < this.data.nodes; ++i) this.fill(i, plain);
    for (const part of this.parts) part.mesh.material.color.set(by === "parts" ? part.colour : "#ffffff");
    if (by === "motion" && this.chosen) for (let i = 0; i < this.data.nodes; ++i) this.fill(i, colourAt(AMPLITUDE, this.chosen.amplitude[i]));
    if (by === "pressure") {
      for (let i = 0; i < this.data.nodes; ++i) if (this.pressure[i] > 0) this.fill(i, colourAt(PRESSURE, this.pressure[i] / this.data.contact.highest));
      for (const node of this.pairs) if (node >= 0 && !(this.pressure[node] > 0)) this.fill(node, colourAt(PRESSURE, 0));
    }
    if (by === "state") this.paintStates(Number(this.phase.value));
    this.colour.needsUpdate = true;
    this.key(by);
    this.draw();
  }

  paintStates(phase) {
    const steps = this.data.contact.steps, step = Math.floor(phase * steps) % steps, count = this.pairs.length;
    const shades = Object.values(this.data.contact.states).map(shade => new THREE.Color(shade));
    this.pairs.forEach((node, pair) => { if (node >= 0) this.fill(node, shades[this.status[step * count + pair]]); });
    this.colour.needsUpdate = true;
  }

  // What the colours mean.
  key(by) {
    const bar = (scale, low, high) => [low, make("span", { className: "bar", style: `background:linear-gradient(90deg,${scale.map(([place, colour]) => `${colour} ${100 * place}%`)})` }), high];
    const chips = pairs => pairs.map(([name, colour]) => make("span", {}, make("span", { className: "chip", style: `background:${colour}` }), name));
    const inside = by === "motion" ? bar(AMPLITUDE, "still", "moves most")
      : by === "pressure" ? bar(PRESSURE, "0", quantity(this.data.contact.highest, "Pa"))
        : by === "state" ? chips(Object.entries(this.data.contact.states)) : chips(this.parts.map(part => [part.name, part.colour]));
    this.legend.replaceChildren(...inside);
  }

  // Looks from a direction at points, so that they fill the picture.
  frame(points, towards) {
    const box = new THREE.Box3();
    for (const point of points) box.expandByPoint(point);
    const middle = box.getCenter(new THREE.Vector3()), radius = Math.max(box.getSize(new THREE.Vector3()).length() / 2, 1e-9);
    this.radius = radius;
    this.camera.zoom = 1;
    this.camera.position.copy(middle).addScaledVector(towards.normalize(), 4 * radius);
    this.camera.lookAt(middle);
    this.camera.updateMatrixWorld();
    const seen = new THREE.Box3().setFromPoints(points.map(point => point.clone().applyMatrix4(this.camera.matrixWorldInverse)));
    this.spans = seen.getSize(new THREE.Vector3());
    this.controls.target.copy(seen.getCenter(new THREE.Vector3()).applyMatrix4(this.camera.matrixWorld));
    this.camera.position.copy(this.controls.target).addScaledVector(towards, 4 * radius);
    this.resize();
    this.controls.update();
    this.draw();
  }

  points(parts) {
    const found = [];
    for (const part of parts) for (const node of part.triangles) found.push(new THREE.Vector3().fromArray(this.base, 3 * node));
    return found;
  }

  // All parts, from the side that moves and above it.
  whole() {
    for (const part of this.parts) part.shown.checked = true;
    const points = this.points(this.parts), middle = new THREE.Box3().setFromPoints(points).getCenter(new THREE.Vector3()), aside = new THREE.Vector3();
    if (this.chosen) this.chosen.amplitude.forEach((a, i) => aside.addScaledVector(new THREE.Vector3().fromArray(this.base, 3 * i).sub(middle), a * a));
    const turn = Math.atan2(aside.y, aside.x) - 35 * Math.PI / 180, rise = 30 * Math.PI / 180;
    this.frame(points, new THREE.Vector3(Math.cos(rise) * Math.cos(turn), Math.cos(rise) * Math.sin(turn), Math.sin(rise)));
  }

  // The side of a pad that touches, by itself.
  look(contact) {
    this.parts.forEach((part, k) => { part.shown.checked = contact.parts.includes(k); });
    if (this.by.value === "motion") { this.by.value = "pressure"; this.paint(); }
    const away = new THREE.Vector3().fromArray(contact.normal).negate();
    this.frame(this.points(contact.parts.map(k => this.parts[k])), away.add(new THREE.Vector3(0, -0.01, 0)));
  }

  text(words, place) {
    const canvas = make("canvas", { width: 512, height: 64 }), pen = canvas.getContext("2d");
    pen.font = "600 46px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.lineWidth = 10;
    pen.strokeStyle = "white";
    pen.strokeText(words, 256, 48);
    pen.fillStyle = ARROW;
    pen.fillText(words, 256, 48);
    const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), depthTest: false, transparent: true }));
    sprite.position.copy(place);
    sprite.renderOrder = 3;
    this.marked.add(sprite);
  }

  arrow(points, thick) {
    const material = new THREE.MeshBasicMaterial({ color: ARROW, depthTest: false, transparent: true, opacity: 0.85 });
    const tip = points[points.length - 1], before = points[points.length - 2], way = tip.clone().sub(before).normalize();
    const tube = new THREE.Mesh(new THREE.TubeBufferGeometry(new THREE.CatmullRomCurve3(points), 32, thick, 8), material);
    const head = new THREE.Mesh(new THREE.ConeBufferGeometry(3.2 * thick, 9 * thick, 16), material);
    head.position.copy(tip).addScaledVector(way, 3 * thick);
    head.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), way);
    tube.renderOrder = head.renderOrder = 2;
    this.marked.add(tube, head);
  }

  // The way of each rotor, centres of pressure, edges of pads.
  markContacts(contacts) {
    this.marked = new THREE.Group();
    this.scene.add(this.marked);
    const vector = list => new THREE.Vector3().fromArray(list), said = new Set();
    for (const contact of contacts) {
      const centre = vector(contact.centre), thick = Math.max(contact.size, 0.3 * (contact.radius || 0)) / 80;
      const dot = new THREE.Mesh(new THREE.SphereBufferGeometry(2 * thick, 16, 12), new THREE.MeshBasicMaterial({ color: "#c0272d", depthTest: false, transparent: true }));
      dot.position.copy(centre);
      dot.renderOrder = 2;
      this.marked.add(dot);
      if (contact.leading) { this.text("leading", vector(contact.leading)); this.text("trailing", vector(contact.trailing)); }
      if (!contact.way) continue;
      const key = contact.axis ? String(contact.axis) : contact.name;
      if (said.has(key)) continue; // both faces of a disc turn alike
      said.add(key);
      const reach = [...Array(17).keys()];
      if (!contact.axis) { this.arrow(reach.map(k => centre.clone().addScaledVector(vector(contact.way), contact.size * k / 32)), thick); continue; }
      const axis = vector(contact.axis), foot = centre.clone().sub(axis.clone().multiplyScalar(centre.dot(axis))), sense = Math.sign(axis.clone().cross(foot).dot(vector(contact.way)));
      this.arrow(reach.map(k => centre.clone().applyAxisAngle(axis, sense * (Math.PI * 0.8 + 0.4 * Math.PI * k / 16))), thick);
    }
  }

  resize() {
    const width = this.stage.clientWidth || 300, height = Math.round(Math.min(0.72 * width, 620));
    this.renderer.setSize(width, height);
    const spans = this.spans || { x: 1, y: 1 }, half = 0.56 * Math.max(spans.y, spans.x * height / width), across = half * width / height, deep = 100 * (this.radius || 1);
    Object.assign(this.camera, { left: -across, right: across, top: half, bottom: -half, near: -deep, far: deep });
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  draw() {
    if (!this.scene) return;
    for (const part of this.parts) {
      const opacity = part.clear ? Number(part.clear.value) : 1, shown = part.shown ? part.shown.checked : true;
      Object.assign(part.mesh, { visible: shown });
      Object.assign(part.mesh.material, { opacity, transparent: opacity < 1, depthWrite: opacity >= 1 });
      part.net.visible = shown && this.edges.checked;
      part.net.material.opacity = 0.35 * opacity;
    }
    this.marked.visible = this.marks.checked;
    const pixel = (this.camera.top - this.camera.bottom) / this.camera.zoom / this.renderer.domElement.clientHeight;
    for (const mark of this.marked.children) if (mark.isSprite) mark.scale.set(144 * pixel, 18 * pixel, 1);
    this.light.position.copy(this.camera.position).sub(this.controls.target).add(new THREE.Vector3(0, 0, 0.4 * this.radius));
    this.renderer.render(this.scene, this.camera);
  }
}

async function startView(element, runs) {
  const view = new View(element, runs);
  await view.load(0);
  return view;
}
