// @ts-check
// The explorer: replay a distillation, query a policy at a state, change the policy and watch its
// episodes. It draws a scene, which scene.py describes. "Cell 3" is cell 3 in Python, or, where a
// run is replayed, the cell whose codeword was born as the fourth.

import { Player, button, choice, element, equations, row } from "./controls.js"
import { Episodes } from "./episodes.js"
import { act, clip, dynamics, name, numberOf, raw, ready, rollout } from "./model.js"
import { CELLS, Picture, drawAll, drawTime, ownArrow } from "./picture.js"
import { answerOf, episodeOf, legendOf, momentOf, noteOf, resultOf } from "./texts.js"

const [COARSE, FINE] = [240, 480] // points per axis of the map: in motion, and at rest
const IN_MOTION = 8 // milliseconds for episodes; at rest all are played
const ALL = 4 // cells whose equations stand below each other
const STRIDE = 149 // a prime, so the first are spread over all
const LABEL = "Map of the policy. Arrow keys move the chosen state."
/** @type {Record<string, Vector>} */
const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] }

/** A view of a policy, a chosen state, and texts about them. With `bare`, the page arranges the
 * controls; `above` stands above the panel. `settled(view)` is called after each gesture,
 * `told(view)` after each update. */
export class Explorer {
  /** @type {Map<number, number>} */
  failing = new Map() // of the starts that fail, by index: the cell of their last step
  /** @type {Partial<Numbers>[]} */ past = [] // after each gesture
  /** @type {Vector[] | null} */ regions = null // polygons to fill
  /** @type {Vector | null} */ ring = null // a place to mark
  zooming = 0 // a frame
  starts = true // whether they are drawn
  fixed = false // whether codewords and arrows cannot be moved
  /** @type {number | null} */ lit = null // the cell whose equations are touched
  /** @type {Held | null} */ held = null // what is dragged
  /** @type {Policy} */ policy // with the numbers of the reader
  /** @type {Policy} */ original
  /** @type {Moment[]} */ run
  /** @type {Played} */ played // from the state that is `asked`
  /** @type {number} */ cell // that acts there
  /** @type {Judged} */ results
  /** @type {Judged | null} */ base // the results before the last gesture

  armed = false // whether the next change begins a gesture
  writing = false // whether a finger is on a field, which must stay
  /** @type {number | null} */ mapped // the cell that is marked on the map; null: of another policy

  waiting = 0 // for a frame
  /** @type {Record<string, ReturnType<typeof setTimeout>>} */ timers = {}

  result = element("p", { class: "vsp-result" })
  from = element("p", { class: "vsp-from" })
  said = element("div", {}, this.result, this.from)
  answer = element("div")
  note = element("p", { class: "vsp-note" })
  legend = element("ul", { class: "vsp-legend", "aria-label": "legend" })
  // Kept while a reader writes
  form = element("div", {
    focusout: ({ relatedTarget: to }) => {
      if (!this.form.contains(/** @type {Node | null} */ (to))) this.light(null)
    },
    focusin: () => (this.armed = true),
    pointerdown: () => (this.writing = this.armed = true),
    pointerup: () => this.soon(),
    pointercancel: () => this.soon(),
    pointerleave: () => this.light(null),
    input: () => this.soon(),
  })
  backs = row(
    button("undo", () => this.undo()),
    button("reset", () => this.take(this.original)),
  )
  replay = new Player(this)

  /** @param {HTMLElement} root @param {Scene} scene @param {Hooks} hooks */
  constructor(root, scene, hooks = {}) {
    this.scene = scene
    this.hooks = hooks
    this.task = dynamics(scene.task.name)
    this.angular = scene.task.inputs.length > scene.plane.low.length
    const { pointerdown, pointermove, pointerup, keydown } = this,
      about = { tabindex: 0, role: "application", "aria-label": LABEL, keydown },
      acts = { pointerdown, pointermove, pointerup, pointercancel: pointerup },
      transitionend = () => this.changed(true) // of the page's colours, or of JupyterLab's
    this.canvas = element("canvas", { ...about, ...acts, transitionend })
    this.picture = new Picture(this.canvas, scene.plane)
    const { first = {} } = hooks,
      at = String(first.at).split(",").map(Number),
      start = this.place(scene.starts.at(-63) ?? scene.starts[0]) // in SimpleGoal beyond the pit
    this.asked = this.picture.shows(at) ? at : start
    const active = /** @type {HTMLElement | null} */ (document.activeElement),
      focus = root.contains(active) && active
    root.classList.add("vsp-explorer")
    // Of the car or the pendulum
    this.drawing = element("div", { class: "vsp-drawing", "data-task": scene.task.name })
    const shown = scene.policies.find(({ name }) => name === first.policy) ?? scene.policies[0],
      take = (/** @type {Policy} */ policy) => (this.show(policy), this.settle()),
      policy = choice("policy", scene.policies, take, shown),
      lists = row(...(hooks.above ?? []), policy),
      seen = [this.canvas, this.drawing, this.said, this.replay.line, this.legend],
      stage = element("div", { class: "vsp-stage" }, ...seen),
      parts = [this.said, this.answer, this.form, this.backs, this.note, this.replay.row],
      panel = element("div", { class: "vsp-panel" }, ...(hooks.bare ? [] : parts))
    root.replaceChildren(...(hooks.bare ? [stage] : [lists, stage, panel]))
    if (focus) (focus.isConnected ? focus : this.canvas).focus()
    new ResizeObserver(() => this.waiting || this.draw()).observe(this.canvas)
    this.show(shown)
  }

  // -- What is shown
  place = (/** @type {Vector} */ state) => this.task.place(this.task.see(state))
  /** The cell that stands out. */
  get marked() {
    return this.lit !== null && this.lit < this.cells ? this.lit : this.cell
  }
  /** Whether codewords can be dragged, and the arrows of cells, to drag. */
  get movable() {
    return !this.fixed && !this.angular && this.cells > 1
  }
  get arrows() {
    const none = this.fixed || this.cells > ALL || this.scene.task.outputs.length !== 2
    return none || this.policy.layers ? [] : this.shown.map(i => ownArrow(this, i))
  }
  get cells() {
    return this.policy.layers ? 1 : this.policy.codewords.length
  }
  /** The cells whose equations are shown: all, or the one that stands out. */
  get shown() {
    return this.cells > ALL ? [this.marked] : [...Array(this.cells).keys()]
  }
  /** Show a policy of the scene with its run, if it has one; `numbers` replace its own.
   * @param {Policy} policy @param {Partial<Numbers>} [numbers] */
  show(policy, numbers) {
    this.replay.stop()
    name(policy)
    const { replay: run = [], ...own } = policy
    const copy = policy.layers ? policy : structuredClone(own)
    Object.assign(this, { original: policy, run, policy: copy, held: null, lit: null })
    this.replay.row.hidden = this.replay.line.hidden = !run.length
    this.backs.hidden = Boolean(policy.layers)
    if (run.length) this.replay.grow(true)
    if (numbers) this.put(numbers)
    this.afresh()
  }

  // -- Changing the policy
  /** A copy of what a reader can change. */
  numbers(/** @type {Partial<Numbers>} */ numbers = this.policy) {
    const { codewords, coefficients, born, tints } = { ...this.policy, ...numbers }
    return structuredClone({ codewords, coefficients, born, tints })
  }
  put(/** @type {Partial<Numbers>} */ numbers) {
    Object.assign(this.policy, this.numbers(numbers))
    name(this.policy)
  }
  /** Forget all gestures. */
  afresh() {
    Object.assign(this, { base: null, past: [this.numbers()], armed: false })
    this.changed(true)
  }
  /** After every change of a number: keep what it is, beside what it was before the gesture. */
  edited() {
    if (this.armed) Object.assign(this, { armed: false, base: this.results })
    else this.past.pop()
    this.past.push(this.numbers())
    this.changed(true)
  }
  /** Take other numbers, as one gesture. */
  take(/** @type {Partial<Numbers>} */ numbers) {
    this.replay.stop()
    this.put(numbers)
    this.armed = true
    this.edited()
    this.settle()
  }
  undo() {
    if (this.past.length > 1) this.take(this.past.splice(-2)[0])
  }
  /** A gesture is finished: tell it once the picture shows it. */
  settle() {
    requestAnimationFrame(() => requestAnimationFrame(() => this.hooks.settled?.(this)))
  }
  /** The same once keys rest: the next one begins another gesture. */
  soon() {
    clearTimeout(this.timers.still)
    this.timers.still = setTimeout(() => {
      Object.assign(this, { armed: true, writing: false })
      this.settle()
    }, 400)
  }

  // -- Everything that depends on policy and state
  /** Schedule an update: of everything if the `policy` changed. */
  changed(policy = false) {
    if (policy) this.mapped = null
    this.waiting ||= requestAnimationFrame(() => this.redo())
  }
  redo() {
    this.waiting = 0
    if (this.mapped === null) this.judge(IN_MOTION)
    this.cell = act(this.scene, this.policy, this.task.see(this.asked)).cell
    // Of a network that is not loaded yet, one episode is known
    const { episode } = this.policy,
      other = episode && String(episode.states[0]) !== String(this.asked)
    this.played = other ? { states: [] } : (episode ?? rollout(this.scene, this.policy, this.asked))
    if (!this.writing && !this.form.contains(document.activeElement)) this.fill()
    this.draw()
    this.speak()
  }
  /** Run an episode from every start, or as many as `budget` ms allow. */
  judge(budget = Infinity) {
    const { scene, policy } = this,
      n = scene.starts.length,
      begun = performance.now()
    this.failing.clear()
    if (policy.layers) return Object.assign(this, { results: { played: n, ...policy.results } })
    ready(policy)
    let [played, sum] = [0, 0]
    for (; played < n && (!played || performance.now() - begun < budget); played++) {
      const i = (played * STRIDE) % n,
        { total, outcome, last } = rollout(scene, policy, scene.starts[i])
      if (scene.lost.includes(outcome)) this.failing.set(i, last)
      sum += total
    }
    const failures = Math.round((this.failing.size / played) * n)
    this.results = { played, failures, mean: sum / played }
  }
  fill() {
    if (this.policy.layers) return this.form.replaceChildren()
    const parts = this.shown.map(i => {
      const title = this.cells > 1 ? `Cell ${numberOf(this.policy, i)}` : "The map",
        cells = this.cells > 1 && this.scene.task.outputs.length > 1, // as in the picture
        tint = cells ? CELLS[this.policy.tints?.[i] ?? 0] : "var(--vsp-line)",
        light = () => this.lit === i || this.light(i),
        lines = equations(this, i, () => this.edited()),
        acts = { pointerenter: light, focusin: light, "data-cell": i, style: `--tint: ${tint}` }
      return element("fieldset", acts, element("legend", {}, title), ...lines)
    })
    this.form.replaceChildren(...parts)
  }
  /** Let a cell stand out while its equations are touched. @param {number | null} cell */
  light(cell) {
    if (this.held) return
    this.lit = cell
    this.changed()
  }
  speak() {
    const { replay } = this,
      moment = momentOf(this)
    // While it moves, it would be too much to hear
    this.said.setAttribute("aria-live", replay.playing || this.held ? "off" : "polite")
    this.result.textContent = resultOf(this)
    this.from.textContent = episodeOf(this)
    this.drawing.style.setProperty("--at", String(this.asked[0]))
    this.answer.replaceChildren(...answerOf(this, this.task.see(this.asked)))
    this.legend.replaceChildren(...legendOf(this))
    this.note.textContent = noteOf(this)
    for (const part of this.form.children)
      part.classList.toggle("vsp-lit", Number(part.getAttribute("data-cell")) === this.marked)
    replay.said.textContent = moment
    replay.slider.setAttribute("aria-valuetext", moment)
    replay.time.hidden = this.run[0]?.failures === undefined
    if (!replay.time.hidden) drawTime(this)
    this.hooks.told?.(this)
  }
  /** Draw. Until the picture rests, the map has few points, and not all starts are played. */
  draw() {
    if (this.mapped === this.marked) return drawAll(this)
    drawAll(this, COARSE)
    this.mapped = this.marked
    clearTimeout(this.timers.sharp)
    this.timers.sharp = setTimeout(() => this.finish(), 120)
  }
  finish() {
    if (this.waiting) return // a change comes, and its own timer
    if (this.results.played < this.scene.starts.length) this.judge()
    drawAll(this, FINE)
    this.speak()
  }
  /** Show another part of the plane, after a while on the way (by equal factors), or at once.
   * @param {Box} to */
  zoom({ low, high }, duration = 0) {
    const { plane } = this.picture,
      factor = (high[0] - low[0]) / (plane.high[0] - plane.low[0]),
      begun = performance.now()
    cancelAnimationFrame(this.zooming)
    const frame = (/** @type {number} */ now) => {
      const time = duration && factor !== 1 ? clip((now - begun) / duration, 0, 1) : 1,
        way = time < 1 ? (factor ** time - 1) / (factor - 1) : 1
      /** @type {(from: Vector, to: Vector) => Vector} */
      const mean = (from, to) => from.map((value, i) => (1 - way) * value + way * to[i])
      this.picture.plane = { ...plane, low: mean(plane.low, low), high: mean(plane.high, high) }
      this.changed(true)
      if (time < 1) this.zooming = requestAnimationFrame(frame)
    }
    frame(begun)
  }

  // -- Pointer and keys
  pointerdown = (/** @type {PointerEvent} */ event) => {
    if (event.button || !event.isPrimary) return
    this.canvas.setPointerCapture(event.pointerId)
    const { offsetX: x, offsetY: y } = event,
      finger = event.pointerType === "touch",
      words = this.movable ? (this.policy.codewords ?? []) : []
    if (finger) this.canvas.focus() // else a field would keep it
    /** @type {(places: Vector[], turned: boolean) => Omit<Held, "from"> | undefined} the nearest */
    const near = (places, turned) => {
      const far = places.map(place => Math.hypot(place[0] - x, place[1] - y)),
        cell = far.indexOf(Math.min(...far))
      if (far[cell] < (finger ? 22 : 12)) return { cell, turned, finger, place: places[cell] }
    }
    const word = near(words.map(word => this.picture.at(word)), false),
      found = word ?? near(this.arrows.map(({ tip }) => tip), true),
      held = { cell: -1, turned: false, finger, place: [x, y], ...found, from: [x, y] }
    Object.assign(this, { held, armed: true, lit: found?.cell ?? null })
    this.replay.stop()
    if (found) this.changed()
    else this.choose(this.picture.point(x, y))
  }
  pointermove = (/** @type {PointerEvent} */ event) => {
    if (!this.held) return
    const { cell, turned, place, from } = this.held,
      [dx, dy] = [event.offsetX - from[0], event.offsetY - from[1]],
      [px, py] = [place[0] + dx, place[1] + dy],
      point = this.picture.point(px, py)
    if (cell < 0) return this.choose(point)
    if (this.armed && Math.hypot(dx, dy) < 4) return // a finger that rests
    if (turned) this.bend(cell, px, py)
    else this.policy.codewords?.splice(cell, 1, point)
    this.edited()
  }
  /** Let the arrow of a cell end at a pixel: its constants follow.
   * @param {number} cell @param {number} px @param {number} py */
  bend(cell, px, py) {
    const { start, word, rows, own } = ownArrow(this, cell),
      wanted = [px - start[0], start[1] - py].map(length => clip(length / own, -1, 1)),
      constants = rows[word.length]
    wanted.forEach((value, k) => {
      constants[k] = +(constants[k] + value - raw(rows, word, k)).toFixed(2)
    })
  }
  choose(/** @type {Vector} */ point) {
    this.asked = [...point]
    this.base = this.lit = null
    this.changed()
  }
  pointerup = () => {
    if (!this.held) return
    const { cell, turned } = this.held,
      word = this.policy.codewords?.[cell]
    this.held = null
    if (this.armed && word && !turned) this.choose(word) // not moved, so clicked
    this.light(null)
    this.settle()
  }
  keydown = (/** @type {KeyboardEvent} */ event) => {
    const way = { ...WAYS, " ": [0, 0] }[event.key] // a space would scroll
    if (!way || event.altKey || event.ctrlKey || event.metaKey) return
    event.preventDefault()
    const { low, high } = this.picture.plane,
      by = event.shiftKey ? 0.1 : 0.01
    /** @type {(value: number, i: number) => number} */
    const moved = (value, i) => clip(value + way[i] * by * (high[i] - low[i]), low[i], high[i])
    this.choose(this.asked.map(moved))
    this.soon()
  }
}

/** For anywidget. */
export default {
  /** @param {Widget} widget */
  render({ model, el }) {
    el.addEventListener("keydown", event => {
      // JupyterLab would take the arrow keys from sliders and lists to select a cell
      if (event.key.startsWith("Arrow") && !event.altKey && !event.ctrlKey) event.stopPropagation()
    })
    el.classList.add("vsp-controls") // hides the still picture for readers without a kernel
    const made = () => new Explorer(el, JSON.parse(model.get("scene")))
    let view = made()
    model.on("change:scene", () => {
      const { asked } = view // the reader's state stays chosen
      view = made()
      view.asked = asked
      view.redo() // at once: the page keeps its height, and so its scroll position
    })
  },
}

/** Load the scene of an explorer; of several the one that the address names, with a choice.
 * @param {HTMLElement} root */
async function reveal(root) {
  const files = JSON.parse(root.dataset.scenes ?? "{}"),
    names = Object.keys(files),
    address = Object.fromEntries(new URLSearchParams(location.search))
  let wanted = ""
  const open = async (/** @type {string} */ task, first = {}) => {
    wanted = task
    const scene = await (await fetch(files[task])).json()
    /** @param {Explorer} view */
    const settled = ({ original: { name: policy }, asked }) => {
      const query = new URLSearchParams({ task, policy, at: String(asked) })
      history.replaceState(null, "", `?${query}${location.hash}`)
    }
    if (wanted === task) new Explorer(root, scene, above[0] ? { above, settled, first } : {})
  }
  const task = names.find(name => name === address.task) ?? names[0],
    above = names.length > 1 ? [choice("task", names, task => open(task), task)] : []
  await open(task, address)
}

/** Mount all explorers of a page: each contains its scene, or loads it when in view. */
export function mountAll() {
  for (const script of document.querySelectorAll(":is(.vsp-episodes, .vsp-explorer) > script")) {
    const root = /** @type {HTMLElement} */ (script.parentElement),
      scene = JSON.parse(script.textContent)
    if (root.matches(".vsp-episodes")) new Episodes(root, scene)
    else new Explorer(root, scene)
  }
  for (const root of document.querySelectorAll("[data-scenes]"))
    reveal(/** @type {HTMLElement} */ (root))
}
