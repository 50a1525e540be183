// @ts-check
// Policies, tasks and the teacher, computed as Python does. Nothing here knows a page or picture.

const ON_BORDER = 1e-9 // distances that differ by less are equal, or rounding makes a checkerboard
const TINTS = 6 // colours of cells

/** @type {(value: number, low: number, high: number) => number} */
export const clip = (value, low, high) => Math.min(Math.max(value, low), high)

// ---- Which cell, which action

/** The orders of the Minkowski distances that a scene may name alone. */
const ORDERS = new Map([
  ["manhattan", 1],
  ["euclidean", 2],
  ["chebyshev", null],
])

/** Prepare a policy for fast look-ups: its codewords divided by the scale, in one flat array.
 * @param {Linear} policy */
export function ready(policy) {
  const { codewords, scale, metric, order = ORDERS.get(metric) } = policy
  if (order === undefined) throw new Error(`the metric ${metric} has no known order`)
  policy.power = order ?? Infinity
  policy.scaled = Float64Array.from(
    codewords.flatMap(word => word.map((value, i) => value / scale[i])),
  )
  policy.place = new Float64Array(scale.length)
  policy.far = new Float64Array(codewords.length)
  return policy
}

/** The distances of an observation (Euclidean: squared), valid until the next call.
 * @param {Linear} policy @param {Vector} seen */
function distances({ scaled, scale, power, place, far }, seen) {
  const d = scale.length,
    plain = power === 1 || power === 2 || power === Infinity
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
  }
  return far
}

/** The index of the nearest codeword; among equally near ones, up to `slack`, the first.
 * @param {Linear} policy @param {Vector} seen */
export function cellOf(policy, seen, slack = 0) {
  const far = distances(policy, seen)
  let best = 0
  for (let j = 1; j < far.length; j++) if (far[j] < far[best] - slack) best = j
  return best
}

/** The nearest codeword, and the last other one that is as near (or the same again).
 * @param {Linear} policy @param {Vector} seen */
export function tied(policy, seen) {
  const cell = cellOf(policy, seen, ON_BORDER),
    { far } = policy
  let other = far.length - 1
  while (Math.abs(far[other] - far[cell]) >= ON_BORDER) other--
  return [cell, other]
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

/** A network: relu in the hidden layers, tanh at the end; of each layer weights, then biases.
 * @param {StoredNetwork} stored */
export function network({ sizes, weights }) {
  const numbers = Float64Array.from(floats(weights))
  let at = 0
  const take = (/** @type {number} */ count) => numbers.subarray(at, (at += count))
  return {
    layers: sizes.slice(1).map((n, i) => ({ weights: take(n * sizes[i]), biases: take(n) })),
  }
}

/** The output of a network, for actions from -1 to 1.
 * @param {Network} policy @param {Vector} seen */
function output({ layers }, seen) {
  let values = Float64Array.from(seen, Math.fround) // as the network sees them in Python
  layers.forEach(({ weights, biases }, layer) => {
    const next = new Float64Array(biases)
    for (let j = 0, at = 0; j < next.length; j++) {
      let sum = 0
      for (let i = 0; i < values.length; i++, at++) sum += weights[at] * values[i]
      sum += next[j]
      next[j] = layer === layers.length - 1 ? Math.tanh(sum) : Math.max(sum, 0)
    }
    values = next
  })
  return [...values]
}

// ---- Tasks: `step` returns next state, reward and outcome (0: running, 1: goal, 2: pit)

/** @type {Record<string, Rules>} */
const TASKS = {
  "SimpleGoal-v0": {
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
    step([angle, speed], [torque]) {
      const turn = 2 * Math.PI,
        upright = ((((angle + Math.PI) % turn) + turn) % turn) - Math.PI
      const cost = upright ** 2 + 0.1 * speed ** 2 + 0.001 * torque ** 2
      const next = clip(speed + (15 * Math.sin(angle) + 3 * clip(torque, -2, 2)) * 0.05, -8, 8)
      return [[angle + next * 0.05, next], -cost, 0]
    },
    places: [],
  },
}

/** The dynamics of a task: the observation of a state, a step, and places to draw.
 * @type {(name: string) => Required<Rules>} */
export const dynamics = name => ({ see: state => state, ...TASKS[name] })

/** Run an episode: return, outcome, the cell of its last step, and with `keep` its states.
 * @param {Scene} scene @param {Policy} policy @param {Vector} start */
export function rollout(scene, policy, start, keep = false) {
  const { see, step } = dynamics(scene.task.name),
    states = [start]
  let [state, total, outcome, last] = [start, 0, 0, 0]
  for (let t = 0; t < scene.task.maxSteps && !outcome; t++) {
    const { cell, action } = act(scene, policy, see(state))
    let reward
    ;[state, reward, outcome] = step(state, action)
    last = cell
    total += reward
    if (keep) states.push(state)
  }
  return { total, outcome, last, states }
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
  const dot = (u, v) => a.reduce((sum, _, row) => sum + u[row] * v[row], 0)
  for (let sweep = 0, turned = true; turned && sweep < 60; sweep++) {
    turned = false
    for (const [i, u] of columns.entries())
      for (const v of columns.slice(i + 1)) {
        const [p, q, both] = [dot(u, u), dot(v, v), dot(u, v)]
        if (Math.abs(both) <= 1e-16 * Math.sqrt(p * q)) continue
        turned = true
        turn(u, v, 0.5 * Math.atan2(2 * both, p - q))
      }
  }
  const sizes = columns.map(u => Math.sqrt(dot(u, u))),
    least = Math.max(...sizes) * Number.EPSILON * Math.max(a.length, a[0].length),
    solution = a[0].map(() => b[0].map(() => 0))
  columns.forEach((u, i) => {
    if (sizes[i] <= least) return
    b[0].forEach((_, k) => {
      const share = b.reduce((sum, values, row) => sum + u[row] * values[k], 0) / sizes[i] ** 2
      solution.forEach((weights, j) => (weights[k] += u[a.length + j] * share))
    })
  })
  return solution
}

/** @param {Vector} u @param {Vector} v @param {number} angle */
function turn(u, v, angle) {
  const [cosine, sine] = [Math.cos(angle), Math.sin(angle)]
  u.forEach((x, i) => {
    u[i] = cosine * x + sine * v[i]
    v[i] = cosine * v[i] - sine * x
  })
}

/** A policy's maps, in `cells` (by default all) fitted by least squares to visited states.
 * @param {Linear} policy @param {Visited} visited @param {Iterable<number>} cells */
export function refit(policy, { states, actions }, cells = policy.codewords.keys()) {
  const own = states.map(state => cellOf(policy, state)),
    maps = structuredClone(policy.coefficients)
  for (const cell of cells) {
    const [a, b] = [/** @type {Vector[]} */ ([]), /** @type {Vector[]} */ ([])]
    own.forEach((at, i) => at === cell && (a.push([...states[i], 1]), b.push(actions[i])))
    if (a.length) maps[cell] = leastSquares(a, b)
  }
  return maps
}

/** The share of the variance of the teacher's actions that a policy reproduces.
 * @param {Scene} scene @param {Policy} policy @param {Visited} visited */
export function rSquared(scene, policy, { states, actions }) {
  let [off, spread] = [0, 0]
  const n = actions.length,
    means = actions[0].map((_, k) => actions.reduce((sum, action) => sum + action[k], 0) / n)
  states.forEach((state, i) =>
    act(scene, policy, state).action.forEach((value, k) => {
      off += (value - actions[i][k]) ** 2
      spread += (means[k] - actions[i][k]) ** 2
    }),
  )
  return 1 - off / spread
}

// ---- Cells in a picture

/** A colour for each of k cells, other than its neighbours' in the pixels `cells` (n, n), and if
 * possible as wanted. @param {ArrayLike<number>} cells @param {number} n @param {number} k
 * @param {(number | undefined)[]} wanted */
export function colouring(cells, n, k, wanted = []) {
  const near = Array.from({ length: k }, () => /** @type {Set<number>} */ (new Set())),
    colours = /** @type {number[]} */ ([])
  /** @type {(i: number, j: number) => unknown} */
  const meet = (i, j) => i !== j && (near[i].add(j), near[j].add(i))
  for (let at = 0; at < n * n; at++) {
    if (at % n) meet(cells[at], cells[at - 1])
    if (at >= n) meet(cells[at], cells[at - n])
  }
  const order = [...near.keys()].sort((i, j) => near[j].size - near[i].size)
  for (const i of order) {
    const taken = new Set([...near[i]].map(j => colours[j])),
      all = [wanted[i] ?? i % TINTS, ...Array(TINTS).keys()]
    colours[i] = all.find(colour => !taken.has(colour)) ?? all[0]
  }
  return colours
}
