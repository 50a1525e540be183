// What the page's scripts pass to each other, for `tsc` alone; __init__.py writes the data.

type Limit = "max_pol_loss" | "min_pol_distance" | "min_param_distance"
type Reruns = { means: number[]; sds: number[] }
type Data = { scene: Scene; visited: Visited; episodes: Visited[]; reruns: Reruns }
