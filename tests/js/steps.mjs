// For test_modules.py: how often steps and cells differ from Python's, and all episodes.

import { readFileSync } from "fs"
import { act, cellOf, dynamics, ready, rollout } from "../../vsp/show/explorer/model.js"

/** `file`: per step state (2), cell, next state (2), reward and outcome, as float64. */
export function compare(file, scene, policy) {
  const bytes = readFileSync(file),
    numbers = new Float64Array(bytes.buffer, bytes.byteOffset, bytes.length / 8),
    { see, step } = dynamics(scene.task.name),
    found = { steps: 0, ties: 0, cells: 0, off: 0 }
  ready(policy)
  for (let i = 0; i < numbers.length; i += 7) {
    const [x, y, cell, ...expected] = numbers.subarray(i, i + 7),
      near = cellOf(policy, see([x, y]), 1e-9),
      other = policy.far.findLastIndex(far => Math.abs(far - policy.far[near]) < 1e-9)
    found.steps += 1
    found.ties += near !== other
    if (near !== other) continue
    const acted = act(scene, policy, see([x, y])),
      made = step([x, y], acted.action).flat()
    found.cells += acted.cell !== cell
    found.off += made.some((value, k) => Math.abs(value - expected[k]) > 1e-9)
  }
  const ends = scene.starts.map(start => rollout(scene, policy, start))
  return { ...found, totals: ends.map(end => end.total), outcomes: ends.map(end => end.outcome) }
}
