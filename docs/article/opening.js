// @ts-check
// What moves before one reads: 400 walkers, led by the network and by three equations.

import { one } from "../../vsp/show/explorer/controls.js"
import { clip, dynamics, name, ready, rollout } from "../../vsp/show/explorer/model.js"
import { Picture, drawCells } from "../../vsp/show/explorer/picture.js"

const [STEP, REST] = [450, 1500] // milliseconds: of a step, and at the end
const THERE = 0.95 // of all walkers, before they rest and begin again

/** The stored ways of the teacher. @param {Walks} walks @returns {Vector[][]} */
function ways({ lengths, states }) {
  const bytes = Uint8Array.from(atob(states), sign => sign.charCodeAt(0)),
    numbers = Array.from(new Uint16Array(bytes.buffer), number => number / 65535)
  return lengths.map(n => Array.from({ length: n }, () => numbers.splice(0, 2)))
}

/** Two pictures in which walkers go from their starts to the goal, again and again. */
export class Opening {
  playing = false
  /** @param {HTMLElement} root @param {Scene & { walks: Walks }} scene @param {Linear} policy */
  constructor(root, scene, policy) {
    name(policy)
    ready(policy)
    const canvases = [...root.querySelectorAll("canvas")]
    this.pictures = canvases.map(canvas => new Picture(canvas, scene.plane, true))
    const [, picture] = this.pictures,
      task = dynamics(scene.task.name)
    this.own = { policy, scene, task, picture, cells: policy.codewords.length, marked: -1 }
    this.ways = [ways(scene.walks), scene.starts.map(start => rollout(scene, policy, start).states)]
    const lengths = this.ways.flat().map(way => way.length - 1).sort((a, b) => a - b)
    this.steps = lengths[Math.floor(lengths.length * THERE)]
    this.told = one(root, ".count")
    this.toggle = one(root, ".walk")
    this.toggle.addEventListener("click", () => this.play(!this.playing))
    new ResizeObserver(() => this.draw()).observe(root)
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches
    this.time = still ? 4 : 0 // in steps
    this.play(!still)
  }
  /** @param {boolean} on */
  play(on) {
    this.playing = on
    this.toggle.textContent = on ? "stop" : "walk"
    let before = performance.now()
    const frame = (/** @type {number} */ now) => {
      this.time += clip(now - before, 0, 100) / STEP
      before = now
      if (this.time > this.steps + REST / STEP) this.time = 0
      if (this.toggle.getBoundingClientRect().bottom > 0) this.draw()
      if (this.playing) requestAnimationFrame(frame)
    }
    if (on) requestAnimationFrame(frame)
  }
  draw() {
    const [left, right] = this.pictures.map((picture, i) => this.walkers(picture, i))
    this.told.textContent = `step ${Math.floor(this.time)}: ${left} and ${right} of 400 at the goal`
  }
  /** Draw all walkers where they are now, and count those at the goal.
   * @param {Picture} picture @param {number} i */
  walkers(picture, i) {
    const ways = this.ways[i],
      { places } = this.own.task
    picture.begin()
    const { ctx, tones } = picture,
      colour = i ? tones.ink : tones.teacher
    if (i) drawCells(this.own)
    places.forEach(place => picture.place(place))
    for (const way of ways) {
      const now = Math.min(this.time, way.length - 1),
        [from, to] = [way[Math.floor(now)], way[Math.ceil(now)]],
        place = from.map((value, k) => value + (now % 1) * (to[k] - value))
      ctx.globalAlpha = 0.35
      picture.line([way[Math.max(Math.floor(now) - 1, 0)], from, place], colour, 1)
      ctx.globalAlpha = 1
      picture.dot(place, 1.6, colour)
    }
    places.forEach(place => picture.name(place))
    return ways.filter(way => this.time >= way.length - 1).length
  }
}
