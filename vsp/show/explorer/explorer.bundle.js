// Made by npm --prefix docs run build

// ../vsp/show/explorer/model.js
var TINTS = 8;
var ROUNDED = 1e-4;
var clip = (value, low, high) => Math.min(Math.max(value, low), high);
var dot = (one, other) => one.reduce((total, value, i) => total + value * other[i], 0);
var less = (one, other) => one.map((value, i) => value - other[i]);
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
    let sum = 0;
    for (let i = 0; i < d; i++, at++) {
      const gap = Math.abs(place[i] - scaled[at]);
      if (power === 2) sum += gap * gap;
      else if (power === 1) sum += gap;
      else if (power !== Infinity) sum += gap ** power;
      else if (gap > sum) sum = gap;
    }
    far[j] = plain ? sum : sum ** (1 / power);
    if (far[j] < far[best] - slack) best = j;
  }
  return best;
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
    const sums = biases.slice(), n = sums.length;
    values.forEach((value, i) => {
      if (value) for (let j = 0, at = i * n; j < n; j++, at++) sums[j] += weights[at] * value;
    });
    values = sums.map((sum) => layer === layers.length - 1 ? Math.tanh(sum) : Math.max(sum, 0));
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
function rollout(scene, policy, start) {
  const { see, step } = dynamics(scene.task.name), states = [start], actions = (
    /** @type {Vector[]} */
    []
  );
  let [state, total, reward, outcome, last] = [start, 0, 0, 0, 0];
  for (let t = 0; t < scene.task.maxSteps && !outcome; t++) {
    const { cell, action } = act(scene, policy, see(state));
    [state, reward, outcome] = step(state, action);
    last = cell;
    total += reward;
    states.push(state);
    actions.push(action);
  }
  return { total, outcome, last, states, actions };
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
    const near = (gap) => Math.abs(gap) < ROUNDED, known = living.find((one) => less(one.codeword, codeword).every(near));
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
  const { step, times, whole } = range;
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
    const moved = times ? from.value * 1.1 ** by : from.value + by * step / 2;
    take(whole ? Math.round(moved) : +(times ? moved.toPrecision(2) : moved.toFixed(2)));
    change();
  };
  const about = { type: "number", step, value: value(), "aria-label": label };
  const acts = { input: () => take(made.valueAsNumber), change, pointerdown, pointermove };
  const made = element("input", { ...about, ...acts });
  return made;
}
function equations({ scene, policy, cells, angular, fixed }, cell, changed) {
  if (policy.layers) return [];
  const { task, plane } = scene, [rows, codeword] = [policy.coefficients[cell], policy.codewords[cell]];
  const term = (label, list, i, step, before, after = "") => {
    const written = field(label, list, i, changed, { step });
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
  text(words, x, y, align = "center") {
    const { ctx, tones } = this;
    Object.assign(ctx, { strokeStyle: tones.paper, fillStyle: tones.ink, lineWidth: 3 });
    ctx.textAlign = align;
    ctx.strokeText(words, x, y);
    ctx.fillText(words, x, y);
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
  const all = [[left, low], [right, low], [right, top], [left, top]], { codewords, scale } = policy;
  tintsOf(view).forEach((hue, i) => {
    const fill = plain ? css(hue[Number(i === view.marked && view.cells > 1)]) : CLEAR, shape = codewords.reduce((left2, other) => nearer(left2, codewords[i], other, scale), all);
    picture.polygons([shape.flat()], fill, css(hue[2]), 1.5);
  });
}
function nearer(shape, one, other, scale) {
  const normal = one.map((value, i) => (other[i] - value) / scale[i] ** 2), middle = one.map((value, i) => (value + other[i]) / 2), beyond = shape.map((corner) => dot(normal, corner) - dot(normal, middle));
  return shape.flatMap((corner, i) => {
    const [before, from, to] = [shape.at(i - 1) ?? corner, beyond.at(i - 1) ?? 0, beyond[i]], cut = before.map((value, k) => value + from / (from - to) * (corner[k] - value));
    return [...from * to < 0 ? [cut] : [], ...to <= 0 ? [corner] : []];
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
  return told.map(([, kind, words]) => element("li", { class: `vsp-${kind}` }, words));
}

// ../vsp/show/explorer/episodes.js
var [BAND, ROW, TEXT] = [14, 72, 26];
var N_STEPS = 150;
var STEPS = Array.from({ length: N_STEPS }, (_, n) => (n + 1) / N_STEPS).flatMap((x) => [x, -x]);
var CLOSE = 0.05;
var CHANGES = 3;
var Episodes = class {
  at = 0;
  // the moment
  /** @type {Seen} */
  episode;
  /** @type {ReturnType<typeof act>[]} */
  done;
  // at each moment
  /** @type {HTMLInputElement} */
  slider;
  text = element("div", { "aria-live": "polite" });
  /** @param {HTMLElement} root @param {EpisodeScene} scene */
  constructor(root, scene) {
    const { episodes, policies, task } = scene;
    this.scene = scene;
    this.policy = ready(policies[0]);
    name(this.policy);
    const all = episodes.flatMap(({ states }) => states);
    this.ranges = task.inputs.map((_, i) => ends(all.map((state) => state[i])));
    const input = () => this.show(+this.slider.value);
    this.slider = element("input", { type: "range", min: 0, "aria-label": "moment", input });
    const take = (share) => this.show(Math.round(share * +this.slider.max));
    this.canvas = touched(take, { "aria-label": "inputs, actions and cells over time" });
    const list = choice("episode", episodes, (episode) => this.open(episode));
    root.append(row(list), this.canvas, row(this.slider), this.text);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    this.open(episodes[0]);
  }
  /** @param {Seen} episode */
  open(episode) {
    this.episode = episode;
    this.done = episode.states.map((state) => act(this.scene, this.policy, state));
    this.slider.max = String(episode.states.length - 1);
    this.show(Math.floor(episode.states.length / 3));
  }
  /** @param {number} at */
  show(at) {
    this.at = at;
    this.slider.value = String(at);
    this.draw();
    this.text.replaceChildren(...this.said());
  }
  draw() {
    const { inputs, outputs } = this.scene.task, { states, agent } = this.episode, high = BAND + ROW * (this.scene.curves.length + outputs.length), { ctx, wide, tones } = begun(this.canvas, high), x = (t) => t / Math.max(states.length - 1, 1) * wide;
    this.canvas.style.height = `${high}px`;
    ctx.lineJoin = "round";
    this.done.forEach(({ cell }, t) => {
      ctx.fillStyle = CELLS[this.policy.tints?.[cell] ?? 0];
      ctx.fillRect(x(t - 0.5), 0, x(1) + 0.5, BAND);
    });
    let low = BAND - 4;
    const plot = (name2, k, ...lines) => {
      const curves = lines.map((line) => line.map((row2) => row2[k])), [least, most] = ends(curves.flat()), y = (v) => (v - least) / (most - least || 1) * (ROW - TEXT);
      low += ROW;
      curves.forEach((values, i) => {
        const theirs = i < lines.length - 1;
        ctx.beginPath();
        values.forEach((value, t) => ctx.lineTo(x(t), low - y(value)));
        ctx.lineWidth = theirs ? 3 : 1.3;
        ctx.strokeStyle = theirs ? tones.teacher : tones.ink;
        ctx.stroke();
      });
      ctx.fillStyle = tones.ink;
      ctx.fillText(`${name2}: ${digits(least)} to ${digits(most)}`, 2, low - ROW + TEXT - 4);
    };
    for (const i of this.scene.curves) plot(inputs[i], i, states);
    outputs.forEach((name2, k) => plot(name2, k, agent, this.done.map(({ action }) => action)));
    ctx.fillStyle = tones.failing;
    ctx.fillRect(x(this.at) - 1, 0, 2, high);
  }
  /** The smallest changes of one input for which `changed` holds, by a grid and then by halving.
   * @param {Vector} state @param {(seen: Vector) => string | boolean} changed may add words */
  changes(state, changed) {
    const found = this.scene.task.inputs.flatMap((name2, i) => {
      const [low, high] = this.ranges[i], wide = high - low;
      const holds = (by2) => {
        const moved = state.with(i, state[i] + by2);
        return moved[i] >= low && moved[i] <= high && changed(moved);
      };
      let by = STEPS.map((step) => step * wide).find(holds);
      if (!by) return [];
      let before = by - Math.sign(by) * wide / N_STEPS;
      for (let half = 0; half < 20; half++)
        if (holds((before + by) / 2)) by = (before + by) / 2;
        else before = (before + by) / 2;
      const said = holds(by) === true ? "" : holds(by), enough = digits(Math.ceil(Math.abs(by) * 1e3) / 1e3), words2 = `${name2} were ${enough} ${by > 0 ? "more" : "less"}${said}`;
      return [{ share: Math.abs(by) / wide, words: words2 }];
    });
    const nearest = found.sort((a, b) => a.share - b.share).slice(0, CHANGES);
    const words = nearest.map(({ words: words2 }) => words2).join(", or ");
    return words || "no change of one input within its range in these episodes";
  }
  said() {
    const { scene, policy, at, episode } = this, { outputs, actionLow, actionHigh } = scene.task, [state, agent] = [episode.states[at], episode.agent[at]], { cell, action } = this.done[at], cells = policy.codewords.length, theirs = agent.map((value, k) => `${outputs[k]} = ${digits(value)}`).join(", "), differ = outputs.filter((_, k) => differs(action[k], agent[k], actionLow[k], actionHigh[k]));
    const line = (what, told) => element("p", {}, element("b", {}, `${what}: `), `${told}.`);
    const lines = [line(`Step ${at * episode.every}`, `here the agent's action is ${theirs}`)];
    const only = `it differs in ${differ.join(", ")}, so what follows explains the policy alone`;
    if (differ.length) lines.push(line("Not as the agent", only));
    lines.push(...answerOf({ scene, policy, cell, cells }, state));
    const moved = (seen) => {
      const other = act(scene, policy, seen).cell;
      return other !== cell && ` (cell ${other})`;
    };
    if (cells > 1) lines.push(line("Another cell would act if", this.changes(state, moved)));
    outputs.forEach((name2, k) => {
      const middle = (actionLow[k] + actionHigh[k]) / 2, above = action[k] >= middle;
      const other = (seen) => act(scene, policy, seen).action[k] >= middle !== above;
      const turned = (seen) => other(seen) && (moved(seen) || true);
      const side = `${above ? "below" : "above"} ${minus(String(middle))}`;
      lines.push(line(`${name2} would be ${side} if`, this.changes(state, turned)));
    });
    return lines;
  }
};
function differs(ours, theirs, low, high) {
  const middle = (low + high) / 2;
  return Math.abs(ours - theirs) > CLOSE * (high - low) || ours >= middle !== theirs >= middle;
}
var ends = (values) => [Math.min(...values), Math.max(...values)];

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
    let [played, sum] = [0, 0];
    for (; played < n && (!played || performance.now() - begun2 < budget); played++) {
      const i = played * STRIDE % n, { total, outcome, last } = rollout(scene, policy, scene.starts[i]);
      if (scene.lost.includes(outcome)) this.failing.set(i, last);
      sum += total;
    }
    const failures = Math.round(this.failing.size / played * n);
    this.results = { played, failures, mean: sum / played };
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
    const { offsetX: x, offsetY: y } = event, finger = event.pointerType === "touch", words = this.movable ? this.policy.codewords ?? [] : [];
    if (finger) this.canvas.focus();
    const near = (places, turned) => {
      const far = places.map((place) => Math.hypot(place[0] - x, place[1] - y)), cell = far.indexOf(Math.min(...far));
      if (far[cell] < (finger ? 22 : 12)) return { cell, turned, finger, place: places[cell] };
    };
    const word = near(words.map((word2) => this.picture.at(word2)), false), found = word ?? near(this.arrows.map(({ tip }) => tip), true), held = { cell: -1, turned: false, finger, place: [x, y], ...found, from: [x, y] };
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
var explorer_default = {
  /** @param {Widget} widget */
  render({ model, el }) {
    el.addEventListener("keydown", (event) => {
      if (event.key.startsWith("Arrow") && !event.altKey && !event.ctrlKey) event.stopPropagation();
    });
    el.classList.add("vsp-controls");
    const made = () => new Explorer(el, JSON.parse(model.get("scene")));
    let view = made();
    model.on("change:scene", () => {
      const { asked } = view;
      view = made();
      view.asked = asked;
      view.redo();
    });
  }
};
async function reveal(root) {
  const files = JSON.parse(root.dataset.scenes ?? "{}"), names = Object.keys(files), address = Object.fromEntries(new URLSearchParams(location.search));
  let wanted = "";
  const open = async (task2, first = {}) => {
    wanted = task2;
    const scene = await (await fetch(files[task2])).json();
    const settled = ({ original: { name: policy }, asked }) => {
      const query = new URLSearchParams({ task: task2, policy, at: String(asked) });
      history.replaceState(null, "", `?${query}${location.hash}`);
    };
    if (wanted === task2) new Explorer(root, scene, above[0] ? { above, settled, first } : {});
  };
  const task = names.find((name2) => name2 === address.task) ?? names[0], above = names.length > 1 ? [choice("task", names, (task2) => open(task2), task)] : [];
  await open(task, address);
}
function mountAll() {
  for (const script of document.querySelectorAll(":is(.vsp-episodes, .vsp-explorer) > script")) {
    const root = (
      /** @type {HTMLElement} */
      script.parentElement
    ), scene = JSON.parse(script.textContent);
    if (root.matches(".vsp-episodes")) new Episodes(root, scene);
    else new Explorer(root, scene);
  }
  for (const root of document.querySelectorAll("[data-scenes]"))
    reveal(
      /** @type {HTMLElement} */
      root
    );
}
export {
  Explorer,
  explorer_default as default,
  mountAll
};
