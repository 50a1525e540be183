// The explorer: replay a distillation, ask a policy about a state, change it and see what becomes of the episodes.
// One module for JupyterLab (`render`, as anywidget asks), for the site and for one HTML file (`mount`). It draws a
// scene, which vsp/show/explorer/scene.py describes.

const PALETTE = ["#0173b2", "#de8f05", "#029e73", "#d55e00", "#cc78bc", "#ca9161", "#56b4e9", "#949494", "#ece133"]
const [GOAL, FAILED, INK, PAPER] = ["#029e73", "#d55e00", "#222222", "#ffffff"]
const [COARSE, FINE] = [100, 240] // points of the map along an axis: while something moves, and afterwards
const ARROWS = 14

const clip = (value, low, high) => Math.min(Math.max(value, low), high)

// ---- The method: which cell, which action

/** A policy with its codewords divided by the scale, one after the other: so a look-up is quick. */
export function ready(policy) {
  const { codewords, scale } = policy
  policy.scaled = Float64Array.from(codewords.flatMap(codeword => codeword.map((value, i) => value / scale[i])))
  return policy
}

/** Into `far`: how far an observation is from each codeword, as the look-up measures (in squares, where it is Euclidean).
 * Returns how many there are. */
function distances({ scaled, scale, metric }, seen) {
  const d = scale.length,
    k = scaled.length / d
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
  return k
}
const place = new Float64Array(64),
  far = new Float64Array(4096)

/** The nearest codeword; of equally near ones the first. */
export function cellOf(policy, seen) {
  const k = distances(policy, seen)
  let best = 0
  for (let j = 1; j < k; j++) if (far[j] < far[best]) best = j
  return best
}

/** What a linear map gives for action k: the weights of the inputs, then the bias. */
function raw(rows, seen, k) {
  let sum = rows[seen.length][k]
  for (let i = 0; i < seen.length; i++) sum += seen[i] * rows[i][k]
  return sum
}

/** The cell, what its map gives, and the action within the limits. */
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

/** By how little the nearest codeword wins: zero on a border. */
export function margin(policy, seen) {
  const [first, second] = far.slice(0, distances(policy, seen)).sort()
  return second === undefined ? Infinity : second - first
}

// ---- The tasks: `step` returns the next state, the reward and the outcome (0: it goes on, 1: goal, 2: pit)

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

/** The dynamics of a task: what a policy sees of a state, and a step. */
export const dynamics = name => TASKS[name]

/** An episode: its return, outcome, states and cells (of the states that were acted in). */
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

/** The canvas: what is at which point of the plane. */
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
      i && !far ? ctx.lineTo(x, y) : ctx.moveTo(x, y) // an angle comes round
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
    const number = value => String(+value.toPrecision(3)).replace("-", "−")
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
    ctx.translate(11, top + this.high / 2)
    ctx.rotate(-Math.PI / 2)
    ctx.fillText(labels[1], 0, 0)
    ctx.restore()
  }
}

const rgb = colour => [1, 3, 5].map(i => parseInt(colour.slice(i, i + 2), 16))
const TINTS = PALETTE.map(colour => rgb(colour).map(part => 255 - 0.3 * (255 - part)))
const [LEFT, RIGHT] = [rgb("#2d004b"), rgb("#7f3b08")] // purple and orange, as in the force maps of the figures

/** The policy's map: cells in pale colours, or, where there is one action, the action; borders dark. */
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
        cell = (cells[at] = cellOf(policy, seen))
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

/** The picture; a map that is out of date is drawn with few points first, and with many when nothing moves. */
function draw(view) {
  if (view.mapped !== view.cell) {
    drawMap(view, COARSE)
    view.mapped = view.cell
    clearTimeout(view.later)
    view.later = setTimeout(() => {
      drawMap(view, FINE)
      drawAll(view)
    }, 120)
  }
  drawAll(view)
}

function drawAll(view) {
  const { picture, scene, policy, asked } = view,
    { ctx } = picture
  picture.fit()
  ctx.fillStyle = PAPER
  ctx.fillRect(0, 0, picture.side, picture.side)
  ctx.font = "12px system-ui, sans-serif"
  ctx.drawImage(picture.map, picture.edge.left, picture.edge.top, picture.wide, picture.high)
  view.task.furniture(picture)
  if (scene.task.outputs.length === 2) drawArrows(view)
  scene.starts.forEach((start, i) => {
    const lost = view.ends[i]
    picture.dot(view.place(start), lost ? 3 : 1.3, lost ? FAILED : GOAL)
  })
  picture.line(view.path.map(view.place), PAPER, 4)
  picture.line(view.path.map(view.place), INK, 2)
  view.path.slice(1).forEach(state => picture.dot(view.place(state), 2, INK))
  policy.codewords.forEach((codeword, i) =>
    picture.dot(view.placeSeen(codeword), 5, i === view.cell ? INK : PAPER, INK),
  )
  picture.dot(asked, 7, null, FAILED)
  picture.dot(asked, 2, FAILED)
  picture.axes()
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
.vsp-explorer :is(td, th) { padding: 0.1rem 0.5rem; text-align: right; font-weight: normal }
.vsp-explorer legend { font-size: inherit }
.vsp-explorer [hidden] { display: none }
.vsp-explorer .vsp-note { font-size: 0.85rem; opacity: 0.85 }
.vsp-explorer fieldset { border: 1px solid #888; padding: 0.3rem 0.6rem; margin: 0.5rem 0; min-width: 0 }
.vsp-explorer input[type=number] { width: 5rem } .vsp-explorer input[type=range] { flex: 1 1 140px }
.vsp-explorer p { margin: 0.3rem 0 }`

/** An element with attributes, listeners (functions) and children. */
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag)
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name, value)
    else if (value !== false) made.setAttribute(name, value === true ? "" : value)
  }
  made.append(...children)
  return made
}

/** A table: names of the columns, then rows that begin with their name. */
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
const copied = policy => structuredClone(policy)

/** The explorer in `root`, in place of what stands there. Returns its view, for tests. */
export function mount(root, scene) {
  const task = dynamics(scene.task.name),
    still = matchMedia("(prefers-reduced-motion: reduce)").matches
  const canvas = element("canvas", { tabindex: 0, role: "img" })
  const picture = new Picture(canvas, scene.plane)
  const { low, high } = scene.plane
  const angular = scene.task.name === "Pendulum-v1"
  const view = {
    scene,
    task,
    picture,
    policy: copied(scene.policies[0]),
    path: null,
    ends: [],
    frames: 0,
    asked: low.map((value, i) => value + 0.7 * (high[i] - value)),
    see: point => task.see(point),
    place: angular
      ? ([angle, speed]) => [angle - 2 * Math.PI * Math.round(angle / 2 / Math.PI), speed]
      : point => point,
    placeSeen: angular ? seen => [Math.atan2(seen[1], seen[0]), seen[2]] : seen => seen,
  }

  // -- What is said
  const answer = element("div"),
    result = element("p", { "aria-live": "polite" }),
    form = element("div")

  function ask() {
    const seen = view.see(view.asked),
      { cell, raw: given, action } = act(scene, view.policy, seen)
    view.cell = cell
    const rows = view.policy.coefficients[cell],
      { inputs, outputs } = scene.task
    const lines = [
      ...inputs.map((name, i) => [
        `${name} = ${digits(seen[i])} adds`,
        outputs.map((_, k) => digits(rows[i][k] * seen[i])),
      ]),
      ["the bias adds", rows[inputs.length].map(digits)],
      ["sum", given.map(digits)],
      ["action, within the limits", action.map(digits)],
      ...(scene.teacher ? [["the teacher's action", teacherAt(scene, view.asked).map(digits)]] : []),
    ]
    answer.replaceChildren(
      element(
        "p",
        {},
        element("b", {}, `Cell ${cell + 1} of ${view.policy.codewords.length}. `),
        border(view, seen, cell),
      ),
      ...outputs.map((name, k) => element("p", {}, element("code", {}, equation(name, inputs, rows, k)))),
      table(
        ["", ...outputs],
        lines.map(([name, values]) => [name, ...values]),
      ),
    )
    canvas.setAttribute("aria-label", `Map of the policy. The chosen state is in cell ${cell + 1}. Arrow keys move it.`)
  }

  function judge() {
    const found = scene.starts.map(start => rollout(scene, view.policy, start))
    view.ends = found.map(one => scene.lost.includes(one.outcome))
    const mean = found.reduce((sum, one) => sum + one.total, 0) / found.length
    view.mean = mean
    view.failures = view.ends.filter(Boolean).length
    const fails = scene.lost.length ? ` ${view.failures} of ${found.length} fail.` : ""
    const teacher = scene.teacher ? ` The teacher: ${scene.teacher.mean.toFixed(2)}.` : ""
    result.textContent = `Mean return from ${found.length} starts: ${mean.toFixed(2)}.${fails}${teacher}`.replaceAll(
      "-",
      "\u2212",
    )
  }

  // -- What can be changed
  function number(label, value, step, put) {
    const input = element("input", {
      type: "number",
      step,
      value: +value.toFixed(4),
      "aria-label": label,
      input: () => {
        if (Number.isFinite(input.valueAsNumber)) {
          put(input.valueAsNumber)
          changed({ policy: true, whole: false })
        }
      },
    })
    return input
  }

  function showForm() {
    const { policy, cell } = view,
      { inputs, outputs } = scene.task
    const steps = policy.scale.map((_, i) => (angular ? 0.05 : +((high[i] - low[i]) / 50).toPrecision(1)))
    const codeword = i =>
      i < inputs.length
        ? number(`codeword: ${inputs[i]}`, policy.codewords[cell][i], steps[i], value => {
            policy.codewords[cell][i] = value
          })
        : ""
    const weight = (i, name, k) =>
      number(`${outputs[k]}: ${name}`, policy.coefficients[cell][i][k], 0.1, value => {
        policy.coefficients[cell][i][k] = value
      })
    form.replaceChildren(
      element(
        "fieldset",
        {},
        element("legend", {}, `Change cell ${cell + 1}`),
        table(
          ["", "codeword", ...outputs],
          [...inputs, "bias"].map((name, i) => [name, codeword(i), ...outputs.map((_, k) => weight(i, name, k))]),
        ),
      ),
    )
  }

  /** What follows from policy and state, and the picture. `renewed`: the policy is another one. */
  view.redo = (renewed = true) => {
    const before = view.cell
    if (renewed) {
      ready(view.policy)
      view.mapped = null
      judge()
    }
    ask()
    view.path = rollout(scene, view.policy, view.asked, true).states
    if (view.whole || view.cell !== before) showForm()
    view.whole = false
    draw(view)
    view.frames += 1
  }
  let waiting = 0,
    renewed = false
  /** The same once before the next picture. `whole`: with the form, in which the reader may be writing. */
  function changed({ policy = false, whole = true } = {}) {
    renewed ||= policy
    view.whole ||= whole
    waiting ||= requestAnimationFrame(() => {
      const anew = renewed
      waiting = 0
      renewed = false
      view.redo(anew)
    })
  }

  // -- Choosing a policy; the replay
  const replays = scene.policies.map(policy => policy.replay ?? null)
  const names = element(
    "select",
    { "aria-label": "policy", change: () => choose(+names.value) },
    ...scene.policies.map((policy, i) => element("option", { value: i }, policy.name)),
  )
  const slider = element("input", {
    type: "range",
    min: 0,
    value: 0,
    "aria-label": "iteration",
    input: () => turn(+slider.value),
  })
  const when = element("span", {}),
    replay = element("div", { class: "vsp-row" })
  const button = (label, click) => element("button", { type: "button", click }, label)
  const player = button("play", () => (view.playing ? stop() : start()))
  replay.append(
    button("previous change", () => jump(-1)),
    player,
    button("next change", () => jump(1)),
    slider,
    when,
  )
  let run = null

  function choose(i) {
    stop()
    view.chosen = i
    run = replays[i]
    replay.hidden = !run
    view.policy = copied(scene.policies[i])
    if (run) {
      slider.max = run.length - 1
      slider.value = run.length - 1
      turn(run.length - 1)
    } else changed({ policy: true })
  }
  function turn(i) {
    const one = run[i],
      cells = one.codewords.length
    view.policy = {
      ...copied(scene.policies[view.chosen]),
      codewords: copied(one.codewords),
      coefficients: copied(one.coefficients),
    }
    when.textContent = `iteration ${one.n}: ${cells} cell${cells > 1 ? "s" : ""}${one.change ? `, ${one.change}` : ""}`
    slider.setAttribute("aria-valuetext", when.textContent)
    changed({ policy: true })
  }
  function jump(way) {
    stop()
    for (let i = +slider.value + way; i >= 0 && i < run.length; i += way) {
      if (run[i].change || i === 0 || i === run.length - 1) {
        slider.value = i
        turn(i)
        return
      }
    }
  }
  function start() {
    view.playing = true
    player.textContent = "pause"
    if (+slider.value === run.length - 1) slider.value = 0
    let last = 0
    const frame = now => {
      if (!view.playing || !canvas.isConnected) return
      if (now - last >= (still ? 1000 : 0)) {
        // who asked for little motion gets a picture a second
        last = now
        slider.value = +slider.value + 1
        turn(+slider.value)
      }
      ;+slider.value < run.length - 1 ? requestAnimationFrame(frame) : stop()
    }
    requestAnimationFrame(frame)
  }
  function stop() {
    view.playing = false
    player.textContent = "play"
  }

  // -- Pointer and keys
  let dragged = null
  const under = event => {
    const box = canvas.getBoundingClientRect()
    return [event.clientX - box.left, event.clientY - box.top]
  }
  canvas.addEventListener("pointerdown", event => {
    const [px, py] = under(event)
    canvas.setPointerCapture(event.pointerId)
    const near = point => {
      const [x, y] = picture.at(view.placeSeen(point))
      return Math.hypot(x - px, y - py) < 11
    }
    dragged = !angular ? view.policy.codewords.findIndex(near) : -1
    move(event)
  })
  function move(event) {
    if (dragged === null) return
    const point = picture.point(...under(event))
    if (dragged >= 0) view.policy.codewords[dragged] = point
    view.asked = point
    changed({ policy: dragged >= 0, whole: dragged >= 0 })
  }
  canvas.addEventListener("pointermove", move)
  canvas.addEventListener("pointerup", () => {
    dragged = null
  })
  canvas.addEventListener("pointercancel", () => {
    dragged = null
  })
  canvas.addEventListener("keydown", event => {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] }[event.key]
    if (!way) return
    event.preventDefault()
    const by = event.shiftKey ? 0.1 : 0.01
    view.asked = view.asked.map((value, i) => clip(value + way[i] * by * (high[i] - low[i]), low[i], high[i]))
    changed({ whole: false })
  })

  const back = button("reset", () => choose(view.chosen))
  const panel = element(
    "div",
    { class: "vsp-panel" },
    element("div", { class: "vsp-row" }, element("label", {}, "policy ", names), back),
    replay,
    result,
    answer,
    form,
  )
  root.classList.add("vsp-explorer")
  const single = scene.task.outputs.length === 1
  panel.append(
    element(
      "p",
      { class: "vsp-note" },
      [
        single ? `Purple: ${scene.task.outputs[0]} below 0; brown: above 0.` : "An arrow is the action there.",
        `Circles are codewords${angular ? "" : ": drag one"}. Click or drag elsewhere to choose a state; its episode is black.`,
        scene.lost.length ? "Orange starts fail." : "Small dots are starts.",
        scene.teacher
          ? `The teacher's action is read from a grid: in nine of ten states off by at most ${scene.teacher.usual.toFixed(3)}, in all by ${scene.teacher.error.toFixed(2)}.`
          : "",
      ].join(" "),
    ),
  )
  root.replaceChildren(element("style", {}, STYLE), canvas, panel)
  new ResizeObserver(() => view.path && draw(view)).observe(canvas)
  choose(0)
  return view
}

function equation(name, inputs, rows, k) {
  const terms = [...inputs.map((input, i) => [rows[i][k], ` ${input}`]), [rows[inputs.length][k], ""]]
  const sum = terms.map(
    ([value, input], i) =>
      `${value < 0 ? (i ? " \u2212 " : "\u2212") : i ? " + " : ""}${Math.abs(value).toFixed(2)}${input}`,
  )
  return `${name} = ${sum.join("")}`
}

/** The least change of one coordinate of the plane that leads to another cell. */
function border(view, seen, cell) {
  const { low, high, labels } = view.picture.plane
  let least = null
  for (const axis of [0, 1])
    for (const end of [low[axis], high[axis]]) {
      const at = value => cellOf(view.policy, view.see(view.asked.map((v, i) => (i === axis ? value : v))))
      let [inside, outside] = [view.asked[axis], null]
      for (let i = 1; i <= 200 && outside === null; i++) {
        const value = view.asked[axis] + (i / 200) * (end - view.asked[axis])
        if (at(value) === cell) inside = value
        else outside = value
      }
      if (outside === null) continue
      for (let i = 0; i < 30; i++) {
        const half = (inside + outside) / 2
        at(half) === cell ? (inside = half) : (outside = half)
      }
      const gap = outside - view.asked[axis],
        share = Math.abs(gap) / (high[axis] - low[axis])
      if (!least || share < least.share) least = { share, gap, axis, to: at(outside) }
    }
  if (!least) return "No border lies straight ahead."
  const gap = Math.abs(least.gap) < 0.005 ? least.gap.toPrecision(2).replace("-", "\u2212") : digits(least.gap)
  return `A change of ${gap} in ${labels[least.axis]} leads to cell ${least.to + 1}.`
}

/** The teacher's action at a point of the plane, between the points of its grid. (linear) */
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

/** For anywidget: the scene comes as text. */
export default {
  render({ model, el }) {
    el.classList.add("vsp-controls") // hides the picture that stands there without a kernel: vsp/show/page.py
    mount(el, JSON.parse(model.get("scene")))
  },
}

/** On a page: every explorer has its scene in itself, or in a file that loads when it comes into view. */
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
