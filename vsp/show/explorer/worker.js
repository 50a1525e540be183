// @ts-check
// A distillation in a worker, so that the page stays quick: what distiller.js starts.

import { Partition, distil } from "./algorithms.js"
import { births, network, random, rollout, taught } from "./model.js"

const SLICE = 40 // milliseconds of work before it listens again
const EVERY = 10 // iterations between two moments without a change, as Python's `History`
const QUICK = 100 // steps: of longer episodes every twentieth start is played

/** Stored episodes at random. @param {Visited[]} episodes @param {() => number} draw */
function* drawn(episodes, draw) {
  while (true) yield episodes[Math.floor(draw() * episodes.length)]
}

/** A run of Algorithm 1 on episodes that the teacher plays as it goes: of each iteration the moment
 * to show, if there is one. @param {Begun} begun @returns {Generator<Made | undefined>} */
function* iterations({ scene, network: stored, config, seed }) {
  /** @type {(draw: () => number) => (n: number) => Vector} */
  const many = draw => n => Array(n).fill(0).map(draw)
  const { task, plane, lost } = scene,
    [starts, maps, rows] = [1, 2, 3].map(i => random(3 * seed + i)),
    partition = new Partition(config, { ...task, ...plane }, { map: many(maps), rows: many(rows) }),
    named = births(partition.scale),
    played = scene.starts.filter((_, i) => task.maxSteps < QUICK || i % 20 === 0)
  const episodes = Array.isArray(stored)
    ? drawn(stored, starts)
    : taught(scene, /** @type {Network} */ (network(stored)), starts)
  for (const { n, loss, events, last } of distil(partition, episodes)) {
    if (!events.length && n % EVERY && !last) yield undefined
    else {
      const { scale, metric, codewords, coefficients } = partition.look,
        numbers = structuredClone({ codewords, coefficients, ...named(codewords, events) }),
        ends = played.map(start => rollout(scene, partition.look, start).outcome),
        share = ends.filter(outcome => lost.includes(outcome)).length / ends.length,
        failures = Math.round(share * scene.starts.length)
      yield { n, scale, metric, ...numbers, events, loss, failures }
    }
  }
}

/** Answer the page: begin, take other settings, go faster or slower. */
export function work() {
  /** @type {Begun} */ let begun
  /** @type {ReturnType<typeof iterations>} */ let run
  /** @type {ReturnType<typeof setTimeout> | undefined} */ let waiting
  let [since, owed] = [0, 0] // iterations that may be made
  const go = () => {
    const now = performance.now(),
      moments = []
    let [made, done] = [0, false]
    owed = Math.min(owed + ((now - since) / 1000) * begun.pace, begun.pace)
    since = now
    for (; owed >= 1 && !done && performance.now() - now < SLICE; owed--, made++) {
      const next = run.next()
      done = Boolean(next.done)
      if (next.value) moments.push(next.value)
    }
    const rate = Math.min(begun.pace, made / ((performance.now() - now) / 1000 || 1))
    postMessage({ moments, done, rate })
    if (!done) waiting = setTimeout(go, begun.pace < 1e5 ? SLICE : 0)
  }
  addEventListener("message", ({ data: { config, ...data } }) => {
    begun = { ...begun, ...data, config: Object.assign(begun?.config ?? {}, config) }
    run ??= iterations(begun)
    since = performance.now()
    clearTimeout(waiting)
    go()
  })
}
