// What the scripts pass to each other, for `tsc` alone (docs/tsconfig.json).

type Vector = number[]
type Rows = Vector[] // of a map: the weights of each input, then the bias
type Numbers = { codewords: Vector[]; coefficients: Rows[] } & Named // what a reader can change
type Named = { born?: Vector; tints?: Vector } // numbers and colours of the codewords
type Explorer = import("./explorer.js").Explorer
type Mapped = Pick<Explorer, "picture" | "policy" | "scene" | "cells" | "marked"> & { task: Pick<Required<Rules>, "see"> }
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
type Moment = Numbers & { n: number; events: Change[]; loss?: number; failures?: number; set?: string }
type Made = Moment & Metric
type Results = { mean: number; failures: number }
type About = { name: string; id?: string; replay?: Moment[]; limits?: Limits; r2?: number }
type Limits = { max_pol_loss?: number; min_param_distance?: number }
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
type Born = { codeword: Vector; born: number; tint: number }
type Visited = { states: Vector[]; actions: Vector[] }
type Sums = { products: Rows; targets: Rows } // X'X and X'y of a cell's states
type Cell = { codeword: Vector; map: Rows; moments: Rows[]; steps: number } & Filled
type Filled = { count: number; inputs: Vector[]; goals: Vector[]; sums: Sums }
type Box = { low: Vector; high: Vector }
type Draws = { map(n: number): Vector; rows(n: number): Vector } // numbers from 0 to 1
type Settings = Record<Whole | Real, number> & Record<Yes, boolean> & Words // of `vsp.Config`
type Whole = "n_epochs" | "n_split" | "n_merge" | "n_freeze" | "n_reset" | "batch_size" | "n_minibatches"
type Real = "max_pol_loss" | "min_pol_distance" | "min_param_distance" | "learning_rate"
type Yes = "one_split" | "inclusive"
type Words = {
  freeze: "last_n_freeze" | "first_n_freeze" | "last_n_split"
  metric: string
  scale: "raw" | "box"
  split_metric: "manhattan" | "euclidean"
  split_loss: "raw" | "clipped"
  merge_parameters: "all" | "weights"
  periodic_reset: "buffers" | "off"
  initial: "uniform" | "zeros"
  adam_on_reset: "keep" | "restart"
  fit: "adam" | "closed_form"
}
type Iterated = { n: number; loss: number | undefined; events: Change[]; last: boolean }
type Played = { states: Vector[]; outcome?: number }
type Place = { name: string; from: Vector; to: Vector }
type Rules = {
  start?: (draw: () => number) => Vector
  see?: (state: Vector) => Vector
  place?: (seen: Vector) => Vector // of an observation in the plane
  step(state: Vector, action: Vector): [next: Vector, reward: number, outcome: number]
  places?: Place[]
}

type Choices = Record<string, (string | boolean)[]>
type BenchScene = { scene: Scene; network: StoredNetwork; preset: Settings; choices: Choices }

// What distiller.js and worker.js tell each other; `counted` by a page
type Run = { moments: Moment[]; done: boolean; rate: number } & Running // rate: iterations a second
type Running = { worker?: Worker; policy?: Linear; counted?: boolean }

type Begun = { scene: Scene; network: StoredNetwork | Visited[]; config: Settings; seed: number; pace: number }
type ToWorker = { pace?: number; config?: Partial<Settings> }
type FromWorker = { moments: Made[]; done: boolean; rate: number }

// What controls.js makes

type Listeners = {
  [kind in keyof HTMLElementEventMap]?: (event: HTMLElementEventMap[kind]) => unknown
}
type Attribute = "class" | "type" | "scope" | "value" | "selected" | "open" | "min" | "step" | "tabindex"
type Attributes = Listeners & {
  [name in Attribute | "role" | "style" | `data-${string}` | `aria-${string}`]?: string | number | boolean
}
type Limited = { step: number; times?: boolean; least?: number; most?: number; whole?: boolean }
type Asked = Pick<Explorer, "scene" | "policy" | "cell" | "cells">
type Said = [what: string, ...numbers: number[]]
type Arrow = { start: Vector; tip: Vector } // in pixels
// What is dragged: a codeword, an arrow that is turned, or (cell -1) the state
type Held = { cell: number; turned: boolean; finger: boolean; place: Vector; from: Vector }
type Judged = Results & { played: number }
type Hooks = {
  bare?: boolean
  above?: Node[]
  first?: { policy?: string; at?: string } // what is shown and chosen
  settled?: (view: Explorer) => void
  told?: (view: Explorer) => void
}
type Widget = {
  model: { get(name: "scene"): string; on(event: "change:scene", act: () => void): void }
  el: HTMLElement
}
