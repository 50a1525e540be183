// @ts-check
// The explorer: replay a distillation, query a policy at a state, change the policy and watch its
// episodes. It draws a scene, which scene.py describes. "Cell 3" here is cell 3 in Python.

import { Player, button, choice, count, element, equations, row } from "./controls.js"
import { Episodes } from "./episodes.js"
import { act, clip, dynamics, ready, rollout } from "./model.js"
import { Picture, drawAll, drawMap } from "./picture.js"
import { answerOf, causeOf, episodeOf, legendOf, noteOf, resultOf } from "./texts.js"

const [COARSE, FINE] = [120, 320] // points per axis of the map: in motion, and at rest
const IN_MOTION = 8 // milliseconds for episodes; at rest all are played
const STRIDE = 149 // a prime, so the first are spread over all
const [PLAYS, PAUSE] = [20_000, 400] // milliseconds: of a run, and at most of one of its changes

/** A view of a policy, a chosen state, and texts about them. With `bare`, the page arranges the
 * controls; `above` stands above the panel. `settled(view)` is called after each gesture,
 * `told(view)` after each update. */
export class Explorer {
  /** @type {Map<number, number>} */
  failing = new Map() // of the starts that fail, by index: the cell of their last step
  /** @type {Partial<Numbers>[]} */ past = [] // to undo to
  /** @type {(Change & { since: number })[]} */ flashes = [] // changes that have just happened
  /** @type {Vector[] | null} */ regions = null // polygons to fill
  starts = true // whether they are drawn
  fixed = false // whether codewords cannot be moved
  /** @type {number | null} */ dragged = null // the codeword, or -1 for the state
  pressed = { x: 0, y: 0, place: [0, 0] } // where a gesture began
  moment = -1 // of the run
  /** @type {Policy} */ policy // with the numbers of the reader
  /** @type {Policy} */ original
  /** @type {Moment[]} */ run
  /** @type {Played} */ played // from the state that is `asked`
  /** @type {number} */ cell // that acts there
  /** @type {Judged} */ results
  /** @type {Judged | null} */ base // the results before the last gesture
  /** @type {Partial<Numbers>} */ kept // those before the next gesture
  armed = false // whether the next change begins a gesture
  /** @type {number | null} */ mapped // the cell that is marked on the map
  renewed = false // whether the policy has changed since the last frame
  waiting = 0 // for a frame
  fading = 0
  /** @type {ReturnType<typeof setTimeout> | undefined} */ still
  /** @type {ReturnType<typeof setTimeout> | undefined} */ later

  result = element("p", { class: "vsp-result" })
  from = element("p", { class: "vsp-from" })
  said = element("div", {}, this.result, this.from)
  answer = element("div")
  note = element("p", { class: "vsp-note" })
  legend = element("ul", { class: "vsp-legend", "aria-label": "legend" })
  // Kept while a reader writes
  form = element("div", {
    focusout: ({ relatedTarget: to }) => {
      if (!this.form.contains(/** @type {Node | null} */ (to))) this.changed()
    },
    focusin: () => (this.armed = true),
    input: () => this.soon(),
  })
  backs = row(
    button("undo", () => this.undo()),
    button("reset", () => this.take(this.original)),
  )
  replay = new Player(this)

  /** @param {HTMLElement} root @param {Scene} scene @param {Hooks} hooks */
  constructor(root, scene, { bare, above = [], settled = () => {}, told = () => {} } = {}) {
    const { low, high } = scene.plane
    this.scene = scene
    this.settled = settled
    this.told = told
    this.task = dynamics(scene.task.name)
    this.angular = scene.task.name === "Pendulum-v1"
    this.asked = low.map((value, i) => value + 0.7 * (high[i] - value))
    this.canvas = this.makeCanvas()
    this.picture = new Picture(this.canvas, scene.plane)
    const active = /** @type {HTMLElement | null} */ (document.activeElement),
      held = root.contains(active) && active
    root.classList.add("vsp-explorer")
    const under = bare ? this.legend : this.answer,
      stage = element("div", { class: "vsp-stage" }, this.canvas, this.said, under)
    root.replaceChildren(stage, ...(bare ? [] : [this.panel(above)]))
    if (held) (held.isConnected ? held : this.canvas).focus()
    this.listen()
    this.show(scene.policies[0])
  }
  makeCanvas() {
    const { pointerdown, pointermove, pointerup, keydown } = this,
      answers = { pointerdown, pointermove, pointerup, pointercancel: pointerup, keydown },
      label = "Map of the policy. Arrow keys move the chosen state."
    return element("canvas", { tabindex: 0, role: "application", "aria-label": label, ...answers })
  }
  panel(/** @type {Node[]} */ above) {
    const names = this.scene.policies.map(({ name }) => name)
    const policy = choice("policy", names, i => this.show(this.scene.policies[i]))
    const parts = [this.replay.row, this.form, this.backs, this.note]
    return element("div", { class: "vsp-panel" }, this.legend, row(...above, policy), ...parts)
  }

  // -- What is shown, and where it lies in the picture
  place = (/** @type {Vector} */ state) => {
    if (!this.angular) return state
    const [angle, speed] = state
    return [angle - 2 * Math.PI * Math.round(angle / 2 / Math.PI), speed]
  }
  /** @type {(seen: Vector) => Vector} */
  placeSeen = seen => (this.angular ? [Math.atan2(seen[1], seen[0]), seen[2]] : seen)
  get teacher() {
    return "teacher" in this.policy ? this.policy.teacher : this.scene.teacher
  }
  get cells() {
    return this.policy.layers ? 1 : this.policy.codewords.length
  }
  /** Show a policy of the scene with its run, if it has one; `numbers` replace its own.
   * @param {Policy} policy @param {Partial<Numbers>} [numbers] */
  show(policy, numbers) {
    this.replay.stop()
    const { replay: run = [], ...own } = policy
    const copy = policy.layers ? policy : structuredClone(own)
    Object.assign(this.picture, { colours: [], known: {} })
    Object.assign(this, { original: policy, run, policy: copy, moment: -1, dragged: null })
    this.replay.row.hidden = !run.length
    this.backs.hidden = Boolean(policy.layers)
    if (run.length) this.replay.restart(run.length)
    if (numbers) this.put(numbers)
    this.afresh()
  }

  // -- Changing the policy
  /** A copy of what a reader can change. */
  numbers({ codewords, coefficients } = /** @type {Partial<Numbers>} */ (this.policy)) {
    return structuredClone({ codewords, coefficients })
  }
  put(/** @type {Partial<Numbers>} */ numbers) {
    Object.assign(this.policy, this.numbers(numbers))
  }
  /** Forget all gestures. */
  afresh() {
    Object.assign(this, { base: null, past: [], armed: false, kept: this.numbers() })
    this.changed(true)
  }
  /** After every change of a number. Before the first of a gesture, keep what it was. */
  edited() {
    if (this.armed) {
      this.past.push(this.kept)
      Object.assign(this, { armed: false, base: this.results })
    }
    this.kept = this.numbers()
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
    const before = this.past.pop()
    if (!before) return
    this.take(before)
    this.past.pop() // going back is no gesture of its own
  }
  /** A gesture is finished: tell it once the picture shows it. */
  settle() {
    requestAnimationFrame(() => requestAnimationFrame(() => this.settled(this)))
  }

  /** The same once keys rest: the next one begins another gesture. */
  soon() {
    clearTimeout(this.still)
    this.still = setTimeout(() => {
      this.armed = true
      this.settle()
    }, 400)
  }

  // -- Everything that depends on policy and state
  /** Schedule an update: of everything if the `policy` changed. */
  changed(policy = false) {
    this.renewed ||= policy
    this.waiting ||= requestAnimationFrame(() => {
      const { renewed } = this
      Object.assign(this, { waiting: 0, renewed: false })
      this.redo(renewed)
    })
  }
  redo(renewed = true) {
    if (renewed) this.judge(IN_MOTION)
    if (renewed) this.mapped = null
    this.cell = act(this.scene, this.policy, this.task.see(this.asked)).cell
    // Of a network that is not loaded yet, one episode is known
    this.played = this.policy.episode ?? rollout(this.scene, this.policy, this.asked, true)
    if (!this.form.contains(document.activeElement)) this.fill() // else a reader writes
    this.draw()
    this.speak()
  }
  /** Run an episode from every start, or as many as `budget` ms allow. */
  judge(budget = Infinity) {
    const { scene, policy } = this,
      n = scene.starts.length,
      begun = performance.now()
    this.failing.clear()
    if (policy.layers) {
      this.results = { played: n, ...policy.results }
      return
    }
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
    const lines = equations(this, () => this.edited())
    const title = this.cells > 1 ? `Change cell ${this.cell}` : "Change the map"
    this.form.replaceChildren(element("fieldset", {}, element("legend", {}, title), ...lines))
  }
  speak() {
    const moving = this.replay.playing || this.dragged !== null
    this.said.setAttribute("aria-live", moving ? "off" : "polite") // else too much to hear
    this.result.textContent = resultOf(this)
    this.from.textContent = episodeOf(this)
    if (this.answer.isConnected) this.answer.replaceChildren(...answerOf(this))
    this.legend.replaceChildren(...legendOf(this))
    this.note.textContent = noteOf(this)
    this.replay.tell()
    this.told(this)
  }
  /** Draw. Until the picture rests, the map has few points, and not all starts are played. */
  draw() {
    this.picture.begin()
    if (this.mapped !== this.cell) {
      drawMap(this, COARSE)
      this.mapped = this.cell
      clearTimeout(this.later)
      this.later = setTimeout(() => this.finish(), 120)
    }
    drawAll(this)
    const fade = () => {
      this.fading = 0
      if (!this.waiting) this.draw()
    }
    if (this.flashes.length) this.fading ||= requestAnimationFrame(fade)
  }
  finish() {
    if (this.waiting) return // a change comes, and its own timer
    if (this.results.played < this.scene.starts.length) this.judge()
    drawMap(this, FINE)
    drawAll(this)
    this.speak()
  }

  // -- The run
  /** Show moment i of the run, and say what changed. */
  turn(/** @type {number} */ i) {
    const { n, codewords } = this.run[i]
    const moments = this.run.slice(Math.min(this.moment + 1, i), i + 1),
      happened = moments.flatMap(({ events }) => events),
      now = performance.now()
    if (this.moment >= 0 && !this.replay.slow)
      this.flashes.push(...happened.map(event => ({ ...event, since: now })))
    this.moment = i
    this.put(this.run[i])
    this.afresh()
    const last = this.run.slice(0, i + 1).findLast(({ events }) => events.length),
      since = last && last.n < n ? `, since iteration ${last.n}` : "",
      why = last?.events.map(event => `\n${causeOf(event, this.original.limits)}`) ?? []
    return `iteration ${n}: ${count(codewords.length, "cell")}${since}${why.join("")}`
  }
  /** For how many milliseconds a moment of the run stays: with a change, longer. */
  lasts(/** @type {number} */ i) {
    const changes = this.run.filter(({ events }) => events.length).length,
      pause = Math.min(PAUSE, PLAYS / 2 / Math.max(changes, 1)),
      rest = (PLAYS - pause * changes) / Math.max(this.run.length - changes, 1)
    const [long, short] = this.replay.slow ? [1000, 0] : [pause, rest]
    return this.run[i].events.length ? long : short
  }
  /** Go to the next change (1) or the one before (-1). */
  jump(/** @type {1 | -1} */ way) {
    const end = way > 0 ? this.run.length - 1 : 0
    let i = this.replay.at
    do i = i === end ? i : i + way
    while (i !== end && !this.run[i].events.length)
    this.replay.to(i)
    this.settle()
  }

  // -- Size and colours of the page, pointer and keys
  listen() {
    new ResizeObserver(() => this.waiting || this.draw()).observe(this.canvas)
    const recolour = () => this.canvas.isConnected && this.changed(true)
    const watch = new MutationObserver(recolour) // of the site's theme, and of JupyterLab's
    for (const part of [document.documentElement, document.body])
      watch.observe(part, { attributeFilter: ["data-theme", "data-jp-theme-light"] })
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour)
  }
  pointerdown = (/** @type {PointerEvent} */ event) => {
    if (event.button || !event.isPrimary) return
    this.canvas.setPointerCapture(event.pointerId)
    this.canvas.focus() // a finger does not
    const { offsetX: x, offsetY: y } = event,
      words = this.fixed || this.angular || this.cells === 1 ? [] : (this.policy.codewords ?? []),
      places = words.map(word => this.picture.at(word)),
      far = places.map(place => Math.hypot(place[0] - x, place[1] - y)),
      least = Math.min(...far)
    this.dragged = least < (event.pointerType === "touch" ? 22 : 12) ? far.indexOf(least) : -1
    Object.assign(this, { pressed: { x, y, place: places[this.dragged] ?? [x, y] }, armed: true })
    this.replay.stop()
    this.choose(words[this.dragged] ?? this.picture.point(x, y))
  }
  pointermove = (/** @type {PointerEvent} */ event) => {
    if (this.dragged === null) return
    const { codewords } = this.policy,
      { x, y, place } = this.pressed,
      [dx, dy] = [event.offsetX - x, event.offsetY - y],
      point = this.picture.point(place[0] + dx, place[1] + dy)
    if (this.dragged < 0 || !codewords) return this.choose(point)
    if (this.armed && Math.hypot(dx, dy) < 4) return // a finger that rests
    codewords[this.dragged] = point
    this.asked = [...point]
    this.edited()
  }
  choose(/** @type {Vector} */ point) {
    this.asked = [...point]
    this.base = null
    this.changed()
  }
  pointerup = () => {
    if (this.dragged !== null) this.settle()
    this.dragged = null
  }
  keydown = (/** @type {KeyboardEvent} */ event) => {
    /** @type {Record<string, Vector>} */
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] }
    const way = { ...ways, " ": [0, 0] }[event.key] // a space would scroll
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

/** Load the scene of an explorer in view; of several the first, with a choice.
 * @type {IntersectionObserverCallback} */
async function reveal([{ isIntersecting, target }], watch) {
  if (!isIntersecting) return
  watch.disconnect()
  const root = /** @type {HTMLElement} */ (target),
    files = JSON.parse(root.dataset.scenes ?? "{}"),
    names = Object.keys(files)
  let wanted = 0
  const open = async (/** @type {number} */ i) => {
    wanted = i
    const found = await (await fetch(files[names[i]])).json()
    if (wanted === i) new Explorer(root, found, { above })
  }
  const above = names.length > 1 ? [choice("task", names, open)] : []
  await open(0)
}

/** Mount all explorers of a page: each contains its scene, or loads it when in view. */
export function mountAll() {
  for (const found of document.querySelectorAll(".vsp-episodes > script"))
    new Episodes(/** @type {HTMLElement} */ (found.parentElement), JSON.parse(found.textContent))
  const bare = ".vsp-explorer:is([data-scenes], :has(> script)):not([data-mounted])"
  for (const found of document.querySelectorAll(bare)) {
    const root = /** @type {HTMLElement} */ (found)
    root.dataset.mounted = "true"
    const inner = root.querySelector("script")
    if (inner) new Explorer(root, JSON.parse(inner.textContent))
    else new IntersectionObserver(reveal, { rootMargin: "200px" }).observe(root)
  }
}
