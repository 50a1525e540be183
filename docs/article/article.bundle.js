// Made by npm --prefix docs run build

// ../vsp/show/explorer/model.js
var TINTS = 8;
var ROUNDED = 1e-4;
var clip = (value, low, high) => Math.min(Math.max(value, low), high);
var sum = (values) => values.reduce((total, value) => total + value, 0);
var dot = (one2, other) => one2.reduce((total, value, i) => total + value * other[i], 0);
var less = (one2, other) => one2.map((value, i) => value - other[i]);
var ORDERS = { manhattan: 1, euclidean: 2, chebyshev: null };
function ready(policy) {
  const { codewords, scale, metric, order = ORDERS[metric] } = policy;
  if (order === void 0) throw new Error(`the metric ${metric} has no known order`);
  policy.power = order ?? Infinity;
  policy.scaled = Float64Array.from(
    codewords.flatMap((word) => word.map((value, i) => value / scale[i]))
  );
  policy.place = new Float64Array(scale.length);
  policy.far = new Float64Array(codewords.length);
  return policy;
}
function cellOf({ scaled, scale, power, place, far }, seen, slack = 0) {
  const d = scale.length, plain = power === 1 || power === 2 || power === Infinity;
  let best = 0;
  for (let i = 0; i < d; i++) place[i] = seen[i] / scale[i];
  for (let j = 0, at = 0; j < far.length; j++) {
    let sum2 = 0;
    for (let i = 0; i < d; i++, at++) {
      const gap = Math.abs(place[i] - scaled[at]);
      if (power === 2) sum2 += gap * gap;
      else if (power === 1) sum2 += gap;
      else if (power !== Infinity) sum2 += gap ** power;
      else if (gap > sum2) sum2 = gap;
    }
    far[j] = plain ? sum2 : sum2 ** (1 / power);
    if (far[j] < far[best] - slack) best = j;
  }
  return best;
}
function raw(rows, seen, k) {
  let sum2 = rows[seen.length][k];
  for (let i = 0; i < seen.length; i++) sum2 += seen[i] * rows[i][k];
  return sum2;
}
function act({ task }, policy, seen) {
  const cell = policy.layers ? 0 : cellOf(policy, seen);
  const given = policy.layers ? output(policy, seen) : task.outputs.map((_, k) => raw(policy.coefficients[cell], seen, k));
  const action = given.map((value, k) => clip(value, task.actionLow[k], task.actionHigh[k]));
  return { cell, raw: given, action };
}
var floats = (text) => new Float32Array(Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0)).buffer);
function network({ sizes, weights }) {
  const numbers = Float64Array.from(floats(weights));
  let at = 0;
  const take = (count2) => numbers.subarray(at, at += count2);
  const layers = sizes.slice(1).map((n, i) => {
    const rows = take(n * sizes[i]), turned = rows.map((_, w) => rows[w % n * sizes[i] + Math.floor(w / n)]);
    return { weights: turned, biases: take(n) };
  });
  return { layers };
}
function output({ layers }, seen) {
  let values = Float64Array.from(seen, Math.fround);
  layers.forEach(({ weights, biases }, layer) => {
    const sums = biases.slice(), n = sums.length;
    values.forEach((value, i) => {
      if (value) for (let j = 0, at = i * n; j < n; j++, at++) sums[j] += weights[at] * value;
    });
    values = sums.map((sum2) => layer === layers.length - 1 ? Math.tanh(sum2) : Math.max(sum2, 0));
  });
  return [...values];
}
var TASKS = {
  "SimpleGoal-v0": {
    start: (draw) => [draw(), draw()],
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
    start: (draw) => [-0.6 + 0.2 * draw(), 0].map(Math.fround),
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
    place: ([x, y, speed]) => [Math.atan2(y, x), speed],
    step([angle, speed], [torque]) {
      const turn = 2 * Math.PI, upright = ((angle + Math.PI) % turn + turn) % turn - Math.PI;
      const cost = upright ** 2 + 0.1 * speed ** 2 + 1e-3 * torque ** 2;
      const next = clip(speed + (15 * Math.sin(angle) + 3 * clip(torque, -2, 2)) * 0.05, -8, 8);
      return [[angle + next * 0.05, next], -cost, 0];
    }
  }
};
var dynamics = (name2) => ({ ...PLAIN, ...TASKS[name2] });
var PLAIN = { start: () => [], see: (state) => state, place: (seen) => seen, places: [] };
function random(seed) {
  let state = seed * 2654435769;
  return () => {
    state = state + 1831565813 | 0;
    let mixed2 = Math.imul(state ^ state >>> 15, state | 1);
    mixed2 = mixed2 + Math.imul(mixed2 ^ mixed2 >>> 7, mixed2 | 61) ^ mixed2;
    return ((mixed2 ^ mixed2 >>> 14) >>> 0) / 2 ** 32;
  };
}
function* taught(scene, teacher, draw) {
  const { see, start } = dynamics(scene.task.name);
  while (true) {
    const { states, actions } = rollout(scene, teacher, start(draw));
    yield { states: states.slice(0, -1).map(see), actions };
  }
}
function rollout(scene, policy, start) {
  const { see, step: step2 } = dynamics(scene.task.name), states = [start], actions = (
    /** @type {Vector[]} */
    []
  );
  let [state, total, reward, outcome, last] = [start, 0, 0, 0, 0];
  for (let t = 0; t < scene.task.maxSteps && !outcome; t++) {
    const { cell, action } = act(scene, policy, see(state));
    [state, reward, outcome] = step2(state, action);
    last = cell;
    total += reward;
    states.push(state);
    actions.push(action);
  }
  return { total, outcome, last, states, actions };
}
function leastSquares(a, b) {
  const unit = (i) => a[0].map((_, j) => +(i === j));
  const columns = a[0].map((_, i) => [...a.map((row2) => row2[i]), ...unit(i)]);
  const own = (u, v) => a.reduce((total, _, row2) => total + u[row2] * v[row2], 0);
  for (let sweep = 0, turned = true; turned && sweep < 60; sweep++) {
    turned = false;
    for (const [i, u] of columns.entries())
      for (const v of columns.slice(i + 1)) {
        const [p, q, both] = [own(u, u), own(v, v), own(u, v)];
        if (Math.abs(both) <= 1e-16 * Math.sqrt(p * q)) continue;
        const angle = Math.atan2(2 * both, p - q) / 2, [cosine, sine] = [Math.cos(angle), Math.sin(angle)];
        for (const [k, x] of u.entries())
          [u[k], v[k]] = [cosine * x + sine * v[k], cosine * v[k] - sine * x];
        turned = true;
      }
  }
  const sizes = columns.map((u) => Math.sqrt(own(u, u))), least = Math.max(...sizes) * Number.EPSILON * Math.max(a.length, a[0].length), whole = columns.filter((_, i) => sizes[i] > least), goals = b[0].map((_, k) => b.map((values) => values[k])), shares = goals.map((goal) => whole.map((u) => own(u, goal) / own(u, u)));
  return a[0].map((_, i) => shares.map((one2) => dot(whole.map((u) => u[a.length + i]), one2)));
}
function refit(policy, { states, actions }, cells = policy.codewords.keys()) {
  const own = states.map((state) => cellOf(policy, state)), maps = structuredClone(policy.coefficients);
  for (const cell of cells) {
    const inputs = states.filter((_, i) => own[i] === cell).map((state) => [...state, 1]);
    const goals = actions.filter((_, i) => own[i] === cell);
    if (goals.length) maps[cell] = leastSquares(inputs, goals);
  }
  return maps;
}
var squares = (ones, others) => sum(ones.map((one2, i) => less(one2, others[i])).map((off) => dot(off, off)));
var errorOf = (scene, policy, { states, actions }) => squares(states.map((state) => act(scene, policy, state).action), actions);
function rSquared(scene, policy, visited) {
  const { actions } = visited, means = actions[0].map((_, k) => sum(actions.map((action) => action[k])) / actions.length);
  return 1 - errorOf(scene, policy, visited) / squares(actions, actions.map(() => means));
}
function births(scale) {
  let [living, count2] = [
    /** @type {Born[]} */
    [],
    0
  ];
  const tintOf = (codeword) => {
    const far = Array(TINTS).fill(Infinity);
    for (const { codeword: other, tint } of living) {
      const gaps = less(codeword, other).map((gap, i) => gap / scale[i]);
      far[tint] = Math.min(far[tint], Math.hypot(...gaps));
    }
    return far.indexOf(Math.max(...far));
  };
  const found = (codeword) => {
    const near = (gap) => Math.abs(gap) < ROUNDED, known = living.find((one2) => less(one2.codeword, codeword).every(near));
    if (known) return known;
    const made = { codeword, born: count2++, tint: tintOf(codeword) };
    living.push(made);
    return made;
  };
  return (codewords, changes = (
    /** @type {Change[]} */
    []
  )) => {
    const first = count2 ? [] : codewords.slice(0, 1), splits = changes.filter(({ kind }) => kind === "split").map(({ codeword }) => codeword);
    for (const codeword of [...first, ...splits]) found(codeword);
    living = codewords.map(found);
    return { born: living.map(({ born }) => born), tints: living.map(({ tint }) => tint) };
  };
}
function name(policy) {
  if (policy.layers || policy.tints?.length === policy.codewords.length) return;
  const of = births(policy.scale);
  for (const moment of policy.replay ?? [])
    Object.assign(moment, of(moment.codewords, moment.events));
  Object.assign(policy, of(policy.codewords));
}
var numberOf = ({ born }, cell) => born?.[cell] ?? cell;

// ../vsp/show/explorer/controls.js
var [CHANGED, SAME] = [250, 30];
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name2, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(
      name2,
      /** @type {any} */
      value
    );
    else if (value !== false) made.setAttribute(name2, value === true ? "" : String(value));
  }
  made.append(...children);
  return made;
}
var one = (root, selector) => (
  /** @type {T} */
  root.querySelector(selector)
);
var textOf = async (inner, file = "") => inner.textContent || (await fetch(file)).text();
var button = (label, click, name2 = "") => element("button", { type: "button", class: name2, click }, label);
var row = (...children) => element("div", { class: "vsp-row" }, ...children);
var minus = (text) => text.replaceAll("-", "−");
var count = (n, thing) => `${n} ${thing}${n === 1 ? "" : "s"}`;
var digits = (value) => Math.abs(value) < 5e-4 ? "0.000" : minus(value.toFixed(3));
function table(head, rows) {
  const cells = (tag, scope, texts) => texts.map((text) => element(tag, { scope }, text));
  const lines = [[element("td"), ...cells("th", "col", head)]];
  for (const [name2, ...values] of rows)
    lines.push([...cells("th", "row", [name2]), ...cells("td", false, values)]);
  return element("table", {}, ...lines.map((line) => element("tr", {}, ...line)));
}
function choice(label, options, take, chosen = options[0]) {
  const lines = options.map((option, value) => {
    const about = { value, selected: option === chosen };
    return element("option", about, String(Object(option).name ?? option));
  });
  const list = element("select", { change: () => take(options[+list.value]) }, ...lines);
  return element("label", {}, `${label} `, list);
}
function touched(take, about) {
  const touch = ({ offsetX, buttons, type, target }) => {
    const { clientWidth } = (
      /** @type {Element} */
      target
    );
    if (buttons || type === "pointerdown") take(clip(offsetX / clientWidth, 0, 1));
  };
  return element("canvas", { role: "img", pointerdown: touch, pointermove: touch, ...about });
}
var LEAST_DRAG = 4;
var fits = (value, { least = -1e6, most = 1e6, whole }) => value >= least && value <= most && (!whole || Number.isInteger(value));
function field(label, list, i, changed, range) {
  const { step: step2, times, whole } = range;
  let from = { x: 0, value: 0 };
  const value = () => +(times ? list[i] : +list[i].toFixed(3)).toPrecision(times ? 3 : 4);
  const take = (given) => {
    if (!fits(given, range)) return;
    list[i] = given;
    changed();
  };
  const change = () => made.value = String(value());
  const pointerdown = ({ clientX: x, pointerId }) => {
    from = { x, value: list[i] };
    made.setPointerCapture(pointerId);
  };
  const pointermove = ({ clientX, buttons }) => {
    const by = Math.trunc((clientX - from.x) / LEAST_DRAG);
    if (!buttons || !by) return;
    const moved = times ? from.value * 1.1 ** by : from.value + by * step2 / 2;
    take(whole ? Math.round(moved) : +(times ? moved.toPrecision(2) : moved.toFixed(2)));
    change();
  };
  const about = { type: "number", step: step2, value: value(), "aria-label": label };
  const acts = { input: () => take(made.valueAsNumber), change, pointerdown, pointermove };
  const made = element("input", { ...about, ...acts });
  return made;
}
function equations({ scene, policy, cells, angular, fixed }, cell, changed) {
  if (policy.layers) return [];
  const { task, plane } = scene, [rows, codeword] = [policy.coefficients[cell], policy.codewords[cell]];
  const term = (label, list, i, step2, before, after = "") => {
    const written = field(label, list, i, changed, { step: step2 });
    return element("span", { class: "vsp-term" }, before, written, after);
  };
  const line = (name2, terms) => element("div", { class: "vsp-equation" }, `${name2} `, ...terms);
  const places = task.inputs.map((name2, i) => {
    const range = angular ? 2 : plane.high[i] - plane.low[i];
    return term(`codeword: ${name2}`, codeword, i, +(range / 50).toPrecision(1), `${name2} = `);
  });
  const lines = task.outputs.map((output2, k) => {
    const terms = [...task.inputs, "bias"].map(
      (name2, i) => term(`${output2}: ${name2}`, rows[i], k, 0.1, "", name2 === "bias" ? "" : `${name2} +`)
    );
    return line(`${output2} =`, terms);
  });
  return cells > 1 && !fixed ? [line("codeword", places), ...lines] : lines;
}
var Player = class {
  playing = false;
  slow = matchMedia("(prefers-reduced-motion: reduce)").matches;
  // one picture a second
  said = element("span", { class: "vsp-said" });
  toggle = button("play", () => this.playing ? this.stop(true) : this.start());
  /** @type {HTMLInputElement} */
  slider;
  constructor(view) {
    this.view = view;
    const soon = () => view.soon(), acts = { input: () => this.go(this.at), change: soon };
    this.slider = element("input", { type: "range", min: 0, "aria-label": "iteration", ...acts });
    this.time = touched((share) => this.touch(share), { "aria-label": "failures", pointerup: soon });
    const back = button("previous change", () => this.jump(-1)), on = button("next change", () => this.jump(1));
    this.line = element("div", { class: "vsp-line" }, this.time, this.slider);
    this.row = row(this.toggle, back, on, this.said);
  }
  get at() {
    return +this.slider.value;
  }
  get last() {
    return this.view.run.length - 1;
  }
  /** Show a moment of the run. */
  to(i) {
    this.slider.value = String(i);
    this.view.put(this.view.run[i]);
    this.view.afresh();
  }
  /** The same, as a gesture. */
  go(i) {
    this.stop();
    this.to(i);
  }
  /** The run has more moments, or is another one: go to its end, if `follow`. */
  grow(follow = this.at === +this.slider.max) {
    this.slider.max = String(this.last);
    if (follow) this.to(this.last);
    else this.view.changed();
  }
  /** Go to a share of the run; nearby it takes the moment with the most failures.
   * @param {number} share */
  touch(share) {
    const { run } = this.view, at = Math.round(share * this.last), reach = Math.ceil(this.last / 100), near = [...run.keys()].slice(Math.max(at - reach, 0), at + reach + 1), fails = (i) => run[i].failures ?? 0;
    this.go(near.reduce((best, i) => fails(i) > fails(best) ? i : best, at));
  }
  /** Go to the next change (1) or the one before (-1). */
  jump(way) {
    const { run } = this.view, stops = [...run.keys()].filter((i) => (i - this.at) * way > 0 && run[i].events.length);
    this.go(way > 0 ? stops[0] ?? this.last : stops.at(-1) ?? 0);
    this.view.settle();
  }
  /** Play: a moment with a change stays longer. */
  start() {
    const { run } = this.view, [long, short] = this.slow ? [1e3, 0] : [CHANGED, SAME], lasts = (i) => run[i].events.length ? long : short;
    this.playing = true;
    this.toggle.textContent = "pause";
    if (this.at === this.last) this.to(0);
    let [before, waited] = [performance.now(), 0];
    const frame = (now) => {
      if (!this.playing || !this.slider.isConnected) return;
      waited += now - before;
      before = now;
      let i = this.at;
      for (; i < this.last && waited >= lasts(i); i++) waited -= lasts(i);
      if (i > this.at) this.to(i);
      if (this.at < this.last) return requestAnimationFrame(frame);
      this.stop(true);
    };
    requestAnimationFrame(frame);
  }
  stop(gesture = false) {
    this.playing = false;
    this.toggle.textContent = "play";
    if (gesture) this.view.settle();
  }
};

// ../vsp/show/explorer/picture.js
var ARROWS = 14;
var ON_BORDER = 1e-9;
var SMALL = 330;
var [TICK, END] = [10, 8];
var CELLS = "#56b4e9 #ece133 #73502e #581799 #95e6bd #732e62 #86bf4d #2222e6".split(" ");
var [LEFT, RIGHT] = ["#7f4fa8", "#c9730f"];
var CLEAR = "transparent";
var rgb = (colour) => [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));
var mixed = (colour, ground, share) => colour.map((part, i) => ground[i] + share * (part - ground[i]));
var css = (colour) => `rgb(${colour.join(" ")})`;
function begun(canvas, high) {
  const [wide, ratio] = [canvas.clientWidth || 440, devicePixelRatio], style = getComputedStyle(canvas), ctx = (
    /** @type {CanvasRenderingContext2D} */
    canvas.getContext("2d")
  );
  canvas.width = Math.round(wide * ratio);
  canvas.height = Math.round((high ?? wide) * ratio);
  ctx.scale(ratio, ratio);
  ctx.font = `${wide < SMALL ? 11 : 13}px ${style.fontFamily}`;
  const names = ["paper", "ink", "start", "goal", "pit", "failing", "teacher"], tones = names.map((name2) => [name2, style.getPropertyValue(`--vsp-${name2}`).trim() || "#888888"]);
  return { ctx, wide, tones: Object.fromEntries(tones) };
}
var Picture = class {
  map = new OffscreenCanvas(1, 1);
  edge = { left: 0, right: 0, top: 0, bottom: 0 };
  side = 0;
  wide = 0;
  high = 0;
  /** @type {Record<string, string>} */
  tones = {};
  /** @type {CanvasRenderingContext2D} */
  ctx;
  /** `bare`: without axes. @param {HTMLCanvasElement} canvas @param {Plane} plane */
  constructor(canvas, plane, bare = false) {
    this.canvas = canvas;
    this.plane = plane;
    this.bare = bare;
  }
  /** Take size and colours from the page, and clear: all is cut off at the frame, but `axes`. */
  begin() {
    const { ctx, wide: side, tones } = begun(this.canvas), [left, right] = side < SMALL ? [46, 4] : [54, 8];
    Object.assign(this, { ctx, side, tones });
    if (!this.bare) this.edge = { left, right, top: right, bottom: left };
    this.wide = side - this.edge.left - this.edge.right;
    this.high = side - this.edge.top - this.edge.bottom;
    ctx.save();
    ctx.beginPath();
    ctx.rect(this.edge.left, this.edge.top, this.wide, this.high);
    ctx.clip();
  }
  shows(at) {
    const { low, high } = this.plane;
    return at.length === 2 && at.every((value, i) => value >= low[i] && value <= high[i]);
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
    const { low, high } = this.plane, shares = [(px - this.edge.left) / this.wide, 1 - (py - this.edge.top) / this.high];
    return this.spot(shares).map((value, i) => {
      const digits2 = clip(2 - Math.floor(Math.log10(high[i] - low[i])), 2, 12);
      return +clip(value, low[i], high[i]).toFixed(digits2);
    });
  }
  /** The middle of one of n by n parts of the plane, counted from the top left.
   * @param {number} at @param {number} n */
  middle(at, n) {
    return this.spot([(at % n + 0.5) / n, (n - 0.5 - Math.floor(at / n)) / n]);
  }
  /** The point of the plane at shares of its width and height. @param {Vector} shares */
  spot(shares) {
    const { low, high } = this.plane;
    return shares.map((share, i) => low[i] + share * (high[i] - low[i]));
  }
  /** @type {(words: string, x: number, y: number, align?: CanvasTextAlign) => void} */
  text(words2, x, y, align = "center") {
    const { ctx, tones } = this;
    Object.assign(ctx, { strokeStyle: tones.paper, fillStyle: tones.ink, lineWidth: 3 });
    ctx.textAlign = align;
    ctx.strokeText(words2, x, y);
    ctx.fillText(words2, x, y);
  }
  place({ name: name2, from, to }) {
    const [left, bottom] = this.at(from), [right, top] = this.at(to);
    this.ctx.fillStyle = (name2 === "pit" ? this.tones.pit : this.tones.goal) + "77";
    this.ctx.fillRect(left, top, right - left, bottom - top);
  }
  /** Name a place: at its middle, or at the top of the frame that it fills. */
  name({ name: name2, from, to }) {
    const { low, high } = this.plane, fills = from.every((value, i) => value <= low[i] && to[i] >= high[i]), [x, y] = this.at(from.map((value, i) => (value + to[i]) / 2)), half = this.ctx.measureText(name2).width / 2 + 3;
    if (fills) this.text(name2, this.edge.left + this.wide / 2, this.edge.top + 16);
    else this.text(name2, Math.max(x, this.edge.left + half), y + 4);
  }
  /** @param {Vector[]} points @param {string} colour */
  line(points, colour, width = 2) {
    const { ctx } = this;
    ctx.beginPath();
    let before = Infinity;
    for (const [x, y] of points.map((point) => this.at(point))) {
      const far = Math.abs(x - before) > this.wide / 2;
      ctx[far ? "moveTo" : "lineTo"](x, y);
      before = x;
    }
    Object.assign(ctx, { strokeStyle: colour, lineWidth: width });
    ctx.stroke();
  }
  /** Draw arrows between pixels. @param {Arrow[]} arrows @param {number} head its length
   * @param {string} colour @param {number} width */
  arrows(arrows, head, colour, width) {
    const { ctx } = this;
    ctx.beginPath();
    for (const { start, tip: [x, y] } of arrows) {
      const turn = Math.atan2(y - start[1], x - start[0]);
      ctx.moveTo(start[0], start[1]);
      for (const side of [-2.6, 2.6]) {
        ctx.lineTo(x, y);
        ctx.lineTo(x + head * Math.cos(turn + side), y + head * Math.sin(turn + side));
      }
    }
    Object.assign(ctx, { strokeStyle: colour, lineWidth: width });
    ctx.stroke();
  }
  /** @param {Vector[]} shapes @param {string} colour @param {string} [border] */
  polygons(shapes, colour, border = colour, width = 0.5) {
    const { ctx } = this;
    ctx.beginPath();
    for (const shape of shapes) {
      for (let i = 0; i < shape.length; i += 2) {
        const [x, y] = this.at([shape[i], shape[i + 1]]);
        ctx[i ? "lineTo" : "moveTo"](x, y);
      }
      ctx.closePath();
    }
    Object.assign(ctx, { fillStyle: colour, strokeStyle: border, lineWidth: width });
    ctx.fill();
    ctx.stroke();
  }
  /** @param {Vector} point @param {number} radius
   * @param {string} [fill] @param {string} [stroke] */
  dot(point, radius, fill = CLEAR, stroke = CLEAR, width = 1.5) {
    const { ctx } = this, [x, y] = this.at(point);
    ctx.beginPath();
    ctx.arc(x, y, radius, 0, 7);
    Object.assign(ctx, { fillStyle: fill, strokeStyle: stroke, lineWidth: width });
    ctx.fill();
    ctx.stroke();
  }
  axes() {
    const { ctx, plane, edge } = this, { low, high, labels } = plane, bottom = edge.top + this.high, sides = (
      /** @type {const} */
      ["left", "center", "right"]
    );
    ctx.restore();
    Object.assign(ctx, { strokeStyle: this.tones.ink, lineWidth: 1 });
    ctx.strokeRect(edge.left, edge.top, this.wide, this.high);
    for (const share of [0, 0.5, 1]) {
      const [first, second] = low.map((value, i) => tick(value, high[i] - value, share));
      const y = bottom - share * this.high + [0, 4, 10][2 * share];
      this.text(first, edge.left + share * this.wide, bottom + 15, sides[2 * share]);
      if (share !== 0.5 || second.length < 5 && this.side > SMALL)
        this.text(second, edge.left - 5, y, "right");
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
  const { picture, scene, policy } = view, cells = new Int16Array(n * n), image = new ImageData(n, n), pixels = new Uint32Array(image.data.buffer), tints = tintsOf(view), { far } = (
    /** @type {Linear} */
    policy
  ), by = [...Array(129).keys()].map((i) => (i - 64) / 64), hues = by.map((by2) => shades(view, by2 < 0 ? LEFT : RIGHT, 0.7 * Math.abs(by2))), bent = !straight(view);
  for (let at = 0; at < n * n; at++) {
    const seen = view.task.see(picture.middle(at, n)), cell = cells[at] = policy.layers ? 0 : cellOf(policy, seen, ON_BORDER), tied = far?.findLastIndex((each) => Math.abs(each - far[cell]) < ON_BORDER), striped = Math.floor((at % n + Math.floor(at / n)) * 50 / n) % 2;
    let hue = tints[striped && tied || cell];
    if (scene.task.outputs.length === 1 && !policy.layers) {
      const push = raw(policy.coefficients[cell], seen, 0);
      hue = hues[Math.round(64 + 64 * clip(push / scene.task.actionHigh[0], -1, 1))];
    }
    const edge = at % n && cells[at - 1] !== cell || at >= n && cells[at - n] !== cell, [red, green, blue] = hue[edge && bent ? 2 : +(view.cells > 1 && cell === view.marked)];
    pixels[at] = 255 << 24 | blue << 16 | green << 8 | red;
  }
  picture.map.width = picture.map.height = n;
  picture.map.getContext("2d")?.putImageData(image, 0, 0);
}
function shades({ picture: { tones } }, hue, share) {
  const [paper, ink] = [tones.paper, tones.ink].map(rgb), plain = mixed(rgb(hue), paper, share);
  return [plain, mixed(ink, plain, 0.13), mixed(ink, plain, 0.5)];
}
function tintsOf(view) {
  const full = view.cells === 1 ? 0.1 : rgb(view.picture.tones.paper)[0] < 128 ? 0.6 : 0.42;
  return (view.policy.tints ?? [0]).map((tint) => shades(view, CELLS[tint], full));
}
var straight = ({ policy, scene: { task, plane } }) => !policy.layers && policy.power === 2 && task.inputs.length === plane.low.length;
function drawCells(view, points) {
  const { picture, policy, scene } = view, { edge, wide, high } = picture, { low: [left, low], high: [right, top] } = picture.plane, plain = straight(view) && scene.task.outputs.length === 2;
  if (points && !plain) drawMap(view, points);
  if (!plain) picture.ctx.drawImage(picture.map, edge.left, edge.top, wide, high);
  if (policy.layers || !straight(view)) return;
  const all2 = [[left, low], [right, low], [right, top], [left, top]], { codewords, scale } = policy;
  tintsOf(view).forEach((hue, i) => {
    const fill = plain ? css(hue[Number(i === view.marked && view.cells > 1)]) : CLEAR, shape = codewords.reduce((left2, other) => nearer(left2, codewords[i], other, scale), all2);
    picture.polygons([shape.flat()], fill, css(hue[2]), 1.5);
  });
}
function nearer(shape, one2, other, scale) {
  const normal = one2.map((value, i) => (other[i] - value) / scale[i] ** 2), middle = one2.map((value, i) => (value + other[i]) / 2), beyond = shape.map((corner) => dot(normal, corner) - dot(normal, middle));
  return shape.flatMap((corner, i) => {
    const [before, from, to] = [shape.at(i - 1) ?? corner, beyond.at(i - 1) ?? 0, beyond[i]], cut2 = before.map((value, k) => value + from / (from - to) * (corner[k] - value));
    return [...from * to < 0 ? [cut2] : [], ...to <= 0 ? [corner] : []];
  });
}
function drawAll(view, points) {
  const { picture, scene, task } = view;
  picture.begin();
  drawCells(view, points);
  const path = view.played.states.slice(0, 250).map(view.place), { paper, ink, failing, start } = picture.tones;
  task.places.forEach((place) => picture.place(place));
  if (view.regions) picture.polygons(view.regions, failing);
  if (scene.task.outputs.length === 2) drawArrows(view);
  for (const [i, place] of view.starts ? scene.starts.map(view.place).entries() : []) {
    const cell = view.failing.get(i);
    if (cell === void 0) picture.dot(place, 1.3, start);
    else if (cell === view.cell) picture.dot(place, 3.4, failing, paper, 1);
    else picture.dot(place, 2.7, paper, failing);
  }
  picture.line(path, paper, 5);
  picture.line(path, ink, 2);
  path.slice(1).forEach((point) => picture.dot(point, 2, ink));
  drawCodewords(view);
  picture.arrows(view.arrows, 9, paper, 6);
  picture.arrows(view.arrows, 9, ink, 3);
  task.places.forEach((place) => picture.name(place));
  if (view.ring) picture.dot(view.ring, 14, CLEAR, failing, 3);
  picture.dot(view.asked, 7, paper, ink);
  picture.dot(view.asked, 2.5, ink);
  picture.axes();
}
function drawArrows(view) {
  const { picture, scene, policy } = view, { teacher, ink } = picture.tones, length = picture.wide / ARROWS * 0.42;
  const arrows = Array.from({ length: ARROWS * ARROWS }, (_, i) => {
    const point = picture.middle(i, ARROWS), [dx, dy] = (policy.arrows?.[i] ?? act(scene, policy, point).action).map((by) => by * length), [x, y] = picture.at(point);
    return { start: [x - dx, y + dy], tip: [x + dx, y - dy] };
  });
  const moving = arrows.filter(({ start: [x, y], tip }) => x !== tip[0] || y !== tip[1]);
  picture.arrows(moving, 4, policy.layers ? teacher : ink, policy.layers ? 1.4 : 1);
}
function ownArrow({ picture, policy, cells }, cell) {
  const { codewords = [], coefficients = [] } = policy, word = cells > 1 ? codewords[cell] : picture.spot([0.5, 0.5]), rows = coefficients[cell], [x, y] = picture.at(word), own = picture.wide / 10, [dx, dy] = [0, 1].map((k) => clip(raw(rows, word, k), -1, 1) * own);
  return { start: [x, y], tip: [x + dx, y - dy], word, rows, own };
}
function drawCodewords(view) {
  const { picture, policy } = view, { paper, ink } = picture.tones;
  if (policy.layers || view.cells === 1) return;
  policy.codewords.forEach((codeword, i) => {
    const point = view.task.place(codeword), [x, y] = picture.at(point);
    picture.dot(point, 5, i === view.marked ? ink : paper, ink);
    if (view.held?.finger && i === view.held.cell) picture.dot(point, 34, CLEAR, ink, 2);
    if (view.cells > 30 && i !== view.marked) return;
    const inner = x > picture.side - 40;
    const [right, down] = [inner ? -9 : 9, y < 28 ? 16 : -6];
    picture.text(String(numberOf(policy, i)), x + right, y + down, inner ? "right" : "left");
  });
}
function drawTime({ run, scene: { starts }, replay: { time: canvas, at } }) {
  const high = canvas.clientHeight, { ctx, wide, tones } = begun(canvas, high), x = (i) => END + i / Math.max(run.length - 1, 1) * (wide - 2 * END), y = (share) => high - TICK - 4 - Math.sqrt(share) * (high - 2 * TICK - 14);
  Object.assign(ctx, { fillStyle: tones.ink, textAlign: "right", strokeStyle: tones.failing });
  for (const share of [0, 1 / 4, 1]) {
    ctx.fillRect(END, y(share), wide - 2 * END, 0.3);
    ctx.fillText(String(Math.round(share * starts.length)), wide - END - 6, y(share) - 3);
  }
  run.forEach(({ events, set }, i) => {
    for (const { kind } of events)
      ctx.fillRect(x(i) - 0.5, kind === "split" ? 0 : high - TICK, 1, TICK);
    ctx.fillRect(x(i) - 0.5, 0, set ? 1.5 : 0, high);
    ctx.fillText(set ?? "", Math.max(x(i) - 4, 160), 36);
  });
  ctx.fillRect(x(at) - 1, 0, 2, high);
  ctx.beginPath();
  run.forEach(({ failures = 0 }, i) => ctx.lineTo(x(i), y(failures / starts.length)));
  ctx.lineWidth = 1.5;
  ctx.stroke();
}

// ../vsp/show/explorer/texts.js
function resultOf({ scene, policy, results, base }) {
  const { played, failures, mean } = results, { teacher } = { ...scene, ...policy }, about = played < scene.starts.length ? "about " : "";
  const both = (before, now) => base ? `${before} → ${about}${now}` : about + now;
  const fails = `${both(base?.failures, failures)} of ${scene.starts.length} fail, mean return `, aim = teacher && !base && !policy.layers ? ` (teacher ${teacher.mean.toFixed(2)})` : "";
  const returned = both(base?.mean.toFixed(2), mean.toFixed(2));
  return minus(`${scene.lost.length ? fails : "mean return "}${returned}${aim}.`);
}
function episodeOf({ policy, cell, cells, asked, played, task, picture: { plane } }) {
  if (!played.states.length) return "";
  const [goal] = task.places, place = task.places[(played.outcome ?? 0) - 1], end = place ? ` to the ${place.name}` : goal ? `, not to the ${goal.name}` : "", size = (i) => Math.floor(Math.log10(plane.high[i] - plane.low[i])), at = asked.map((value, i) => minus(value.toFixed(2 - Math.min(size(i), 0)))).join(", "), where = cells > 1 ? `, in cell ${numberOf(policy, cell)}` : "";
  return `From (${at})${where}: ${count(played.states.length - 1, "step")}${end}.`;
}
function momentOf({ run, replay: { at }, original: { limits } }) {
  if (!run.length) return "";
  const { n, codewords, loss } = run[at], last = run.slice(0, at + 1).findLast(({ events }) => events.length), lossy = loss === void 0 ? "" : `, loss ${loss.toPrecision(2)}`, since = last && last.n < n ? `, since iteration ${last.n}` : "", why = last?.events.map((event) => `
${causeOf(event, limits)}`).join("") ?? "";
  const cells = count(codewords.length, "cell");
  return `iteration ${n}: ${cells}${lossy}${since}${why}`;
}
function causeOf({ kind, codeword, cause }, limits = {}) {
  const { max_pol_loss: most, min_param_distance: least } = limits, at = `${kind} at (${codeword.map((value) => minus(value.toFixed(2))).join(", ")})`, found = cause.toPrecision(3);
  if (kind === "merge")
    return `${at}: maps differ by ${found}${least ? `, below ${least}` : ""}`;
  return `${at}: loss ${found}${most ? `, above ${most}` : ""}; the new map was untrained`;
}
function answerOf({ scene, policy, cell, cells }, seen) {
  if (policy.layers) return [];
  const { inputs, outputs } = scene.task, rows = policy.coefficients[cell], { raw: raw2, action } = act(scene, policy, seen);
  const adds = [...inputs, "bias"].map((name2, i) => {
    const said = name2 === "bias" ? "the bias adds" : `${name2} = ${digits(seen[i])} adds`;
    return [said, ...rows[i].map((weight) => weight * (seen[i] ?? 1))];
  });
  const found = [...adds, ["sum", ...raw2], ["action, within the limits", ...action]];
  const told = found.map(([name2, ...values]) => [name2, ...values.map(digits)]);
  const title = cells > 1 ? `Cell ${numberOf(policy, cell)}, one of ${cells}` : "The map";
  return [element("p", {}, element("b", {}, title)), table(outputs, told)];
}
var noteOf = ({ movable, arrows }) => (movable ? "Drag a codeword to move its cell. " : "") + (arrows.length ? "Drag a thick arrow: its constants follow. " : "") + "Drag a number sideways. Click to choose a state; arrow keys move it.";
function legendOf({ scene, policy, failing, starts, regions, cells, picture, task }) {
  const [output2, second] = scene.task.outputs, fails = starts && failing.size > 0, inside = policy.codewords?.some((word) => picture.shows(task.place(word)));
  const marks = [
    [starts, "start", "start"],
    [fails, "failing", cells > 1 ? "fails; last step in the chosen cell" : "start that fails"],
    [fails && cells > 1, "elsewhere", "fails; last step in another"],
    [regions, "region", "falls into the pit"],
    [second && policy.layers, "taught", "teacher's step"],
    [second && !policy.layers, "step", "step"],
    [!second, "below", `${output2} below 0`],
    [!second, "above", "above 0"],
    [cells > 1 && inside, "codeword", "codeword; filled: of the chosen cell"],
    [true, "chosen", "chosen state, and its episode"]
  ];
  const told = marks.filter(([shown]) => shown);
  return told.map(([, kind, words2]) => element("li", { class: `vsp-${kind}` }, words2));
}

// ../vsp/show/explorer/episodes.js
var N_STEPS = 150;
var STEPS = Array.from({ length: N_STEPS }, (_, n) => (n + 1) / N_STEPS).flatMap((x) => [x, -x]);

// ../vsp/show/explorer/explorer.js
var [COARSE, FINE] = [240, 480];
var IN_MOTION = 8;
var ALL = 4;
var STRIDE = 149;
var LABEL = "Map of the policy. Arrow keys move the chosen state.";
var WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] };
var Explorer = class {
  /** @type {Map<number, number>} */
  failing = /* @__PURE__ */ new Map();
  // of the starts that fail, by index: the cell of their last step
  /** @type {Partial<Numbers>[]} */
  past = [];
  // after each gesture
  /** @type {Vector[] | null} */
  regions = null;
  // polygons to fill
  /** @type {Vector | null} */
  ring = null;
  // a place to mark
  zooming = 0;
  // a frame
  starts = true;
  // whether they are drawn
  fixed = false;
  // whether codewords and arrows cannot be moved
  /** @type {number | null} */
  lit = null;
  // the cell whose equations are touched
  /** @type {Held | null} */
  held = null;
  // what is dragged
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
  armed = false;
  // whether the next change begins a gesture
  writing = false;
  // whether a finger is on a field, which must stay
  /** @type {number | null} */
  mapped;
  // the cell that is marked on the map; null: of another policy
  waiting = 0;
  // for a frame
  /** @type {Record<string, ReturnType<typeof setTimeout>>} */
  timers = {};
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
      )) this.light(null);
    },
    focusin: () => this.armed = true,
    pointerdown: () => this.writing = this.armed = true,
    pointerup: () => this.soon(),
    pointercancel: () => this.soon(),
    pointerleave: () => this.light(null),
    input: () => this.soon()
  });
  backs = row(
    button("undo", () => this.undo()),
    button("reset", () => this.take(this.original))
  );
  replay = new Player(this);
  /** @param {HTMLElement} root @param {Scene} scene @param {Hooks} hooks */
  constructor(root, scene, hooks = {}) {
    this.scene = scene;
    this.hooks = hooks;
    this.task = dynamics(scene.task.name);
    this.angular = scene.task.inputs.length > scene.plane.low.length;
    const { pointerdown, pointermove, pointerup, keydown } = this, about = { tabindex: 0, role: "application", "aria-label": LABEL, keydown }, acts = { pointerdown, pointermove, pointerup, pointercancel: pointerup }, transitionend = () => this.changed(true);
    this.canvas = element("canvas", { ...about, ...acts, transitionend });
    this.picture = new Picture(this.canvas, scene.plane);
    const { first = {} } = hooks, at = String(first.at).split(",").map(Number), start = this.place(scene.starts.at(-63) ?? scene.starts[0]);
    this.asked = this.picture.shows(at) ? at : start;
    const active = (
      /** @type {HTMLElement | null} */
      document.activeElement
    ), focus = root.contains(active) && active;
    root.classList.add("vsp-explorer");
    this.drawing = element("div", { class: "vsp-drawing", "data-task": scene.task.name });
    const shown = scene.policies.find(({ name: name2 }) => name2 === first.policy) ?? scene.policies[0], take = (policy2) => (this.show(policy2), this.settle()), policy = choice("policy", scene.policies, take, shown), lists = row(...hooks.above ?? [], policy), seen = [this.canvas, this.drawing, this.said, this.replay.line, this.legend], stage = element("div", { class: "vsp-stage" }, ...seen), parts = [this.said, this.answer, this.form, this.backs, this.note, this.replay.row], panel = element("div", { class: "vsp-panel" }, ...hooks.bare ? [] : parts);
    root.replaceChildren(...hooks.bare ? [stage] : [lists, stage, panel]);
    if (focus) (focus.isConnected ? focus : this.canvas).focus();
    new ResizeObserver(() => this.waiting || this.draw()).observe(this.canvas);
    this.show(shown);
  }
  // -- What is shown
  place = (state) => this.task.place(this.task.see(state));
  /** The cell that stands out. */
  get marked() {
    return this.lit !== null && this.lit < this.cells ? this.lit : this.cell;
  }
  /** Whether codewords can be dragged, and the arrows of cells, to drag. */
  get movable() {
    return !this.fixed && !this.angular && this.cells > 1;
  }
  get arrows() {
    const none = this.fixed || this.cells > ALL || this.scene.task.outputs.length !== 2;
    return none || this.policy.layers ? [] : this.shown.map((i) => ownArrow(this, i));
  }
  get cells() {
    return this.policy.layers ? 1 : this.policy.codewords.length;
  }
  /** The cells whose equations are shown: all, or the one that stands out. */
  get shown() {
    return this.cells > ALL ? [this.marked] : [...Array(this.cells).keys()];
  }
  /** Show a policy of the scene with its run, if it has one; `numbers` replace its own.
   * @param {Policy} policy @param {Partial<Numbers>} [numbers] */
  show(policy, numbers) {
    this.replay.stop();
    name(policy);
    const { replay: run = [], ...own } = policy;
    const copy = policy.layers ? policy : structuredClone(own);
    Object.assign(this, { original: policy, run, policy: copy, held: null, lit: null });
    this.replay.row.hidden = this.replay.line.hidden = !run.length;
    this.backs.hidden = Boolean(policy.layers);
    if (run.length) this.replay.grow(true);
    if (numbers) this.put(numbers);
    this.afresh();
  }
  // -- Changing the policy
  /** A copy of what a reader can change. */
  numbers(numbers = this.policy) {
    const { codewords, coefficients, born, tints } = { ...this.policy, ...numbers };
    return structuredClone({ codewords, coefficients, born, tints });
  }
  put(numbers) {
    Object.assign(this.policy, this.numbers(numbers));
    name(this.policy);
  }
  /** Forget all gestures. */
  afresh() {
    Object.assign(this, { base: null, past: [this.numbers()], armed: false });
    this.changed(true);
  }
  /** After every change of a number: keep what it is, beside what it was before the gesture. */
  edited() {
    if (this.armed) Object.assign(this, { armed: false, base: this.results });
    else this.past.pop();
    this.past.push(this.numbers());
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
    if (this.past.length > 1) this.take(this.past.splice(-2)[0]);
  }
  /** A gesture is finished: tell it once the picture shows it. */
  settle() {
    requestAnimationFrame(() => requestAnimationFrame(() => this.hooks.settled?.(this)));
  }
  /** The same once keys rest: the next one begins another gesture. */
  soon() {
    clearTimeout(this.timers.still);
    this.timers.still = setTimeout(() => {
      Object.assign(this, { armed: true, writing: false });
      this.settle();
    }, 400);
  }
  // -- Everything that depends on policy and state
  /** Schedule an update: of everything if the `policy` changed. */
  changed(policy = false) {
    if (policy) this.mapped = null;
    this.waiting ||= requestAnimationFrame(() => this.redo());
  }
  redo() {
    this.waiting = 0;
    if (this.mapped === null) this.judge(IN_MOTION);
    this.cell = act(this.scene, this.policy, this.task.see(this.asked)).cell;
    const { episode } = this.policy, other = episode && String(episode.states[0]) !== String(this.asked);
    this.played = other ? { states: [] } : episode ?? rollout(this.scene, this.policy, this.asked);
    if (!this.writing && !this.form.contains(document.activeElement)) this.fill();
    this.draw();
    this.speak();
  }
  /** Run an episode from every start, or as many as `budget` ms allow. */
  judge(budget = Infinity) {
    const { scene, policy } = this, n = scene.starts.length, begun2 = performance.now();
    this.failing.clear();
    if (policy.layers) return Object.assign(this, { results: { played: n, ...policy.results } });
    ready(policy);
    let [played, sum2] = [0, 0];
    for (; played < n && (!played || performance.now() - begun2 < budget); played++) {
      const i = played * STRIDE % n, { total, outcome, last } = rollout(scene, policy, scene.starts[i]);
      if (scene.lost.includes(outcome)) this.failing.set(i, last);
      sum2 += total;
    }
    const failures = Math.round(this.failing.size / played * n);
    this.results = { played, failures, mean: sum2 / played };
  }
  fill() {
    if (this.policy.layers) return this.form.replaceChildren();
    const parts = this.shown.map((i) => {
      const title = this.cells > 1 ? `Cell ${numberOf(this.policy, i)}` : "The map", cells = this.cells > 1 && this.scene.task.outputs.length > 1, tint = cells ? CELLS[this.policy.tints?.[i] ?? 0] : "var(--vsp-line)", light = () => this.lit === i || this.light(i), lines = equations(this, i, () => this.edited()), acts = { pointerenter: light, focusin: light, "data-cell": i, style: `--tint: ${tint}` };
      return element("fieldset", acts, element("legend", {}, title), ...lines);
    });
    this.form.replaceChildren(...parts);
  }
  /** Let a cell stand out while its equations are touched. @param {number | null} cell */
  light(cell) {
    if (this.held) return;
    this.lit = cell;
    this.changed();
  }
  speak() {
    const { replay } = this, moment = momentOf(this);
    this.said.setAttribute("aria-live", replay.playing || this.held ? "off" : "polite");
    this.result.textContent = resultOf(this);
    this.from.textContent = episodeOf(this);
    this.drawing.style.setProperty("--at", String(this.asked[0]));
    this.answer.replaceChildren(...answerOf(this, this.task.see(this.asked)));
    this.legend.replaceChildren(...legendOf(this));
    this.note.textContent = noteOf(this);
    for (const part of this.form.children)
      part.classList.toggle("vsp-lit", Number(part.getAttribute("data-cell")) === this.marked);
    replay.said.textContent = moment;
    replay.slider.setAttribute("aria-valuetext", moment);
    replay.time.hidden = this.run[0]?.failures === void 0;
    if (!replay.time.hidden) drawTime(this);
    this.hooks.told?.(this);
  }
  /** Draw. Until the picture rests, the map has few points, and not all starts are played. */
  draw() {
    if (this.mapped === this.marked) return drawAll(this);
    drawAll(this, COARSE);
    this.mapped = this.marked;
    clearTimeout(this.timers.sharp);
    this.timers.sharp = setTimeout(() => this.finish(), 120);
  }
  finish() {
    if (this.waiting) return;
    if (this.results.played < this.scene.starts.length) this.judge();
    drawAll(this, FINE);
    this.speak();
  }
  /** Show another part of the plane, after a while on the way (by equal factors), or at once.
   * @param {Box} to */
  zoom({ low, high }, duration = 0) {
    const { plane } = this.picture, factor = (high[0] - low[0]) / (plane.high[0] - plane.low[0]), begun2 = performance.now();
    cancelAnimationFrame(this.zooming);
    const frame = (now) => {
      const time = duration && factor !== 1 ? clip((now - begun2) / duration, 0, 1) : 1, way = time < 1 ? (factor ** time - 1) / (factor - 1) : 1;
      const mean = (from, to) => from.map((value, i) => (1 - way) * value + way * to[i]);
      this.picture.plane = { ...plane, low: mean(plane.low, low), high: mean(plane.high, high) };
      this.changed(true);
      if (time < 1) this.zooming = requestAnimationFrame(frame);
    };
    frame(begun2);
  }
  // -- Pointer and keys
  pointerdown = (event) => {
    if (event.button || !event.isPrimary) return;
    this.canvas.setPointerCapture(event.pointerId);
    const { offsetX: x, offsetY: y } = event, finger = event.pointerType === "touch", words2 = this.movable ? this.policy.codewords ?? [] : [];
    if (finger) this.canvas.focus();
    const near = (places, turned) => {
      const far = places.map((place) => Math.hypot(place[0] - x, place[1] - y)), cell = far.indexOf(Math.min(...far));
      if (far[cell] < (finger ? 22 : 12)) return { cell, turned, finger, place: places[cell] };
    };
    const word = near(words2.map((word2) => this.picture.at(word2)), false), found = word ?? near(this.arrows.map(({ tip }) => tip), true), held = { cell: -1, turned: false, finger, place: [x, y], ...found, from: [x, y] };
    Object.assign(this, { held, armed: true, lit: found?.cell ?? null });
    this.replay.stop();
    if (found) this.changed();
    else this.choose(this.picture.point(x, y));
  };
  pointermove = (event) => {
    if (!this.held) return;
    const { cell, turned, place, from } = this.held, [dx, dy] = [event.offsetX - from[0], event.offsetY - from[1]], [px, py] = [place[0] + dx, place[1] + dy], point = this.picture.point(px, py);
    if (cell < 0) return this.choose(point);
    if (this.armed && Math.hypot(dx, dy) < 4) return;
    if (turned) this.bend(cell, px, py);
    else this.policy.codewords?.splice(cell, 1, point);
    this.edited();
  };
  /** Let the arrow of a cell end at a pixel: its constants follow.
   * @param {number} cell @param {number} px @param {number} py */
  bend(cell, px, py) {
    const { start, word, rows, own } = ownArrow(this, cell), wanted = [px - start[0], start[1] - py].map((length) => clip(length / own, -1, 1)), constants = rows[word.length];
    wanted.forEach((value, k) => {
      constants[k] = +(constants[k] + value - raw(rows, word, k)).toFixed(2);
    });
  }
  choose(point) {
    this.asked = [...point];
    this.base = this.lit = null;
    this.changed();
  }
  pointerup = () => {
    if (!this.held) return;
    const { cell, turned } = this.held, word = this.policy.codewords?.[cell];
    this.held = null;
    if (this.armed && word && !turned) this.choose(word);
    this.light(null);
    this.settle();
  };
  keydown = (event) => {
    const way = { ...WAYS, " ": [0, 0] }[event.key];
    if (!way || event.altKey || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    const { low, high } = this.picture.plane, by = event.shiftKey ? 0.1 : 0.01;
    const moved = (value, i) => clip(value + way[i] * by * (high[i] - low[i]), low[i], high[i]);
    this.choose(this.asked.map(moved));
    this.soon();
  };
};

// ../vsp/show/explorer/algorithms.js
var RIDGE = 1e-6;
var [BETA1, BETA2, EPSILON] = [0.9, 0.999, 1e-8];
var zeros = (rows, columns) => Array.from({ length: rows }, () => Array(columns).fill(0));
var Partition = class {
  /** @type {Cell[]} */
  cells = [];
  /** @type {Linear} */
  look;
  /** @type {Set<number>[] | null} */
  graph = null;
  // while the codewords stay
  /** `draw(n)` gives n random numbers from 0 to 1, for new maps. @param {Settings} config
   * @param {Pick<Task, "actionLow" | "actionHigh"> & Box} task @param {Draws} draws */
  constructor(config, task, draws) {
    this.config = config;
    this.task = task;
    this.draws = draws;
    const { low, high } = task;
    this.scale = config.scale === "box" ? less(high, low) : low.map(() => 1);
    this.shape = /** @type {const} */
    [low.length + 1, task.actionLow.length];
  }
  /** After a change of the codewords. */
  moved() {
    const codewords = this.cells.map(({ codeword }) => codeword), coefficients = this.cells.map(({ map }) => map), about = { name: "", codewords, coefficients, scale: this.scale, metric: this.config.metric };
    this.look = ready(
      /** @type {Linear} */
      about
    );
    this.graph = null;
  }
  /** Make a state the codeword of a new, untrained cell. @param {Vector} state */
  add(state) {
    const [p, m] = this.shape, random2 = this.config.initial === "uniform", drawn2 = random2 ? this.draws.map(p * m).map((value) => (2 * value - 1) / Math.sqrt(p - 1)) : [], map = zeros(p, m).map((row2, i) => row2.map((_, k) => drawn2[i * m + k] ?? 0));
    this.cells.push({ codeword: [...state], map, ...this.unmoved(), ...this.nothing() });
    this.moved();
  }
  /** What an empty buffer holds: rows for minibatches, sums for exact maps. */
  nothing() {
    const [p, m] = this.shape;
    const sums = { products: zeros(p, p), targets: zeros(p, m) };
    return (
      /** @type {Filled} */
      { count: 0, inputs: [], goals: [], sums }
    );
  }
  /** What Adam knows before the first step. */
  unmoved() {
    return { moments: [zeros(...this.shape), zeros(...this.shape)], steps: 0 };
  }
  /** @param {Iterable<number>} chosen */
  reset(chosen) {
    const anew = this.config.adam_on_reset === "restart";
    for (const i of chosen) Object.assign(this.cells[i], this.nothing(), anew && this.unmoved());
  }
  /** Put an episode into the buffers of its cells. @param {Visited} episode */
  observe({ states, actions }) {
    states.forEach((state, t) => {
      const cell = this.cells[cellOf(this.look, state)];
      cell.count += 1;
      cell.inputs.push([...state, 1]);
      cell.goals.push(actions[t]);
    });
  }
  /** Train each cell that has data. Returns the mean loss of the last minibatches, before. */
  train() {
    const filled = this.cells.filter(({ count: count2 }) => count2);
    if (this.config.fit === "closed_form") return void filled.forEach(solve);
    const { batch_size: size, n_minibatches: n, learning_rate: rate } = this.config;
    let loss = 0;
    for (let i = 0; i < n; i++) {
      const drawn2 = this.draws.rows(filled.length * size), part = (j) => drawn2.slice(j * size, (j + 1) * size);
      loss = sum(filled.map((cell, j) => step(cell, part(j), rate))) / filled.length;
    }
    return loss;
  }
  /** How far a state is from the codeword of cell i.
   * @param {number} i @param {Vector} state */
  gap(i, state) {
    const by = less(state, this.cells[i].codeword).map((value, j) => value / this.scale[j]);
    return this.config.split_metric === "manhattan" ? sum(by.map(Math.abs)) : Math.hypot(...by);
  }
  /** @param {number} i @param {Vector} state @param {Vector} action */
  loss(i, state, action) {
    const { actionLow, actionHigh } = this.task;
    const clipped = this.config.split_loss === "clipped";
    const off = action.map((value, k) => {
      const given = raw(this.cells[i].map, state, k);
      return (clipped ? clip(given, actionLow[k], actionHigh[k]) : given) - value;
    });
    return dot(off, off) / off.length;
  }
  neighbours() {
    const { codewords, scale } = this.look;
    return this.graph ??= neighbours(codewords.map((word) => word.map((x, i) => x / scale[i])));
  }
  /** Algorithm 2. Returns the codewords that came, with the mean losses that caused them.
   * @param {Visited} episode @returns {Change[]} */
  split({ states, actions }) {
    const { max_pol_loss, min_pol_distance, one_split } = this.config, made = (
      /** @type {Change[]} */
      []
    );
    let [previous, since, total] = [-1, 0, 0];
    for (const [t, state] of states.entries()) {
      const cell = cellOf(this.look, state), same = (word) => word.every((value, i) => value === state[i]);
      if (cell !== previous) [previous, since, total] = [cell, t, 0];
      total += this.loss(cell, state, actions[t]);
      const cause = total / (t - since + 1), far = this.gap(cell, state) > min_pol_distance && !this.look.codewords.some(same);
      if (!far || !(cause > max_pol_loss)) continue;
      const near = [...this.neighbours()[cell], cell];
      this.add(state);
      this.reset(near);
      made.push({ kind: "split", codeword: state, cause });
      if (one_split) break;
      previous = -1;
    }
    return made;
  }
  /** Algorithm 3. Returns the codewords that went, with the differences of their maps.
   * @returns {Change[]} */
  merge() {
    const { merge_parameters, min_param_distance } = this.config, gone = (
      /** @type {Change[]} */
      []
    );
    const compared = ({ map }) => (merge_parameters === "weights" ? map.slice(0, -1) : map).flat();
    for (let i = 0; i < this.cells.length; i++) {
      const cell = this.cells[i], near = [...this.neighbours()[i]];
      const gap = (other) => Math.max(...less(compared(other), compared(cell)).map(Math.abs));
      const alike = near.map((j) => this.cells[j]).filter((other) => gap(other) < min_param_distance);
      if (!alike.length) continue;
      this.reset([...near, i]);
      for (const other of alike)
        gone.push({ kind: "merge", codeword: other.codeword, cause: gap(other) });
      this.cells = this.cells.filter((other) => !alike.includes(other));
      i = this.cells.indexOf(cell);
      this.moved();
    }
    return gone;
  }
};
function solve({ map, inputs, goals, sums: { products, targets } }) {
  for (const input of inputs.splice(0)) {
    const [goal] = goals.splice(0, 1);
    input.forEach((value, i) => {
      input.forEach((other, j) => products[i][j] += value * other);
      goal.forEach((action, k) => targets[i][k] += value * action);
    });
  }
  const columns = map[0].map((_, k) => map.map((weights) => weights[k])), found = products.map((line) => columns.map((column) => dot(line, column))), slope = targets.map((goal, i) => less(goal, found[i]));
  const ridged = products.map((line, i) => line.with(i, line[i] + RIDGE));
  leastSquares(ridged, slope).forEach((line, i) => line.forEach((by, k) => map[i][k] += by));
}
function step(cell, drawn2, rate) {
  const { map, moments, inputs, goals, count: count2 } = cell, [p, m] = [map.length, map[0].length], gradient = zeros(p, m);
  let loss = 0;
  for (const value of drawn2) {
    const row2 = Math.trunc(value * count2), input = inputs[row2];
    for (let k = 0; k < m; k++) {
      let error = -goals[row2][k];
      for (let i = 0; i < p; i++) error += input[i] * map[i][k];
      for (let i = 0; i < p; i++) gradient[i][k] += error * input[i];
      loss += error * error;
    }
  }
  cell.steps += 1;
  const [first, second] = [BETA1, BETA2].map((beta) => 1 - beta ** cell.steps);
  for (let i = 0; i < p; i++)
    for (let k = 0; k < m; k++) {
      const slope = 2 / (drawn2.length * m) * gradient[i][k], mean = moments[0][i][k] = BETA1 * moments[0][i][k] + (1 - BETA1) * slope, square = moments[1][i][k] = BETA2 * moments[1][i][k] + (1 - BETA2) * slope ** 2;
      map[i][k] -= rate / first * mean / (Math.sqrt(square / second) + EPSILON);
    }
  return loss / (drawn2.length * m);
}
function* distil(partition, episodes) {
  const { config } = partition, iterations2 = config.n_epochs + Number(config.inclusive);
  const due = (n2, every) => n2 % every === 0 && (n2 > 0 || config.inclusive);
  let n = -1;
  for (const episode of episodes) {
    if (++n === 0) partition.add(episode.states[0]);
    partition.observe(episode);
    const loss = partition.train(), closing = config.freeze === "last_n_split" ? config.n_split : config.n_freeze, thawed = n < (config.freeze === "first_n_freeze" ? config.n_freeze : iterations2 - closing), splits = thawed && due(n, config.n_split) ? partition.split(episode) : [], merges = thawed && due(n, config.n_merge) ? partition.merge() : [], last = n === iterations2 - 1;
    if (due(n, config.n_reset) && config.periodic_reset === "buffers")
      partition.reset(partition.cells.keys());
    yield { n, loss, events: [...splits, ...merges], last };
    if (last) return;
  }
}
function neighbours(points) {
  const near = points.map(() => (
    /** @type {Set<number>} */
    /* @__PURE__ */ new Set()
  ));
  points.forEach((p, i) => {
    for (let j = 0; j < i; j++) {
      const [dx, dy] = less(points[j], p);
      let [low, high] = [-Infinity, Infinity];
      points.forEach((r, k) => {
        if (k === i || k === j) return;
        const from = less(r, p), side = 2 * dot([-dy, dx], from), room = dot(from, less(r, points[j]));
        if (side > 0) high = Math.min(high, room / side);
        else if (side < 0) low = Math.max(low, room / side);
        else if (room < 0) high = -Infinity;
      });
      if (low >= high) continue;
      near[i].add(j);
      near[j].add(i);
    }
  });
  return near;
}

// ../vsp/show/explorer/worker.js
var SLICE = 40;
var EVERY = 10;
var QUICK = 100;
function* drawn(episodes, draw) {
  while (true) yield episodes[Math.floor(draw() * episodes.length)];
}
function* iterations({ scene, network: stored, config, seed }) {
  const many = (draw) => (n) => Array(n).fill(0).map(draw);
  const { task, plane, lost } = scene, [starts, maps, rows] = [1, 2, 3].map((i) => random(3 * seed + i)), partition = new Partition(config, { ...task, ...plane }, { map: many(maps), rows: many(rows) }), named = births(partition.scale), played = scene.starts.filter((_, i) => task.maxSteps < QUICK || i % 20 === 0);
  const episodes = Array.isArray(stored) ? drawn(stored, starts) : taught(
    scene,
    /** @type {Network} */
    network(stored),
    starts
  );
  for (const { n, loss, events, last } of distil(partition, episodes)) {
    if (!events.length && n % EVERY && !last) yield void 0;
    else {
      const { scale, metric, codewords, coefficients } = partition.look, numbers = structuredClone({ codewords, coefficients, ...named(codewords, events) }), ends = played.map((start) => rollout(scene, partition.look, start).outcome), share = ends.filter((outcome) => lost.includes(outcome)).length / ends.length, failures = Math.round(share * scene.starts.length);
      yield { n, scale, metric, ...numbers, events, loss, failures };
    }
  }
}
function work() {
  let begun2;
  let run;
  let waiting;
  let [since, owed] = [0, 0];
  const go = () => {
    const now = performance.now(), moments = [];
    let [made, done] = [0, false];
    owed = Math.min(owed + (now - since) / 1e3 * begun2.pace, begun2.pace);
    since = now;
    for (; owed >= 1 && !done && performance.now() - now < SLICE; owed--, made++) {
      const next = run.next();
      done = Boolean(next.done);
      if (next.value) moments.push(next.value);
    }
    const rate = Math.min(begun2.pace, made / ((performance.now() - now) / 1e3 || 1));
    postMessage({ moments, done, rate });
    if (!done) waiting = setTimeout(go, begun2.pace < 1e5 ? SLICE : 0);
  };
  addEventListener("message", ({ data: { config, ...data2 } }) => {
    begun2 = { ...begun2, ...data2, config: Object.assign(begun2?.config ?? {}, config) };
    run ??= iterations(begun2);
    since = performance.now();
    clearTimeout(waiting);
    go();
  });
}

// ../vsp/show/explorer/settings.json
var settings_default = {
  "when a cell splits": {
    max_pol_loss: "its loss is above",
    min_pol_distance: "the codeword is farther than",
    n_split: "looked at every … iterations",
    one_split: "at most one split each time",
    split_metric: "how far: the distance",
    split_loss: "loss of raw or of clipped actions"
  },
  "when neighbours merge": {
    min_param_distance: "all numbers differ by less than",
    n_merge: "looked at every … iterations",
    merge_parameters: "which numbers: with constants, or weights alone"
  },
  "how long, how maps are trained": {
    n_epochs: "iterations",
    learning_rate: "step size",
    n_minibatches: "minibatches an iteration",
    batch_size: "states a minibatch",
    fit: "steps of Adam, or exact least squares",
    initial: "a new map is random, or 0"
  },
  "what the paper leaves open, or says twice": {
    freeze: "when cells stay as they are",
    n_freeze: "that phase, in iterations",
    n_reset: "data forgotten every … iterations",
    periodic_reset: "forget the data, or nothing",
    adam_on_reset: "Adam's memory then",
    metric: "distance that makes the cells",
    scale: "divide it by the width of the box",
    inclusive: "one iteration more, changes in the first"
  }
};

// ../vsp/show/explorer/distiller.js
var nameOf = (pace) => pace < 1e6 ? `${pace} a second` : "as fast as it can";
var PACES = [300, 1e6, 30, 3].map((pace) => ({ pace, name: nameOf(pace) }));
var MOST = 1e5;
var ANEW = "n_epochs metric scale fit inclusive seed".split(" ");
var rangeOf = (name2, value) => {
  const whole = Number.isInteger(value), least = name2 === "seed" ? 0 : whole ? 1 : 1e-9;
  return { step: 1, times: name2 !== "seed", least, most: MOST, whole };
};
function control(config, name2, meaning, words2, changed) {
  const range = rangeOf(name2, config[name2]), take = (word) => changed(config[name2] = word), list = words2 && choice("", words2, take, config[name2]), part = list ?? element("label", {}, field(name2, config, name2, changed, range));
  part.prepend(`${meaning} `, element("code", {}, name2));
  return part;
}
var Distiller = class {
  /** @type {Run} */
  run = { moments: [], done: true, counted: true, rate: 0 };
  pace = PACES[0].pace;
  go = button("distil", () => this.run.done ? this.begin() : this.stop(), "vsp-go");
  said = element("p", { class: "vsp-note", role: "status" });
  /** @param {Explorer} view @param {Settings & { seed?: number }} config @param {Choices} choices
   * @param {() => Promise<StoredNetwork | Visited[] | undefined>} network
   * @param {(distiller: Distiller) => void} told @param {Record<string, object>} groups */
  constructor(view, config, choices, network2, told = () => {
  }, groups = settings_default) {
    this.view = view;
    this.network = network2;
    this.told = told;
    this.config = { seed: 0, ...config };
    const pace = choice("iterations", PACES, ({ pace: pace2 }) => this.tell({ pace: this.pace = pace2 }));
    const made = ([name2, meaning]) => control(this.config, name2, meaning, choices[name2], () => this.changed(name2));
    const known = ([name2]) => choices[name2] || typeof Reflect.get(config, name2) === "number";
    const parts = Object.entries(groups).map(([title, settings], i) => {
      const shown = Object.entries(settings).filter(known).map(made), fields = element("div", { class: "vsp-settings" }, ...shown);
      return element("details", { open: i === 0 }, element("summary", {}, title), fields);
    });
    this.row = element("div", {}, row(this.go, pace, made(["seed", ""])), this.said, ...parts);
  }
  /** @param {string} name */
  changed(name2) {
    const later = !this.run.done && ANEW.includes(name2);
    const value = Reflect.get(this.config, name2), now = this.run.moments.at(-1);
    if (!later) this.tell({ config: { [name2]: value } });
    if (!later && now && !this.run.done) now.set = `${name2} = ${value}`;
    this.say(later ? "This counts from the next run on." : "");
    this.told(this);
  }
  /** @param {ToWorker} changes */
  tell(changes) {
    this.run.worker?.postMessage(changes);
  }
  stop() {
    this.run.worker?.terminate();
    this.run.done = true;
    this.say();
  }
  async begin() {
    const { config, pace } = this, { n_freeze: freeze, n_epochs: epochs } = config;
    if (freeze > epochs) return this.say(`n_freeze is ${freeze}: at most n_epochs, ${epochs}.`);
    const scene = { ...this.view.scene, policies: [] }, script = (
      /** @type {HTMLScriptElement} */
      one(document, "#vsp-script")
    );
    const run = this.run = { moments: [], done: false, rate: 0 };
    this.say();
    const [text, network2] = await Promise.all([textOf(script, script.src), this.network()]);
    if (run.done) return;
    if (!network2) return this.stop();
    const plain = text.replace(/^export \{[^}]*\};?/gm, ""), parts = [plain.replace(/begin\(\)\s*$/, `${work.name}()`)];
    run.worker = new Worker(URL.createObjectURL(new Blob(parts, { type: "text/javascript" })));
    run.worker.onmessage = ({ data: data2 }) => this.grown(run, data2);
    run.worker.postMessage({ scene, network: network2, config, seed: config.seed, pace });
  }
  /** Moments have come. @param {Run} run @param {FromWorker} found */
  grown(run, { moments, done, rate }) {
    const { view } = this;
    run.moments.push(...moments);
    run.rate = rate || run.rate;
    if (!run.policy && moments.length) {
      const about = { name: "your run", replay: run.moments };
      run.policy = /** @type {Linear} */
      /** @type {Numbers} */
      { ...moments[0], ...about };
      view.show(run.policy);
    } else if (view.original === run.policy && moments.length) view.replay.grow();
    if (run.policy) run.policy.limits = this.config;
    if (!done) return this.say();
    this.stop();
    this.told(this);
  }
  say(words2 = "") {
    const { done, moments, rate } = this.run, n = moments.at(-1)?.n ?? 0, now = `iteration ${n}: ${Math.round(rate).toLocaleString("en")} a second`;
    if (moments.length) words2 ||= done ? `${n + 1} iterations` : now;
    this.go.textContent = done ? "distil" : "stop";
    this.said.textContent = words2;
  }
};

// article/address.js
var [VERSION, LONGEST, MOST_CELLS, LARGEST] = ["1", 4096, 16, 1e6];
function checksum(text) {
  let sum2 = 2166136261;
  for (const sign of text) sum2 = Math.imul(sum2 ^ Number(sign.codePointAt(0)), 16777619);
  return (sum2 >>> 0).toString(36);
}
function write({ section, policy, at, moment, zoomed, numbers }) {
  const { codewords, coefficients } = numbers ?? {};
  const pairs2 = { v: VERSION, s: section, p: policy, a: at, n: moment, z: zoomed ? 1 : void 0 };
  Object.assign(pairs2, { c: codewords?.flat(), m: coefficients?.flat(2) });
  const told = Object.entries(pairs2).filter(([, value]) => value !== void 0);
  const text = told.map(([key, value]) => `${key}=${value}`).join("&");
  return `#${text}&k=${checksum(text)}`;
}
var cut = (list, size) => list.flatMap((_, i) => i % size ? [] : [list.slice(i, i + size)]);
function read(hash, sections, moments) {
  const text = new URLSearchParams(hash.slice(1, LONGEST)), { s: section, p: policy, n, z, ...lists } = Object.fromEntries(text), [at, words2, maps] = ["a", "c", "m"].map((key) => lists[key]?.split(",").map(Number) ?? []), own = { codewords: cut(words2, 2), coefficients: cut(cut(maps, 2), 3) }, moment = n === void 0 ? void 0 : Number(n), shown = { section, policy, at, moment, zoomed: z === "1" }, state = { ...shown, numbers: words2.length ? own : void 0 };
  const known = Object.hasOwn(sections, section) && sections[section].includes(policy), small = [...at, ...words2, ...maps].every((value) => Math.abs(value) <= LARGEST), sized = at.length === 2 && words2.length % 2 === 0 && maps.length === 3 * words2.length, played = moment === void 0 || Number.isInteger(moment) && moment >= 0 && moment < moments;
  if (words2.length > 2 * MOST_CELLS) return null;
  return known && small && sized && played && write(state) === hash ? state : null;
}

// article/opening.js
var [STEP, REST] = [450, 1500];
var THERE = 0.95;
function ways({ lengths, states }) {
  const bytes = Uint8Array.from(atob(states), (sign) => sign.charCodeAt(0)), numbers = Array.from(new Uint16Array(bytes.buffer), (number) => number / 65535);
  return lengths.map((n) => Array.from({ length: n }, () => numbers.splice(0, 2)));
}
var Opening = class {
  playing = false;
  /** @param {HTMLElement} root @param {Scene & { walks: Walks }} scene @param {Linear} policy */
  constructor(root, scene, policy) {
    name(policy);
    ready(policy);
    const canvases = [...root.querySelectorAll("canvas")];
    this.pictures = canvases.map((canvas) => new Picture(canvas, scene.plane, true));
    const [, picture] = this.pictures, task = dynamics(scene.task.name);
    this.own = { policy, scene, task, picture, cells: policy.codewords.length, marked: -1 };
    this.ways = [ways(scene.walks), scene.starts.map((start) => rollout(scene, policy, start).states)];
    const lengths = this.ways.flat().map((way) => way.length - 1).sort((a, b) => a - b);
    this.steps = lengths[Math.floor(lengths.length * THERE)];
    this.told = one(root, ".count");
    this.toggle = one(root, ".walk");
    this.toggle.addEventListener("click", () => this.play(!this.playing));
    new ResizeObserver(() => this.draw()).observe(root);
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.time = still ? 4 : 0;
    this.play(!still);
  }
  /** @param {boolean} on */
  play(on) {
    this.playing = on;
    this.toggle.textContent = on ? "stop" : "walk";
    let before = performance.now();
    const frame = (now) => {
      this.time += clip(now - before, 0, 100) / STEP;
      before = now;
      if (this.time > this.steps + REST / STEP) this.time = 0;
      if (this.toggle.getBoundingClientRect().bottom > 0) this.draw();
      if (this.playing) requestAnimationFrame(frame);
    };
    if (on) requestAnimationFrame(frame);
  }
  draw() {
    const [left, right] = this.pictures.map((picture, i) => this.walkers(picture, i));
    this.told.textContent = `step ${Math.floor(this.time)}: ${left} and ${right} of 400 at the goal`;
  }
  /** Draw all walkers where they are now, and count those at the goal.
   * @param {Picture} picture @param {number} i */
  walkers(picture, i) {
    const ways2 = this.ways[i], { places } = this.own.task;
    picture.begin();
    const { ctx, tones } = picture, colour = i ? tones.ink : tones.teacher;
    if (i) drawCells(this.own);
    places.forEach((place) => picture.place(place));
    for (const way of ways2) {
      const now = Math.min(this.time, way.length - 1), [from, to] = [way[Math.floor(now)], way[Math.ceil(now)]], place = from.map((value, k) => value + now % 1 * (to[k] - value));
      ctx.globalAlpha = 0.35;
      picture.line([way[Math.max(Math.floor(now) - 1, 0)], from, place], colour, 1);
      ctx.globalAlpha = 1;
      picture.dot(place, 1.6, colour);
    }
    places.forEach((place) => picture.name(place));
    return ways2.filter((way) => this.time >= way.length - 1).length;
  }
};

// article/article.js
var ZOOM = 1500;
var NARROW = 800;
var UNLOADED = "A part of the page could not be loaded. Try again.";
var UNREAD = "This link is damaged or from a newer version. So here is the first picture.";
var WON = "No failure. Now the return.";
var BEATEN = "No failure, and more than section 5: send it!";
var all = (root, selector) => Array.from(root.querySelectorAll(selector));
var words = (text) => text?.split(" ") ?? [];
async function data(name2) {
  const inner = one(document, `#article-${name2}`);
  return JSON.parse(await textOf(inner, inner.dataset.source));
}
function pairs(text) {
  const numbers = floats(text);
  return Array.from({ length: numbers.length / 2 }, (_, i) => [numbers[2 * i], numbers[2 * i + 1]]);
}
function replayOf({ n, cells, codewords, coefficients, events, failures }) {
  const rows = pairs(coefficients), places = new Map(codewords);
  let [at, placed] = [
    0,
    /** @type {Vector[]} */
    []
  ];
  return n.map((iteration, i) => {
    placed = places.get(i) ?? placed;
    const maps = Array.from({ length: cells[i] }, () => rows.slice(at, at += 3)), happened = events.filter((event) => event.n === iteration);
    const numbers = { codewords: placed, coefficients: maps };
    return { n: iteration, ...numbers, events: happened, failures: failures[i] };
  });
}
function firstOf({ dataset }) {
  const { policies, at, moment } = dataset;
  return { policy: words(policies)[0], at: String(at).split(",").map(Number), moment };
}
var Article = class {
  /** @type {Record<string, Promise<unknown>>} */
  parts = {};
  /** @type {Record<string, State>} */
  left = {};
  // the scenes of sections, as a reader left them
  /** @type {HTMLElement | undefined} */
  section;
  /** @type {Promise<void> | null} */
  entering = null;
  staging = false;
  // whether a scene is being set
  begun = false;
  gestured = false;
  zoomed = false;
  held = -Infinity;
  // when a focus scrolled
  /** @type {Vector[] | null} */
  proved = null;
  // failing starts of the policy as it was
  /** @type {Visited | undefined} */
  visited;
  // states, and the teacher's actions there
  /** @param {HTMLElement} root @param {Parts["scene"]} scene */
  constructor(root, scene) {
    this.root = root;
    this.scene = scene;
    this.policies = Object.fromEntries(scene.policies.map((policy) => [String(policy.id), policy]));
    this.sections = all(root, "section[data-policies]");
    this.status = one(root, ".status");
    const settled = () => {
      this.keep();
      this.gestured = true;
      this.tell("gesture");
    };
    const hooks = { bare: true, settled, told: () => this.say() };
    this.view = new Explorer(one(root, ".view"), scene, hooks);
    root.classList.add("live");
    new Opening(
      one(root, ".opening"),
      scene,
      /** @type {Linear} */
      this.policies.faithful_3
    );
    this.listen();
    this.follow();
  }
  listen() {
    const { root, sections, view: { canvas } } = this;
    for (const section of sections)
      section.addEventListener("focusin", () => {
        this.held = performance.now();
        this.enter(section);
      });
    addEventListener("scroll", () => {
      if (performance.now() - this.held < 200) return;
      const line = (innerWidth < NARROW ? 0.6 : 0.4) * innerHeight, section = sections.findLast((each) => each.getBoundingClientRect().top < line);
      if (section && section !== this.section) this.enter(section);
    });
    for (const pressed of all(root, "[data-act]"))
      pressed.addEventListener("click", () => this.act(pressed, ...words(pressed.dataset.act)));
    const slider = (
      /** @type {HTMLInputElement} */
      one(root, "[data-stops]")
    ), stops = words(slider.dataset.stops);
    slider.addEventListener("input", () => this.act(slider, "policy", stops[+slider.value]));
    canvas.addEventListener("focus", () => this.section ?? this.enter(sections[0]));
    canvas.addEventListener("keydown", ({ key }) => {
      if (key === "Escape" && this.section) one(this.section, ".skip").focus();
    });
    for (const task of all(root, ".do")) {
      const skip = button("to the picture (arrows; Escape: back)", () => canvas.focus());
      skip.className = "skip";
      task.append(skip);
    }
    addEventListener("popstate", () => this.follow());
    addEventListener("beforeprint", () => {
      for (const output2 of root.querySelectorAll("output")) output2.value = output2.defaultValue;
    });
    addEventListener("afterprint", () => this.say());
  }
  /** A part of the data, loaded once.
   * @template {keyof Parts} N @param {N} name @returns {Promise<Parts[N] | undefined>} */
  part(name2) {
    this.parts[name2] ??= data(name2).catch(() => {
      delete this.parts[name2];
      this.entering = null;
      this.status.textContent = UNLOADED;
    });
    return (
      /** @type {Promise<Parts[N] | undefined>} */
      this.parts[name2]
    );
  }
  // -- Scenes
  /** Show a section's scene: as `state` says, as the reader left it, or as it is at first.
   * @param {HTMLElement} section @param {State} [state] @param {Put} [put] */
  enter(section, state, put) {
    if (this.section === section && !state && this.entering) return this.entering;
    this.remember();
    Object.assign(this, { section, staging: true });
    if (!this.distiller?.run.policy) this.distiller?.stop();
    this.status.textContent = "";
    for (const each of this.sections) each.classList.toggle("active", each === section);
    this.entering = this.stage(section, state ?? this.left[section.id] ?? firstOf(section), put);
    return this.entering;
  }
  /** @param {HTMLElement} section @param {State} state @param {Put} [put] */
  async stage(section, { policy, at, moment, zoomed = false, numbers, own }, put) {
    const { view, scene } = this;
    const load = (name2) => words(section.dataset.needs).includes(name2) ? this.part(name2) : null;
    const loaded = await Promise.all(
      /** @type {const} */
      [load("run"), load("visited"), load("proofs"), load("teacher")]
    );
    if (this.section !== section || loaded.includes(void 0)) return;
    const [run, visited, proofs, teacher] = loaded;
    if (teacher) Object.assign(this.policies.teacher, network(teacher), { episode: null });
    if (visited) this.visited ??= { states: pairs(visited.states), actions: pairs(visited.actions) };
    if (run) this.takeRun(run);
    const proof = proofs?.[policy];
    Object.assign(this, { zoomed, proved: proof?.polygons ?? null });
    const [low, high] = zoomed && proof ? proof.box : [scene.plane.low, scene.plane.high], small = proof && proof.box[1][0] - proof.box[0][0] < 0.1, moves = view.original.id === policy && put && !view.replay.slow;
    view.zoom({ low, high }, moves ? ZOOM : 0);
    view.ring = small && !zoomed ? proof.at : null;
    Object.assign(view, { fixed: Boolean(section.dataset.fixed), starts: !proof, asked: at });
    view.show(own && this.distiller?.run.policy || this.policies[policy], numbers);
    if (view.run.length && moment !== void 0) view.replay.to(+moment);
    view.regions = this.same ? this.proved : null;
    this.arrange(section, policy);
    this.staging = false;
    this.keep(put ?? (this.gestured ? history.pushState : history.replaceState));
    this.gestured = put === history.pushState;
  }
  /** Put the controls into a section, and set its own.
   * @param {HTMLElement} section @param {string} policy */
  arrange(section, policy) {
    const { replay, form, backs, cells } = this.view, distil2 = this.distiller ? [this.distiller.row] : [], slots = new Map(Object.entries({ replay: [replay.row], form: [form, backs], distil: distil2 }));
    for (const slot of all(section, "[data-slot]"))
      for (const part of slots.get(String(slot.dataset.slot)) ?? [])
        if (part.parentNode !== slot) slot.append(part);
    for (
      const slider of
      /** @type {HTMLInputElement[]} */
      all(section, "[data-stops]")
    ) {
      slider.value = String(words(slider.dataset.stops).indexOf(policy));
      slider.setAttribute("aria-valuetext", count(cells, "cell"));
    }
  }
  takeRun(stored) {
    const { run } = this.policies;
    if (run.replay) return;
    run.replay = replayOf(stored);
    Object.assign(run.replay[run.replay.length - 1], this.view.numbers(run));
    run.limits = stored.config;
    this.distiller = new Distiller(this.view, stored.config, {}, () => this.part("teacher"));
  }
  /** What a section tells comes after a gesture, or after the one that it names.
   * @param {string} done */
  tell(done) {
    const { section } = this;
    if (section && done === (section.dataset.tells ?? done)) section.classList.add("done");
  }
  /** Whether the policy is as it was: not one that the reader has changed. */
  get same() {
    const { view } = this;
    return JSON.stringify(view.numbers()) === JSON.stringify(view.numbers(view.original));
  }
  /** Remember the scene of a section. */
  remember() {
    const { view, zoomed, section } = this;
    if (!section || this.staging) return;
    const { id = "run" } = view.original, shown = { section: section.id, policy: id, at: view.asked, zoomed, own: !view.original.id }, replayed = section.querySelector("[data-slot=replay]"), numbers = this.same ? void 0 : view.numbers();
    this.left[section.id] = { ...shown, ...replayed ? { moment: view.replay.at } : { numbers } };
  }
  /** Remember the scene, and write it into the address: after a gesture, to come back from. */
  keep(put = history.pushState) {
    if (!this.section || this.staging) return;
    this.remember();
    const address = write(this.left[this.section.id]);
    if (address !== location.hash && this.begun) put.call(history, null, "", address);
    this.begun = true;
  }
  /** Show what the address says: a state, a section, or the first scene. */
  follow() {
    const hash = location.hash.replaceAll("%2C", ","), policies = this.sections.map(({ id, dataset }) => [id, words(dataset.policies)]), state = read(hash, Object.fromEntries(policies), this.scene.moments), named = state?.section ?? hash.slice(1), known = this.sections.find(({ id }) => id === named), section = known ?? this.sections[0];
    if (!known && document.getElementById(named)) return this.section ?? this.enter(section);
    if (!hash && !this.section) return void (this.begun = true);
    section.scrollIntoView();
    if (this.section) this.held = performance.now();
    this.enter(section, state ?? firstOf(section), history.replaceState);
    if (hash && !known) this.status.textContent = UNREAD;
  }
  // -- What buttons do
  /** @param {HTMLElement} pressed @param {string[]} words */
  async act(pressed, ...[verb, what]) {
    const section = (
      /** @type {HTMLElement} */
      pressed.closest("section")
    );
    await this.enter(section);
    const { view } = this;
    if (section !== this.section || this.staging) return;
    this.tell(`${verb} ${what}`);
    const scene = (to) => this.enter(section, { at: view.asked, policy: what, ...to }, history.pushState);
    if (verb === "policy") await scene({ moment: section.dataset.moment });
    else if (verb === "zoom")
      await scene({ at: (await this.part("proofs"))?.[what].at, zoomed: true });
    else if (verb === "reset") view.take(view.original);
    else if (verb === "refit") this.refit(what === "cell");
    else if (verb === "copy") this.copy(pressed);
    else if (verb === "guess") {
      section.dataset.guess = what;
      one(section, ".guess").textContent = `You said: the ${what}. `;
    }
  }
  refit(here) {
    const { view, visited } = this;
    view.redo();
    view.judge();
    if (view.policy.layers || !visited) return;
    view.take({ coefficients: refit(view.policy, visited, here ? [view.cell] : void 0) });
  }
  /** @param {HTMLElement} pressed */
  copy(pressed) {
    const copied = () => pressed.textContent = "link copied", forbidden = () => this.status.textContent = location.href;
    (navigator.clipboard?.writeText(location.href) ?? Promise.reject()).then(copied, forbidden);
  }
  // -- What the text says of the picture
  say() {
    const { view, section } = this;
    if (!section || this.staging || !view.played.states.length) return;
    if (this.proved && !this.same) view.regions = null;
    const { policy, cells } = view, { failures, mean, played } = view.results, { visited } = this, r2 = visited && !this.same ? rSquared(this.scene, policy, visited) : view.original.r2, rounded = { mean: mean.toFixed(2), exactly: mean.toFixed(3), r2: r2?.toFixed(2) }, about = { cells, failures, ...rounded }, known = new Map(Object.entries({ ...about, episode: view.from.textContent }));
    for (const output2 of section.querySelectorAll("output")) {
      const now = minus(String(known.get(String(output2.dataset.say)) ?? output2.value));
      if (output2.value !== now) output2.value = now;
    }
    const [scale, won] = [".scale", ".won"].map((selector) => one(this.root, selector)), done = !failures && played === this.scene.starts.length && section.id === "you";
    one(scale, ".own").style.setProperty("--score", String(mean));
    scale.classList.toggle("near", done);
    won.textContent = done ? mean.toFixed(3) > String(won.dataset.aim) ? BEATEN : WON : "";
  }
};
async function begin() {
  return new Article(one(document, ".vsp-article"), await data("scene"));
}
export {
  begin
};
