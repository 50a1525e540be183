// @ts-check
// Algorithms 1 to 3 of the paper as vsp runs them with exact maps: `Config(fit="closed_form",
// initial="zeros")`, everything else as by default.

import { cellOf, leastSquares, raw, ready } from "./model.js"

const RIDGE = 1e-6 // weight of the map that a cell has, as a number of states

/** @type {(one: Vector, other: Vector) => number} */
const dot = (one, other) => one.reduce((sum, value, i) => sum + value * other[i], 0)
/** @type {(one: Vector, other: Vector) => Vector} */
const minus = (one, other) => one.map((value, i) => value - other[i])
/** @type {(rows: number, columns: number) => Rows} */
const zeros = (rows, columns) => Array.from({ length: rows }, () => Array(columns).fill(0))

/** The state of a distillation in a plane. */
export class Partition {
  /** @type {Vector[]} */ codewords = []
  /** @type {Rows[]} */ coefficients = []
  /** @type {Sums[]} */ sums = []
  /** @type {Linear} */ look
  /** @param {Thresholds} limits @param {number} outputs */
  constructor(limits, outputs) {
    this.limits = limits
    this.outputs = outputs
  }
  cellOf(/** @type {Vector} */ state) {
    return cellOf(this.look, state)
  }
  /** For look-ups. */
  moved() {
    const { codewords, coefficients } = this,
      scale = codewords[0].map(() => 1)
    const about = { name: "", codewords, coefficients, scale, metric: "manhattan" }
    this.look = ready(/** @type {Linear} */ (about))
  }
  empty() {
    const size = this.codewords[0].length + 1
    return { count: 0, products: zeros(size, size), targets: zeros(size, this.outputs) }
  }
  /** A new cell around a state; its map says 0. @param {Vector} state */
  add(state) {
    this.codewords.push([...state])
    this.coefficients.push(zeros(state.length + 1, this.outputs))
    this.sums.push(this.empty())
    this.moved()
  }
  /** Put an episode into the buffers of its cells. @param {Visited} episode */
  observe({ states, actions }) {
    states.forEach((state, t) => {
      const sum = this.sums[this.cellOf(state)],
        inputs = [...state, 1]
      sum.count += 1
      inputs.forEach((value, i) => {
        inputs.forEach((other, j) => (sum.products[i][j] += value * other))
        actions[t].forEach((action, k) => (sum.targets[i][k] += value * action))
      })
    })
  }
  /** Least squares in each cell with states, pulled a little towards the map that it has. */
  train() {
    this.sums.forEach(({ count, products, targets }, cell) => {
      if (!count) return
      const map = this.coefficients[cell],
        columns = map[0].map((_, k) => map.map(weights => weights[k]))
      const slope = targets.map((goal, i) =>
        goal.map((value, k) => value - dot(products[i], columns[k])),
      )
      const ridged = products.map((line, i) => line.with(i, line[i] + RIDGE))
      leastSquares(ridged, slope).forEach((line, i) => line.forEach((by, k) => (map[i][k] += by)))
    })
  }
  /** Algorithm 2, a step of the episode at a time.
   * @param {Visited} episode @returns {Generator<Step>} */
  *walk({ states, actions }) {
    let [previous, losses] = [-1, /** @type {Vector} */ ([])]
    for (const [t, state] of states.entries()) {
      const cell = this.cellOf(state)
      if (cell !== previous) [previous, losses] = [cell, []]
      const off = actions[t].map((value, k) => raw(this.coefficients[cell], state, k) - value),
        loss = dot(off, off) / off.length
      losses.push(loss)
      const mean = losses.reduce((sum, each) => sum + each, 0) / losses.length,
        gap = minus(state, this.codewords[cell]).reduce((sum, value) => sum + Math.abs(value), 0),
        known = this.codewords.some(word => word.every((value, i) => value === state[i])),
        splits = mean > this.limits.loss && gap > this.limits.distance && !known
      if (splits) {
        const near = this.neighbours()[cell]
        near.add(cell)
        this.add(state)
        for (const i of near) this.sums[i] = this.empty()
        losses = []
      }
      yield { t, cell, loss, mean, gap, splits }
    }
  }
  /** Algorithm 3. Returns the codewords that went, with the differences of their maps.
   * @returns {Change[]} */
  merge() {
    const gone = /** @type {Change[]} */ ([])
    for (let i = 0; i < this.codewords.length; i++) {
      const near = this.neighbours()[i],
        own = this.coefficients[i].flat()
      const alike = [...near].flatMap(j => {
        const apart = minus(this.coefficients[j].flat(), own).map(Math.abs),
          cause = Math.max(...apart)
        return cause < this.limits.difference ? [{ j, cause }] : []
      })
      if (!alike.length) continue
      for (const j of near.add(i)) this.sums[j] = this.empty()
      for (const { j, cause } of alike)
        gone.push({ kind: "merge", codeword: this.codewords[j], cause })
      const left = [...this.codewords.keys()].filter(j => !alike.some(one => one.j === j))
      this.codewords = left.map(j => this.codewords[j])
      this.coefficients = left.map(j => this.coefficients[j])
      this.sums = left.map(j => this.sums[j])
      i = left.indexOf(i)
    }
    this.moved()
    return gone
  }
  neighbours() {
    return neighbours(this.codewords)
  }
}

/** Algorithm 1, a step of a pass at a time, where the partition may be read. `periods`: episodes
 * between two splitting and merging passes, and without any at the end.
 * @param {Partition} partition @param {Visited[]} episodes @param {Periods} periods
 * @returns {Generator<Happening>} */
export function* distil(partition, episodes, { split, merge, freeze }) {
  partition.add(episodes[0].states[0])
  for (const [n, episode] of episodes.entries()) {
    partition.observe(episode)
    partition.train()
    yield { n, episode }
    if (!n || n >= episodes.length - freeze) continue
    if (n % split === 0) for (const step of partition.walk(episode)) yield { n, episode, step }
    if (n % merge === 0) yield { n, episode, gone: partition.merge() }
  }
}

/** Of each point in a plane its neighbours in the Delaunay triangulation: some circle through both
 * has no other point inside. @param {Vector[]} points */
export function neighbours(points) {
  const near = points.map(() => /** @type {Set<number>} */ (new Set()))
  points.forEach((p, i) => {
    for (let j = 0; j < i; j++) {
      const [dx, dy] = minus(points[j], p)
      let [low, high] = [-Infinity, Infinity] // of the centre, along the line between both
      points.forEach((r, k) => {
        if (k === i || k === j) return
        const from = minus(r, p),
          side = 2 * dot([-dy, dx], from),
          room = dot(from, minus(r, points[j]))
        if (side > 0) high = Math.min(high, room / side)
        else if (side < 0) low = Math.max(low, room / side)
        else if (room < 0) high = -Infinity // between them
      })
      if (low < high) near[i].add(j), near[j].add(i)
    }
  })
  return near
}
