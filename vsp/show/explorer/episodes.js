// @ts-check
// Episodes of a policy in any task: inputs, actions and cells over time, and why it acts as it does
// at a chosen moment.

import { choice, digits, element, minus, row } from "./controls.js"
import { act, ready } from "./model.js"
import { CELLS } from "./picture.js"
import { answerOf } from "./texts.js"

const [BAND, ROW, TEXT] = [14, 72, 26] // pixels: the band of the cells, a curve, its name
const STEPS = 150 // tried on each side of an input, up to its range in the episodes
const CLOSE = 0.05 // of an action's range
const CHANGES = 3 // inputs that are named in a sentence

/** What one sees and asks at a moment of one of `scene.episodes`. */
export class Episodes {
  at = 0 // the moment
  /** @type {EpisodeScene["episodes"][number]} */ episode
  /** @type {ReturnType<typeof act>[]} */ done // at each moment
  /** @type {HTMLInputElement} */ slider
  text = element("div", { "aria-live": "polite" })

  /** @param {HTMLElement} root @param {EpisodeScene} scene */
  constructor(root, scene) {
    const { episodes, policies, task } = scene,
      label = "inputs, actions and cells over time"
    this.scene = scene
    this.policy = ready(policies[0])
    const all = episodes.flatMap(({ states }) => states)
    this.ranges = task.inputs.map((_, i) => ends(all.map(state => state[i])))
    const input = () => this.show(+this.slider.value)
    this.slider = element("input", { type: "range", min: 0, "aria-label": "moment", input })
    const touch = (/** @type {PointerEvent} */ { clientX, buttons, type }) => {
      const { left, width } = this.canvas.getBoundingClientRect(),
        share = (clientX - left) / width
      if (buttons || type === "pointerdown") this.show(Math.round(share * +this.slider.max))
    }
    const about = { role: "img", "aria-label": label, pointerdown: touch, pointermove: touch }
    this.canvas = element("canvas", about)
    const names = episodes.map(({ name }) => name)
    const list = choice("episode", names, i => this.open(episodes[i]))
    root.append(row(list), this.canvas, row(this.slider), this.text)
    new ResizeObserver(() => this.draw()).observe(this.canvas)
    this.open(episodes[0])
  }
  /** @param {EpisodeScene["episodes"][number]} episode */
  open(episode) {
    this.episode = episode
    this.done = episode.states.map(state => act(this.scene, this.policy, state))
    this.slider.max = String(episode.states.length - 1)
    this.show(Math.floor(episode.states.length / 3))
  }
  /** @param {number} at */
  show(at) {
    this.at = Math.min(Math.max(at, 0), this.episode.states.length - 1)
    this.slider.value = String(this.at)
    this.draw()
    this.text.replaceChildren(...this.said())
  }
  draw() {
    const { curves, task } = this.scene,
      { states, agent } = this.episode,
      ctx = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d")),
      style = getComputedStyle(this.canvas),
      [wide, ratio] = [this.canvas.clientWidth || 600, devicePixelRatio],
      high = BAND + ROW * (curves.length + agent[0].length),
      x = (/** @type {number} */ t) => (t / Math.max(states.length - 1, 1)) * wide,
      tone = (/** @type {string} */ name) => style.getPropertyValue(`--vsp-${name}`).trim()
    this.canvas.width = Math.round(wide * ratio)
    this.canvas.height = Math.round(high * ratio)
    this.canvas.style.height = `${high}px`
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0)
    ctx.font = `13px ${style.fontFamily}`
    ctx.lineJoin = "round" // else sharp turns reach into the names
    this.done.forEach(({ cell }, t) => {
      ctx.fillStyle = CELLS[cell % CELLS.length]
      ctx.fillRect(x(t - 0.5), 0, x(1) + 0.5, BAND)
      ctx.fillStyle = tone("ink") // an edge, where a colour comes again
      if (cell >= CELLS.length) ctx.fillRect(x(t - 0.5), 0, x(1) + 0.5, BAND / 3)
    })
    /** @type {(name: string, place: number, ...lines: Vector[]) => void} the agent's line first */
    const plot = (name, place, ...lines) => {
      const [least, most] = ends(lines.flat()),
        low = BAND + ROW * (place + 1) - 4
      lines.forEach((values, i) => {
        const y = (/** @type {number} */ v) => ((v - least) / (most - least || 1)) * (ROW - TEXT)
        ctx.beginPath()
        values.forEach((value, t) => ctx.lineTo(x(t), low - y(value)))
        ctx.lineWidth = i < lines.length - 1 ? 3 : 1.3
        ctx.strokeStyle = tone(i < lines.length - 1 ? "teacher" : "ink")
        ctx.stroke()
      })
      ctx.fillStyle = tone("ink")
      ctx.fillText(`${name}: ${digits(least)} to ${digits(most)}`, 2, low - ROW + TEXT - 4)
    }
    const of = (/** @type {Vector[]} */ rows, /** @type {number} */ i) => rows.map(row => row[i])
    const actions = this.done.map(({ action }) => action)
    curves.forEach((i, place) => plot(task.inputs[i], place, of(states, i)))
    const after = (/** @type {number} */ k) => curves.length + k
    task.outputs.forEach((name, k) => plot(name, after(k), of(agent, k), of(actions, k)))
    ctx.fillStyle = tone("failing")
    ctx.fillRect(x(this.at) - 1, 0, 2, high)
  }

  /** The smallest changes of one input for which `changed` holds, by a grid and then by halving.
   * @param {Vector} state @param {(seen: Vector) => string | boolean} changed may add words */
  changes(state, changed) {
    const found = this.scene.task.inputs.flatMap((name, i) => {
      const [low, high] = this.ranges[i],
        moved = (/** @type {number} */ by) => state.with(i, state[i] + by),
        holds = (/** @type {number} */ by) =>
          moved(by)[i] >= low && moved(by)[i] <= high && changed(moved(by))
      for (let n = 1; n <= STEPS && low < high; n++)
        for (const way of [1, -1]) {
          let [before, by] = [n - 1, n].map(step => (way * step * (high - low)) / STEPS)
          if (!holds(by)) continue
          for (let half = 0; half < 20; half++)
            if (holds((before + by) / 2)) by = (before + by) / 2
            else before = (before + by) / 2
          const said = holds(by) === true ? "" : holds(by),
            share = Math.abs(by) / (high - low),
            enough = digits(Math.ceil(Math.abs(by) * 1000) / 1000), // rounded up: so much suffices
            words = `${name} were ${enough} ${way > 0 ? "more" : "less"}`
          return [{ share, words: words + said }]
        }
      return []
    })
    const nearest = found.sort((a, b) => a.share - b.share).slice(0, CHANGES)
    const words = nearest.map(({ words }) => words).join(", or ")
    return words || "no change of one input within its range in these episodes"
  }
  said() {
    const { scene, policy, at, episode } = this,
      { outputs, actionLow, actionHigh } = scene.task,
      state = episode.states[at],
      { cell, action } = this.done[at],
      cells = policy.codewords.length,
      theirs = episode.agent[at].map((value, k) => `${outputs[k]} = ${digits(value)}`).join(", "),
      then = (/** @type {Vector} */ seen) => act(scene, policy, seen)
    /** @type {(what: string, told: string) => Node} */
    const line = (what, told) => element("p", {}, element("b", {}, `${what}: `), `${told}.`)
    const why = answerOf({ scene, policy, cell, cells, asked: state, task: { see: seen => seen } })
    const step = line(`Step ${at * episode.every}`, `here the agent's action is ${theirs}`),
      lines = [step, ...why],
      cellAt = (/** @type {Vector} */ seen) => then(seen).cell,
      moved = (/** @type {Vector} */ seen) => cellAt(seen) !== cell && ` (cell ${cellAt(seen)})`,
      middles = actionLow.map((low, k) => (low + actionHigh[k]) / 2),
      above = (/** @type {Vector} */ one, /** @type {number} */ k) => one[k] >= middles[k],
      agent = episode.agent[at],
      differ = outputs.filter((_, k) => differs(action[k], agent[k], actionLow[k], actionHigh[k]))
    const only = `it differs in ${differ.join(", ")}, so what follows explains the policy alone`
    if (differ.length) lines.splice(1, 0, line("Not as the agent", only))
    if (cells > 1) lines.push(line("Another cell would act if", this.changes(state, moved)))
    outputs.forEach((name, k) => {
      const turned = (/** @type {Vector} */ seen) =>
        above(then(seen).action, k) !== above(action, k) && (moved(seen) || true)
      const other = this.changes(state, turned),
        side = `${above(action, k) ? "below" : "above"} ${minus(String(middles[k]))}`
      lines.push(line(`${name} would be ${side} if`, other))
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
function ends(values) {
  let [least, most] = [Infinity, -Infinity]
  for (const value of values) [least, most] = [Math.min(least, value), Math.max(most, value)]
  return [least, most]
}
