// Made by npm --prefix docs run build

// ../vsp/show/explorer/model.js
var ON_BORDER = 1e-9;
var TINTS = 6;
var clip = (value, low, high) => Math.min(Math.max(value, low), high);
var ORDERS = /* @__PURE__ */ new Map([
  ["manhattan", 1],
  ["euclidean", 2],
  ["chebyshev", null]
]);
function ready(policy) {
  const { codewords, scale, metric, order = ORDERS.get(metric) } = policy;
  if (order === void 0) throw new Error(`the metric ${metric} has no known order`);
  policy.power = order ?? Infinity;
  policy.scaled = Float64Array.from(
    codewords.flatMap((word) => word.map((value, i) => value / scale[i]))
  );
  policy.place = new Float64Array(scale.length);
  policy.far = new Float64Array(codewords.length);
  return policy;
}
function distances({ scaled, scale, power, place, far }, seen) {
  const d = scale.length, plain = power === 1 || power === 2 || power === Infinity;
  for (let i = 0; i < d; i++) place[i] = seen[i] / scale[i];
  for (let j = 0, at = 0; j < far.length; j++) {
    let sum = 0;
    for (let i = 0; i < d; i++, at++) {
      const gap = Math.abs(place[i] - scaled[at]);
      if (power === 2) sum += gap * gap;
      else if (power === 1) sum += gap;
      else if (power !== Infinity) sum += gap ** power;
      else if (gap > sum) sum = gap;
    }
    far[j] = plain ? sum : sum ** (1 / power);
  }
  return far;
}
function cellOf(policy, seen, slack = 0) {
  const far = distances(policy, seen);
  let best = 0;
  for (let j = 1; j < far.length; j++) if (far[j] < far[best] - slack) best = j;
  return best;
}
function tied(policy, seen) {
  const cell = cellOf(policy, seen, ON_BORDER), { far } = policy;
  let other = far.length - 1;
  while (Math.abs(far[other] - far[cell]) >= ON_BORDER) other--;
  return [cell, other];
}
function raw(rows, seen, k) {
  let sum = rows[seen.length][k];
  for (let i = 0; i < seen.length; i++) sum += seen[i] * rows[i][k];
  return sum;
}
function act({ task }, policy, seen) {
  const cell = policy.layers ? 0 : cellOf(policy, seen);
  const given = policy.layers ? output(policy, seen) : task.outputs.map((_, k) => raw(policy.coefficients[cell], seen, k));
  const action = given.map((value, k) => clip(value, task.actionLow[k], task.actionHigh[k]));
  return { cell, raw: given, action };
}
function output({ layers }, seen) {
  let values = Float64Array.from(seen, Math.fround);
  layers.forEach(({ weights, biases }, layer) => {
    const next = new Float64Array(biases);
    for (let j = 0, at = 0; j < next.length; j++) {
      let sum = 0;
      for (let i = 0; i < values.length; i++, at++) sum += weights[at] * values[i];
      sum += next[j];
      next[j] = layer === layers.length - 1 ? Math.tanh(sum) : Math.max(sum, 0);
    }
    values = next;
  });
  return [...values];
}
var TASKS = {
  "SimpleGoal-v0": {
    step([x, y], [dx, dy]) {
      const next = [clip(x + 0.1 * clip(dx, -1, 1), 0, 1), clip(y + 0.1 * clip(dy, -1, 1), 0, 1)];
      if (next[0] < 0.1 && next[1] < 0.1) return [next, 10, 1];
      if (next.every((value) => value > 0.4 && value < 0.6)) return [next, -10, 2];
      return [next, 10 * (Math.hypot(x, y) - Math.hypot(...next)), 0];
    },
    places: [
      { name: "goal", from: [0, 0], to: [0.1, 0.1] },
      { name: "pit", from: [0.4, 0.4], to: [0.6, 0.6] }
    ]
  },
  "MountainCarContinuous-v0": {
    step([x, v], [force]) {
      let speed = clip(v + 15e-4 * clip(force, -1, 1) - 25e-4 * Math.cos(3 * x), -0.07, 0.07);
      const place = clip(x + speed, -1.2, 0.6);
      if (place === -1.2 && speed < 0) speed = 0;
      const there = +(place >= 0.45 && speed >= 0);
      return [[place, speed].map(Math.fround), 100 * there - 0.1 * force ** 2, there];
    },
    places: [{ name: "flag", from: [0.45, 0], to: [0.6, 0.07] }]
  },
  "Pendulum-v1": {
    see: ([angle, speed]) => [Math.cos(angle), Math.sin(angle), speed],
    step([angle, speed], [torque]) {
      const turn2 = 2 * Math.PI, upright = ((angle + Math.PI) % turn2 + turn2) % turn2 - Math.PI;
      const cost = upright ** 2 + 0.1 * speed ** 2 + 1e-3 * torque ** 2;
      const next = clip(speed + (15 * Math.sin(angle) + 3 * clip(torque, -2, 2)) * 0.05, -8, 8);
      return [[angle + next * 0.05, next], -cost, 0];
    },
    places: []
  }
};
var dynamics = (name) => ({ see: (state) => state, ...TASKS[name] });
function rollout(scene, policy, start, keep = false) {
  const { see, step } = dynamics(scene.task.name), states = [start];
  let [state, total, outcome, last] = [start, 0, 0, 0];
  for (let t = 0; t < scene.task.maxSteps && !outcome; t++) {
    const { cell, action } = act(scene, policy, see(state));
    let reward;
    [state, reward, outcome] = step(state, action);
    last = cell;
    total += reward;
    if (keep) states.push(state);
  }
  return { total, outcome, last, states };
}
function leastSquares(a, b) {
  const unit = (i) => a[0].map((_, j) => +(i === j));
  const columns = a[0].map((_, i) => [...a.map((row2) => row2[i]), ...unit(i)]);
  const dot2 = (u, v) => a.reduce((sum, _, row2) => sum + u[row2] * v[row2], 0);
  for (let sweep = 0, turned = true; turned && sweep < 60; sweep++) {
    turned = false;
    for (const [i, u] of columns.entries())
      for (const v of columns.slice(i + 1)) {
        const [p, q, both] = [dot2(u, u), dot2(v, v), dot2(u, v)];
        if (Math.abs(both) <= 1e-16 * Math.sqrt(p * q)) continue;
        turned = true;
        turn(u, v, 0.5 * Math.atan2(2 * both, p - q));
      }
  }
  const sizes = columns.map((u) => Math.sqrt(dot2(u, u))), least = Math.max(...sizes) * Number.EPSILON * Math.max(a.length, a[0].length), solution = a[0].map(() => b[0].map(() => 0));
  columns.forEach((u, i) => {
    if (sizes[i] <= least) return;
    b[0].forEach((_, k) => {
      const share = b.reduce((sum, values, row2) => sum + u[row2] * values[k], 0) / sizes[i] ** 2;
      solution.forEach((weights, j) => weights[k] += u[a.length + j] * share);
    });
  });
  return solution;
}
function turn(u, v, angle) {
  const [cosine, sine] = [Math.cos(angle), Math.sin(angle)];
  u.forEach((x, i) => {
    u[i] = cosine * x + sine * v[i];
    v[i] = cosine * v[i] - sine * x;
  });
}
function refit(policy, { states, actions }, cells = policy.codewords.keys()) {
  const own = states.map((state) => cellOf(policy, state)), maps = structuredClone(policy.coefficients);
  for (const cell of cells) {
    const [a, b] = [
      /** @type {Vector[]} */
      [],
      /** @type {Vector[]} */
      []
    ];
    own.forEach((at, i) => at === cell && (a.push([...states[i], 1]), b.push(actions[i])));
    if (a.length) maps[cell] = leastSquares(a, b);
  }
  return maps;
}
function colouring(cells, n, k, wanted = []) {
  const near = Array.from({ length: k }, () => (
    /** @type {Set<number>} */
    /* @__PURE__ */ new Set()
  )), colours = (
    /** @type {number[]} */
    []
  );
  const meet = (i, j) => i !== j && (near[i].add(j), near[j].add(i));
  for (let at = 0; at < n * n; at++) {
    if (at % n) meet(cells[at], cells[at - 1]);
    if (at >= n) meet(cells[at], cells[at - n]);
  }
  const order = [...near.keys()].sort((i, j) => near[j].size - near[i].size);
  for (const i of order) {
    const taken = new Set([...near[i]].map((j) => colours[j])), all = [wanted[i] ?? i % TINTS, ...Array(TINTS).keys()];
    colours[i] = all.find((colour) => !taken.has(colour)) ?? all[0];
  }
  return colours;
}

// ../vsp/show/explorer/algorithms.js
var RIDGE = 1e-6;
var dot = (one2, other) => one2.reduce((sum, value, i) => sum + value * other[i], 0);
var minus = (one2, other) => one2.map((value, i) => value - other[i]);
var zeros = (rows, columns) => Array.from({ length: rows }, () => Array(columns).fill(0));
var Partition = class {
  /** @type {Vector[]} */
  codewords = [];
  /** @type {Rows[]} */
  coefficients = [];
  /** @type {Sums[]} */
  sums = [];
  /** @type {Linear} */
  look;
  /** @param {Thresholds} limits @param {number} outputs */
  constructor(limits, outputs) {
    this.limits = limits;
    this.outputs = outputs;
  }
  cellOf(state) {
    return cellOf(this.look, state);
  }
  /** For look-ups. */
  moved() {
    const { codewords, coefficients } = this, scale = codewords[0].map(() => 1);
    const about = { name: "", codewords, coefficients, scale, metric: "manhattan" };
    this.look = ready(
      /** @type {Linear} */
      about
    );
  }
  empty() {
    const size = this.codewords[0].length + 1;
    return { count: 0, products: zeros(size, size), targets: zeros(size, this.outputs) };
  }
  /** A new cell around a state; its map says 0. @param {Vector} state */
  add(state) {
    this.codewords.push([...state]);
    this.coefficients.push(zeros(state.length + 1, this.outputs));
    this.sums.push(this.empty());
    this.moved();
  }
  /** Put an episode into the buffers of its cells. @param {Visited} episode */
  observe({ states, actions }) {
    states.forEach((state, t) => {
      const sum = this.sums[this.cellOf(state)], inputs = [...state, 1];
      sum.count += 1;
      inputs.forEach((value, i) => {
        inputs.forEach((other, j) => sum.products[i][j] += value * other);
        actions[t].forEach((action, k) => sum.targets[i][k] += value * action);
      });
    });
  }
  /** Least squares in each cell with states, pulled a little towards the map that it has. */
  train() {
    this.sums.forEach(({ count: count2, products, targets }, cell) => {
      if (!count2) return;
      const map = this.coefficients[cell], columns = map[0].map((_, k) => map.map((weights) => weights[k]));
      const slope = targets.map(
        (goal, i) => goal.map((value, k) => value - dot(products[i], columns[k]))
      );
      const ridged = products.map((line, i) => line.with(i, line[i] + RIDGE));
      leastSquares(ridged, slope).forEach((line, i) => line.forEach((by, k) => map[i][k] += by));
    });
  }
  /** Algorithm 2, a step of the episode at a time.
   * @param {Visited} episode @returns {Generator<Step>} */
  *walk({ states, actions }) {
    let [previous, losses] = [
      -1,
      /** @type {Vector} */
      []
    ];
    for (const [t, state] of states.entries()) {
      const cell = this.cellOf(state);
      if (cell !== previous) [previous, losses] = [cell, []];
      const off = actions[t].map((value, k) => raw(this.coefficients[cell], state, k) - value), loss = dot(off, off) / off.length;
      losses.push(loss);
      const mean = losses.reduce((sum, each) => sum + each, 0) / losses.length, gap = minus(state, this.codewords[cell]).reduce((sum, value) => sum + Math.abs(value), 0), known = this.codewords.some((word) => word.every((value, i) => value === state[i])), splits = mean > this.limits.loss && gap > this.limits.distance && !known;
      if (splits) {
        const near = this.neighbours()[cell];
        near.add(cell);
        this.add(state);
        for (const i of near) this.sums[i] = this.empty();
        losses = [];
      }
      yield { t, cell, loss, mean, gap, splits };
    }
  }
  /** Algorithm 3. Returns the codewords that went, with the differences of their maps.
   * @returns {Change[]} */
  merge() {
    const gone = (
      /** @type {Change[]} */
      []
    );
    for (let i = 0; i < this.codewords.length; i++) {
      const near = this.neighbours()[i], own = this.coefficients[i].flat();
      const alike = [...near].flatMap((j) => {
        const apart = minus(this.coefficients[j].flat(), own).map(Math.abs), cause = Math.max(...apart);
        return cause < this.limits.difference ? [{ j, cause }] : [];
      });
      if (!alike.length) continue;
      for (const j of near.add(i)) this.sums[j] = this.empty();
      for (const { j, cause } of alike)
        gone.push({ kind: "merge", codeword: this.codewords[j], cause });
      const left = [...this.codewords.keys()].filter((j) => !alike.some((one2) => one2.j === j));
      this.codewords = left.map((j) => this.codewords[j]);
      this.coefficients = left.map((j) => this.coefficients[j]);
      this.sums = left.map((j) => this.sums[j]);
      i = left.indexOf(i);
    }
    this.moved();
    return gone;
  }
  neighbours() {
    return neighbours(this.codewords);
  }
};
function* distil(partition, episodes, { split, merge, freeze }) {
  partition.add(episodes[0].states[0]);
  for (const [n, episode] of episodes.entries()) {
    partition.observe(episode);
    partition.train();
    yield { n, episode };
    if (!n || n >= episodes.length - freeze) continue;
    if (n % split === 0) for (const step of partition.walk(episode)) yield { n, episode, step };
    if (n % merge === 0) yield { n, episode, gone: partition.merge() };
  }
}
function neighbours(points) {
  const near = points.map(() => (
    /** @type {Set<number>} */
    /* @__PURE__ */ new Set()
  ));
  points.forEach((p, i) => {
    for (let j = 0; j < i; j++) {
      const [dx, dy] = minus(points[j], p);
      let [low, high] = [-Infinity, Infinity];
      points.forEach((r, k) => {
        if (k === i || k === j) return;
        const from = minus(r, p), side = 2 * dot([-dy, dx], from), room = dot(from, minus(r, points[j]));
        if (side > 0) high = Math.min(high, room / side);
        else if (side < 0) low = Math.max(low, room / side);
        else if (room < 0) high = -Infinity;
      });
      if (low < high) near[i].add(j), near[j].add(i);
    }
  });
  return near;
}

// ../vsp/show/explorer/controls.js
var SPEEDS = [0.25, 1, 4];
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function")
      made.addEventListener(
        name,
        /** @type {EventListener} */
        value
      );
    else if (value !== false) made.setAttribute(name, value === true ? "" : String(value));
  }
  made.append(...children);
  return made;
}
var button = (label, click) => element("button", { type: "button", click }, label);
var row = (...children) => element("div", { class: "vsp-row" }, ...children);
var minus2 = (text) => text.replaceAll("-", "−");
var count = (n, thing) => `${n} ${thing}${n === 1 ? "" : "s"}`;
var digits = (value) => Math.abs(value) < 5e-4 ? "0.000" : minus2(value.toFixed(3));
function table(head, rows) {
  const line = (first, tag, about, values) => element("tr", {}, first, ...values.map((value) => element(tag, about, value)));
  const body = rows.map(
    ([name, ...values]) => line(element("th", { scope: "row" }, name), "td", {}, values)
  );
  return element("table", {}, line(element("td"), "th", { scope: "col" }, head), ...body);
}
function choice(label, names, take, at = 0) {
  const options = names.map((name, i) => element("option", { value: i, selected: i === at }, name));
  const change = () => void take(+list.value);
  const list = element("select", { change }, ...options);
  return element("label", {}, `${label} `, list);
}
function field(label, list, i, step, changed) {
  const value = () => +(+list[i].toFixed(3)).toPrecision(4);
  const input = () => {
    const given = made.valueAsNumber;
    if (!(Math.abs(given) <= 1e6)) return;
    list[i] = given;
    changed();
  };
  const change = () => made.value = String(value());
  const about = { type: "number", step, value: value(), "aria-label": label };
  const made = element("input", { ...about, input, change });
  return made;
}
function equations({ scene, policy, cell, cells, angular }, changed) {
  if (policy.layers) return [];
  const { task, plane } = scene, rows = policy.coefficients[cell], codeword = policy.codewords[cell];
  const range = (i) => angular ? 2 : plane.high[i] - plane.low[i];
  const term = (label, list, i, step, before, after = "") => {
    const written = field(label, list, i, step, changed);
    return element("span", { class: "vsp-term" }, before, written, after);
  };
  const line = (name, terms) => element("div", { class: "vsp-equation" }, `${name} `, ...terms);
  const places = task.inputs.map(
    (name, i) => term(`codeword: ${name}`, codeword, i, +(range(i) / 50).toPrecision(1), `${name} = `)
  );
  const lines = task.outputs.map((output2, k) => {
    const names = [...task.inputs, "bias"];
    const terms = names.map(
      (name, i) => term(`${output2}: ${name}`, rows[i], k, 0.1, "", name === "bias" ? "" : `${name} +`)
    );
    return line(`${output2} =`, terms);
  });
  return cells > 1 ? [line("codeword", places), ...lines] : lines;
}
var Player = class {
  text = "";
  speed = 1;
  playing = false;
  /** @type {HTMLInputElement} */
  slider;
  constructor(view) {
    this.view = view;
    this.slow = matchMedia("(prefers-reduced-motion: reduce)").matches;
    const go = (way) => (this.stop(), view.jump(way));
    const input = () => (this.stop(), this.to(+this.slider.value));
    const settled = { input, change: () => view.soon() };
    this.slider = element("input", { type: "range", min: 0, "aria-label": "iteration", ...settled });
    this.toggle = button("play", () => this.playing ? this.pause() : this.start());
    this.said = element("span", { class: "vsp-said" });
    const steps = [button("previous change", () => go(-1)), button("next change", () => go(1))];
    const names = SPEEDS.map((speed) => `${speed} ×`);
    const speeds = choice("speed", names, (i) => this.speed = SPEEDS[i], 1);
    this.row = row(this.toggle, ...steps, speeds, this.slider, this.said);
  }
  get at() {
    return +this.slider.value;
  }
  /** Set the number of moments and go to the last one. */
  restart(count2) {
    this.slider.max = String(count2 - 1);
    this.to(count2 - 1);
  }
  to(i) {
    this.slider.value = String(i);
    this.text = this.view.turn(this.at);
  }
  /** Say where it is: with the next frame, as all texts. */
  tell() {
    this.said.textContent = this.text;
    this.slider.setAttribute("aria-valuetext", this.text);
  }
  start() {
    const last = +this.slider.max;
    this.playing = true;
    this.toggle.textContent = "pause";
    if (this.at === last) this.to(0);
    let [before, waited] = [performance.now(), 0];
    const frame = (now) => {
      if (!this.playing || !this.slider.isConnected) return;
      waited += (now - before) * this.speed;
      before = now;
      let i = this.at;
      for (; i < last && waited >= this.view.lasts(i); i++) waited -= this.view.lasts(i);
      if (i > this.at) this.to(i);
      if (this.at < last) return requestAnimationFrame(frame);
      this.pause();
    };
    requestAnimationFrame(frame);
  }
  pause() {
    this.stop();
    this.view.settle();
  }
  stop() {
    this.playing = false;
    this.toggle.textContent = "play";
  }
};

// ../vsp/show/explorer/picture.js
var ARROWS = 14;
var STRIPES = 50;
var FLASH = 900;
var CELLS = ["#56b4e9", "#ece133", "#ca9161", "#b0b0b0", "#fbafe4", "#8a7fd0"];
var [LEFT, RIGHT] = ["#7f4fa8", "#c9730f"];
var rgb = (colour) => [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));
var mixed = (colour, ground, share) => colour.map((part, i) => ground[i] + share * (part - ground[i]));
var Picture = class {
  map = new OffscreenCanvas(1, 1);
  edge = { left: 0, right: 0, top: 0, bottom: 0 };
  side = 0;
  wide = 0;
  high = 0;
  ties = false;
  // whether the map has points that are equally near to two codewords
  /** @type {Record<string, string>} */
  tones = {};
  /** @type {number[]} */
  colours = [];
  // of the cells
  /** @type {Record<string, number>} */
  known = {};
  // those of codewords
  /** @param {HTMLCanvasElement} canvas @param {Plane} plane */
  constructor(canvas, plane) {
    this.canvas = canvas;
    this.plane = plane;
    this.ctx = /** @type {CanvasRenderingContext2D} */
    canvas.getContext("2d");
  }
  /** Take size and colours from the page, and clear. */
  begin() {
    const ratio = devicePixelRatio, side = this.canvas.clientWidth || 440, size = Math.round(side * ratio), style = getComputedStyle(this.canvas);
    if (this.canvas.width !== size) this.canvas.width = this.canvas.height = size;
    const small = side < 330;
    this.edge = { left: small ? 46 : 54, right: small ? 4 : 8, top: 8, bottom: small ? 32 : 36 };
    this.ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.side = side;
    this.wide = side - this.edge.left - this.edge.right;
    this.high = side - this.edge.top - this.edge.bottom;
    const tone = (name) => style.getPropertyValue(`--vsp-${name}`).trim() || "#888888";
    const names = ["paper", "ink", "start", "goal", "pit", "failing", "teacher"];
    this.tones = Object.fromEntries(names.map((name) => [name, tone(name)]));
    this.ctx.clearRect(0, 0, side, side);
    this.ctx.font = `${small ? 11 : 13}px ${style.fontFamily}`;
  }
  at([x, y]) {
    const { low, high } = this.plane;
    return [
      this.edge.left + (x - low[0]) / (high[0] - low[0]) * this.wide,
      this.edge.top + (high[1] - y) / (high[1] - low[1]) * this.high
    ];
  }
  /** @param {number} px @param {number} py */
  point(px, py) {
    const { low, high } = this.plane;
    return [
      low[0] + (px - this.edge.left) / this.wide * (high[0] - low[0]),
      high[1] - (py - this.edge.top) / this.high * (high[1] - low[1])
    ].map((value, i) => clip(value, low[i], high[i]));
  }
  shows(point) {
    const { low, high } = this.plane;
    return point.every((value, i) => value >= low[i] && value <= high[i]);
  }
  /** The middle of one of n by n parts of the plane, counted from the top left.
   * @param {number} at @param {number} n */
  middle(at, n) {
    const { low, high } = this.plane, shares = [at % n + 0.5, n - 0.5 - Math.floor(at / n)];
    return shares.map((share, i) => low[i] + share / n * (high[i] - low[i]));
  }
  /** Call `draw` with everything cut off at the frame. */
  inside(draw) {
    this.ctx.save();
    this.ctx.beginPath();
    this.ctx.rect(this.edge.left, this.edge.top, this.wide, this.high);
    this.ctx.clip();
    draw();
    this.ctx.restore();
  }
  /** @type {(words: string, x: number, y: number, align?: CanvasTextAlign) => void} */
  text(words, x, y, align = "center") {
    const { ctx } = this;
    ctx.textAlign = align;
    ctx.lineWidth = 3;
    ctx.strokeStyle = this.tones.paper;
    ctx.strokeText(words, x, y);
    ctx.fillStyle = this.tones.ink;
    ctx.fillText(words, x, y);
  }
  place({ name, from, to }) {
    const [left, bottom] = this.at(from), [right, top] = this.at(to);
    this.ctx.fillStyle = (name === "pit" ? this.tones.pit : this.tones.goal) + "77";
    this.ctx.fillRect(left, top, right - left, bottom - top);
  }
  /** Name a place: at its middle, or at the top of the frame that it fills. */
  name({ name, from, to }) {
    const { low, high } = this.plane, fills = from.every((value, i) => value <= low[i] && to[i] >= high[i]), [x, y] = this.at(from.map((value, i) => (value + to[i]) / 2)), half = this.ctx.measureText(name).width / 2 + 3;
    if (fills) this.text(name, this.edge.left + this.wide / 2, this.edge.top + 16);
    else this.text(name, Math.max(x, this.edge.left + half), y + 4);
  }
  /** @param {Vector[]} points @param {string} colour */
  line(points, colour, width = 2) {
    const { ctx } = this;
    ctx.beginPath();
    points.forEach((point, i) => {
      const [x, y] = this.at(point), far = i && Math.abs(x - this.at(points[i - 1])[0]) > this.wide / 2;
      if (i && !far) ctx.lineTo(x, y);
      else ctx.moveTo(x, y);
    });
    ctx.strokeStyle = colour;
    ctx.lineWidth = width;
    ctx.stroke();
  }
  /** @param {Vector[]} shapes @param {string} colour */
  polygons(shapes, colour) {
    const { ctx } = this;
    ctx.beginPath();
    for (const shape of shapes) {
      for (let i = 0; i < shape.length; i += 2) {
        const [x, y] = this.at([shape[i], shape[i + 1]]);
        ctx[i ? "lineTo" : "moveTo"](x, y);
      }
      ctx.closePath();
    }
    ctx.fillStyle = ctx.strokeStyle = colour;
    ctx.lineWidth = 0.5;
    ctx.fill();
    ctx.stroke();
  }
  /** @param {Vector} point @param {number} radius
   * @param {string | undefined} fill @param {string} [stroke] */
  dot(point, radius, fill, stroke, width = 1.5) {
    const { ctx } = this, [x, y] = this.at(point);
    ctx.beginPath();
    ctx.arc(x, y, radius, 0, 7);
    if (fill) {
      ctx.fillStyle = fill;
      ctx.fill();
    }
    if (stroke) {
      ctx.strokeStyle = stroke;
      ctx.lineWidth = width;
      ctx.stroke();
    }
  }
  axes() {
    const { ctx, plane, edge } = this, { low, high, labels } = plane, bottom = edge.top + this.high, sides = (
      /** @type {const} */
      ["left", "center", "right"]
    );
    ctx.strokeStyle = this.tones.ink;
    ctx.lineWidth = 1;
    ctx.strokeRect(edge.left, edge.top, this.wide, this.high);
    for (const share of [0, 0.5, 1]) {
      const [first, second] = low.map((value, i) => tick(value, high[i] - value, share));
      const x = edge.left + share * this.wide, y = bottom - share * this.high;
      this.text(first, x, bottom + 15, sides[2 * share]);
      if (share !== 0.5 || second.length < 5 && this.side > 330)
        this.text(second, edge.left - 5, y + [0, 4, 10][2 * share], "right");
    }
    this.text(labels[0], edge.left + this.wide / 2, bottom + 31);
    ctx.save();
    ctx.translate(12, edge.top + this.high / 2);
    ctx.rotate(-Math.PI / 2);
    this.text(labels[1], 0, 0);
    ctx.restore();
  }
};
function tick(low, range, share) {
  const digits2 = clip(1 - Math.floor(Math.log10(range)), 0, 12);
  return String(+(low + share * range).toFixed(digits2)).replace("-", "−");
}
function drawMap(view, n) {
  const { picture, policy } = view, cells = new Int16Array(n * n), others = new Int16Array(n * n);
  for (let at = 0; at < n * n && !policy.layers; at++)
    [cells[at], others[at]] = tied(policy, view.task.see(picture.middle(at, n)));
  picture.ties = cells.some((cell, at) => cell !== others[at] && cells[at - 1] !== others[at - 1]);
  const keys = (policy.codewords ?? [0]).map(String), wanted = keys.map((key, i) => picture.known[key] ?? picture.colours[i]);
  picture.colours = colouring(cells, n, view.cells, wanted);
  picture.known = Object.fromEntries(keys.map((key, i) => [key, picture.colours[i]]));
  picture.map.width = picture.map.height = n;
  picture.map.getContext("2d")?.putImageData(painted(view, cells, others, n), 0, 0);
}
function painted(view, cells, others, n) {
  const { picture, scene, policy } = view, [paper, ink] = [picture.tones.paper, picture.tones.ink].map(rgb), image = new ImageData(n, n), pixels = new Uint32Array(image.data.buffer);
  const packed = ([red, green, blue]) => 255 << 24 | blue << 16 | green << 8 | red;
  const shades = (hue, share) => {
    const plain = mixed(rgb(hue), paper, share);
    return [plain, mixed(ink, plain, 0.13), mixed(ink, plain, Math.min(n / 400, 0.6))].map(packed);
  };
  const single = scene.task.outputs.length === 1, tints = picture.colours.map((colour) => shades(CELLS[colour], view.cells > 1 ? 0.34 : 0.1)), pushes = Array.from(
    { length: 129 },
    (_, i) => shades(i < 64 ? LEFT : RIGHT, 0.7 * Math.abs(i - 64) / 64)
  );
  for (let at = 0; at < n * n; at++) {
    const [row2, column] = [Math.floor(at / n), at % n], cell = Math.floor((row2 + column) * STRIPES / n) % 2 ? others[at] : cells[at];
    let hue = tints[cell];
    if (single && !policy.layers) {
      const push = raw(policy.coefficients[cell], view.task.see(picture.middle(at, n)), 0);
      hue = pushes[Math.round(64 + 64 * clip(push / scene.task.actionHigh[0], -1, 1))];
    }
    const edge = column && cells[at - 1] !== cells[at] || row2 && cells[at - n] !== cells[at];
    pixels[at] = hue[edge ? 2 : Number(view.cells > 1 && cells[at] === view.cell)];
  }
  return image;
}
function drawAll(view) {
  const { picture } = view;
  picture.begin();
  picture.inside(() => {
    drawPlane(view);
    const path = view.played.states.map(view.place), { paper, ink } = picture.tones;
    picture.line(path, paper, 5);
    picture.line(path, ink, 2);
    path.slice(1).forEach((point) => picture.dot(point, 2, ink));
    drawCodewords(view);
    drawFlashes(view);
    picture.dot(view.asked, 9, paper);
    picture.dot(view.asked, 6.5, void 0, ink);
    picture.dot(view.asked, 2.5, ink);
  });
  picture.axes();
}
function drawPlane(view) {
  const { picture, scene } = view, { tones, edge } = picture;
  picture.ctx.drawImage(picture.map, edge.left, edge.top, picture.wide, picture.high);
  view.task.places.forEach((place) => picture.place(place));
  if (view.regions) picture.polygons(view.regions, tones.failing);
  if (scene.task.outputs.length === 2) drawArrows(view);
  const starts = view.starts ? scene.starts.map(view.place) : [];
  starts.forEach((start, i) => {
    const cell = view.failing.get(i);
    if (cell === void 0) picture.dot(start, 1.3, tones.start);
    else picture.dot(start, 2.7, cell === view.cell ? tones.failing : tones.paper, tones.failing);
  });
  view.task.places.forEach((place) => picture.name(place));
}
function drawArrows(view) {
  const { picture, scene, policy } = view, { ctx } = picture, length = picture.wide / ARROWS * 0.42;
  ctx.strokeStyle = policy.layers ? picture.tones.teacher : picture.tones.ink;
  ctx.lineWidth = policy.layers ? 1.4 : 1;
  ctx.beginPath();
  for (let i = 0; i < ARROWS * ARROWS; i++) {
    const point = picture.middle(i, ARROWS);
    const [dx, dy] = policy.arrows?.[i] ?? act(scene, policy, point).action;
    if (!dx && !dy) continue;
    const [x, y] = picture.at(point), [ex, ey] = [x + dx * length, y - dy * length], turn2 = Math.atan2(-dy, dx);
    ctx.moveTo(x - dx * length, y + dy * length);
    ctx.lineTo(ex, ey);
    for (const side of [-2.6, 2.6]) {
      ctx.moveTo(ex, ey);
      ctx.lineTo(ex + 4 * Math.cos(turn2 + side), ey + 4 * Math.sin(turn2 + side));
    }
  }
  ctx.stroke();
}
function drawCodewords(view) {
  const { picture, policy } = view, { paper, ink } = picture.tones;
  if (policy.layers || view.cells === 1) return;
  policy.codewords.forEach((codeword, i) => {
    const point = view.placeSeen(codeword), [x, y] = picture.at(point);
    picture.dot(point, 5, i === view.cell ? ink : paper, ink);
    const [inner, below] = [x > picture.side - 40, y < 28];
    if (view.cells > 30) return;
    picture.text(String(i), x + (inner ? -9 : 9), y + (below ? 16 : -6), inner ? "right" : "left");
  });
}
function drawFlashes(view) {
  const now = performance.now(), { picture } = view;
  view.flashes = view.flashes.filter(({ since }) => now - since < FLASH);
  for (const { codeword, kind, since } of view.flashes) {
    const share = (now - since) / FLASH;
    const radius = 34 * (kind === "split" ? share : 1 - share);
    picture.ctx.globalAlpha = 1 - share;
    picture.dot(view.placeSeen(codeword), radius, void 0, picture.tones.ink, 4);
  }
  picture.ctx.globalAlpha = 1;
}

// ../vsp/show/explorer/texts.js
function resultOf({ scene, results, base, teacher }) {
  const { played, failures, mean } = results, about = played < scene.starts.length ? "about " : "";
  const both = (before, now) => base ? `${before} → ${about}${now}` : about + now;
  const fails = `${both(base?.failures, failures)} of ${scene.starts.length} starts fail. `;
  const returned = `Mean return ${both(base?.mean.toFixed(2), mean.toFixed(2))}`;
  const aim = teacher ? ` (teacher: ${teacher.mean.toFixed(2)})` : "";
  return minus2(`${scene.lost.length ? fails : ""}${returned}${aim}.`);
}
function episodeOf({ cell, cells, asked, played, task, picture: { plane } }) {
  if (!played.states.length) return "";
  const [goal] = task.places, place = task.places[(played.outcome ?? 0) - 1], end = place ? ` to the ${place.name}` : goal ? `, not to the ${goal.name}` : "", size = (i) => Math.floor(Math.log10(plane.high[i] - plane.low[i])), at = asked.map((value, i) => minus2(value.toFixed(2 - Math.min(size(i), 0)))).join(", "), steps = count(played.states.length - 1, "step");
  const where = cells > 1 ? `, in cell ${cell}` : "";
  return `From (${at})${where}: ${steps}${end}.`;
}
function causeOf({ kind, codeword, cause }, limits = {}) {
  const at = `${kind} at (${codeword.map((value) => minus2(value.toFixed(2))).join(", ")})`, found = cause.toPrecision(3);
  if (kind === "merge")
    return `${at}: maps differ by ${found}${limits.merge ? `, below ${limits.merge}` : ""}`;
  return `${at}: loss ${found}${limits.split ? `, above ${limits.split}` : ""}`;
}
function answerOf({ scene, policy, cell, cells, asked, task }) {
  if (policy.layers) return [];
  const { inputs, outputs } = scene.task, seen = task.see(asked), rows = policy.coefficients[cell], { raw: raw2, action } = act(scene, policy, seen);
  const adds = [...inputs, "bias"].map((name, i) => {
    const said = name === "bias" ? "the bias adds" : `${name} = ${digits(seen[i])} adds`;
    return [said, ...rows[i].map((weight) => weight * (seen[i] ?? 1))];
  });
  const found = [...adds, ["sum", ...raw2], ["action, within the limits", ...action]];
  const told = found.map(([name, ...values]) => [name, ...values.map(digits)]);
  const title = cells > 1 ? `Cell ${cell} of ${cells}, counted from 0` : "The map";
  return [element("p", {}, element("b", {}, title)), table(outputs, told)];
}
var noteOf = ({ angular, cells }) => (angular || cells === 1 ? "" : "Drag a codeword to move its cell. ") + "Click to choose a state; arrow keys move it.";
function legendOf({ scene, policy, failing, starts, regions, cells, picture, placeSeen }) {
  const [output2, second] = scene.task.outputs;
  const mark = (kind, words) => element("li", {}, element("i", { class: `vsp-mark vsp-${kind}` }), words);
  const fails = starts && failing.size > 0, inside = policy.codewords?.some((word) => picture.shows(placeSeen(word)));
  const marks = [
    starts && mark("start", "start"),
    fails && mark("failing", cells > 1 ? "fails; last step in the chosen cell" : "start that fails"),
    fails && cells > 1 && mark("elsewhere", "fails; last step in another"),
    regions && mark("region", "falls into the pit"),
    second && mark(policy.layers ? "taught" : "step", policy.layers ? "teacher's step" : "step"),
    !second && mark("below", `${output2} below 0`),
    !second && mark("above", "above 0"),
    cells > 1 && inside && mark("codeword", "codeword; filled: of the chosen cell"),
    picture.ties && mark("tied", "two codewords equally near: the first acts")
  ];
  return [...marks.filter((made) => !!made), mark("chosen", "chosen state, and its episode")];
}

// ../vsp/show/explorer/explorer.js
var [COARSE, FINE] = [120, 320];
var IN_MOTION = 8;
var STRIDE = 149;
var [PLAYS, PAUSE] = [2e4, 400];
var Explorer = class {
  /** @type {Map<number, number>} */
  failing = /* @__PURE__ */ new Map();
  // of the starts that fail, by index: the cell of their last step
  /** @type {Partial<Numbers>[]} */
  past = [];
  // to undo to
  /** @type {(Change & { since: number })[]} */
  flashes = [];
  // changes that have just happened
  /** @type {Vector[] | null} */
  regions = null;
  // polygons to fill
  starts = true;
  // whether they are drawn
  fixed = false;
  // whether codewords cannot be moved
  /** @type {number | null} */
  dragged = null;
  // the codeword, or -1 for the state
  pressed = { x: 0, y: 0, place: [0, 0] };
  // where a gesture began
  moment = -1;
  // of the run
  /** @type {Policy} */
  policy;
  // with the numbers of the reader
  /** @type {Policy} */
  original;
  /** @type {Moment[]} */
  run;
  /** @type {Played} */
  played;
  // from the state that is `asked`
  /** @type {number} */
  cell;
  // that acts there
  /** @type {Judged} */
  results;
  /** @type {Judged | null} */
  base;
  // the results before the last gesture
  /** @type {Partial<Numbers>} */
  kept;
  // those before the next gesture
  armed = false;
  // whether the next change begins a gesture
  /** @type {number | null} */
  mapped;
  // the cell that is marked on the map
  renewed = false;
  // whether the policy has changed since the last frame
  waiting = 0;
  // for a frame
  fading = 0;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  still;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  later;
  result = element("p", { class: "vsp-result" });
  from = element("p", { class: "vsp-from" });
  said = element("div", {}, this.result, this.from);
  answer = element("div");
  note = element("p", { class: "vsp-note" });
  legend = element("ul", { class: "vsp-legend", "aria-label": "legend" });
  // Kept while a reader writes
  form = element("div", {
    focusout: ({ relatedTarget: to }) => {
      if (!this.form.contains(
        /** @type {Node | null} */
        to
      )) this.changed();
    },
    focusin: () => this.armed = true,
    input: () => this.soon()
  });
  backs = row(
    button("undo", () => this.undo()),
    button("reset", () => this.take(this.original))
  );
  replay = new Player(this);
  /** @param {HTMLElement} root @param {Scene} scene @param {Hooks} hooks */
  constructor(root, scene, { bare, above = [], settled = () => {
  }, told = () => {
  } } = {}) {
    const { low, high } = scene.plane;
    this.scene = scene;
    this.settled = settled;
    this.told = told;
    this.task = dynamics(scene.task.name);
    this.angular = scene.task.name === "Pendulum-v1";
    this.asked = low.map((value, i) => value + 0.7 * (high[i] - value));
    this.canvas = this.makeCanvas();
    this.picture = new Picture(this.canvas, scene.plane);
    const active = (
      /** @type {HTMLElement | null} */
      document.activeElement
    ), held = root.contains(active) && active;
    root.classList.add("vsp-explorer");
    const under = bare ? this.legend : this.answer, stage = element("div", { class: "vsp-stage" }, this.canvas, this.said, under);
    root.replaceChildren(stage, ...bare ? [] : [this.panel(above)]);
    if (held) (held.isConnected ? held : this.canvas).focus();
    this.listen();
    this.show(scene.policies[0]);
  }
  makeCanvas() {
    const { pointerdown, pointermove, pointerup, keydown } = this, answers = { pointerdown, pointermove, pointerup, pointercancel: pointerup, keydown }, label = "Map of the policy. Arrow keys move the chosen state.";
    return element("canvas", { tabindex: 0, role: "application", "aria-label": label, ...answers });
  }
  panel(above) {
    const names = this.scene.policies.map(({ name }) => name);
    const policy = choice("policy", names, (i) => this.show(this.scene.policies[i]));
    const parts = [this.replay.row, this.form, this.backs, this.note];
    return element("div", { class: "vsp-panel" }, this.legend, row(...above, policy), ...parts);
  }
  // -- What is shown, and where it lies in the picture
  place = (state) => {
    if (!this.angular) return state;
    const [angle, speed] = state;
    return [angle - 2 * Math.PI * Math.round(angle / 2 / Math.PI), speed];
  };
  /** @type {(seen: Vector) => Vector} */
  placeSeen = (seen) => this.angular ? [Math.atan2(seen[1], seen[0]), seen[2]] : seen;
  get teacher() {
    return "teacher" in this.policy ? this.policy.teacher : this.scene.teacher;
  }
  get cells() {
    return this.policy.layers ? 1 : this.policy.codewords.length;
  }
  /** Show a policy of the scene with its run, if it has one; `numbers` replace its own.
   * @param {Policy} policy @param {Partial<Numbers>} [numbers] */
  show(policy, numbers) {
    this.replay.stop();
    const { replay: run = [], ...own } = policy;
    const copy = policy.layers ? policy : structuredClone(own);
    Object.assign(this.picture, { colours: [], known: {} });
    Object.assign(this, { original: policy, run, policy: copy, moment: -1, dragged: null });
    this.replay.row.hidden = !run.length;
    this.backs.hidden = Boolean(policy.layers);
    if (run.length) this.replay.restart(run.length);
    if (numbers) this.put(numbers);
    this.afresh();
  }
  // -- Changing the policy
  /** A copy of what a reader can change. */
  numbers({ codewords, coefficients } = (
    /** @type {Partial<Numbers>} */
    this.policy
  )) {
    return structuredClone({ codewords, coefficients });
  }
  put(numbers) {
    Object.assign(this.policy, this.numbers(numbers));
  }
  /** Forget all gestures. */
  afresh() {
    Object.assign(this, { base: null, past: [], armed: false, kept: this.numbers() });
    this.changed(true);
  }
  /** After every change of a number. Before the first of a gesture, keep what it was. */
  edited() {
    if (this.armed) {
      this.past.push(this.kept);
      Object.assign(this, { armed: false, base: this.results });
    }
    this.kept = this.numbers();
    this.changed(true);
  }
  /** Take other numbers, as one gesture. */
  take(numbers) {
    this.replay.stop();
    this.put(numbers);
    this.armed = true;
    this.edited();
    this.settle();
  }
  undo() {
    const before = this.past.pop();
    if (!before) return;
    this.take(before);
    this.past.pop();
  }
  /** A gesture is finished: tell it once the picture shows it. */
  settle() {
    requestAnimationFrame(() => requestAnimationFrame(() => this.settled(this)));
  }
  /** The same once keys rest: the next one begins another gesture. */
  soon() {
    clearTimeout(this.still);
    this.still = setTimeout(() => {
      this.armed = true;
      this.settle();
    }, 400);
  }
  // -- Everything that depends on policy and state
  /** Schedule an update: of everything if the `policy` changed. */
  changed(policy = false) {
    this.renewed ||= policy;
    this.waiting ||= requestAnimationFrame(() => {
      const { renewed } = this;
      Object.assign(this, { waiting: 0, renewed: false });
      this.redo(renewed);
    });
  }
  redo(renewed = true) {
    if (renewed) this.judge(IN_MOTION);
    if (renewed) this.mapped = null;
    this.cell = act(this.scene, this.policy, this.task.see(this.asked)).cell;
    this.played = this.policy.episode ?? rollout(this.scene, this.policy, this.asked, true);
    if (!this.form.contains(document.activeElement)) this.fill();
    this.draw();
    this.speak();
  }
  /** Run an episode from every start, or as many as `budget` ms allow. */
  judge(budget = Infinity) {
    const { scene, policy } = this, n = scene.starts.length, begun = performance.now();
    this.failing.clear();
    if (policy.layers) {
      this.results = { played: n, ...policy.results };
      return;
    }
    ready(policy);
    let [played, sum] = [0, 0];
    for (; played < n && (!played || performance.now() - begun < budget); played++) {
      const i = played * STRIDE % n, { total, outcome, last } = rollout(scene, policy, scene.starts[i]);
      if (scene.lost.includes(outcome)) this.failing.set(i, last);
      sum += total;
    }
    const failures = Math.round(this.failing.size / played * n);
    this.results = { played, failures, mean: sum / played };
  }
  fill() {
    if (this.policy.layers) return this.form.replaceChildren();
    const lines = equations(this, () => this.edited());
    const title = this.cells > 1 ? `Change cell ${this.cell}` : "Change the map";
    this.form.replaceChildren(element("fieldset", {}, element("legend", {}, title), ...lines));
  }
  speak() {
    const moving = this.replay.playing || this.dragged !== null;
    this.said.setAttribute("aria-live", moving ? "off" : "polite");
    this.result.textContent = resultOf(this);
    this.from.textContent = episodeOf(this);
    if (this.answer.isConnected) this.answer.replaceChildren(...answerOf(this));
    this.legend.replaceChildren(...legendOf(this));
    this.note.textContent = noteOf(this);
    this.replay.tell();
    this.told(this);
  }
  /** Draw. Until the picture rests, the map has few points, and not all starts are played. */
  draw() {
    this.picture.begin();
    if (this.mapped !== this.cell) {
      drawMap(this, COARSE);
      this.mapped = this.cell;
      clearTimeout(this.later);
      this.later = setTimeout(() => this.finish(), 120);
    }
    drawAll(this);
    const fade = () => {
      this.fading = 0;
      if (!this.waiting) this.draw();
    };
    if (this.flashes.length) this.fading ||= requestAnimationFrame(fade);
  }
  finish() {
    if (this.waiting) return;
    if (this.results.played < this.scene.starts.length) this.judge();
    drawMap(this, FINE);
    drawAll(this);
    this.speak();
  }
  // -- The run
  /** Show moment i of the run, and say what changed. */
  turn(i) {
    const { n, codewords } = this.run[i];
    const moments = this.run.slice(Math.min(this.moment + 1, i), i + 1), happened = moments.flatMap(({ events }) => events), now = performance.now();
    if (this.moment >= 0 && !this.replay.slow)
      this.flashes.push(...happened.map((event) => ({ ...event, since: now })));
    this.moment = i;
    this.put(this.run[i]);
    this.afresh();
    const last = this.run.slice(0, i + 1).findLast(({ events }) => events.length), since = last && last.n < n ? `, since iteration ${last.n}` : "", why = last?.events.map((event) => `
${causeOf(event, this.original.limits)}`) ?? [];
    return `iteration ${n}: ${count(codewords.length, "cell")}${since}${why.join("")}`;
  }
  /** For how many milliseconds a moment of the run stays: with a change, longer. */
  lasts(i) {
    const changes = this.run.filter(({ events }) => events.length).length, pause = Math.min(PAUSE, PLAYS / 2 / Math.max(changes, 1)), rest = (PLAYS - pause * changes) / Math.max(this.run.length - changes, 1);
    const [long, short] = this.replay.slow ? [1e3, 0] : [pause, rest];
    return this.run[i].events.length ? long : short;
  }
  /** Go to the next change (1) or the one before (-1). */
  jump(way) {
    const end = way > 0 ? this.run.length - 1 : 0;
    let i = this.replay.at;
    do
      i = i === end ? i : i + way;
    while (i !== end && !this.run[i].events.length);
    this.replay.to(i);
    this.settle();
  }
  // -- Size and colours of the page, pointer and keys
  listen() {
    new ResizeObserver(() => this.waiting || this.draw()).observe(this.canvas);
    const recolour = () => this.canvas.isConnected && this.changed(true);
    const watch = new MutationObserver(recolour);
    for (const part of [document.documentElement, document.body])
      watch.observe(part, { attributeFilter: ["data-theme", "data-jp-theme-light"] });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour);
  }
  pointerdown = (event) => {
    if (event.button || !event.isPrimary) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.canvas.focus();
    const { offsetX: x, offsetY: y } = event, words = this.fixed || this.angular || this.cells === 1 ? [] : this.policy.codewords ?? [], places = words.map((word) => this.picture.at(word)), far = places.map((place) => Math.hypot(place[0] - x, place[1] - y)), least = Math.min(...far);
    this.dragged = least < (event.pointerType === "touch" ? 22 : 12) ? far.indexOf(least) : -1;
    Object.assign(this, { pressed: { x, y, place: places[this.dragged] ?? [x, y] }, armed: true });
    this.replay.stop();
    this.choose(words[this.dragged] ?? this.picture.point(x, y));
  };
  pointermove = (event) => {
    if (this.dragged === null) return;
    const { codewords } = this.policy, { x, y, place } = this.pressed, [dx, dy] = [event.offsetX - x, event.offsetY - y], point = this.picture.point(place[0] + dx, place[1] + dy);
    if (this.dragged < 0 || !codewords) return this.choose(point);
    if (this.armed && Math.hypot(dx, dy) < 4) return;
    codewords[this.dragged] = point;
    this.asked = [...point];
    this.edited();
  };
  choose(point) {
    this.asked = [...point];
    this.base = null;
    this.changed();
  }
  pointerup = () => {
    if (this.dragged !== null) this.settle();
    this.dragged = null;
  };
  keydown = (event) => {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] };
    const way = { ...ways, " ": [0, 0] }[event.key];
    if (!way || event.altKey || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    const { low, high } = this.picture.plane, by = event.shiftKey ? 0.1 : 0.01;
    const moved = (value, i) => clip(value + way[i] * by * (high[i] - low[i]), low[i], high[i]);
    this.choose(this.asked.map(moved));
    this.soon();
  };
};

// ../vsp_course/live/studies.js
var DRAWS = 400;
function random(seed) {
  let state = seed * 2654435769;
  return () => {
    state = state + 1831565813 | 0;
    let mixed2 = Math.imul(state ^ state >>> 15, state | 1);
    mixed2 = mixed2 + Math.imul(mixed2 ^ mixed2 >>> 7, mixed2 | 61) ^ mixed2;
    return ((mixed2 ^ mixed2 >>> 14) >>> 0) / 2 ** 32;
  };
}
var normal = (draw) => Math.sqrt(-2 * Math.log(1 - draw())) * Math.cos(2 * Math.PI * draw());
function interval({ means, sds }, p, n, whole, draw) {
  const chosen = Array.from({ length: p }, () => Math.floor(draw() * means.length)), found = chosen.map((i) => means[i] + sds[i] / Math.sqrt(n) * normal(draw)), mean = found.reduce((sum, value) => sum + value, 0) / p;
  if (!whole) {
    const within = chosen.reduce((sum, i) => sum + sds[i] ** 2, 0) / p, between = found.reduce((sum, value) => sum + (value - mean) ** 2, 0) / p, half = 1.96 * Math.sqrt((within + between) / (p * n));
    return [mean - half, mean + half];
  }
  const drawn = Array.from({ length: DRAWS }, () => {
    let sum = 0;
    for (let i = 0; i < p; i++) sum += found[Math.floor(draw() * p)];
    return sum / p;
  }).sort((a, b) => a - b);
  return [drawn[Math.floor(0.025 * DRAWS)], drawn[Math.ceil(0.975 * DRAWS) - 1]];
}

// ../vsp_course/live/live.js
var PERIODS = { split: 1, merge: 5, freeze: 10 };
var STUDIES = 100;
var AT_MOST = 8;
var FAR = 1.5;
var one = (root, selector) => (
  /** @type {HTMLElement} */
  root.querySelector(selector)
);
var say = (root, name, words) => one(root, `[data-say=${name}]`).textContent = words;
function ask(part, open) {
  const [asked, todo, seen] = [".predict", ".do", ".see"].map((name) => one(part, name));
  asked.addEventListener("change", ({ target }) => {
    const { parentElement: label } = (
      /** @type {HTMLInputElement} */
      target
    );
    asked.setAttribute("disabled", "");
    label?.classList.add("said");
    say(part, "said", ` You said: ${label?.textContent?.trim()}.`);
    todo.hidden = false;
    open(part);
    let left = Number(seen.dataset.after ?? 1);
    for (const kind of ["click", "change"])
      todo.addEventListener(kind, ({ target: target2 }) => {
        const counts = !seen.dataset.after || /** @type {Element} */
        target2.matches("button");
        if (counts && --left <= 0) seen.hidden = false;
      });
  });
}
function viewOf(part, { scene }, numbers, hooks = {}) {
  const policy = { name: "", metric: "manhattan", scale: [1, 1], ...numbers };
  return new Explorer(
    one(part, ".view"),
    { ...scene, policies: [
      /** @type {Linear} */
      policy
    ] },
    { bare: true, ...hooks }
  );
}
var still = () => [0, 0, 0].map(() => [0, 0]);
function borders(part, data) {
  const codewords = [
    [0.25, 0.35],
    [0.7, 0.55]
  ];
  const view = viewOf(part, data, { codewords, coefficients: codewords.map(still) });
  view.starts = false;
  const names = ["manhattan", "euclidean", "chebyshev"];
  const take = (i) => {
    Object.assign(view.policy, { metric: names[i] });
    view.changed(true);
  };
  const list = choice("distance", ["Manhattan", "Euclidean", "largest difference"], take);
  one(part, ".panel").prepend(list);
}
function by_hand(part, data) {
  const { visited } = data;
  let [fitted, alone] = ["", 0];
  const error = ({ scene, policy }) => visited.states.reduce((sum, state, i) => {
    const given = act(scene, policy, state).action;
    return sum + given.reduce((part2, value, k) => part2 + (value - visited.actions[i][k]) ** 2, 0);
  }, 0);
  const told = (view2) => {
    const policy = (
      /** @type {Linear} */
      view2.policy
    ), words2 = JSON.stringify(policy.codewords);
    if (words2 !== fitted) {
      fitted = words2;
      policy.coefficients = refit(policy, visited);
      return view2.changed(true);
    }
    alone ||= error(view2);
    say(part, "share", `${(100 * error(view2) / alone).toFixed(0)} %`);
    say(part, "failing", String(view2.results.failures));
    say(part, "cells", count(view2.cells, "cell"));
  };
  const view = viewOf(part, data, { codewords: [[0.5, 0.5]], coefficients: [still()] }, { told });
  const change = (codewords) => view.take({ codewords, coefficients: codewords.map(still) });
  const words = () => view.numbers().codewords ?? [];
  const more = button("add a cell at the chosen state", () => {
    const there = words().some((word) => String(word) === String(view.asked));
    if (!there && view.cells < AT_MOST) change([...words(), view.asked]);
  });
  const less = button("remove the last", () => view.cells > 1 && change(words().slice(0, -1)));
  one(part, ".panel").prepend(more, less);
}
function shuffled(episodes, run) {
  const draw = random(run), keys = episodes.map(() => draw());
  return [...keys.keys()].sort((i, j) => keys[i] - keys[j]).map((i) => episodes[i]);
}
function toldOf({ n, step, gone }, limits) {
  const episode = `Episode ${n}`;
  if (gone) {
    const causes = gone.map(({ cause }) => digits(cause)).join(", "), none = `no neighbours differ by less than ${limits.difference}`, those = gone.length ? `${count(gone.length, "cell")} gone: maps differ by ${causes}` : none;
    return `${episode}, merging pass: ${those}.`;
  }
  if (!step) return `${episode}: its states are in the buffers, and all maps are fitted again.`;
  const { t, cell, loss, mean, gap, splits } = step;
  const far = `distance ${digits(gap)} ${gap > limits.distance ? ">" : "≤"} ${limits.distance}`, bad = `mean so far ${digits(mean)} ${mean > limits.loss ? ">" : "≤"} ${limits.loss}`, then = splits ? "Both: a new cell here." : "Not both: no split.";
  return `${episode}, step ${t}, cell ${cell}: loss ${digits(loss)}, ${bad}; ${far}. ${then}`;
}
var Passes = class {
  limits = { loss: 0, distance: 0, difference: 0 };
  partition = new Partition(this.limits, 2);
  /** @type {Generator<Happening>} */
  going;
  /** @type {string[][]} */
  past = [];
  // whole runs
  tries = 0;
  splits = 0;
  merges = 0;
  /** @param {HTMLElement} part @param {Data} data */
  constructor(part, data) {
    this.part = part;
    this.episodes = data.episodes;
    this.view = viewOf(part, data, { codewords: [[0.5, 0.5]], coefficients: [still()] });
    this.view.fixed = true;
    this.fields = /** @type {HTMLInputElement[]} */
    [...part.querySelectorAll("[data-limit]")];
    for (const field2 of this.fields) field2.addEventListener("change", () => this.begin());
    one(part, ".steps").append(
      button("next step", () => this.go(() => true)),
      button("next split", () => this.go(({ step }) => step?.splits)),
      button("next merge", () => this.go(({ gone }) => gone?.length)),
      button("next episode", () => this.go(({ step, gone }) => !step && !gone)),
      button("start anew", () => this.begin())
    );
    const answers = ["…", "more cells", "as many", "fewer cells"];
    this.expected = choice("I expect", answers, () => this.wait());
    this.whole = button("a whole run of 100 episodes", () => this.run());
    one(part, ".whole").append(this.expected, this.whole);
    this.wait();
    this.begin();
  }
  get said() {
    return (
      /** @type {HTMLSelectElement} */
      one(this.expected, "select")
    );
  }
  /** Ask before each run but the first. */
  wait() {
    this.expected.hidden = !this.past.length;
    this.whole.disabled = this.past.length > 0 && !this.said.selectedIndex;
  }
  begin() {
    for (const { dataset, valueAsNumber: given } of this.fields)
      this.limits[
        /** @type {keyof Thresholds} */
        dataset.limit
      ] = Math.max(given || 0, 0);
    this.tries += 1;
    this.partition = new Partition({ ...this.limits }, 2);
    this.going = distil(this.partition, shuffled(this.episodes, this.tries), PERIODS);
    this.splits = this.merges = 0;
    this.go(() => true);
  }
  /** Go on until `wanted`, and show where that is. @param {(now: Happening) => unknown} wanted */
  go(wanted) {
    let last;
    for (let now = this.going.next(); !now.done; now = this.going.next()) {
      last = now.value;
      this.splits += Number(last.step?.splits ?? 0);
      this.merges += last.gone?.length ?? 0;
      if (wanted(last)) break;
    }
    if (!last) return say(this.part, "step", "This run is over. Start anew.");
    const { view, part, splits, merges } = this, { codewords, coefficients, limits } = this.partition, states = last.episode.states.slice(0, (last.step?.t ?? Infinity) + 1);
    Object.assign(view.policy, { episode: { states } });
    view.asked = states[states.length - 1];
    view.put({ codewords, coefficients });
    view.afresh();
    say(part, "step", toldOf(last, limits));
    const cells = count(codewords.length, "cell");
    say(part, "events", `${cells}, ${count(splits, "split")}, ${merges} merged.`);
  }
  run() {
    this.begin();
    this.go(() => false);
    this.view.judge();
    const { past, limits, splits, merges, view, said } = this, numbers = [splits, merges, view.cells, view.results.failures], words = past.length ? said.selectedOptions[0].text : "";
    const set = Object.values(limits).map(String);
    past.push([`run ${past.length + 1}`, ...set, words, ...numbers.map(String)]);
    const head = [...Object.keys(limits), "I expected", "splits", "merged", "cells", "fail"];
    one(this.part, ".runs").replaceChildren(table(head, past));
    said.selectedIndex = 0;
    this.wait();
  }
};
function intervals(part, { reruns }) {
  const canvas = (
    /** @type {HTMLCanvasElement} */
    one(part, "canvas")
  ), sizes = { policies: 8, episodes: 100, whole: 0 };
  const past = (
    /** @type {string[][]} */
    []
  );
  let seed = 0;
  const truth = reruns.means.reduce((sum, mean) => sum + mean, 0) / reruns.means.length;
  const go = button(`${STUDIES} studies`, () => {
    const draw = random(++seed), { policies, episodes, whole } = sizes;
    const found = Array.from(
      { length: STUDIES },
      () => interval(reruns, policies, episodes, whole > 0, draw)
    );
    const hold = found.filter(([low, high]) => low <= truth && truth <= high).length;
    drawIntervals(canvas, found, truth);
    canvas.setAttribute("aria-label", `${STUDIES} intervals; ${hold} hold the true mean`);
    const how = whole ? "policies drawn again" : "all episodes";
    const width = found.reduce((sum, [low, high]) => sum + high - low, 0) / STUDIES;
    past.push([how, ...[policies, episodes].map(String), digits(width), String(hold)]);
    const head = ["policies", "episodes", "mean width", "hold the truth"];
    one(part, ".runs").replaceChildren(table(head, past.slice(-8)));
  });
  const pick = (label, name, values, at) => choice(label, values.map(String), (i) => sizes[name] = values[i], at);
  const ways = ["all episodes, as if independent", "policies, drawn again (3.3)"];
  one(part, ".panel").prepend(
    pick("policies", "policies", [4, 8, 16, 30], 1),
    pick("episodes of each", "episodes", [20, 100, 1e3], 1),
    choice("interval from", ways, (i) => sizes.whole = i),
    go
  );
}
function drawIntervals(canvas, found, truth) {
  const [wide, high, ratio] = [canvas.clientWidth || 440, 440, devicePixelRatio], ctx = (
    /** @type {CanvasRenderingContext2D} */
    canvas.getContext("2d")
  ), style = getComputedStyle(canvas), tone = (name) => style.getPropertyValue(`--vsp-${name}`).trim();
  Object.assign(canvas, { width: wide * ratio, height: high * ratio });
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  const x = (value) => wide / 2 + (value - truth) / FAR * (wide / 2 - 12);
  const sorted = [...found].sort((a, b) => a[0] + a[1] - b[0] - b[1]);
  sorted.forEach(([low, top], i) => {
    const misses = truth < low || truth > top;
    ctx.fillStyle = tone(misses ? "failing" : "start");
    ctx.fillRect(x(low), 24 + 4 * i, Math.max(x(top) - x(low), 2), misses ? 3 : 1.5);
  });
  ctx.fillStyle = tone("ink");
  ctx.fillRect(x(truth) - 0.75, 20, 1.5, 4 * found.length + 8);
  ctx.font = `13px ${style.fontFamily}`;
  ctx.textAlign = "center";
  ctx.fillText(`true mean return ${truth.toFixed(2)}`, wide / 2, 14);
  for (const by of [-1, 1]) ctx.fillText(digits(truth + by), x(truth + by), 14);
}
function begin() {
  const data = JSON.parse(one(document, "#live-data").textContent ?? ""), all = (name) => data.episodes.flatMap((episode) => episode[name]);
  data.visited = { states: all("states"), actions: all("actions") };
  const parts = { borders, by_hand, passes: (part, data2) => new Passes(part, data2), intervals };
  for (const [name, open] of Object.entries(parts))
    ask(one(document, `#${name}`), (part) => open(part, data));
}
export {
  begin
};
