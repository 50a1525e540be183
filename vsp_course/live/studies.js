// @ts-check
// A study of a method: policies, episodes of each, and a 95 % interval of the mean return.

const DRAWS = 400 // of the bootstrap

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

/** A normal number, with mean 0 and standard deviation 1 (Box and Muller 1958).
 * @param {() => number} draw */
const normal = draw => Math.sqrt(-2 * Math.log(1 - draw())) * Math.cos(2 * Math.PI * draw())

/** The interval of one study. A policy is one of the reruns; its mean over n episodes differs from
 * the rerun's by chance, as its standard deviation says. With `whole`, policies are drawn again
 * with all their episodes (exercise 3.3); else all episodes count as if they were independent.
 * @param {Reruns} reruns @param {number} p @param {number} n @param {boolean} whole
 * @param {() => number} draw */
export function interval({ means, sds }, p, n, whole, draw) {
  const chosen = Array.from({ length: p }, () => Math.floor(draw() * means.length)),
    found = chosen.map(i => means[i] + (sds[i] / Math.sqrt(n)) * normal(draw)),
    mean = found.reduce((sum, value) => sum + value, 0) / p
  if (!whole) {
    const within = chosen.reduce((sum, i) => sum + sds[i] ** 2, 0) / p,
      between = found.reduce((sum, value) => sum + (value - mean) ** 2, 0) / p,
      half = 1.96 * Math.sqrt((within + between) / (p * n))
    return [mean - half, mean + half]
  }
  const drawn = Array.from({ length: DRAWS }, () => {
    let sum = 0
    for (let i = 0; i < p; i++) sum += found[Math.floor(draw() * p)]
    return sum / p
  }).sort((a, b) => a - b)
  return [drawn[Math.floor(0.025 * DRAWS)], drawn[Math.ceil(0.975 * DRAWS) - 1]]
}
