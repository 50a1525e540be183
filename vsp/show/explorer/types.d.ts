// What the scripts pass to each other, for `tsc` alone (docs/tsconfig.json).

type Vector = number[]
type Rows = Vector[] // of a map: the weights of each input, then the bias
type Numbers = { codewords: Vector[]; coefficients: Rows[] } // what a reader can change
type Explorer = import("./explorer.js").Explorer
type Picture = import("./picture.js").Picture

// Scenes, as scene.py and docs/article/data.py write them

type Task = {
  name: string
  inputs: string[]
  outputs: string[]
  maxSteps: number
  actionLow: Vector
  actionHigh: Vector
}
type Plane = { low: Vector; high: Vector; labels: string[] }
type Change = { kind: "split" | "merge"; codeword: Vector; cause: number }
type Moment = Numbers & { n: number; events: Change[] }
type Results = { mean: number; failures: number }
type About = { name: string; id?: string; replay?: Moment[]; limits?: Limits; r2?: number }
type Limits = { split?: number; merge?: number }
type Metric = { metric: string; order?: number | null; scale: Vector } // null: infinity
type Learnt = { layers: Layer[]; arrows: Vector[]; episode: Played | null; results: Results }
type No<T> = { [name in keyof T]?: undefined }
type Network = About & Learnt & No<Numbers>
type Linear = About & No<Omit<Learnt, "episode">> & Numbers & Metric & Ready & OfLinear
type OfLinear = { teacher?: Results | null; episode?: Played | null } // to draw in place of its own
type Policy = Linear | Network
type Scene = {
  task: Task
  plane: Plane
  starts: Vector[]
  lost: number[] // outcomes
  policies: Policy[]
  teacher?: Results
}
type Seen = { name: string; every: number; states: Vector[]; agent: Vector[] }
type EpisodeScene = {
  task: Task
  policies: Linear[]
  episodes: Seen[]
  curves: number[] // inputs to draw
} & Omit<Scene, "policies" | "task">
type StoredNetwork = { sizes: Vector; weights: string }

// What model.js computes

type Layer = { weights: Float64Array; biases: Float64Array }
type Ready = { power: number; scaled: Float64Array; place: Float64Array; far: Float64Array }
type Visited = { states: Vector[]; actions: Vector[] }
type Sums = { count: number; products: Rows; targets: Rows } // X'X and X'y of a cell's states
type Thresholds = { loss: number; distance: number; difference: number }
type Step = { t: number; cell: number; loss: number; mean: number; gap: number; splits: boolean }
type Periods = { split: number; merge: number; freeze: number }
type Happening = { n: number; episode: Visited; step?: Step; gone?: Change[] }
type Played = { states: Vector[]; outcome?: number }
type Place = { name: string; from: Vector; to: Vector }
type Rules = {
  see?: (state: Vector) => Vector
  step(state: Vector, action: Vector): [next: Vector, reward: number, outcome: number]
  places: Place[]
}

// What controls.js makes

type Listeners = {
  [kind in keyof HTMLElementEventMap]?: (event: HTMLElementEventMap[kind]) => unknown
}
type Attribute = "class" | "type" | "scope" | "value" | "selected" | "min" | "step" | "tabindex"
type Attributes = Listeners & {
  [name in Attribute | "role" | `aria-${string}`]?: string | number | boolean
}
type Asked = Pick<Explorer, "scene" | "policy" | "cell" | "cells" | "asked"> & {
  task: Pick<Required<Rules>, "see">
}
type Said = [what: string, ...numbers: number[]]
type Judged = Results & { played: number }
type Hooks = {
  bare?: boolean
  above?: Node[]
  settled?: (view: Explorer) => void
  told?: (view: Explorer) => void
}
type Widget = {
  model: { get(name: "scene"): string; on(event: "change:scene", act: () => void): void }
  el: HTMLElement
}
