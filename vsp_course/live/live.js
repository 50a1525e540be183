// @ts-check
// The course without Python: predict, do, see. The page is page.html.

import { button, choice, count, digits, one, table } from "../../vsp/show/explorer/controls.js"
import { Explorer } from "../../vsp/show/explorer/explorer.js"
import { errorOf, random, refit, sum } from "../../vsp/show/explorer/model.js"
import { begun } from "../../vsp/show/explorer/picture.js"
import { Distiller } from "../../vsp/show/explorer/distiller.js"

import { interval } from "./studies.js"

const STUDIES = 100
const AT_MOST = 8 // cells by hand
const FAR = 1.5 // from the true mean to the edge of the picture
/** @type {Record<string, string>} */
const KINDS = { Manhattan: "manhattan", Euclidean: "euclidean", "largest difference": "chebyshev" }
const WAYS = ["all episodes, as if independent", "policies, drawn again (3.3)"]

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

/** Cells in which one stays where one is. @type {(codewords: Vector[]) => Numbers} */
const still = codewords => ({ codewords, coefficients: codewords.map(() => [0, 1, 2].map(rest)) })
const rest = () => [0, 0]

/** A view of a policy of SimpleGoal with these codewords, in a part of the page.
 * @param {HTMLElement} part @param {Data} data @param {Vector[]} codewords @param {Hooks} hooks */
function viewOf(part, { scene }, codewords, hooks = {}) {
  const about = { name: "", metric: "manhattan", scale: [1, 1], ...still(codewords) },
    policies = [/** @type {Linear} */ (about)]
  return new Explorer(one(part, ".view"), { ...scene, policies }, { bare: true, ...hooks })
}

/** Lesson 1: the distance decides where borders run.
 * @param {HTMLElement} part @param {Data} data */
function borders(part, data) {
  const view = viewOf(part, data, [[0.25, 0.35], [0.7, 0.55]])
  view.starts = false
  const take = (/** @type {string} */ name) => {
    Object.assign(view.policy, { metric: KINDS[name] })
    view.changed(true)
  }
  one(part, ".panel").prepend(choice("distance", Object.keys(KINDS), take))
}

/** Lesson 1: cells by hand, with maps by least squares.
 * @param {HTMLElement} part @param {Data} data */
function by_hand(part, data) {
  const { visited } = data
  let [fitted, alone] = ["", 0]
  /** After each change of a codeword, fit all maps again. @param {Explorer} view */
  const told = view => {
    const policy = /** @type {Linear} */ (view.policy),
      words = JSON.stringify(policy.codewords)
    if (words !== fitted) {
      fitted = words
      policy.coefficients = refit(policy, visited)
      return view.changed(true)
    }
    const error = errorOf(view.scene, policy, visited)
    alone ||= error
    say(part, "share", `${((100 * error) / alone).toFixed(0)} %`)
    say(part, "failing", String(view.results.failures))
    say(part, "cells", count(view.cells, "cell"))
  }
  const view = viewOf(part, data, [[0.5, 0.5]], { told }),
    words = () => view.numbers().codewords ?? []
  const more = button("add a cell at the chosen state", () => {
    const there = words().some(word => String(word) === String(view.asked))
    if (!there && view.cells < AT_MOST) view.take(still([...words(), view.asked]))
  })
  const less = button("remove the last", () => {
    if (view.cells > 1) view.take(still(words().slice(0, -1)))
  })
  one(part, ".panel").prepend(more, less)
}

/** Lesson 2: whole runs; before each but the first one says what one expects.
 * @param {HTMLElement} part @param {Data} data */
function passes(part, data) {
  const past = /** @type {string[][]} */ ([]),
    config = JSON.parse(one(part, "script").textContent),
    view = viewOf(part, data, [[0.5, 0.5]]),
    expected = choice("I expect", ["…", "more cells", "as many", "fewer cells"], () => wait()),
    said = /** @type {HTMLSelectElement} */ (one(expected, "select"))
  const wait = () => {
    expected.hidden = !past.length
    distiller.go.disabled = past.length > 0 && !said.selectedIndex && distiller.run.done
  }
  const told = ({ run, config } = distiller) => {
    if (!run.done || run.counted) return wait()
    run.counted = true
    view.judge()
    const kinds = run.moments.flatMap(({ events }) => events.map(({ kind }) => kind)),
      merged = kinds.filter(kind => kind === "merge").length,
      numbers = [kinds.length - merged, merged, view.cells, view.results.failures],
      set = limits.map(name => config[name]),
      words = past.length ? said.selectedOptions[0].text : ""
    past.push([`run ${past.length + 1}`, ...set.map(String), words, ...numbers.map(String)])
    const head = "loss,distance,difference,I expected,splits,merged,cells,fail".split(",")
    one(part, ".runs").replaceChildren(table(head, past))
    said.selectedIndex = 0
    wait()
  }
  const limits = /** @type {Limit[]} */ (Object.keys(config).slice(0, 3)), // the thresholds
    thresholds = Object.fromEntries(limits.map(name => [name, ""])),
    episodes = async () => data.episodes,
    distiller = new Distiller(view, config, {}, episodes, told, { thresholds })
  view.fixed = true
  one(part, ".whole").append(distiller.row, expected, view.replay.row)
  wait()
}

/** Lesson 3: a hundred studies, and whether their intervals hold the truth.
 * @param {HTMLElement} part @param {Data} data */
function intervals(part, { reruns }) {
  const sizes = { policies: 8, episodes: 100, way: WAYS[0] },
    past = /** @type {string[][]} */ ([]),
    truth = sum(reruns.means) / reruns.means.length
  let seed = 0
  const go = button(`${STUDIES} studies`, () => {
    const draw = random(++seed),
      { policies, episodes, way } = sizes,
      study = () => interval(reruns, policies, episodes, way === WAYS[1], draw),
      found = Array.from({ length: STUDIES }, study),
      hold = found.filter(([low, high]) => low <= truth && truth <= high).length,
      width = sum(found.map(([low, high]) => high - low)) / STUDIES
    drawIntervals(/** @type {HTMLCanvasElement} */ (one(part, "canvas")), found, truth)
    one(part, "canvas").ariaLabel = `${STUDIES} intervals; ${hold} hold the true mean`
    past.push([way.split(",")[0], String(policies), String(episodes), digits(width), String(hold)])
    const head = ["policies", "episodes", "mean width", "hold the truth"]
    one(part, ".runs").replaceChildren(table(head, past.slice(-8)))
  })
  one(part, ".panel").prepend(
    choice("policies", [4, 8, 16, 30], n => (sizes.policies = n), sizes.policies),
    choice("episodes of each", [20, 100, 1000], n => (sizes.episodes = n), sizes.episodes),
    choice("interval from", WAYS, way => (sizes.way = way)),
    go,
  )
}

/** A line for each interval, from the lowest middle to the highest; those without the truth stand
 * out. @param {HTMLCanvasElement} canvas @param {Vector[]} found @param {number} truth */
function drawIntervals(canvas, found, truth) {
  const { ctx, wide, tones } = begun(canvas, 440),
    x = (/** @type {number} */ value) => wide / 2 + ((value - truth) / FAR) * (wide / 2 - 12)
  found.sort((a, b) => a[0] + a[1] - b[0] - b[1]).forEach(([low, top], i) => {
    const misses = truth < low || truth > top
    ctx.fillStyle = misses ? tones.failing : tones.start
    ctx.fillRect(x(low), 24 + 4 * i, Math.max(x(top) - x(low), 2), misses ? 3 : 1.5)
  })
  ctx.fillStyle = tones.ink
  ctx.fillRect(x(truth) - 0.75, 20, 1.5, 4 * found.length + 8)
  ctx.textAlign = "center"
  ctx.fillText(`true mean return ${truth.toFixed(2)}`, wide / 2, 14)
  for (const by of [-1, 1]) ctx.fillText(digits(truth + by), x(truth + by), 14)
}

/** Begin the page. */
export function begin() {
  /** @type {Data} */ const data = JSON.parse(one(document, "#live-data").textContent)
  /** @type {(name: keyof Visited) => Vector[]} */
  const all = name => data.episodes.flatMap(episode => episode[name])
  data.visited = { states: all("states"), actions: all("actions") }
  /** @type {Record<string, (part: HTMLElement, data: Data) => unknown>} */
  const parts = { borders, by_hand, passes, intervals }
  for (const [name, open] of Object.entries(parts))
    ask(one(document, `#${name}`), part => open(part, data))
}
