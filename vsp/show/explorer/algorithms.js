// @ts-check
// Algorithms 1 to 3 of the paper, as vsp/algorithms.py: the names of the settings are those of
// `vsp.Config`, and the same episodes and draws give the same policy.

import { cellOf, clip, dot, leastSquares, less, raw, ready, sum } from "./model.js"

const RIDGE = 1e-6 // weight of the map that a cell has, as a number of states
const [BETA1, BETA2, EPSILON] = [0.9, 0.999, 1e-8] // Adam (Kingma & Ba 2015)

/** @type {(rows: number, columns: number) => Rows} */
const zeros = (rows, columns) => Array.from({ length: rows }, () => Array(columns).fill(0))

/** The state of a distillation in a plane: a list of cells, in the order of their indices. */
export class Partition {
  /** @type {Cell[]} */ cells = []
  /** @type {Linear} */ look
  /** @type {Set<number>[] | null} */ graph = null // while the codewords stay

  /** `draw(n)` gives n random numbers from 0 to 1, for new maps. @param {Settings} config
   * @param {Pick<Task, "actionLow" | "actionHigh"> & Box} task @param {Draws} draws */
  constructor(config, task, draws) {
    this.config = config
    this.task = task
    this.draws = draws
    const { low, high } = task
    this.scale = config.scale === "box" ? less(high, low) : low.map(() => 1)
    this.shape = /** @type {const} */ ([low.length + 1, task.actionLow.length]) // of a map
  }

  /** After a change of the codewords. */
  moved() {
    const codewords = this.cells.map(({ codeword }) => codeword),
      coefficients = this.cells.map(({ map }) => map),
      about = { name: "", codewords, coefficients, scale: this.scale, metric: this.config.metric }
    this.look = ready(/** @type {Linear} */ (about))
    this.graph = null
  }
  /** Make a state the codeword of a new, untrained cell. @param {Vector} state */
  add(state) {
    const [p, m] = this.shape,
      random = this.config.initial === "uniform",
      drawn = random ? this.draws.map(p * m).map(value => (2 * value - 1) / Math.sqrt(p - 1)) : [],
      map = zeros(p, m).map((row, i) => row.map((_, k) => drawn[i * m + k] ?? 0))
    this.cells.push({ codeword: [...state], map, ...this.unmoved(), ...this.nothing() })
    this.moved()
  }
  /** What an empty buffer holds: rows for minibatches, sums for exact maps. */
  nothing() {
    const [p, m] = this.shape
    const sums = { products: zeros(p, p), targets: zeros(p, m) }
    return /** @type {Filled} */ ({ count: 0, inputs: [], goals: [], sums })
  }
  /** What Adam knows before the first step. */
  unmoved() {
    return { moments: [zeros(...this.shape), zeros(...this.shape)], steps: 0 }
  }
  /** @param {Iterable<number>} chosen */
  reset(chosen) {
    const anew = this.config.adam_on_reset === "restart"
    for (const i of chosen) Object.assign(this.cells[i], this.nothing(), anew && this.unmoved())
  }
  /** Put an episode into the buffers of its cells. @param {Visited} episode */
  observe({ states, actions }) {
    states.forEach((state, t) => {
      const cell = this.cells[cellOf(this.look, state)]
      cell.count += 1
      cell.inputs.push([...state, 1])
      cell.goals.push(actions[t])
    })
  }
  /** Train each cell that has data. Returns the mean loss of the last minibatches, before. */
  train() {
    const filled = this.cells.filter(({ count }) => count)
    if (this.config.fit === "closed_form") return void filled.forEach(solve)
    const { batch_size: size, n_minibatches: n, learning_rate: rate } = this.config
    let loss = 0
    for (let i = 0; i < n; i++) {
      const drawn = this.draws.rows(filled.length * size),
        part = (/** @type {number} */ j) => drawn.slice(j * size, (j + 1) * size)
      loss = sum(filled.map((cell, j) => step(cell, part(j), rate))) / filled.length
    }
    return loss
  }
  /** How far a state is from the codeword of cell i.
   * @param {number} i @param {Vector} state */
  gap(i, state) {
    const by = less(state, this.cells[i].codeword).map((value, j) => value / this.scale[j])
    return this.config.split_metric === "manhattan" ? sum(by.map(Math.abs)) : Math.hypot(...by)
  }
  /** @param {number} i @param {Vector} state @param {Vector} action */
  loss(i, state, action) {
    const { actionLow, actionHigh } = this.task
    const clipped = this.config.split_loss === "clipped"
    const off = action.map((value, k) => {
      const given = raw(this.cells[i].map, state, k)
      return (clipped ? clip(given, actionLow[k], actionHigh[k]) : given) - value
    })
    return dot(off, off) / off.length
  }
  neighbours() {
    const { codewords, scale } = this.look
    return (this.graph ??= neighbours(codewords.map(word => word.map((x, i) => x / scale[i]))))
  }
  /** Algorithm 2. Returns the codewords that came, with the mean losses that caused them.
   * @param {Visited} episode @returns {Change[]} */
  split({ states, actions }) {
    const { max_pol_loss, min_pol_distance, one_split } = this.config,
      made = /** @type {Change[]} */ ([])
    let [previous, since, total] = [-1, 0, 0] // of the losses, since the episode entered the cell
    for (const [t, state] of states.entries()) {
      const cell = cellOf(this.look, state),
        same = (/** @type {Vector} */ word) => word.every((value, i) => value === state[i])
      if (cell !== previous) [previous, since, total] = [cell, t, 0]
      total += this.loss(cell, state, actions[t])
      const cause = total / (t - since + 1),
        far = this.gap(cell, state) > min_pol_distance && !this.look.codewords.some(same)
      if (!far || !(cause > max_pol_loss)) continue
      const near = [...this.neighbours()[cell], cell]
      this.add(state)
      this.reset(near)
      made.push({ kind: "split", codeword: state, cause })
      if (one_split) break
      previous = -1
    }
    return made
  }
  /** Algorithm 3. Returns the codewords that went, with the differences of their maps.
   * @returns {Change[]} */
  merge() {
    const { merge_parameters, min_param_distance } = this.config,
      gone = /** @type {Change[]} */ ([])
    /** @type {(cell: Cell) => Vector} */
    const compared = ({ map }) => (merge_parameters === "weights" ? map.slice(0, -1) : map).flat()
    for (let i = 0; i < this.cells.length; i++) {
      const cell = this.cells[i],
        near = [...this.neighbours()[i]]
      /** @type {(other: Cell) => number} */
      const gap = other => Math.max(...less(compared(other), compared(cell)).map(Math.abs))
      const alike = near.map(j => this.cells[j]).filter(other => gap(other) < min_param_distance)
      if (!alike.length) continue
      this.reset([...near, i])
      for (const other of alike)
        gone.push({ kind: "merge", codeword: other.codeword, cause: gap(other) })
      this.cells = this.cells.filter(other => !alike.includes(other))
      i = this.cells.indexOf(cell)
      this.moved()
    }
    return gone
  }
}

/** Least squares from a cell's sums, to which its rows go, pulled a little towards the map that it
 * has. @param {Cell} cell */
function solve({ map, inputs, goals, sums: { products, targets } }) {
  for (const input of inputs.splice(0)) {
    const [goal] = goals.splice(0, 1)
    input.forEach((value, i) => {
      input.forEach((other, j) => (products[i][j] += value * other))
      goal.forEach((action, k) => (targets[i][k] += value * action))
    })
  }
  const columns = map[0].map((_, k) => map.map(weights => weights[k])),
    found = products.map(line => columns.map(column => dot(line, column))),
    slope = targets.map((goal, i) => less(goal, found[i]))
  const ridged = products.map((line, i) => line.with(i, line[i] + RIDGE))
  leastSquares(ridged, slope).forEach((line, i) => line.forEach((by, k) => (map[i][k] += by)))
}

/** A step of Adam on a minibatch. Returns its mean squared error before.
 * @param {Cell} cell @param {Vector} drawn @param {number} rate */
function step(cell, drawn, rate) {
  const { map, moments, inputs, goals, count } = cell,
    [p, m] = [map.length, map[0].length],
    gradient = zeros(p, m)
  let loss = 0
  for (const value of drawn) {
    const row = Math.trunc(value * count),
      input = inputs[row]
    for (let k = 0; k < m; k++) {
      let error = -goals[row][k]
      for (let i = 0; i < p; i++) error += input[i] * map[i][k]
      for (let i = 0; i < p; i++) gradient[i][k] += error * input[i]
      loss += error * error
    }
  }
  cell.steps += 1
  const [first, second] = [BETA1, BETA2].map(beta => 1 - beta ** cell.steps)
  for (let i = 0; i < p; i++)
    for (let k = 0; k < m; k++) {
      const slope = (2 / (drawn.length * m)) * gradient[i][k],
        mean = (moments[0][i][k] = BETA1 * moments[0][i][k] + (1 - BETA1) * slope),
        square = (moments[1][i][k] = BETA2 * moments[1][i][k] + (1 - BETA2) * slope ** 2)
      map[i][k] -= ((rate / first) * mean) / (Math.sqrt(square / second) + EPSILON)
    }
  return loss / (drawn.length * m)
}

/** Algorithm 1, an iteration at a time: its loss, and what changed.
 * @param {Partition} partition @param {Iterable<Visited>} episodes
 * @returns {Generator<Iterated>} */
export function* distil(partition, episodes) {
  const { config } = partition,
    iterations = config.n_epochs + Number(config.inclusive)
  /** @type {(n: number, every: number) => boolean} */
  const due = (n, every) => n % every === 0 && (n > 0 || config.inclusive)
  let n = -1
  for (const episode of episodes) {
    if (++n === 0) partition.add(episode.states[0])
    partition.observe(episode)
    const loss = partition.train(),
      closing = config.freeze === "last_n_split" ? config.n_split : config.n_freeze,
      thawed = n < (config.freeze === "first_n_freeze" ? config.n_freeze : iterations - closing),
      splits = thawed && due(n, config.n_split) ? partition.split(episode) : [],
      merges = thawed && due(n, config.n_merge) ? partition.merge() : [],
      last = n === iterations - 1
    if (due(n, config.n_reset) && config.periodic_reset === "buffers")
      partition.reset(partition.cells.keys())
    yield { n, loss, events: [...splits, ...merges], last }
    if (last) return
  }
}

/** Of each point in a plane its neighbours in the Delaunay triangulation: some circle through both
 * has no other point inside. @param {Vector[]} points */
export function neighbours(points) {
  const near = points.map(() => /** @type {Set<number>} */ (new Set()))
  points.forEach((p, i) => {
    for (let j = 0; j < i; j++) {
      const [dx, dy] = less(points[j], p)
      let [low, high] = [-Infinity, Infinity] // of the centre, along the line between both
      points.forEach((r, k) => {
        if (k === i || k === j) return
        const from = less(r, p),
          side = 2 * dot([-dy, dx], from),
          room = dot(from, less(r, points[j]))
        if (side > 0) high = Math.min(high, room / side)
        else if (side < 0) low = Math.max(low, room / side)
        else if (room < 0) high = -Infinity // between them
      })
      if (low >= high) continue
      near[i].add(j)
      near[j].add(i)
    }
  })
  return near
}
