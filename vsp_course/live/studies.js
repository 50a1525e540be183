// @ts-check
// A study of a method: policies, episodes of each, and a 95 % interval of the mean return.

import { sum } from "../../vsp/show/explorer/model.js"

const DRAWS = 400 // of the bootstrap

/** A normal number, with mean 0 and standard deviation 1 (Box and Muller 1958).
 * @param {() => number} draw */
const normal = draw => Math.sqrt(-2 * Math.log(1 - draw())) * Math.cos(2 * Math.PI * draw())

/** The interval of one study. A policy is one of the reruns; its mean over n episodes differs from
 * the rerun's by chance, as its standard deviation says. With `whole`, policies are drawn again
 * with all their episodes (exercise 3.3); else all episodes count as if they were independent.
 * @param {Reruns} reruns @param {number} p @param {number} n @param {boolean} whole
 * @param {() => number} draw */
export function interval({ means, sds }, p, n, whole, draw) {
  const any = () => Math.floor(draw() * p),
    chosen = Array.from({ length: p }, () => Math.floor(draw() * means.length)),
    found = chosen.map(i => means[i] + (sds[i] / Math.sqrt(n)) * normal(draw))
  if (!whole) {
    const mean = sum(found) / p,
      within = sum(chosen.map(i => sds[i] ** 2)) / p,
      between = sum(found.map(value => (value - mean) ** 2)) / p,
      half = 1.96 * Math.sqrt((within + between) / (p * n))
    return [mean - half, mean + half]
  }
  const drawn = Array.from({ length: DRAWS }, () => sum(found.map(() => found[any()])) / p)
  drawn.sort((a, b) => a - b)
  return [drawn[Math.floor(0.025 * DRAWS)], drawn[Math.ceil(0.975 * DRAWS) - 1]]
}
