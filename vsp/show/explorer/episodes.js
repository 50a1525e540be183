// @ts-check
// Episodes of a policy in any task: inputs, actions and cells over time, and why it acts as it does
// at a chosen moment.

import { choice, element, minus, row, table } from "./controls.js"
import { act, ready } from "./model.js"
import { CELLS } from "./picture.js"

const [BAND, HIGH, GAP] = [14, 46, 12] // pixels: of the cells' band, of a curve, and between two
const STEPS = 150 // tried on each side of an input, up to its range in the episodes
const TERMS = 6 // inputs in the table
const CHANGES = 3 // inputs that are named in a sentence

/** @type {(value: number) => string} */
const short = value => minus(String(+value.toPrecision(3)))

/** What one sees and asks at a moment of one of `scene.episodes`. */
export class Episodes {
  at = 0 // the moment
  which = 0 // the episode
  /** @type {Vector} */ ranges // of each input, in all episodes
  /** @type {ReturnType<typeof act>[]} */ done // at each moment
  /** @type {HTMLInputElement} */ slider

  /** @param {HTMLElement} root @param {EpisodeScene} scene */
  constructor(root, scene) {
    this.scene = scene
    this.policy = ready(scene.policies[0])
    const every = scene.episodes.flatMap(({ states }) => states)
    this.ranges = scene.task.inputs.map((_, i) => {
      const values = every.map(state => state[i])
      return values.reduce((a, b) => Math.max(a, b)) - values.reduce((a, b) => Math.min(a, b))
    })
    const input = () => this.show(+this.slider.value)
    this.slider = element("input", { type: "range", min: 0, "aria-label": "moment", input })
    const touch = (/** @type {PointerEvent} */ event) => {
      if (event.type === "pointermove" && !event.buttons) return
      const { left, width } = this.canvas.getBoundingClientRect()
      this.show(Math.round(((event.clientX - left) / width) * (this.episode.states.length - 1)))
    }
    const about = { role: "img", pointerdown: touch, pointermove: touch }
    this.canvas = element("canvas", { ...about, "aria-label": "inputs, actions and cells over time" })
    this.text = element("div", { "aria-live": "polite" })
    const names = scene.episodes.map(({ name }) => name)
    const list = choice("episode", names, i => this.open(i))
    root.append(row(list), this.canvas, row(this.slider), this.text)
    new ResizeObserver(() => this.draw()).observe(this.canvas)
    this.open(0)
  }
  get episode() {
    return this.scene.episodes[this.which]
  }
  /** @param {number} which */
  open(which) {
    this.which = which
    this.done = this.episode.states.map(state => act(this.scene, this.policy, state))
    this.slider.max = String(this.episode.states.length - 1)
    this.show(Math.floor(this.episode.states.length / 3))
  }
  /** @param {number} at */
  show(at) {
    this.at = Math.min(Math.max(at, 0), this.episode.states.length - 1)
    this.slider.value = String(this.at)
    this.draw()
    this.text.replaceChildren(...this.said())
  }

  /** The curves: of each a name, its values, and those of the agent. */
  curves() {
    const { task, curves } = this.scene,
      { states, agent } = this.episode
    const seen = curves.map(i => ({ name: task.inputs[i], values: states.map(s => s[i]), agent: [] }))
    const acts = task.outputs.map((name, k) => ({
      name,
      values: this.done.map(({ action }) => action[k]),
      agent: agent.map(action => action[k]),
    }))
    return [...seen, ...acts]
  }
  draw() {
    const curves = this.curves(),
      wide = this.canvas.clientWidth || 600,
      high = BAND + curves.length * (HIGH + GAP + 14),
      ratio = devicePixelRatio,
      ctx = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d")),
      style = getComputedStyle(this.canvas),
      tone = (/** @type {string} */ name) => style.getPropertyValue(`--vsp-${name}`).trim() || "#777",
      n = this.episode.states.length,
      x = (/** @type {number} */ t) => (t / Math.max(n - 1, 1)) * wide
    this.canvas.width = Math.round(wide * ratio)
    this.canvas.height = Math.round(high * ratio)
    this.canvas.style.height = `${high}px`
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0)
    ctx.font = `13px ${style.fontFamily}`
    this.done.forEach(({ cell }, t) => {
      ctx.fillStyle = CELLS[cell % CELLS.length]
      ctx.fillRect(x(t - 0.5), 0, x(1) + 0.5, BAND)
    })
    curves.forEach(({ name, values, agent }, i) => {
      const top = BAND + GAP + i * (HIGH + GAP + 14) + 14,
        all = [...values, ...agent],
        [least, most] = [Math.min(...all), Math.max(...all)]
      /** @type {(line: Vector, colour: string, width: number) => void} */
      const plot = (line, colour, width) => {
        ctx.beginPath()
        line.forEach((value, t) =>
          ctx.lineTo(x(t), top + HIGH - ((value - least) / (most - least || 1)) * HIGH),
        )
        ctx.strokeStyle = colour
        ctx.lineWidth = width
        ctx.stroke()
      }
      if (agent.length) plot(agent, tone("teacher"), 3)
      plot(values, tone("ink"), 1.3)
      ctx.fillStyle = tone("ink")
      ctx.fillText(`${name}: ${short(least)} to ${short(most)}`, 2, top - 4)
    })
    ctx.fillStyle = tone("failing")
    ctx.fillRect(x(this.at) - 1, 0, 2, high)
  }

  /** The smallest change of input i alone for which `changed` holds, as found on a grid.
   * @param {Vector} state @param {number} i @param {(seen: Vector) => boolean} changed */
  smallest(state, i, changed) {
    for (let n = 1; n <= STEPS; n++)
      for (const way of [1, -1]) {
        const change = (way * n * this.ranges[i]) / STEPS
        if (change && changed(state.with(i, state[i] + change))) return change
      }
    return 0
  }
  /** The inputs whose smallest change is the smallest share of their range, in words.
   * @param {Vector} state @param {(seen: Vector) => boolean} changed */
  changes(state, changed) {
    const { inputs } = this.scene.task,
      all = inputs.map((name, i) => ({ name, by: this.smallest(state, i, changed), range: this.ranges[i] })),
      found = all.filter(({ by }) => by).sort((a, b) => Math.abs(a.by / a.range) - Math.abs(b.by / b.range))
    const words = found.slice(0, CHANGES).map(({ name, by }) => `${name} ${by > 0 ? "+" : "−"} ${short(Math.abs(by))}`)
    return words.join(", or ") || "no change of one input within its range in these episodes"
  }
  said() {
    const { scene, policy, at, episode } = this,
      { inputs, outputs, actionLow, actionHigh } = scene.task,
      state = episode.states[at],
      { cell, raw, action } = this.done[at],
      rows = policy.coefficients[cell],
      cells = policy.codewords.length,
      adds = inputs.map((_, i) => rows[i].map(weight => weight * state[i])),
      size = (/** @type {number} */ i) => Math.max(...adds[i].map(Math.abs)),
      order = [...inputs.keys()].sort((i, j) => size(j) - size(i)),
      rest = order.slice(TERMS)
    /** @type {Said[]} */
    const terms = order.slice(0, TERMS).map(i => [`${inputs[i]} = ${short(state[i])} adds`, ...adds[i]])
    if (rest.length)
      terms.push([`${rest.length} other inputs add`, ...outputs.map((_, k) => rest.reduce((sum, i) => sum + adds[i][k], 0))])
    terms.push(["the bias adds", ...rows[inputs.length]], ["sum", ...raw])
    terms.push(["action, within the limits", ...action], ["the agent's action", ...episode.agent[at]])
    const title = `Step ${at * episode.every}: ${cells > 1 ? `cell ${cell} acts` : "the map acts"}`
    const swatch = element("i", { class: "vsp-mark" })
    swatch.style.background = CELLS[cell % CELLS.length]
    const lines = [element("p", {}, swatch, element("b", {}, title))]
    lines.push(table(outputs, terms.map(([name, ...values]) => [name, ...values.map(short)])))
    if (cells > 1) {
      const other = this.changes(state, seen => act(scene, policy, seen).cell !== cell)
      lines.push(element("p", {}, element("b", {}, "Another cell if: "), `${other}.`))
    }
    outputs.forEach((name, k) => {
      const middle = (actionLow[k] + actionHigh[k]) / 2,
        side = (/** @type {number} */ value) => value >= middle,
        other = this.changes(state, seen => side(act(scene, policy, seen).action[k]) !== side(action[k])),
        way = `${name} ${side(action[k]) ? "below" : "above"} ${minus(String(middle))} if: `
      lines.push(element("p", {}, element("b", {}, way), `${other}.`))
    })
    return lines
  }
}
