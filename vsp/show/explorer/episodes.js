// @ts-check
// Episodes of a policy in any task: inputs, actions and cells over time, and why it acts as it does
// at a chosen moment.

import { choice, digits, element, minus, row, touched } from "./controls.js"
import { act, name, ready } from "./model.js"
import { CELLS, begun } from "./picture.js"
import { answerOf } from "./texts.js"

const [BAND, ROW, TEXT] = [14, 72, 26] // pixels: the band of the cells, a curve, its name
const N_STEPS = 150 // tried on each side of an input, up to its range in the episodes
const STEPS = Array.from({ length: N_STEPS }, (_, n) => (n + 1) / N_STEPS).flatMap(x => [x, -x])
const CLOSE = 0.05 // of an action's range
const CHANGES = 3 // inputs that are named in a sentence


/** What one sees and asks at a moment of one of `scene.episodes`. */
export class Episodes {
  at = 0 // the moment
  /** @type {Seen} */ episode
  /** @type {ReturnType<typeof act>[]} */ done // at each moment
  /** @type {HTMLInputElement} */ slider
  text = element("div", { "aria-live": "polite" })

  /** @param {HTMLElement} root @param {EpisodeScene} scene */
  constructor(root, scene) {
    const { episodes, policies, task } = scene
    this.scene = scene
    this.policy = ready(policies[0])
    name(this.policy)
    const all = episodes.flatMap(({ states }) => states)
    this.ranges = task.inputs.map((_, i) => ends(all.map(state => state[i])))
    const input = () => this.show(+this.slider.value)
    this.slider = element("input", { type: "range", min: 0, "aria-label": "moment", input })
    const take = (/** @type {number} */ share) => this.show(Math.round(share * +this.slider.max))
    this.canvas = touched(take, { "aria-label": "inputs, actions and cells over time" })
    const list = choice("episode", episodes, episode => this.open(episode))
    root.append(row(list), this.canvas, row(this.slider), this.text)
    new ResizeObserver(() => this.draw()).observe(this.canvas)
    this.open(episodes[0])
  }
  /** @param {Seen} episode */
  open(episode) {
    this.episode = episode
    this.done = episode.states.map(state => act(this.scene, this.policy, state))
    this.slider.max = String(episode.states.length - 1)
    this.show(Math.floor(episode.states.length / 3))
  }
  /** @param {number} at */
  show(at) {
    this.at = at
    this.slider.value = String(at)
    this.draw()
    this.text.replaceChildren(...this.said())
  }
  draw() {
    const { inputs, outputs } = this.scene.task,
      { states, agent } = this.episode,
      high = BAND + ROW * (this.scene.curves.length + outputs.length),
      { ctx, wide, tones } = begun(this.canvas, high),
      x = (/** @type {number} */ t) => (t / Math.max(states.length - 1, 1)) * wide
    this.canvas.style.height = `${high}px`
    ctx.lineJoin = "round" // else sharp turns reach into the names
    this.done.forEach(({ cell }, t) => {
      ctx.fillStyle = CELLS[this.policy.tints?.[cell] ?? 0]
      ctx.fillRect(x(t - 0.5), 0, x(1) + 0.5, BAND)
    })
    let low = BAND - 4
    /** @type {(name: string, k: number, ...lines: Vector[][]) => void} the agent's line first */
    const plot = (name, k, ...lines) => {
      const curves = lines.map(line => line.map(row => row[k])),
        [least, most] = ends(curves.flat()),
        y = (/** @type {number} */ v) => ((v - least) / (most - least || 1)) * (ROW - TEXT)
      low += ROW
      curves.forEach((values, i) => {
        const theirs = i < lines.length - 1
        ctx.beginPath()
        values.forEach((value, t) => ctx.lineTo(x(t), low - y(value)))
        ctx.lineWidth = theirs ? 3 : 1.3
        ctx.strokeStyle = theirs ? tones.teacher : tones.ink
        ctx.stroke()
      })
      ctx.fillStyle = tones.ink
      ctx.fillText(`${name}: ${digits(least)} to ${digits(most)}`, 2, low - ROW + TEXT - 4)
    }
    for (const i of this.scene.curves) plot(inputs[i], i, states)
    outputs.forEach((name, k) => plot(name, k, agent, this.done.map(({ action }) => action)))
    ctx.fillStyle = tones.failing
    ctx.fillRect(x(this.at) - 1, 0, 2, high)
  }

  /** The smallest changes of one input for which `changed` holds, by a grid and then by halving.
   * @param {Vector} state @param {(seen: Vector) => string | boolean} changed may add words */
  changes(state, changed) {
    const found = this.scene.task.inputs.flatMap((name, i) => {
      const [low, high] = this.ranges[i],
        wide = high - low
      const holds = (/** @type {number} */ by) => {
        const moved = state.with(i, state[i] + by)
        return moved[i] >= low && moved[i] <= high && changed(moved)
      }
      let by = STEPS.map(step => step * wide).find(holds)
      if (!by) return []
      let before = by - (Math.sign(by) * wide) / N_STEPS
      for (let half = 0; half < 20; half++)
        if (holds((before + by) / 2)) by = (before + by) / 2
        else before = (before + by) / 2
      const said = holds(by) === true ? "" : holds(by),
        enough = digits(Math.ceil(Math.abs(by) * 1000) / 1000), // rounded up: so much suffices
        words = `${name} were ${enough} ${by > 0 ? "more" : "less"}${said}`
      return [{ share: Math.abs(by) / wide, words }]
    })
    const nearest = found.sort((a, b) => a.share - b.share).slice(0, CHANGES)
    const words = nearest.map(({ words }) => words).join(", or ")
    return words || "no change of one input within its range in these episodes"
  }
  said() {
    const { scene, policy, at, episode } = this,
      { outputs, actionLow, actionHigh } = scene.task,
      [state, agent] = [episode.states[at], episode.agent[at]],
      { cell, action } = this.done[at],
      cells = policy.codewords.length,
      theirs = agent.map((value, k) => `${outputs[k]} = ${digits(value)}`).join(", "),
      differ = outputs.filter((_, k) => differs(action[k], agent[k], actionLow[k], actionHigh[k]))
    /** @type {(what: string, told: string) => Node} */
    const line = (what, told) => element("p", {}, element("b", {}, `${what}: `), `${told}.`)
    const lines = [line(`Step ${at * episode.every}`, `here the agent's action is ${theirs}`)]
    const only = `it differs in ${differ.join(", ")}, so what follows explains the policy alone`
    if (differ.length) lines.push(line("Not as the agent", only))
    lines.push(...answerOf({ scene, policy, cell, cells }, state))
    const moved = (/** @type {Vector} */ seen) => {
      const other = act(scene, policy, seen).cell
      return other !== cell && ` (cell ${other})`
    }
    if (cells > 1) lines.push(line("Another cell would act if", this.changes(state, moved)))
    outputs.forEach((name, k) => {
      const middle = (actionLow[k] + actionHigh[k]) / 2,
        above = action[k] >= middle
      /** @type {(seen: Vector) => boolean} */
      const other = seen => act(scene, policy, seen).action[k] >= middle !== above
      const turned = (/** @type {Vector} */ seen) => other(seen) && (moved(seen) || true)
      const side = `${above ? "below" : "above"} ${minus(String(middle))}`
      lines.push(line(`${name} would be ${side} if`, this.changes(state, turned)))
    })
    return lines
  }
}

/** Whether two actions within limits are far apart, or on both sides of the middle.
 * @type {(ours: number, theirs: number, low: number, high: number) => boolean} */
export function differs(ours, theirs, low, high) {
  const middle = (low + high) / 2
  return Math.abs(ours - theirs) > CLOSE * (high - low) || ours >= middle !== theirs >= middle
}

/** The least and the greatest of some numbers. @param {Vector} values */
const ends = values => [Math.min(...values), Math.max(...values)]
