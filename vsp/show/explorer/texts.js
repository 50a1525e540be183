// @ts-check
// What an explorer says: how its policy does, why it acts as it does, what its marks mean.

import { count, digits, element, minus, table } from "./controls.js"
import { act, numberOf } from "./model.js"

/** How a policy does from all starts, and how it did before the last gesture ("8 → 31 of 400
 * fail"). Of a part of the starts, the number of failures is an estimate. @param {Explorer} view */
export function resultOf({ scene, policy, results, base }) {
  const { played, failures, mean } = results,
    { teacher } = { ...scene, ...policy },
    about = played < scene.starts.length ? "about " : ""
  /** @type {(before: number | string | undefined, now: number | string) => string} */
  const both = (before, now) => (base ? `${before} → ${about}${now}` : about + now)
  const fails = `${both(base?.failures, failures)} of ${scene.starts.length} fail, mean return `,
    aim = teacher && !base && !policy.layers ? ` (teacher ${teacher.mean.toFixed(2)})` : ""
  const returned = both(base?.mean.toFixed(2), mean.toFixed(2))
  return minus(`${scene.lost.length ? fails : "mean return "}${returned}${aim}.`)
}

/** How the episode from the chosen state goes. @param {Explorer} view */
export function episodeOf({ policy, cell, cells, asked, played, task, picture: { plane } }) {
  if (!played.states.length) return ""
  const [goal] = task.places,
    place = task.places[(played.outcome ?? 0) - 1],
    end = place ? ` to the ${place.name}` : goal ? `, not to the ${goal.name}` : "",
    size = (/** @type {number} */ i) => Math.floor(Math.log10(plane.high[i] - plane.low[i])),
    at = asked.map((value, i) => minus(value.toFixed(2 - Math.min(size(i), 0)))).join(", "),
    where = cells > 1 ? `, in cell ${numberOf(policy, cell)}` : ""
  return `From (${at})${where}: ${count(played.states.length - 1, "step")}${end}.`
}

/** Which moment of the run is shown, and what changed then or last. @param {Explorer} view */
export function momentOf({ run, replay: { at }, original: { limits } }) {
  if (!run.length) return ""
  const { n, codewords, loss } = run[at],
    last = run.slice(0, at + 1).findLast(({ events }) => events.length),
    lossy = loss === undefined ? "" : `, loss ${loss.toPrecision(2)}`,
    since = last && last.n < n ? `, since iteration ${last.n}` : "",
    why = last?.events.map(event => `\n${causeOf(event, limits)}`).join("") ?? ""
  const cells = count(codewords.length, "cell")
  return `iteration ${n}: ${cells}${lossy}${since}${why}`
}

/** What caused a split or a merge; `limits`: the thresholds, where known.
 * @param {Change} change @param {Limits} limits */
export function causeOf({ kind, codeword, cause }, limits = {}) {
  const { max_pol_loss: most, min_param_distance: least } = limits,
    at = `${kind} at (${codeword.map(value => minus(value.toFixed(2))).join(", ")})`,
    found = cause.toPrecision(3)
  if (kind === "merge")
    return `${at}: maps differ by ${found}${least ? `, below ${least}` : ""}`
  return `${at}: loss ${found}${most ? `, above ${most}` : ""}; the new map was untrained`
}

/** Why the policy acts so in the chosen state: its cell, the action, what each input adds.
 * @param {Asked} view @param {Vector} seen */
export function answerOf({ scene, policy, cell, cells }, seen) {
  if (policy.layers) return []
  const { inputs, outputs } = scene.task,
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
  const title = cells > 1 ? `Cell ${numberOf(policy, cell)}, one of ${cells}` : "The map"
  return [element("p", {}, element("b", {}, title)), table(outputs, told)]
}

/** What one can do. @type {(view: Explorer) => string} */
export const noteOf = ({ movable, arrows }) =>
  (movable ? "Drag a codeword to move its cell. " : "") +
  (arrows.length ? "Drag a thick arrow: its constants follow. " : "") +
  "Drag a number sideways. Click to choose a state; arrow keys move it."

/** What colours and marks mean: only those that are in the picture. @param {Explorer} view */
export function legendOf({ scene, policy, failing, starts, regions, cells, picture, task }) {
  const [output, second] = scene.task.outputs,
    fails = starts && failing.size > 0,
    inside = policy.codewords?.some(word => picture.shows(task.place(word)))
  /** @type {[shown: unknown, kind: string, words: string][]} */
  const marks = [
    [starts, "start", "start"],
    [fails, "failing", cells > 1 ? "fails; last step in the chosen cell" : "start that fails"],
    [fails && cells > 1, "elsewhere", "fails; last step in another"],
    [regions, "region", "falls into the pit"],
    [second && policy.layers, "taught", "teacher's step"],
    [second && !policy.layers, "step", "step"],
    [!second, "below", `${output} below 0`],
    [!second, "above", "above 0"],
    [cells > 1 && inside, "codeword", "codeword; filled: of the chosen cell"],
    [true, "chosen", "chosen state, and its episode"],
  ]
  const told = marks.filter(([shown]) => shown)
  return told.map(([, kind, words]) => element("li", { class: `vsp-${kind}` }, words))
}
