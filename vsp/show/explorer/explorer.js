// The explorer: replay a distillation, query a policy at a state, change the policy and watch its
// episodes. It draws a scene, which scene.py describes. "Cell 3" here is cell 3 in Python.

import { Player, button, choice, element, equations, row } from "./controls.js"
import { act, clip, dynamics, ready, rollout } from "./model.js"
import { Picture, drawAll, drawMap } from "./picture.js"
import { answerOf, causeOf, legendOf, noteOf, resultOf } from "./texts.js"

const [COARSE, FINE] = [120, 320] // points per axis of the map: in motion, and at rest
const IN_MOTION = 8 // milliseconds for episodes; at rest all are played
const STRIDE = 149 // a prime: the first starts played are spread over all
const [PLAYS, PAUSE] = [20_000, 400] // milliseconds: of a run, and at most of one of its changes

/** A view of a policy, a chosen state, and texts about them. With `bare`, `root` has only picture,
 * results and legend, and the page arranges the controls; `above` stands above the panel.
 * `settled(view)` is called after each gesture, `told(view)` after each update. */
export class Explorer {
  ends = [] // whether a start fails, undefined if it was not played
  past = [] // numbers to undo to
  flashes = [] // changes that have just happened
  regions = null // polygons to fill
  starts = true // whether they are drawn
  fixed = false // whether codewords cannot be moved
  dragged = null // the codeword, or -1 for the state

  constructor(root, scene, { bare, above = [], settled = () => {}, told = () => {} } = {}) {
    const { low, high } = scene.plane
    Object.assign(this, { root, scene, settled, told, task: dynamics(scene.task.name) })
    this.angular = scene.task.name === "Pendulum-v1"
    this.asked = low.map((value, i) => value + 0.7 * (high[i] - value))
    this.canvas = element("canvas", { tabindex: 0, role: "application" }) // for arrow keys
    this.picture = new Picture(this.canvas, scene.plane)
    this.makeControls()
    const held = root.contains(document.activeElement) && document.activeElement
    root.classList.add("vsp-explorer")
    const stage = element("div", { class: "vsp-stage" }, this.canvas, this.result, this.legend)
    if (!bare) stage.append(this.answer)
    root.replaceChildren(stage, ...(bare ? [] : [this.panel(above)]))
    if (held) (held.isConnected ? held : this.canvas).focus()
    this.listen()
    this.show(scene.policies[0])
  }
  makeControls() {
    this.result = element("p", { class: "vsp-result" })
    this.answer = element("div")
    this.note = element("p", { class: "vsp-note" })
    this.legend = element("ul", { class: "vsp-legend", "aria-label": "legend" })
    const focusout = ({ relatedTarget: to }) =>
      this.stale && !this.form.contains(to) && this.changed()
    const focusin = () => (this.armed = true)
    // Kept while a reader writes
    this.form = element("div", { focusout, focusin, input: () => this.soon() })
    this.backs = row(
      button("undo", () => this.undo()),
      button("reset", () => this.take(this.original)),
    )
    this.replay = new Player(this)
  }
  panel(above) {
    const names = this.scene.policies.map(({ name }) => name)
    const policy = choice("policy", names, i => this.show(this.scene.policies[i]))
    const parts = [row(...above, policy), this.replay.row, this.form, this.backs, this.note]
    return element("div", { class: "vsp-panel" }, ...parts)
  }

  // -- What is shown, and where it lies in the picture
  place = state => {
    if (!this.angular) return state
    const [angle, speed] = state
    return [angle - 2 * Math.PI * Math.round(angle / 2 / Math.PI), speed]
  }
  placeSeen = seen => (this.angular ? [Math.atan2(seen[1], seen[0]), seen[2]] : seen)
  see = point => this.task.see(point)
  get teacher() {
    return "teacher" in this.policy ? this.policy.teacher : this.scene.teacher
  }
  get cells() {
    return this.policy.layers ? 1 : this.policy.codewords.length
  }
  /** Show a policy of the scene with its run, if it has one; `numbers` replace its own. */
  show(policy, numbers) {
    this.replay.stop()
    const { replay, ...own } = policy
    const copy = policy.layers ? policy : structuredClone(own)
    Object.assign(this, { original: policy, run: replay, policy: copy, moment: -1 })
    this.replay.row.hidden = !this.run
    this.backs.hidden = Boolean(policy.layers)
    if (this.run) this.replay.restart(this.run.length)
    if (numbers) Object.assign(this.policy, structuredClone(numbers))
    Object.assign(this, { base: null, past: [], armed: false, kept: this.numbers() })
    this.changed({ policy: true })
  }

  // -- Changing the policy
  /** A copy of what a reader can change. */
  numbers() {
    const { codewords, coefficients } = this.policy
    return structuredClone({ codewords, coefficients })
  }
  /** After every change of a number. Before the first of a gesture, keep what it was. */
  edited({ whole = false } = {}) {
    if (this.armed) {
      this.past.push(this.kept)
      Object.assign(this, { armed: false, base: this.results })
    }
    this.kept = this.numbers()
    this.changed({ policy: true, whole })
  }
  /** Take other numbers, as one gesture. */
  take({ codewords, coefficients }) {
    this.replay.stop()
    Object.assign(this.policy, structuredClone({ codewords, coefficients }))
    this.armed = true
    this.edited({ whole: true })
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

  /** The same once keys rest. */
  soon() {
    clearTimeout(this.still)
    this.still = setTimeout(() => this.settle(), 400)
  }

  // -- Everything that depends on policy and state
  /** Schedule an update. `policy`: it changed; `whole`: with the form, where a reader may write. */
  changed({ policy = false, whole = true } = {}) {
    this.renewed ||= policy
    this.whole ||= whole
    this.waiting ||= requestAnimationFrame(() => {
      const { renewed } = this
      Object.assign(this, { waiting: 0, renewed: false })
      this.redo(renewed)
    })
  }
  redo(renewed = true) {
    const before = this.cell
    if (renewed && !this.policy.layers) ready(this.policy)
    if (renewed) this.judge(IN_MOTION)
    if (renewed) this.mapped = null
    this.cell = act(this.scene, this.policy, this.see(this.asked)).cell
    // Of a network that is not loaded yet, one episode is known
    this.played = this.policy.episode ?? rollout(this.scene, this.policy, this.asked, true)
    const writing = this.form.contains(document.activeElement)
    if (this.whole || (this.cell !== before && !writing)) this.fill()
    else this.stale ||= this.cell !== before
    this.whole = false
    this.draw()
    this.speak()
  }
  /** Run an episode from every start, or as many as `budget` ms allow. */
  judge(budget = Infinity) {
    const { scene, policy } = this,
      n = scene.starts.length,
      begun = performance.now()
    this.ends = []
    if (policy.layers) return (this.results = { played: n, ...policy.results })
    let [played, sum] = [0, 0]
    for (; played < n && (!played || performance.now() - begun < budget); played++) {
      const i = (played * STRIDE) % n,
        { total, outcome } = rollout(scene, policy, scene.starts[i])
      this.ends[i] = scene.lost.includes(outcome)
      sum += total
    }
    const failures = Math.round((this.ends.filter(Boolean).length / played) * n)
    this.results = { played, failures, mean: sum / played }
  }
  fill() {
    this.stale = false
    if (this.policy.layers) return this.form.replaceChildren()
    const lines = equations(this, () => this.edited())
    const title = this.cells > 1 ? `Change cell ${this.cell}` : "Change the map"
    this.form.replaceChildren(element("fieldset", {}, element("legend", {}, title), ...lines))
  }
  speak() {
    const moving = this.replay.playing || this.dragged !== null // too much to hear
    this.result.setAttribute("aria-live", moving ? "off" : "polite")
    const label = `Map of the policy. The chosen state is in cell ${this.cell}. Arrow keys move it.`
    this.canvas.setAttribute("aria-label", label)
    this.result.textContent = resultOf(this)
    if (!this.policy.layers && this.answer.isConnected)
      this.answer.replaceChildren(...answerOf(this))
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
  turn(i) {
    const { n, codewords, coefficients, events } = this.run[i]
    if (this.replay.playing) this.flash(Math.min(this.moment + 1, i), i)
    this.moment = i
    Object.assign(this.policy, structuredClone({ codewords, coefficients }))
    Object.assign(this, { base: null, past: [], kept: this.numbers() })
    this.changed({ policy: true })
    const why = events.map(event => causeOf(event, this.original.limits)).join("\n")
    const count = `${codewords.length} cell${codewords.length > 1 ? "s" : ""}`
    return `iteration ${n}: ${count}${why && `\n${why}`}`
  }
  flash(first, last) {
    const happened = this.run.slice(first, last + 1).flatMap(({ events }) => events)
    const since = performance.now()
    if (!this.replay.slow) this.flashes.push(...happened.map(event => ({ ...event, since })))
  }
  /** For how many milliseconds a moment of the run stays: with a change, longer. */
  lasts(i) {
    const changes = this.run.filter(({ events }) => events.length).length,
      pause = Math.min(PAUSE, PLAYS / 2 / Math.max(changes, 1)),
      rest = (PLAYS - pause * changes) / Math.max(this.run.length - changes, 1)
    return this.run[i].events.length ? pause : rest
  }
  /** Go to the next change (1) or the one before (-1). */
  jump(way) {
    const end = way > 0 ? this.run.length - 1 : 0
    let i = this.replay.at
    do i = i === end ? i : i + way
    while (i !== end && !this.run[i].events.length)
    this.replay.to(i)
    this.flash(i, i)
    this.settle()
  }

  // -- Pointer, keys, and the colours of the page
  listen() {
    const { canvas } = this
    canvas.addEventListener("pointerdown", event => this.press(event))
    canvas.addEventListener("pointermove", event => event.buttons && this.move(event))
    for (const end of ["pointerup", "pointercancel"])
      canvas.addEventListener(end, () => {
        if (this.dragged !== null) this.settle()
        this.dragged = null
      })
    canvas.addEventListener("keydown", event => this.key(event))
    new ResizeObserver(() => this.waiting || this.draw()).observe(canvas)
    const recolour = () => this.changed({ policy: true, whole: false })
    const watch = new MutationObserver(recolour) // of the site's theme, and of JupyterLab's
    for (const part of [document.documentElement, document.body])
      watch.observe(part, { attributeFilter: ["data-theme", "data-jp-theme-light"] })
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour)
  }
  press(event) {
    if (event.button || !event.isPrimary) return
    this.canvas.setPointerCapture(event.pointerId)
    const pixel = [event.offsetX, event.offsetY],
      fixed = this.fixed || this.angular || this.cells === 1
    const far = word => Math.hypot(...this.picture.at(word).map((value, i) => value - pixel[i]))
    const gaps = fixed ? [] : this.policy.codewords.map(far),
      least = Math.min(...gaps)
    this.dragged = least < (event.pointerType === "touch" ? 22 : 12) ? gaps.indexOf(least) : -1
    this.replay.stop()
    this.armed = true
    this.move(event)
  }
  move(event) {
    if (this.dragged === null) return
    this.asked = this.picture.point(event.offsetX, event.offsetY)
    if (this.dragged < 0) return this.changed({ whole: false })
    this.policy.codewords[this.dragged] = [...this.asked]
    this.edited({ whole: true })
  }
  key(event) {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] },
      way = ways[event.key]
    if (!way || event.altKey || event.ctrlKey || event.metaKey) return
    event.preventDefault()
    const { low, high } = this.picture.plane,
      by = event.shiftKey ? 0.1 : 0.01
    const moved = (value, i) => clip(value + way[i] * by * (high[i] - low[i]), low[i], high[i])
    this.asked = this.asked.map(moved)
    this.changed({ whole: false })
    this.soon()
  }
}

/** For anywidget: the scene is JSON text. */
export default {
  render({ model, el }) {
    el.addEventListener("keydown", event => {
      // JupyterLab would take the arrow keys from sliders and lists to select a cell
      if (event.key.startsWith("Arrow") && !event.altKey && !event.ctrlKey) event.stopPropagation()
    })
    el.classList.add("vsp-controls") // hides the still picture for readers without a kernel
    let view = new Explorer(el, JSON.parse(model.get("scene")))
    model.on("change:scene", () => {
      const { asked } = view // the reader's state stays chosen
      view = new Explorer(el, JSON.parse(model.get("scene")))
      view.asked = asked
      view.redo() // at once: the page keeps its height, and so its scroll position
    })
  },
}

/** Load the scene of an explorer in view; of several the first, with a choice. */
async function reveal([{ isIntersecting, target: root }], watch) {
  if (!isIntersecting) return
  watch.disconnect()
  const { scene, scenes } = root.dataset
  const files = scenes ? JSON.parse(scenes) : { "": scene }
  let wanted
  const open = async i => {
    wanted = i
    const found = await (await fetch(Object.values(files)[i])).json()
    if (wanted === i) new Explorer(root, found, { above })
  }
  const above = scenes ? [choice("task", Object.keys(files), open)] : []
  await open(0)
}

/** Mount all explorers of a page: each contains its scene, or loads it when in view. */
export function mountAll() {
  for (const root of document.querySelectorAll(
    ".vsp-explorer:is([data-scene], [data-scenes], :has(> script)):not([data-mounted])",
  )) {
    root.dataset.mounted = true
    const inner = root.querySelector("script")
    if (inner) new Explorer(root, JSON.parse(inner.textContent))
    else new IntersectionObserver(reveal, { rootMargin: "200px" }).observe(root)
  }
}
