// The explorer: replay a distillation, query a policy at a state, change the policy and watch its episodes.
// One module for JupyterLab (`render`, which anywidget calls), the site, and standalone HTML files (`mount`). It draws
// a scene, which vsp/show/explorer/scene.py describes.

const PALETTE = ["#0173b2", "#de8f05", "#029e73", "#d55e00", "#cc78bc", "#ca9161", "#56b4e9", "#949494", "#ece133"]
const [GOAL, FAILED, START, INK, PAPER] = ["#029e73", "#d55e00", "#777777", "#222222", "#ffffff"]
const [COARSE, FINE] = [100, 240] // points per axis of the map: while something moves, and afterwards
const IN_MOTION = 8 // milliseconds for episodes while something moves; afterwards all starts are played
const STRIDE = 149 // a prime: the first starts played are spread over all
const ARROWS = 14
const TIE = 1e-9 // the map draws distances as equal that differ by less: rounding would make a checkerboard of them
const ON_BORDER = 1e-9 // a state is on a border if a change by this share of an input's range leads to another cell

const clip = (value, low, high) => Math.min(Math.max(value, low), high)

// ---- The method: which cell, which action

/** Prepare a policy for fast look-ups: store its codewords divided by the scale, in one flat array. */
export function ready(policy) {
  const { codewords, scale } = policy
  policy.scaled = Float64Array.from(codewords.flatMap(codeword => codeword.map((value, i) => value / scale[i])))
  policy.place = new Float64Array(scale.length)
  policy.far = new Float64Array(codewords.length)
  return policy
}

/** The distance of an observation from each codeword in the metric of the look-up (Euclidean: squared). The array is
 * valid until the next call. */
function distances({ scaled, scale, metric, place, far }, seen) {
  const d = scale.length,
    k = far.length
  for (let i = 0; i < d; i++) place[i] = seen[i] / scale[i]
  for (let j = 0, at = 0; j < k; j++) {
    let sum = 0
    for (let i = 0; i < d; i++, at++) {
      const gap = Math.abs(place[i] - scaled[at])
      if (metric === "euclidean") sum += gap * gap
      else if (metric === "manhattan") sum += gap
      else if (gap > sum) sum = gap
    }
    far[j] = sum
  }
  return far
}

/** The index of the nearest codeword; among equally near ones, up to `slack`, the first. */
export function cellOf(policy, seen, slack = 0) {
  const far = distances(policy, seen)
  let best = 0
  for (let j = 1; j < far.length; j++) if (far[j] < far[best] - slack) best = j
  return best
}

/** The output of a linear map for action k. Its rows are the weights of the inputs, then the bias. */
function raw(rows, seen, k) {
  let sum = rows[seen.length][k]
  for (let i = 0; i < seen.length; i++) sum += seen[i] * rows[i][k]
  return sum
}

/** The cell, the output of its map, and the action clipped to its limits. */
export function act({ task }, policy, seen) {
  const cell = cellOf(policy, seen),
    rows = policy.coefficients[cell],
    given = [],
    action = []
  for (let k = 0; k < task.actionLow.length; k++) {
    given.push(raw(rows, seen, k))
    action.push(clip(given[k], task.actionLow[k], task.actionHigh[k]))
  }
  return { cell, raw: given, action }
}

/** The difference between the two smallest distances to codewords: zero on a border. */
export function margin(policy, seen) {
  const [first, second] = distances(policy, seen).slice().sort()
  return second === undefined ? Infinity : second - first
}

// ---- The tasks: `step` returns the next state, the reward and the outcome (0: running, 1: goal, 2: pit)

const TASKS = {
  "SimpleGoal-v0": {
    see: state => state,
    step([x, y], [dx, dy]) {
      const next = [clip(x + 0.1 * clip(dx, -1, 1), 0, 1), clip(y + 0.1 * clip(dy, -1, 1), 0, 1)]
      if (next.every(value => value < 0.1)) return [next, 10, 1]
      if (next.every(value => value > 0.4 && value < 0.6)) return [next, -10, 2]
      return [next, 10 * (Math.hypot(x, y) - Math.hypot(...next)), 0]
    },
    furniture(picture) {
      picture.box(0, 0, 0.1, 0.1, GOAL, "goal")
      picture.box(0.4, 0.4, 0.6, 0.6, "#555555", "pit")
    },
  },
  "MountainCarContinuous-v0": {
    see: state => state,
    step([x, v], [force]) {
      let speed = clip(v + 0.0015 * clip(force, -1, 1) - 0.0025 * Math.cos(3 * x), -0.07, 0.07)
      const place = clip(x + speed, -1.2, 0.6)
      if (place === -1.2 && speed < 0) speed = 0
      const there = place >= 0.45 && speed >= 0
      return [[Math.fround(place), Math.fround(speed)], (there ? 100 : 0) - 0.1 * force ** 2, there ? 1 : 0]
    },
    furniture: picture => picture.box(0.45, 0, 0.6, 0.07, GOAL, "flag"),
  },
  "Pendulum-v1": {
    see: ([angle, speed]) => [Math.cos(angle), Math.sin(angle), speed],
    step([angle, speed], [torque]) {
      const turn = 2 * Math.PI,
        upright = ((((angle + Math.PI) % turn) + turn) % turn) - Math.PI
      const cost = upright ** 2 + 0.1 * speed ** 2 + 0.001 * torque ** 2
      const next = clip(speed + (15 * Math.sin(angle) + 3 * clip(torque, -2, 2)) * 0.05, -8, 8)
      return [[angle + next * 0.05, next], -cost, 0]
    },
    furniture: () => {},
  },
}

/** A task that is not simulated here: a policy sees the stored state. */
const UNKNOWN = { see: state => state, furniture: () => {} }

/** The dynamics of a task: the observation of a state, and a step. */
export const dynamics = name => TASKS[name]

/** Run an episode: its return, its outcome, and with `keep` its states and the cells that acted. */
export function rollout(scene, policy, start, keep = false) {
  const { see, step } = TASKS[scene.task.name],
    states = [start],
    cells = []
  let state = start,
    total = 0,
    outcome = 0
  for (let t = 0; t < scene.task.maxSteps && !outcome; t++) {
    const { cell, action } = act(scene, policy, see(state))
    let reward
    ;[state, reward, outcome] = step(state, action)
    total += reward
    if (keep) {
      states.push(state)
      cells.push(cell)
    }
  }
  return { total, outcome, states, cells }
}

// ---- Drawing

/** The canvas, with coordinates of the plane. */
class Picture {
  constructor(canvas, plane) {
    Object.assign(this, { canvas, plane, ctx: canvas.getContext("2d"), map: new OffscreenCanvas(1, 1) })
    this.edge = { left: 44, right: 8, top: 8, bottom: 34 }
  }
  fit() {
    const ratio = devicePixelRatio || 1,
      side = this.canvas.clientWidth || 440
    if (this.canvas.width !== Math.round(side * ratio))
      this.canvas.width = this.canvas.height = Math.round(side * ratio)
    this.ctx.setTransform(ratio, 0, 0, ratio, 0, 0)
    this.side = side
    this.wide = side - this.edge.left - this.edge.right
    this.high = side - this.edge.top - this.edge.bottom
  }
  at([x, y]) {
    const { low, high } = this.plane
    return [
      this.edge.left + ((x - low[0]) / (high[0] - low[0])) * this.wide,
      this.edge.top + ((high[1] - y) / (high[1] - low[1])) * this.high,
    ]
  }
  point(px, py) {
    const { low, high } = this.plane
    return [
      low[0] + ((px - this.edge.left) / this.wide) * (high[0] - low[0]),
      high[1] - ((py - this.edge.top) / this.high) * (high[1] - low[1]),
    ].map((v, i) => clip(v, low[i], high[i]))
  }
  box(x0, y0, x1, y1, colour, label) {
    const [left, bottom] = this.at([x0, y0]),
      [right, top] = this.at([x1, y1]),
      { ctx } = this
    ctx.fillStyle = colour + "66"
    ctx.fillRect(left, top, right - left, bottom - top)
    ctx.fillStyle = INK
    ctx.textAlign = "center"
    ctx.fillText(label, (left + right) / 2, (top + bottom) / 2 + 4)
  }
  line(points, colour, width = 2) {
    const { ctx } = this
    ctx.beginPath()
    points.forEach((point, i) => {
      const [x, y] = this.at(point),
        far = i && Math.abs(x - this.at(points[i - 1])[0]) > this.wide / 2
      i && !far ? ctx.lineTo(x, y) : ctx.moveTo(x, y) // no line where an angle wraps around
    })
    ctx.strokeStyle = colour
    ctx.lineWidth = width
    ctx.stroke()
  }
  dot(point, radius, fill, stroke) {
    const { ctx } = this
    ctx.beginPath()
    ctx.arc(...this.at(point), radius, 0, 7)
    if (fill) {
      ctx.fillStyle = fill
      ctx.fill()
    }
    if (stroke) {
      ctx.strokeStyle = stroke
      ctx.lineWidth = 1.5
      ctx.stroke()
    }
  }
  axes() {
    const {
        ctx,
        plane: { low, high, labels },
      } = this,
      { left, top } = this.edge
    ctx.strokeStyle = ctx.fillStyle = INK
    ctx.lineWidth = 1
    ctx.strokeRect(left, top, this.wide, this.high)
    ctx.textAlign = "center"
    const number = value => String(+value.toPrecision(2)).replace("-", "−")
    for (const share of [0, 0.5, 1]) {
      const point = low.map((value, i) => value + share * (high[i] - value)),
        [x, y] = this.at(point)
      ctx.textAlign = share === 1 ? "right" : share ? "center" : "left"
      ctx.fillText(number(point[0]), x, top + this.high + 14)
      ctx.textAlign = "right"
      ctx.fillText(number(point[1]), left - 4, share === 1 ? y + 9 : share ? y + 4 : y)
    }
    ctx.textAlign = "center"
    ctx.fillText(labels[0], left + this.wide / 2, top + this.high + 29)
    ctx.save()
    ctx.translate(8, top + this.high / 2)
    ctx.rotate(-Math.PI / 2)
    ctx.fillText(labels[1], 0, 0)
    ctx.restore()
  }
}

const rgb = colour => [1, 3, 5].map(i => parseInt(colour.slice(i, i + 2), 16))
const TINTS = PALETTE.map(colour => rgb(colour).map(part => 255 - 0.3 * (255 - part)))
const [LEFT, RIGHT] = [rgb("#2d004b"), rgb("#7f3b08")] // purple and orange, as in the force maps of the figures

/** Draw the policy's map: with one action the action, else the cells in pale colours; borders are dark. */
function drawMap(view, n) {
  const { picture, scene, policy } = view,
    { low, high } = picture.plane
  const image = new ImageData(n, n),
    cells = new Int16Array(n * n)
  const single = scene.task.outputs.length === 1,
    most = scene.task.actionHigh[0]
  for (let row = 0; row < n; row++) {
    const y = high[1] - ((row + 0.5) / n) * (high[1] - low[1])
    for (let column = 0; column < n; column++) {
      const seen = view.see([low[0] + ((column + 0.5) / n) * (high[0] - low[0]), y])
      const at = row * n + column,
        cell = (cells[at] = cellOf(policy, seen, TIE))
      let colour = TINTS[cell % TINTS.length]
      if (single) {
        const rows = policy.coefficients[cell],
          share = clip(raw(rows, seen, 0) / most, -1, 1)
        colour = (share < 0 ? LEFT : RIGHT).map(part => 255 - 0.55 * Math.abs(share) * (255 - part))
      }
      const edge = (column && cells[at - 1] !== cell) || (row && cells[at - n] !== cell)
      const light = edge ? 0.3 : cell === view.cell ? 0.86 : 1
      colour.forEach((part, i) => {
        image.data[4 * at + i] = part * light
      })
      image.data[4 * at + 3] = 255
    }
  }
  picture.map.width = picture.map.height = n
  picture.map.getContext("2d").putImageData(image, 0, 0)
}

/** Draw the picture. An outdated map has few points, and not all starts are played, until nothing moves. */
function draw(view) {
  if (!view.stored && view.mapped !== view.cell) {
    drawMap(view, COARSE)
    view.mapped = view.cell
    clearTimeout(view.later)
    view.later = setTimeout(() => {
      if (view.waiting) return // a change comes, and its own timer
      if (view.played < view.scene.starts.length) view.judge()
      drawMap(view, FINE)
      drawAll(view)
    }, 120)
  }
  drawAll(view)
}

function drawAll(view) {
  const { picture, scene, policy } = view,
    { ctx } = picture
  picture.fit()
  ctx.fillStyle = PAPER
  ctx.fillRect(0, 0, picture.side, picture.side)
  ctx.font = "12px system-ui, sans-serif"
  ctx.save()
  if (view.stored) {
    ctx.beginPath()
    ctx.rect(picture.edge.left, picture.edge.top, picture.wide, picture.high)
    ctx.clip() // codewords may lie far outside
    drawStored(view)
  } else {
    ctx.drawImage(picture.map, picture.edge.left, picture.edge.top, picture.wide, picture.high)
    view.task.furniture(picture)
    if (scene.task.outputs.length === 2) drawArrows(view)
    scene.starts.forEach((start, i) => {
      const lost = view.guessed && view.ends[i]
      picture.dot(view.place(start), lost ? 3 : 1.3, lost ? FAILED : START)
    })
  }
  picture.line(view.path.map(view.place), PAPER, 4)
  picture.line(view.path.map(view.place), INK, 2)
  if (!view.stored) view.path.slice(1).forEach(state => picture.dot(view.place(state), 2, INK))
  policy.codewords.forEach((codeword, i) =>
    picture.dot(view.placeSeen(codeword), 5, i === view.cell ? INK : PAPER, INK),
  )
  drawChosen(view)
  ctx.restore()
  picture.axes()
}

/** Draw the chosen state: a ring with a white rim. */
function drawChosen({ picture, stored, asked, seen, place }) {
  const point = stored ? place(seen) : asked
  picture.dot(point, 8, PAPER)
  picture.dot(point, 6, null, INK)
  picture.dot(point, 2.5, INK)
}

/** Draw the states of all stored episodes in the colours of their cells: one path per colour. */
function drawStored(view) {
  const { picture, cells } = view,
    paths = PALETTE.map(() => new Path2D())
  view.episodes.forEach(({ states }, episode) =>
    states.forEach((state, step) => {
      const [x, y] = picture.at(view.place(state))
      paths[cells[episode][step] % PALETTE.length].rect(x - 1.7, y - 1.7, 3.4, 3.4)
    }),
  )
  paths.forEach((path, i) => {
    picture.ctx.fillStyle = PALETTE[i]
    picture.ctx.fill(path)
  })
}

function drawArrows(view) {
  const { picture, scene, policy } = view,
    { low, high } = picture.plane,
    { ctx } = picture
  const length = (picture.wide / ARROWS) * 0.42
  ctx.strokeStyle = "#333333"
  ctx.lineWidth = 1
  for (let i = 0; i < ARROWS * ARROWS; i++) {
    const point = [i % ARROWS, Math.floor(i / ARROWS)].map(
      (k, axis) => low[axis] + ((k + 0.5) / ARROWS) * (high[axis] - low[axis]),
    )
    const [dx, dy] = act(scene, policy, point).action,
      [x, y] = picture.at(point)
    const [ex, ey] = [x + dx * length, y - dy * length],
      turn = Math.atan2(-dy, dx)
    ctx.beginPath()
    ctx.moveTo(x - dx * length, y + dy * length)
    ctx.lineTo(ex, ey)
    for (const side of [-2.6, 2.6]) {
      ctx.moveTo(ex, ey)
      ctx.lineTo(ex + 4 * Math.cos(turn + side), ey + 4 * Math.sin(turn + side))
    }
    ctx.stroke()
  }
}

// ---- The explorer

const STYLE = `
.vsp-explorer { display: flex; flex-wrap: wrap; gap: 1rem 1.5rem; align-items: flex-start; font-size: 0.95rem }
.vsp-explorer canvas { width: min(100%, 440px); aspect-ratio: 1; touch-action: none; cursor: crosshair; flex: none }
.vsp-explorer canvas:focus-visible { outline: 3px solid #0173b2 }
.vsp-explorer .vsp-panel { flex: 1 1 260px; min-width: 0 }
.vsp-explorer .vsp-row { display: flex; flex-wrap: wrap; gap: 0.3rem 0.6rem; align-items: center; margin: 0 0 0.6rem }
.vsp-explorer table { border-collapse: collapse; margin: 0.3rem 0; display: block; overflow-x: auto }
.vsp-explorer .vsp-scroll { overflow: auto; max-height: 15rem }
.vsp-explorer .vsp-scroll table { overflow: visible } .vsp-explorer .vsp-scroll th { white-space: nowrap }
.vsp-explorer :is(td, th) { padding: 0.1rem 0.4rem; text-align: right; font-weight: normal }
.vsp-explorer fieldset :is(td, th) { padding: 0.1rem }
.vsp-explorer legend { font-size: inherit }
.vsp-explorer [hidden] { display: none }
.vsp-explorer .vsp-note { font-size: 0.85rem; opacity: 0.85 }
.vsp-explorer fieldset { border: 1px solid #888; padding: 0.2rem 0.3rem; margin: 0.5rem 0; min-width: 0 }
.vsp-explorer code { overflow-wrap: anywhere }
.vsp-explorer input[type=number] { width: 4.3rem; box-sizing: border-box; padding: 0 0.2rem } .vsp-explorer input[type=range] { flex: 1 1 140px }
.vsp-explorer p { margin: 0.3rem 0 }`

/** Make an element with attributes, listeners (functions) and children. */
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag)
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name, value)
    else if (value !== false) made.setAttribute(name, value === true ? "" : value)
  }
  made.append(...children)
  return made
}

/** Make a table: names of the columns, then rows that begin with their name. */
const table = (head, rows) =>
  element(
    "table",
    {},
    element("tr", {}, ...head.map(name => element(name ? "th" : "td", name ? { scope: "col" } : {}, name))),
    ...rows.map(([name, ...values]) =>
      element("tr", {}, element("th", { scope: "row" }, name), ...values.map(value => element("td", {}, value))),
    ),
  )

const digits = value => (Math.abs(value) < 5e-4 ? "0.000" : value.toFixed(3)).replace("-", "\u2212")
const minus = text => text.replaceAll("-", "\u2212")
const copied = policy => structuredClone(policy)
const button = (label, click) => element("button", { type: "button", click }, label)

/** A row of controls for a sequence: back, play, forward, and a slider. */
class Player {
  constructor(name, labels, { turn, jump }) {
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches
    Object.assign(this, { turn, wait: still ? 1000 : 0 }) // one picture a second for reduced motion
    const input = () => this.to(+this.slider.value)
    this.slider = element("input", { type: "range", min: 0, value: 0, "aria-label": name, input })
    this.toggle = button("play", () => (this.playing ? this.stop() : this.start()))
    this.said = element("span", {})
    const [back, on] = labels.map((label, i) => button(label, () => (this.stop(), jump(i ? 1 : -1))))
    this.row = element("div", { class: "vsp-row" }, back, this.toggle, on, this.slider, this.said)
  }
  get at() {
    return +this.slider.value
  }
  get last() {
    return +this.slider.max
  }
  /** Set the number of moments and go to one of them. */
  restart(count, at) {
    this.stop()
    this.slider.max = count - 1
    this.to(at)
  }
  to(i) {
    this.slider.value = i
    this.text = this.turn(this.at)
  }
  /** Say where it is: along with the picture and all other texts, which are drawn with the next frame. */
  tell() {
    if (this.text === undefined || this.said.textContent === this.text) return
    this.said.textContent = this.text
    this.slider.setAttribute("aria-valuetext", this.text)
  }
  start() {
    this.playing = true
    this.toggle.textContent = "pause"
    if (this.at === this.last) this.to(0)
    let before = performance.now()
    const frame = now => {
      if (!this.playing || !this.slider.isConnected) return
      if (now - before >= this.wait) {
        before = now
        this.to(this.at + 1)
      }
      this.at < this.last ? requestAnimationFrame(frame) : this.stop()
    }
    requestAnimationFrame(frame)
  }
  stop() {
    this.playing = false
    this.toggle.textContent = "play"
  }
}

const UNCHANGED = [
  "Dots are states of stored episodes, in the colours of their cells. Circles are codewords; some lie outside the picture.",
  "Click a state, or step through its episode.",
  "Nothing can be changed here: the browser cannot play this task, only SimpleGoal, MountainCar and Pendulum.",
].join(" ")

/** Replace the content of `root` by the explorer: a view with a policy, a chosen state and texts about them. */
class Explorer {
  constructor(root, scene) {
    const { low, high } = scene.plane
    this.canvas = element("canvas", { tabindex: 0, role: "application" }) // so that screen readers leave it the arrow keys
    Object.assign(this, {
      scene,
      task: dynamics(scene.task.name) ?? UNKNOWN,
      picture: new Picture(this.canvas, scene.plane),
    })
    Object.assign(this, { stored: scene.stored, path: null, ends: [], frames: 0, guessed: !scene.guess })
    this.asked = low.map((value, i) => value + 0.7 * (high[i] - value))
    this.angular = scene.task.name === "Pendulum-v1"
    this.many = scene.task.inputs.length > 8 || scene.task.outputs.length > 3
    this.answer = this.answers()
    this.result = element("p", { "aria-live": "polite" })
    const left = ({ relatedTarget: to }) => this.stale && !this.form.contains(to) && this.changed()
    this.form = element("div", { focusout: left }) // while a reader writes, the form stays as it is, even if it is stale
    this.names = element(
      "select",
      { "aria-label": "policy", change: () => this.choose(+this.names.value) },
      ...scene.policies.map((policy, i) => element("option", { value: i }, policy.name)),
    )
    this.replay = new Player("iteration", ["previous change", "next change"], {
      turn: i => this.turnTo(i),
      jump: way => this.jump(way),
    })
    this.steps = new Player("step", ["previous episode", "next episode"], {
      turn: i => this.stepTo(i),
      jump: way => this.episodeTo(this.episode + way),
    })
    const title = element("label", {}, "policy ", this.names)
    const back = button("reset", () => this.choose(this.chosen))
    const rows = [element("div", { class: "vsp-row" }, title, ...(this.stored ? [] : [back])), this.replay.row]
    const said = [this.stored ? this.steps.row : "", this.guessed ? "" : this.question(), this.result, this.answer]
    const panel = element("div", { class: "vsp-panel" }, ...rows, ...said, this.form, this.note())
    root.classList.add("vsp-explorer")
    const held = root.contains(document.activeElement) // the replaced picture has the keyboard's focus
    root.replaceChildren(element("style", {}, STYLE), this.canvas, panel)
    if (held) this.canvas.focus()
    this.listen()
    new ResizeObserver(() => this.waiting || draw(this)).observe(this.canvas)
    this.choose(0)
  }

  // -- The place of a state and of an observation in the picture
  place = state => {
    if (this.stored) return this.stored.axes.map(i => state[i])
    if (!this.angular) return state
    const [angle, speed] = state
    return [angle - 2 * Math.PI * Math.round(angle / 2 / Math.PI), speed]
  }
  placeSeen = seen => {
    if (this.stored) return this.place(seen)
    return this.angular ? [Math.atan2(seen[1], seen[0]), seen[2]] : seen
  }
  see = point => this.task.see(point)
  /** The stored episodes of the chosen policy. */
  get episodes() {
    return this.scene.policies[this.chosen].episodes
  }
  get seen() {
    return this.stored ? this.episodes[this.episode].states[this.steps.at] : this.see(this.asked)
  }

  // -- Texts about the policy and the chosen state
  ask() {
    const { inputs, outputs } = this.scene.task,
      seen = this.seen,
      { cell, raw: given, action } = act(this.scene, this.policy, seen),
      rows = this.policy.coefficients[cell]
    this.cell = cell
    const teacher = this.teachers()
    const results = [
      ["sum", ...given.map(digits)],
      [this.many ? "action" : "action, within the limits", ...action.map(digits)],
      ...(teacher ? [[this.many ? "teacher" : "the teacher's action", ...teacher.map(digits)]] : []),
    ]
    this.where.replaceChildren(element("b", {}, `Cell ${cell + 1} of ${this.policy.codewords.length}. `), this.border())
    this.written.replaceChildren(
      ...outputs.map((name, k) => element("p", {}, element("code", {}, equation(name, inputs, rows, k)))),
    )
    const adds = this.adds(seen, rows)
    if (this.many) this.results.replaceChildren(table(["", ...outputs], results))
    this.added.replaceChildren(table(["", ...outputs], this.many ? adds : [...adds, ...results]))
    const keys = this.stored ? "Left and right step through the episode." : "Arrow keys move it."
    const moving = this.replay.playing || this.steps.playing // nobody can listen to that much
    for (const said of [this.where, this.result]) said.setAttribute("aria-live", moving ? "off" : "polite")
    this.canvas.setAttribute("aria-label", `Map of the policy. The chosen state is in cell ${cell + 1}. ${keys}`)
  }
  /** One row for what each input and the bias add; with many inputs, the largest first. */
  adds(seen, rows) {
    const { inputs } = this.scene.task
    const found = [...inputs, ""].map((name, i) => {
      const values = rows[i].map(weight => (name ? weight * seen[i] : weight))
      return {
        values,
        size: Math.max(...values.map(Math.abs)),
        name: name ? `${name} = ${digits(seen[i])}` : "the bias",
      }
    })
    if (this.many) found.sort((one, other) => other.size - one.size)
    return found.map(({ name, values }) => [this.many ? name : `${name} adds`, ...values.map(digits)])
  }
  /** Make the elements for these texts. They are kept, so that a scrolled box stays as the reader left it. */
  answers() {
    const box = name =>
      element("div", this.many ? { class: "vsp-scroll", tabindex: 0, role: "region", "aria-label": name } : {})
    Object.assign(this, { where: element("p", { "aria-live": "polite" }), written: element("div") })
    Object.assign(this, { results: box("sum and actions"), added: box("what each input adds") })
    if (!this.many) return element("div", {}, this.where, this.written, this.added)
    const folded = element("details", {}, element("summary", {}, "equations"), this.written)
    const first = element("p", { class: "vsp-note" }, "What each input adds, largest first:")
    return element("div", {}, this.where, folded, this.results, first, this.added)
  }
  teachers() {
    if (this.stored) return this.episodes[this.episode].teacher?.[this.steps.at]
    return this.scene.teacher && teacherAt(this.scene, this.asked)
  }
  /** Describe the smallest change of one input (or coordinate of the plane) that leads to another cell. */
  border() {
    const { stored, scene } = this,
      labels = stored ? scene.task.inputs : scene.plane.labels
    const cellAt = point => cellOf(this.policy, this.see(point))
    const [angle] = this.asked,
      { low, high } = scene.plane
    const turn = { low: [angle - Math.PI, low[1]], high: [angle + Math.PI, high[1]] } // cells go on beyond the edge
    const box = stored ?? (this.angular ? turn : scene.plane)
    const found = leastChange(stored ? this.seen : this.asked, this.cell, box, cellAt)
    if (found.axis === undefined) return "No change of one input leads to another cell."
    if (found.share < ON_BORDER) return `The state is on the border to cell ${found.to + 1}.`
    const gap = Math.abs(found.gap) < 0.005 ? minus(found.gap.toPrecision(2)) : digits(found.gap)
    const share = stored ? ` (${(100 * found.share).toPrecision(2)} % of its range)` : ""
    return `A change of ${gap} in ${labels[found.axis]}${share} leads to cell ${found.to + 1}.`
  }
  /** Run an episode from every start, or from as many as `budget` milliseconds allow, and describe the results. */
  judge(policy = this.policy, budget = Infinity) {
    const { scene } = this,
      n = scene.starts.length,
      begun = performance.now()
    let sum = 0
    this.ends = [] // of starts that were not played: undefined
    for (this.played = 0; this.played < n && (!this.played || performance.now() - begun < budget); this.played++) {
      const i = (this.played * STRIDE) % n,
        { total, outcome } = rollout(scene, policy, scene.starts[i])
      this.ends[i] = scene.lost.includes(outcome)
      sum += total
    }
    this.mean = sum / this.played
    this.failures = this.ends.filter(Boolean).length
    const fails = scene.lost.length ? ` ${this.failures} of ${this.played} fail.` : ""
    const teacher = scene.teacher ? ` The teacher: ${scene.teacher.mean.toFixed(2)}.` : ""
    const text = minus(`Mean return from ${this.played} starts: ${this.mean.toFixed(2)}.${fails}${teacher}`)
    this.result.textContent = this.guessed ? text : ""
  }
  /** Ask the question. Results stay hidden until the reader guesses or asks to see them; then show guess and results. */
  question() {
    const { guess, policies, lost } = this.scene
    const row = element("div", { class: "vsp-row" })
    const show = guessed => () => {
      if (guessed && !Number.isFinite(input.valueAsNumber)) return input.focus()
      const first = ready(copied(policies[0])),
        own = guessed ? ` Your guess: ${input.valueAsNumber}.` : ""
      this.judge(first) // the original policy, whatever the reader chose or changed meanwhile
      this.guessed = true
      const answer = lost.length ? `${this.failures} of ${this.played} fail` : `mean return ${this.mean.toFixed(2)}`
      const said = element("p", { tabindex: -1 }, minus(`${guess}${own} ${first.name}: ${answer}.`))
      row.replaceWith(said)
      said.focus()
      this.changed({ policy: true, whole: false })
    }
    const input = element("input", {
      type: "number",
      "aria-label": "your guess",
      keydown: event => event.key === "Enter" && show(true)(),
    })
    row.append(element("span", {}, guess), input, button("guess", show(true)), button("show", show(false)))
    return row
  }
  note() {
    const { task, lost, teacher } = this.scene
    if (this.stored) return element("p", { class: "vsp-note" }, UNCHANGED)
    const said = [
      task.outputs.length === 1
        ? `Purple: ${task.outputs[0]} below 0; brown: above 0.`
        : "An arrow is the action there.",
      `Circles are codewords${this.angular ? "" : ": drag one"}. Click or drag elsewhere to choose a state; its episode is black.`,
      lost.length ? "Small dots are starts; orange ones fail." : "Small dots are starts.",
      teacher
        ? `The teacher's action is interpolated on a grid: its error is about ${teacher.usual.toFixed(3)} or less in 90 % of states, and at most ${teacher.error.toFixed(2)} in all that were tried.`
        : "",
    ]
    return element("p", { class: "vsp-note" }, said.join(" "))
  }

  // -- What can be changed
  number(label, value, step, put) {
    const input = element("input", {
      type: "number",
      step,
      value: +value.toFixed(3),
      "aria-label": label,
      input: () => {
        if (!Number.isFinite(input.valueAsNumber)) return (this.stale = true)
        put(input.valueAsNumber)
        this.changed({ policy: true, whole: false })
      },
    })
    return input
  }
  showForm() {
    const { policy, cell, angular } = this,
      { inputs, outputs } = this.scene.task,
      { low, high } = this.scene.plane
    const steps = policy.scale.map((_, i) => (angular ? 0.05 : +((high[i] - low[i]) / 50).toPrecision(1)))
    const put = (row, i) => value => (row[i] = value)
    const codeword = i =>
      this.number(`codeword: ${inputs[i]}`, policy.codewords[cell][i], steps[i], put(policy.codewords[cell], i))
    const weight = (i, name, k) =>
      this.number(`${outputs[k]}: ${name}`, policy.coefficients[cell][i][k], 0.1, put(policy.coefficients[cell][i], k))
    const rows = [...inputs, "bias"].map((name, i) => [
      name,
      i < inputs.length ? codeword(i) : "",
      ...outputs.map((_, k) => weight(i, name, k)),
    ])
    const legend = element("legend", {}, `Change cell ${cell + 1}`)
    this.stale = false
    this.form.replaceChildren(element("fieldset", {}, legend, table(["", "codeword", ...outputs], rows)))
  }

  // -- Update everything that depends on policy and state, and the picture. `renewed`: the policy changed.
  redo(renewed = true) {
    const before = this.cell
    if (renewed) {
      ready(this.policy)
      this.mapped = null
      if (this.stored) this.cells = this.episodes.map(({ states }) => states.map(state => cellOf(this.policy, state)))
      else this.judge(this.policy, IN_MOTION)
    }
    this.ask()
    this.path = this.stored ? this.recent() : rollout(this.scene, this.policy, this.asked, true).states
    const writing = this.form.contains(document.activeElement)
    if (!this.stored && (this.whole || (this.cell !== before && !writing))) this.showForm()
    else this.stale ||= this.cell !== before
    this.whole = false
    for (const player of [this.replay, this.steps]) player.tell()
    draw(this)
    this.frames += 1
  }
  /** The last steps of a stored episode up to the chosen one: the whole episode may fill the picture. */
  recent() {
    return this.episodes[this.episode].states.slice(Math.max(0, this.steps.at - 30), this.steps.at + 1)
  }
  /** Schedule one update before the next frame. `whole`: with the form, in which the reader may be writing. */
  changed({ policy = false, whole = true } = {}) {
    this.renewed ||= policy
    this.whole ||= whole
    this.waiting ||= requestAnimationFrame(() => {
      const anew = this.renewed
      this.waiting = 0
      this.renewed = false
      this.redo(anew)
    })
  }

  // -- Choosing a policy, an iteration, an episode
  choose(i) {
    const policy = this.scene.policies[i]
    this.chosen = i
    this.run = policy.replay ?? null
    this.policy = copied(policy)
    this.replay.stop()
    this.replay.row.hidden = !this.run
    if (this.stored) this.episodeTo(0)
    if (this.run) this.replay.restart(this.run.length, this.run.length - 1)
    this.changed({ policy: true })
  }
  turnTo(i) {
    const { n, codewords, coefficients, change } = this.run[i],
      cells = codewords.length
    const { replay, episodes, ...policy } = this.scene.policies[this.chosen]
    this.policy = copied({ ...policy, codewords, coefficients })
    this.changed({ policy: true })
    return `iteration ${n}: ${cells} cell${cells > 1 ? "s" : ""}${change ? `, ${change}` : ""}`
  }
  jump(way) {
    const there = i => this.run[i].change || i === 0 || i === this.run.length - 1
    let i = this.replay.at + way
    while (i >= 0 && i < this.run.length && !there(i)) i += way
    if (i >= 0 && i < this.run.length) this.replay.to(i)
  }
  episodeTo(i, step = 0) {
    this.episode = (i + this.episodes.length) % this.episodes.length
    this.steps.restart(this.episodes[this.episode].states.length, step)
  }
  stepTo(i) {
    this.changed({ whole: false })
    const { every, steps } = this.episodes[this.episode]
    return `episode ${this.episode + 1} of ${this.episodes.length}, step ${i * every + 1} of ${steps}`
  }

  // -- Pointer and keys
  listen() {
    let dragged = null
    const { canvas, picture } = this
    const under = event => {
      const box = canvas.getBoundingClientRect()
      return [event.clientX - box.left, event.clientY - box.top]
    }
    const far = (point, [px, py]) => {
      const [x, y] = picture.at(point)
      return Math.hypot(x - px, y - py)
    }
    const move = event => {
      if (dragged === null || (event.type === "pointermove" && !event.buttons)) return
      if (this.stored) return this.nearest(place => far(place, under(event)))
      const point = picture.point(...under(event))
      if (dragged >= 0) this.policy.codewords[dragged] = point
      this.asked = point
      this.changed({ policy: dragged >= 0, whole: dragged >= 0 })
    }
    canvas.addEventListener("pointerdown", event => {
      if (event.button || !event.isPrimary) return
      canvas.setPointerCapture(event.pointerId)
      const hit = codeword => far(this.placeSeen(codeword), under(event)) < 11
      dragged = this.stored || this.angular ? -1 : this.policy.codewords.findIndex(hit)
      move(event)
    })
    canvas.addEventListener("pointermove", move)
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (dragged = null))
    canvas.addEventListener("keydown", event => this.key(event))
  }
  /** Choose the nearest stored state; `distance` takes its place in the picture. */
  nearest(distance) {
    let best = { gap: Infinity }
    this.episodes.forEach(({ states }, episode) =>
      states.forEach((state, step) => {
        const gap = distance(this.place(state))
        if (gap < best.gap) best = { gap, episode, step }
      }),
    )
    this.episodeTo(best.episode, best.step)
  }
  key(event) {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] }[event.key]
    if (!way || event.altKey || event.ctrlKey || event.metaKey) return
    event.preventDefault()
    if (this.stored) return way[0] ? this.steps.to(this.steps.at + way[0]) : this.episodeTo(this.episode + way[1])
    const { low, high } = this.scene.plane,
      by = event.shiftKey ? 0.1 : 0.01
    this.asked = this.asked.map((value, i) => clip(value + way[i] * by * (high[i] - low[i]), low[i], high[i]))
    this.changed({ whole: false })
  }
}

/** Put the explorer into `root`. Returns its view, for tests. */
export const mount = (root, scene) => new Explorer(root, scene)

function equation(name, inputs, rows, k) {
  const terms = [...inputs.map((input, i) => [rows[i][k], ` ${input}`]), [rows[inputs.length][k], ""]]
  const sum = terms.map(
    ([value, input], i) =>
      `${value < 0 ? (i ? " \u2212 " : "\u2212") : i ? " + " : ""}${Math.abs(value).toFixed(2)}${input}`,
  )
  return `${name} = ${sum.join("")}`
}

/** The smallest change of one coordinate of `point`, as a share of its range, that leads from `cell` to another. */
function leastChange(point, cell, { low, high }, cellAt) {
  const changed = [...point]
  let least = { share: 1 }
  for (const axis of point.keys()) {
    for (const end of [low[axis], high[axis]]) {
      const range = high[axis] - low[axis],
        reach = clip(end - point[axis], -least.share * range, least.share * range)
      if (!reach) continue
      const at = gap => {
        changed[axis] = point[axis] + gap
        return cellAt(changed)
      }
      let [inside, outside] = [0, null]
      for (let i = 1; i <= 200 && outside === null; i++) {
        const gap = (i / 200) * reach
        if (at(gap) === cell) inside = gap
        else outside = gap
      }
      if (outside === null) continue
      for (let i = 0; i < 30; i++) {
        const half = (inside + outside) / 2
        at(half) === cell ? (inside = half) : (outside = half)
      }
      least = { share: Math.abs(outside) / range, gap: outside, axis, to: at(outside) }
    }
    changed[axis] = point[axis]
  }
  return least
}

/** The teacher's action at a point of the plane, by bilinear interpolation between the points of its grid. */
export function teacherAt(scene, point) {
  const { low, high } = scene.plane,
    { n, actions } = scene.teacher
  const [u, v] = point.map((value, i) => ((value - low[i]) / (high[i] - low[i])) * (n - 1))
  const [i, j] = [u, v].map(value => clip(Math.floor(value), 0, n - 2)),
    [a, b] = [u - i, v - j]
  const at = (p, q, k) => actions[p * n + q][k]
  return scene.task.outputs.map(
    (_, k) =>
      (1 - a) * (1 - b) * at(i, j, k) +
      a * (1 - b) * at(i + 1, j, k) +
      (1 - a) * b * at(i, j + 1, k) +
      a * b * at(i + 1, j + 1, k),
  )
}

/** For anywidget: the scene is JSON text. */
export default {
  render({ model, el }) {
    el.addEventListener("keydown", event => {
      // JupyterLab would take the arrow keys from sliders and lists to select a cell
      if (event.key.startsWith("Arrow") && !event.altKey && !event.ctrlKey && !event.metaKey) event.stopPropagation()
    })
    el.classList.add("vsp-controls") // hides the still picture for readers without a kernel: vsp/show/page.py
    let view = mount(el, JSON.parse(model.get("scene")))
    model.on("change:scene", () => {
      const { asked } = view // the reader's state stays chosen
      view = mount(el, JSON.parse(model.get("scene")))
      view.asked = asked
      view.redo() // at once: the page keeps its height, and so its scroll position
    })
  },
}

/** On a page: every explorer contains its scene, or loads it from a file when it comes into view. */
export function mountAll() {
  for (const root of document.querySelectorAll(".vsp-explorer:not([data-mounted])")) {
    root.dataset.mounted = true
    const inner = root.querySelector("script")
    if (inner) mount(root, JSON.parse(inner.textContent))
    else
      new IntersectionObserver(
        async ([seen], watch) => {
          if (!seen.isIntersecting) return
          watch.disconnect()
          mount(root, await (await fetch(root.dataset.scene)).json())
        },
        { rootMargin: "200px" },
      ).observe(root)
  }
}
