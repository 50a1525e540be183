// For test_browser.py: runs of the method as in the page, with draws of their own, and how each does from random starts.

import { readFileSync } from "fs"
import { Partition, distil } from "../../vsp/show/explorer/algorithms.js"
import { network, random, rollout, taught, dynamics } from "../../vsp/show/explorer/model.js"

const { scene, network: stored, preset, seeds } = JSON.parse(readFileSync(0, "utf8"))
const teacher = network(stored)
const many = draw => n => Array(n).fill(0).map(draw)

const found = seeds.map(seed => {
  const [starts, maps, rows, tests] = [1, 2, 3, 4].map(i => random(4 * seed + i)),
    partition = new Partition(preset, { ...scene.task, ...scene.plane }, { map: many(maps), rows: many(rows) }),
    count = { split: 0, merge: 0 }
  for (const { events } of distil(partition, taught(scene, teacher, starts)))
    for (const { kind } of events) count[kind] += 1
  const { start } = dynamics(scene.task.name),
    ends = Array.from({ length: 1000 }, () => rollout(scene, partition.look, start(tests)).outcome),
    failing = ends.filter(outcome => scene.lost.includes(outcome)).length / ends.length
  process.stderr.write(`${seed} `)
  return { cells: partition.cells.length, splits: count.split, merges: count.merge, failing }
})
console.log(JSON.stringify(found))
