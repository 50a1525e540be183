// @ts-check
// What an explorer says: how its policy does, why it acts as it does, what its marks mean.

import { count, digits, element, minus, table } from "./controls.js"
import { act } from "./model.js"

/** How a policy does from all starts, and how it did before the last gesture ("8 → 31 of 400 starts
 * fail"). Of a part of the starts, the number of failures is an estimate. @param {Explorer} view */
export function resultOf({ scene, results, base, teacher }) {
  const { played, failures, mean } = results,
    about = played < scene.starts.length ? "about " : ""
  /** @type {(before: number | string | undefined, now: number | string) => string} */
  const both = (before, now) => (base ? `${before} → ${about}${now}` : about + now)
  const fails = `${both(base?.failures, failures)} of ${scene.starts.length} starts fail. `
  const returned = `Mean return ${both(base?.mean.toFixed(2), mean.toFixed(2))}`
  const aim = teacher ? ` (teacher: ${teacher.mean.toFixed(2)})` : ""
  return minus(`${scene.lost.length ? fails : ""}${returned}${aim}.`)
}

/** How the episode from the chosen state goes. @param {Explorer} view */
export function episodeOf({ cell, cells, asked, played, task, picture: { plane } }) {
  if (!played.states.length) return ""
  const [goal] = task.places,
    place = task.places[(played.outcome ?? 0) - 1],
    end = place ? ` to the ${place.name}` : goal ? `, not to the ${goal.name}` : "",
    size = (/** @type {number} */ i) => Math.floor(Math.log10(plane.high[i] - plane.low[i])),
    at = asked.map((value, i) => minus(value.toFixed(2 - Math.min(size(i), 0)))).join(", "),
    steps = count(played.states.length - 1, "step")
  const where = cells > 1 ? `, in cell ${cell}` : ""
  return `From (${at})${where}: ${steps}${end}.`
}

/** What caused a split or a merge; `limits`: the thresholds, where known.
 * @param {Change} change @param {Limits} limits */
export function causeOf({ kind, codeword, cause }, limits = {}) {
  const at = `${kind} at (${codeword.map(value => minus(value.toFixed(2))).join(", ")})`,
    found = cause.toPrecision(3)
  if (kind === "merge")
    return `${at}: maps differ by ${found}${limits.merge ? `, below ${limits.merge}` : ""}`
  return `${at}: loss ${found}${limits.split ? `, above ${limits.split}` : ""}`
}

/** Why the policy acts so in the chosen state: its cell, the action, what each input adds.
 * @param {Asked} view */
export function answerOf({ scene, policy, cell, cells, asked, task }) {
  if (policy.layers) return []
  const { inputs, outputs } = scene.task,
    seen = task.see(asked),
    rows = policy.coefficients[cell],
    { raw, action } = act(scene, policy, seen)
  /** @type {Said[]} */
  const adds = [...inputs, "bias"].map((name, i) => {
    const said = name === "bias" ? "the bias adds" : `${name} = ${digits(seen[i])} adds`
    return [said, ...rows[i].map(weight => weight * (seen[i] ?? 1))]
  })
  /** @type {Said[]} */
  const found = [...adds, ["sum", ...raw], ["action, within the limits", ...action]]
  const told = found.map(([name, ...values]) => [name, ...values.map(digits)])
  const title = cells > 1 ? `Cell ${cell} of ${cells}, counted from 0` : "The map"
  return [element("p", {}, element("b", {}, title)), table(outputs, told)]
}

/** What one can do. @type {(view: Explorer) => string} */
export const noteOf = ({ angular, cells }) =>
  (angular || cells === 1 ? "" : "Drag a codeword to move its cell. ") +
  "Click to choose a state; arrow keys move it."

/** What colours and marks mean: only those that are in the picture. @param {Explorer} view */
export function legendOf({ scene, policy, failing, starts, regions, cells, picture, placeSeen }) {
  const [output, second] = scene.task.outputs
  /** @type {(kind: string, words: string) => Node} */
  const mark = (kind, words) =>
    element("li", {}, element("i", { class: `vsp-mark vsp-${kind}` }), words)
  const fails = starts && failing.size > 0,
    inside = policy.codewords?.some(word => picture.shows(placeSeen(word)))
  const marks = [
    starts && mark("start", "start"),
    fails &&
      mark("failing", cells > 1 ? "fails; last step in the chosen cell" : "start that fails"),
    fails && cells > 1 && mark("elsewhere", "fails; last step in another"),
    regions && mark("region", "falls into the pit"),
    second && mark(policy.layers ? "taught" : "step", policy.layers ? "teacher's step" : "step"),
    !second && mark("below", `${output} below 0`),
    !second && mark("above", "above 0"),
    cells > 1 && inside && mark("codeword", "codeword; filled: of the chosen cell"),
    picture.ties && mark("tied", "two codewords equally near: the first acts"),
  ]
  return [...marks.filter(made => !!made), mark("chosen", "chosen state, and its episode")]
}
