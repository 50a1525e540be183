// @ts-check
// The course without Python: predict, do, see. The page is page.html.

import { Partition, distil } from "../../vsp/show/explorer/algorithms.js"
import { button, choice, count, digits, element, table } from "../../vsp/show/explorer/controls.js"
import { Explorer } from "../../vsp/show/explorer/explorer.js"
import { act, refit } from "../../vsp/show/explorer/model.js"
import { interval, random } from "./studies.js"

const PERIODS = { split: 1, merge: 5, freeze: 10 }
const STUDIES = 100
const AT_MOST = 8 // cells by hand
const FAR = 1.5 // from the true mean to the edge of the picture

/** @type {(root: ParentNode, selector: string) => HTMLElement} */
const one = (root, selector) => /** @type {HTMLElement} */ (root.querySelector(selector))
/** @type {(root: ParentNode, name: string, words: string) => void} */
const say = (root, name, words) => (one(root, `[data-say=${name}]`).textContent = words)

/** Open what is to do once the question above it is answered, and what is to see once it is done.
 * The first answer stays. @param {HTMLElement} part @param {(part: HTMLElement) => unknown} open */
function ask(part, open) {
  const [asked, todo, seen] = [".predict", ".do", ".see"].map(name => one(part, name))
  asked.addEventListener("change", ({ target }) => {
    const { parentElement: label } = /** @type {HTMLInputElement} */ (target)
    asked.setAttribute("disabled", "")
    label?.classList.add("said")
    say(part, "said", ` You said: ${label?.textContent?.trim()}.`)
    todo.hidden = false
    open(part)
    let left = Number(seen.dataset.after ?? 1) // clicks, or presses of a button if several
    for (const kind of ["click", "change"])
      todo.addEventListener(kind, ({ target }) => {
        const counts = !seen.dataset.after || /** @type {Element} */ (target).matches("button")
        if (counts && --left <= 0) seen.hidden = false
      })
  })
}

/** A view of a policy of SimpleGoal with these numbers, in a part of the page.
 * @param {HTMLElement} part @param {Data} data @param {Numbers} numbers @param {Hooks} hooks */
function viewOf(part, { scene }, numbers, hooks = {}) {
  const policy = { name: "", metric: "manhattan", scale: [1, 1], ...numbers }
  return new Explorer(
    one(part, ".view"),
    { ...scene, policies: [/** @type {Linear} */ (policy)] },
    { bare: true, ...hooks },
  )
}

const still = () => [0, 0, 0].map(() => [0, 0]) // a map that stays where it is

/** Lesson 1: the distance decides where borders run. 
 * @param {HTMLElement} part @param {Data} data */
function borders(part, data) {
  const codewords = [
    [0.25, 0.35],
    [0.7, 0.55],
  ]
  const view = viewOf(part, data, { codewords, coefficients: codewords.map(still) })
  view.starts = false
  const names = ["manhattan", "euclidean", "chebyshev"]
  const take = (/** @type {number} */ i) => {
    Object.assign(view.policy, { metric: names[i] })
    view.changed(true)
  }
  const list = choice("distance", ["Manhattan", "Euclidean", "largest difference"], take)
  one(part, ".panel").prepend(list)
}

/** Lesson 1: cells by hand, with maps by least squares. 
 * @param {HTMLElement} part @param {Data} data */
function by_hand(part, data) {
  const { visited } = data
  let [fitted, alone] = ["", 0]
  const error = (/** @type {Explorer} */ { scene, policy }) =>
    visited.states.reduce((sum, state, i) => {
      const given = act(scene, policy, state).action
      return sum + given.reduce((part, value, k) => part + (value - visited.actions[i][k]) ** 2, 0)
    }, 0)
  /** After each change of a codeword, fit all maps again. @param {Explorer} view */
  const told = view => {
    const policy = /** @type {Linear} */ (view.policy),
      words = JSON.stringify(policy.codewords)
    if (words !== fitted) {
      fitted = words
      policy.coefficients = refit(policy, visited)
      return view.changed(true)
    }
    alone ||= error(view)
    say(part, "share", `${((100 * error(view)) / alone).toFixed(0)} %`)
    say(part, "failing", String(view.results.failures))
    say(part, "cells", count(view.cells, "cell"))
  }
  const view = viewOf(part, data, { codewords: [[0.5, 0.5]], coefficients: [still()] }, { told })
  const change = (/** @type {Vector[]} */ codewords) =>
    view.take({ codewords, coefficients: codewords.map(still) })
  const words = () => view.numbers().codewords ?? []
  const more = button("add a cell at the chosen state", () => {
    const there = words().some(word => String(word) === String(view.asked))
    if (!there && view.cells < AT_MOST) change([...words(), view.asked])
  })
  const less = button("remove the last", () => view.cells > 1 && change(words().slice(0, -1)))
  one(part, ".panel").prepend(more, less)
}

/** The episodes in an order that depends on the number of the run.
 * @param {Visited[]} episodes @param {number} run */
function shuffled(episodes, run) {
  const draw = random(run),
    keys = episodes.map(() => draw())
  return [...keys.keys()].sort((i, j) => keys[i] - keys[j]).map(i => episodes[i])
}

/** What a step of a pass found. @param {Happening} now @param {Thresholds} limits */
function toldOf({ n, step, gone }, limits) {
  const episode = `Episode ${n}`
  if (gone) {
    const causes = gone.map(({ cause }) => digits(cause)).join(", "),
      none = `no neighbours differ by less than ${limits.difference}`,
      those = gone.length ? `${count(gone.length, "cell")} gone: maps differ by ${causes}` : none
    return `${episode}, merging pass: ${those}.`
  }
  if (!step) return `${episode}: its states are in the buffers, and all maps are fitted again.`
  const { t, cell, loss, mean, gap, splits } = step
  const far = `distance ${digits(gap)} ${gap > limits.distance ? ">" : "≤"} ${limits.distance}`,
    bad = `mean so far ${digits(mean)} ${mean > limits.loss ? ">" : "≤"} ${limits.loss}`,
    then = splits ? "Both: a new cell here." : "Not both: no split."
  return `${episode}, step ${t}, cell ${cell}: loss ${digits(loss)}, ${bad}; ${far}. ${then}`
}

/** Lesson 2: splits and merges, a step at a time or a whole run. */
class Passes {
  limits = { loss: 0, distance: 0, difference: 0 }
  partition = new Partition(this.limits, 2)
  /** @type {Generator<Happening>} */ going
  /** @type {string[][]} */ past = [] // whole runs
  tries = 0
  splits = 0
  merges = 0
  /** @param {HTMLElement} part @param {Data} data */
  constructor(part, data) {
    this.part = part
    this.episodes = data.episodes
    this.view = viewOf(part, data, { codewords: [[0.5, 0.5]], coefficients: [still()] })
    this.view.fixed = true
    this.fields = /** @type {HTMLInputElement[]} */ ([...part.querySelectorAll("[data-limit]")])
    for (const field of this.fields) field.addEventListener("change", () => this.begin())
    one(part, ".steps").append(
      button("next step", () => this.go(() => true)),
      button("next split", () => this.go(({ step }) => step?.splits)),
      button("next merge", () => this.go(({ gone }) => gone?.length)),
      button("next episode", () => this.go(({ step, gone }) => !step && !gone)),
      button("start anew", () => this.begin()),
    )
    const answers = ["…", "more cells", "as many", "fewer cells"]
    this.expected = choice("I expect", answers, () => this.wait())
    this.whole = button("a whole run of 100 episodes", () => this.run())
    one(part, ".whole").append(this.expected, this.whole)
    this.wait()
    this.begin()
  }
  get said() {
    return /** @type {HTMLSelectElement} */ (one(this.expected, "select"))
  }
  /** Ask before each run but the first. */
  wait() {
    this.expected.hidden = !this.past.length
    this.whole.disabled = this.past.length > 0 && !this.said.selectedIndex
  }
  begin() {
    for (const { dataset, valueAsNumber: given } of this.fields)
      this.limits[/** @type {keyof Thresholds} */ (dataset.limit)] = Math.max(given || 0, 0)
    this.tries += 1
    this.partition = new Partition({ ...this.limits }, 2)
    this.going = distil(this.partition, shuffled(this.episodes, this.tries), PERIODS)
    this.splits = this.merges = 0
    this.go(() => true)
  }
  /** Go on until `wanted`, and show where that is. @param {(now: Happening) => unknown} wanted */
  go(wanted) {
    let last
    for (let now = this.going.next(); !now.done; now = this.going.next()) {
      last = now.value
      this.splits += Number(last.step?.splits ?? 0)
      this.merges += last.gone?.length ?? 0
      if (wanted(last)) break
    }
    if (!last) return say(this.part, "step", "This run is over. Start anew.")
    const { view, part, splits, merges } = this,
      { codewords, coefficients, limits } = this.partition,
      states = last.episode.states.slice(0, (last.step?.t ?? Infinity) + 1)
    Object.assign(view.policy, { episode: { states } })
    view.asked = states[states.length - 1]
    view.put({ codewords, coefficients })
    view.afresh()
    say(part, "step", toldOf(last, limits))
    const cells = count(codewords.length, "cell")
    say(part, "events", `${cells}, ${count(splits, "split")}, ${merges} merged.`)
  }
  run() {
    this.begin()
    this.go(() => false)
    this.view.judge()
    const { past, limits, splits, merges, view, said } = this,
      numbers = [splits, merges, view.cells, view.results.failures],
      words = past.length ? said.selectedOptions[0].text : ""
    const set = Object.values(limits).map(String)
    past.push([`run ${past.length + 1}`, ...set, words, ...numbers.map(String)])
    const head = [...Object.keys(limits), "I expected", "splits", "merged", "cells", "fail"]
    one(this.part, ".runs").replaceChildren(table(head, past))
    said.selectedIndex = 0
    this.wait()
  }
}

/** Lesson 3: a hundred studies, and whether their intervals hold the truth.
 * @param {HTMLElement} part @param {Data} data */
function intervals(part, { reruns }) {
  const canvas = /** @type {HTMLCanvasElement} */ (one(part, "canvas")),
    sizes = { policies: 8, episodes: 100, whole: 0 }
  const past = /** @type {string[][]} */ ([])
  let seed = 0
  const truth = reruns.means.reduce((sum, mean) => sum + mean, 0) / reruns.means.length
  const go = button(`${STUDIES} studies`, () => {
    const draw = random(++seed),
      { policies, episodes, whole } = sizes
    const found = Array.from({ length: STUDIES }, () =>
      interval(reruns, policies, episodes, whole > 0, draw),
    )
    const hold = found.filter(([low, high]) => low <= truth && truth <= high).length
    drawIntervals(canvas, found, truth)
    canvas.setAttribute("aria-label", `${STUDIES} intervals; ${hold} hold the true mean`)
    const how = whole ? "policies drawn again" : "all episodes"
    const width = found.reduce((sum, [low, high]) => sum + high - low, 0) / STUDIES
    past.push([how, ...[policies, episodes].map(String), digits(width), String(hold)])
    const head = ["policies", "episodes", "mean width", "hold the truth"]
    one(part, ".runs").replaceChildren(table(head, past.slice(-8)))
  })
  /** @type {(label: string, name: keyof typeof sizes, values: number[], at: number) => Node} */
  const pick = (label, name, values, at) =>
    choice(label, values.map(String), i => (sizes[name] = values[i]), at)
  const ways = ["all episodes, as if independent", "policies, drawn again (3.3)"]
  one(part, ".panel").prepend(
    pick("policies", "policies", [4, 8, 16, 30], 1),
    pick("episodes of each", "episodes", [20, 100, 1000], 1),
    choice("interval from", ways, i => (sizes.whole = i)),
    go,
  )
}

/** A line for each interval, from the lowest middle to the highest; those without the truth stand
 * out. @param {HTMLCanvasElement} canvas @param {Vector[]} found @param {number} truth */
function drawIntervals(canvas, found, truth) {
  const [wide, high, ratio] = [canvas.clientWidth || 440, 440, devicePixelRatio],
    ctx = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d")),
    style = getComputedStyle(canvas),
    tone = (/** @type {string} */ name) => style.getPropertyValue(`--vsp-${name}`).trim()
  Object.assign(canvas, { width: wide * ratio, height: high * ratio })
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0)
  const x = (/** @type {number} */ value) => wide / 2 + ((value - truth) / FAR) * (wide / 2 - 12)
  const sorted = [...found].sort((a, b) => a[0] + a[1] - b[0] - b[1])
  sorted.forEach(([low, top], i) => {
    const misses = truth < low || truth > top
    ctx.fillStyle = tone(misses ? "failing" : "start")
    ctx.fillRect(x(low), 24 + 4 * i, Math.max(x(top) - x(low), 2), misses ? 3 : 1.5)
  })
  ctx.fillStyle = tone("ink")
  ctx.fillRect(x(truth) - 0.75, 20, 1.5, 4 * found.length + 8)
  ctx.font = `13px ${style.fontFamily}`
  ctx.textAlign = "center"
  ctx.fillText(`true mean return ${truth.toFixed(2)}`, wide / 2, 14)
  for (const by of [-1, 1]) ctx.fillText(digits(truth + by), x(truth + by), 14)
}

export function begin() {
  const data = JSON.parse(one(document, "#live-data").textContent ?? ""),
    all = (/** @type {keyof Visited} */ name) =>
      data.episodes.flatMap((/** @type {Visited} */ episode) => episode[name])
  data.visited = { states: all("states"), actions: all("actions") }
  /** @type {Record<string, (part: HTMLElement, data: Data) => unknown>} */
  const parts = { borders, by_hand, passes: (part, data) => new Passes(part, data), intervals }
  for (const [name, open] of Object.entries(parts))
    ask(one(document, `#${name}`), part => open(part, data))
}
