// @ts-check
// Policies, tasks and the teacher, computed as Python does. Nothing here knows a page or picture.

const TINTS = 8 // colours of cells
const ROUNDED = 1e-4 // as codewords of a run are stored

/** @type {(value: number, low: number, high: number) => number} */
export const clip = (value, low, high) => Math.min(Math.max(value, low), high)
/** @type {(values: Vector) => number} */
export const sum = values => values.reduce((total, value) => total + value, 0)
/** @type {(one: Vector, other: Vector) => number} */
export const dot = (one, other) => one.reduce((total, value, i) => total + value * other[i], 0)
/** @type {(one: Vector, other: Vector) => Vector} */
export const less = (one, other) => one.map((value, i) => value - other[i])

// ---- Which cell, which action

/** The orders of the Minkowski distances that a scene may name alone.
 * @type {Record<string, number | null>} */
const ORDERS = { manhattan: 1, euclidean: 2, chebyshev: null }

/** Prepare a policy for fast look-ups: its codewords divided by the scale, in one flat array.
 * @param {Linear} policy */
export function ready(policy) {
  const { codewords, scale, metric, order = ORDERS[metric] } = policy
  if (order === undefined) throw new Error(`the metric ${metric} has no known order`)
  policy.power = order ?? Infinity
  policy.scaled = Float64Array.from(
    codewords.flatMap(word => word.map((value, i) => value / scale[i])),
  )
  policy.place = new Float64Array(scale.length)
  policy.far = new Float64Array(codewords.length)
  return policy
}

/** The index of the nearest codeword; among equally near ones, up to `slack`, the first. Until the
 * next call `policy.far` has all distances (Euclidean: squared).
 * @param {Linear} policy @param {Vector} seen */
export function cellOf({ scaled, scale, power, place, far }, seen, slack = 0) {
  const d = scale.length,
    plain = power === 1 || power === 2 || power === Infinity
  let best = 0
  for (let i = 0; i < d; i++) place[i] = seen[i] / scale[i]
  for (let j = 0, at = 0; j < far.length; j++) {
    let sum = 0
    for (let i = 0; i < d; i++, at++) {
      const gap = Math.abs(place[i] - scaled[at])
      if (power === 2) sum += gap * gap
      else if (power === 1) sum += gap
      else if (power !== Infinity) sum += gap ** power
      else if (gap > sum) sum = gap
    }
    far[j] = plain ? sum : sum ** (1 / power)
    if (far[j] < far[best] - slack) best = j
  }
  return best
}

/** The output of a linear map for action k: rows are the weights of the inputs, then the bias.
 * @param {Rows} rows @param {Vector} seen @param {number} k */
export function raw(rows, seen, k) {
  let sum = rows[seen.length][k]
  for (let i = 0; i < seen.length; i++) sum += seen[i] * rows[i][k]
  return sum
}

/** The cell, the output of its map, and the action within its limits. A network has one cell.
 * @param {Scene} scene @param {Policy} policy @param {Vector} seen */
export function act({ task }, policy, seen) {
  const cell = policy.layers ? 0 : cellOf(policy, seen)
  const given = policy.layers
    ? output(policy, seen)
    : task.outputs.map((_, k) => raw(policy.coefficients[cell], seen, k))
  const action = given.map((value, k) => clip(value, task.actionLow[k], task.actionHigh[k]))
  return { cell, raw: given, action }
}

// ---- The teacher

/** Numbers stored as base64 of little-endian float32. @param {string} text */
export const floats = text =>
  new Float32Array(Uint8Array.from(atob(text), sign => sign.charCodeAt(0)).buffer)

/** A network: relu in the hidden layers, tanh at the end; of each layer the weights of each output,
 * then the biases. They are turned round, input by input. @param {StoredNetwork} stored */
export function network({ sizes, weights }) {
  const numbers = Float64Array.from(floats(weights))
  let at = 0
  const take = (/** @type {number} */ count) => numbers.subarray(at, (at += count))
  const layers = sizes.slice(1).map((n, i) => {
    const rows = take(n * sizes[i]),
      turned = rows.map((_, w) => rows[(w % n) * sizes[i] + Math.floor(w / n)])
    return { weights: turned, biases: take(n) }
  })
  return { layers }
}

/** The output of a network, for actions from -1 to 1. Most units of relu are 0: they are skipped.
 * @param {Network} policy @param {Vector} seen */
function output({ layers }, seen) {
  let values = Float64Array.from(seen, Math.fround) // as the network sees them in Python
  layers.forEach(({ weights, biases }, layer) => {
    const sums = biases.slice(),
      n = sums.length
    values.forEach((value, i) => {
      if (value) for (let j = 0, at = i * n; j < n; j++, at++) sums[j] += weights[at] * value
    })
    values = sums.map(sum => (layer === layers.length - 1 ? Math.tanh(sum) : Math.max(sum, 0)))
  })
  return [...values]
}

// ---- Tasks: `step` returns next state, reward and outcome (0: running, 1: goal, 2: pit)

/** @type {Record<string, Rules>} */
const TASKS = {
  "SimpleGoal-v0": {
    start: draw => [draw(), draw()],
    step([x, y], [dx, dy]) {
      const next = [clip(x + 0.1 * clip(dx, -1, 1), 0, 1), clip(y + 0.1 * clip(dy, -1, 1), 0, 1)]
      if (next[0] < 0.1 && next[1] < 0.1) return [next, 10, 1]
      if (next.every(value => value > 0.4 && value < 0.6)) return [next, -10, 2]
      return [next, 10 * (Math.hypot(x, y) - Math.hypot(...next)), 0]
    },
    places: [
      { name: "goal", from: [0, 0], to: [0.1, 0.1] },
      { name: "pit", from: [0.4, 0.4], to: [0.6, 0.6] },
    ],
  },
  "MountainCarContinuous-v0": {
    start: draw => [-0.6 + 0.2 * draw(), 0].map(Math.fround),
    step([x, v], [force]) {
      let speed = clip(v + 0.0015 * clip(force, -1, 1) - 0.0025 * Math.cos(3 * x), -0.07, 0.07)
      const place = clip(x + speed, -1.2, 0.6)
      if (place === -1.2 && speed < 0) speed = 0
      const there = +(place >= 0.45 && speed >= 0)
      return [[place, speed].map(Math.fround), 100 * there - 0.1 * force ** 2, there]
    },
    places: [{ name: "flag", from: [0.45, 0], to: [0.6, 0.07] }],
  },
  "Pendulum-v1": {
    see: ([angle, speed]) => [Math.cos(angle), Math.sin(angle), speed],
    place: ([x, y, speed]) => [Math.atan2(y, x), speed],
    step([angle, speed], [torque]) {
      const turn = 2 * Math.PI,
        upright = ((((angle + Math.PI) % turn) + turn) % turn) - Math.PI
      const cost = upright ** 2 + 0.1 * speed ** 2 + 0.001 * torque ** 2
      const next = clip(speed + (15 * Math.sin(angle) + 3 * clip(torque, -2, 2)) * 0.05, -8, 8)
      return [[angle + next * 0.05, next], -cost, 0]
    },
  },
}

/** The dynamics of a task: a start, the observation of a state, its place in the plane, a step, and
 * places to draw. @type {(name: string) => Required<Rules>} */
export const dynamics = name => ({ ...PLAIN, ...TASKS[name] })
/** @type {Omit<Required<Rules>, "step">} */
const PLAIN = { start: () => [], see: state => state, place: seen => seen, places: [] }

/** Numbers from 0 to 1, the same for the same seed (mulberry32). @param {number} seed */
export function random(seed) {
  let state = seed * 0x9e3779b9
  return () => {
    state = (state + 0x6d2b79f5) | 0
    let mixed = Math.imul(state ^ (state >>> 15), state | 1)
    mixed = (mixed + Math.imul(mixed ^ (mixed >>> 7), mixed | 61)) ^ mixed
    return ((mixed ^ (mixed >>> 14)) >>> 0) / 2 ** 32
  }
}

/** Episodes of the teacher from random starts. @param {Scene} scene @param {Policy} teacher
 * @param {() => number} draw @returns {Generator<Visited>} */
export function* taught(scene, teacher, draw) {
  const { see, start } = dynamics(scene.task.name)
  while (true) {
    const { states, actions } = rollout(scene, teacher, start(draw))
    yield { states: states.slice(0, -1).map(see), actions }
  }
}

/** Run an episode: return, outcome, the cell of its last step, states and actions.
 * @param {Scene} scene @param {Policy} policy @param {Vector} start */
export function rollout(scene, policy, start) {
  const { see, step } = dynamics(scene.task.name),
    states = [start],
    actions = /** @type {Vector[]} */ ([])
  let [state, total, reward, outcome, last] = [start, 0, 0, 0, 0]
  for (let t = 0; t < scene.task.maxSteps && !outcome; t++) {
    const { cell, action } = act(scene, policy, see(state))
    ;[state, reward, outcome] = step(state, action)
    last = cell
    total += reward
    states.push(state)
    actions.push(action)
  }
  return { total, outcome, last, states, actions }
}

// ---- Fitting maps to what the teacher did

/** The least squares solution x (d, m) of a x = b, a (n, d), b (n, m); of several the shortest, as
 * NumPy's. Jacobi rotations turn the columns of `a` until they are orthogonal (Hestenes 1958).
 * @param {Vector[]} a @param {Vector[]} b */
export function leastSquares(a, b) {
  // Below column i, for the sum of all turns
  const unit = (/** @type {number} */ i) => a[0].map((_, j) => +(i === j))
  const columns = a[0].map((_, i) => [...a.map(row => row[i]), ...unit(i)])
  /** @type {(u: Vector, v: Vector) => number} */
  const own = (u, v) => a.reduce((total, _, row) => total + u[row] * v[row], 0)
  for (let sweep = 0, turned = true; turned && sweep < 60; sweep++) {
    turned = false
    for (const [i, u] of columns.entries())
      for (const v of columns.slice(i + 1)) {
        const [p, q, both] = [own(u, u), own(v, v), own(u, v)]
        if (Math.abs(both) <= 1e-16 * Math.sqrt(p * q)) continue
        const angle = Math.atan2(2 * both, p - q) / 2,
          [cosine, sine] = [Math.cos(angle), Math.sin(angle)]
        for (const [k, x] of u.entries())
          [u[k], v[k]] = [cosine * x + sine * v[k], cosine * v[k] - sine * x]
        turned = true
      }
  }
  const sizes = columns.map(u => Math.sqrt(own(u, u))),
    least = Math.max(...sizes) * Number.EPSILON * Math.max(a.length, a[0].length),
    whole = columns.filter((_, i) => sizes[i] > least),
    goals = b[0].map((_, k) => b.map(values => values[k])),
    shares = goals.map(goal => whole.map(u => own(u, goal) / own(u, u)))
  return a[0].map((_, i) => shares.map(one => dot(whole.map(u => u[a.length + i]), one)))
}


/** A policy's maps, in `cells` (by default all) fitted by least squares to visited states.
 * @param {Linear} policy @param {Visited} visited @param {Iterable<number>} cells */
export function refit(policy, { states, actions }, cells = policy.codewords.keys()) {
  const own = states.map(state => cellOf(policy, state)),
    maps = structuredClone(policy.coefficients)
  for (const cell of cells) {
    const inputs = states.filter((_, i) => own[i] === cell).map(state => [...state, 1])
    const goals = actions.filter((_, i) => own[i] === cell)
    if (goals.length) maps[cell] = leastSquares(inputs, goals)
  }
  return maps
}

/** The sum of the squared differences of vectors.
 * @param {Vector[]} ones @param {Vector[]} others */
const squares = (ones, others) =>
  sum(ones.map((one, i) => less(one, others[i])).map(off => dot(off, off)))

/** The squared error of a policy's actions. @param {Scene} scene @param {Policy} policy
 * @param {Visited} visited */
export const errorOf = (scene, policy, { states, actions }) =>
  squares(states.map(state => act(scene, policy, state).action), actions)

/** The share of the variance of the teacher's actions that a policy reproduces.
 * @param {Scene} scene @param {Policy} policy @param {Visited} visited */
export function rSquared(scene, policy, visited) {
  const { actions } = visited,
    means = actions[0].map((_, k) => sum(actions.map(action => action[k])) / actions.length)
  return 1 - errorOf(scene, policy, visited) / squares(actions, actions.map(() => means))
}

// ---- Cells in a picture

/** Numbers and colours of codewords, given at birth and kept for life: a function that tells those
 * of the codewords that live after some changes. A colour is the one whose nearest living bearer is
 * farthest away; of equals the first (as vsp/show/state_space.py). @param {Vector} scale */
export function births(scale) {
  let [living, count] = [/** @type {Born[]} */ ([]), 0]
  const tintOf = (/** @type {Vector} */ codeword) => {
    const far = Array(TINTS).fill(Infinity)
    for (const { codeword: other, tint } of living) {
      const gaps = less(codeword, other).map((gap, i) => gap / scale[i])
      far[tint] = Math.min(far[tint], Math.hypot(...gaps))
    }
    return far.indexOf(Math.max(...far))
  }
  /** Who has a codeword, which a scene may have rounded. @param {Vector} codeword */
  const found = codeword => {
    const near = (/** @type {number} */ gap) => Math.abs(gap) < ROUNDED,
      known = living.find(one => less(one.codeword, codeword).every(near))
    if (known) return known
    const made = { codeword, born: count++, tint: tintOf(codeword) }
    living.push(made)
    return made
  }
  return (/** @type {Vector[]} */ codewords, changes = /** @type {Change[]} */ ([])) => {
    const first = count ? [] : codewords.slice(0, 1),
      splits = changes.filter(({ kind }) => kind === "split").map(({ codeword }) => codeword)
    for (const codeword of [...first, ...splits]) found(codeword)
    living = codewords.map(found)
    return { born: living.map(({ born }) => born), tints: living.map(({ tint }) => tint) }
  }
}

/** Give a policy's codewords numbers and colours, and those of its run, if they have none.
 * @param {Policy} policy */
export function name(policy) {
  if (policy.layers || policy.tints?.length === policy.codewords.length) return
  const of = births(policy.scale)
  for (const moment of policy.replay ?? [])
    Object.assign(moment, of(moment.codewords, moment.events))
  Object.assign(policy, of(policy.codewords))
}

/** The number of the cell with this index. @param {Policy} policy @param {number} cell */
export const numberOf = ({ born }, cell) => born?.[cell] ?? cell
