// What the article's scripts pass to each other, for `tsc` alone; data.py writes the parts.

type Parts = {
  scene: Scene & { moments: number; walks: Walks }
  teacher: StoredNetwork
  run: StoredRun
  visited: { states: string; actions: string }
  proofs: Record<string, Proof>
}
type StoredRun = {
  n: Vector
  cells: Vector
  codewords: [moment: number, codewords: Vector[]][] // where they change
  coefficients: string
  events: (Change & { n: number })[]
  failures: Vector
  config: Settings
}
type Walks = { lengths: Vector; states: string }
type Proof = { polygons: Vector[]; box: [low: Vector, high: Vector]; at: Vector }

// A scene of a section: `moment` of its run, which an attribute may give, and a reader's `numbers`
type State = {
  policy: string
  at: Vector
  section?: string
  moment?: number | string
  zoomed?: boolean
  numbers?: Partial<Numbers>
  own?: boolean // whether it shows the run that the reader has made
}
type Put = typeof history.pushState
