// @ts-check
// A canvas with the coordinates of a plane, and what an explorer draws on it.

import { act, clip, colouring, raw, tied } from "./model.js"

const ARROWS = 14 // along each axis
const STRIPES = 50 // along each axis: where two codewords are equally near, both colours alternate
const FLASH = 900 // milliseconds
// Colours without a meaning of their own (vsp/show/style.py), as pale tints
export const CELLS = ["#56b4e9", "#ece133", "#ca9161", "#b0b0b0", "#fbafe4", "#8a7fd0"]
const [LEFT, RIGHT] = ["#7f4fa8", "#c9730f"] // the force maps of the figures

/** @type {(colour: string) => number[]} */
const rgb = colour => [1, 3, 5].map(i => parseInt(colour.slice(i, i + 2), 16))
/** @type {(colour: number[], ground: number[], share: number) => number[]} */
const mixed = (colour, ground, share) =>
  colour.map((part, i) => ground[i] + share * (part - ground[i]))

/** The canvas. `plane` is the part of the plane that it shows; `tones` are the page's colours. */
export class Picture {
  map = new OffscreenCanvas(1, 1)
  edge = { left: 0, right: 0, top: 0, bottom: 0 }
  side = 0
  wide = 0
  high = 0
  ties = false // whether the map has points that are equally near to two codewords
  /** @type {Record<string, string>} */ tones = {}
  /** @type {number[]} */ colours = [] // of the cells
  /** @type {Record<string, number>} */ known = {} // those of codewords

  /** @param {HTMLCanvasElement} canvas @param {Plane} plane */
  constructor(canvas, plane) {
    this.canvas = canvas
    this.plane = plane
    this.ctx = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"))
  }
  /** Take size and colours from the page, and clear. */
  begin() {
    const ratio = devicePixelRatio,
      side = this.canvas.clientWidth || 440,
      size = Math.round(side * ratio),
      style = getComputedStyle(this.canvas)
    if (this.canvas.width !== size) this.canvas.width = this.canvas.height = size
    const small = side < 330
    this.edge = { left: small ? 46 : 54, right: small ? 4 : 8, top: 8, bottom: small ? 32 : 36 }
    this.ctx.setTransform(ratio, 0, 0, ratio, 0, 0)
    this.side = side
    this.wide = side - this.edge.left - this.edge.right
    this.high = side - this.edge.top - this.edge.bottom
    const tone = (/** @type {string} */ name) =>
      style.getPropertyValue(`--vsp-${name}`).trim() || "#888888"
    const names = ["paper", "ink", "start", "goal", "pit", "failing", "teacher"]
    this.tones = Object.fromEntries(names.map(name => [name, tone(name)]))
    this.ctx.clearRect(0, 0, side, side)
    this.ctx.font = `${small ? 11 : 13}px ${style.fontFamily}`
  }
  at(/** @type {Vector} */ [x, y]) {
    const { low, high } = this.plane
    return [
      this.edge.left + ((x - low[0]) / (high[0] - low[0])) * this.wide,
      this.edge.top + ((high[1] - y) / (high[1] - low[1])) * this.high,
    ]
  }
  /** @param {number} px @param {number} py */
  point(px, py) {
    const { low, high } = this.plane
    return [
      low[0] + ((px - this.edge.left) / this.wide) * (high[0] - low[0]),
      high[1] - ((py - this.edge.top) / this.high) * (high[1] - low[1]),
    ].map((value, i) => clip(value, low[i], high[i]))
  }
  shows(/** @type {Vector} */ point) {
    const { low, high } = this.plane
    return point.every((value, i) => value >= low[i] && value <= high[i])
  }
  /** The middle of one of n by n parts of the plane, counted from the top left.
   * @param {number} at @param {number} n */
  middle(at, n) {
    const { low, high } = this.plane,
      shares = [(at % n) + 0.5, n - 0.5 - Math.floor(at / n)]
    return shares.map((share, i) => low[i] + (share / n) * (high[i] - low[i]))
  }
  /** Call `draw` with everything cut off at the frame. */
  inside(/** @type {() => void} */ draw) {
    this.ctx.save()
    this.ctx.beginPath()
    this.ctx.rect(this.edge.left, this.edge.top, this.wide, this.high)
    this.ctx.clip()
    draw()
    this.ctx.restore()
  }
  /** @type {(words: string, x: number, y: number, align?: CanvasTextAlign) => void} */
  text(words, x, y, align = "center") {
    const { ctx } = this
    ctx.textAlign = align
    ctx.lineWidth = 3
    ctx.strokeStyle = this.tones.paper
    ctx.strokeText(words, x, y)
    ctx.fillStyle = this.tones.ink
    ctx.fillText(words, x, y)
  }
  place(/** @type {Place} */ { name, from, to }) {
    const [left, bottom] = this.at(from),
      [right, top] = this.at(to)
    this.ctx.fillStyle = (name === "pit" ? this.tones.pit : this.tones.goal) + "77"
    this.ctx.fillRect(left, top, right - left, bottom - top)
  }
  /** Name a place: at its middle, or at the top of the frame that it fills. */
  name(/** @type {Place} */ { name, from, to }) {
    const { low, high } = this.plane,
      fills = from.every((value, i) => value <= low[i] && to[i] >= high[i]),
      [x, y] = this.at(from.map((value, i) => (value + to[i]) / 2)),
      half = this.ctx.measureText(name).width / 2 + 3
    if (fills) this.text(name, this.edge.left + this.wide / 2, this.edge.top + 16)
    else this.text(name, Math.max(x, this.edge.left + half), y + 4)
  }
  /** @param {Vector[]} points @param {string} colour */
  line(points, colour, width = 2) {
    const { ctx } = this
    ctx.beginPath()
    points.forEach((point, i) => {
      const [x, y] = this.at(point),
        far = i && Math.abs(x - this.at(points[i - 1])[0]) > this.wide / 2
      if (i && !far) ctx.lineTo(x, y)
      else ctx.moveTo(x, y) // no line where an angle wraps around
    })
    ctx.strokeStyle = colour
    ctx.lineWidth = width
    ctx.stroke()
  }
  /** @param {Vector[]} shapes @param {string} colour */
  polygons(shapes, colour) {
    const { ctx } = this
    ctx.beginPath()
    for (const shape of shapes) {
      for (let i = 0; i < shape.length; i += 2) {
        const [x, y] = this.at([shape[i], shape[i + 1]])
        ctx[i ? "lineTo" : "moveTo"](x, y)
      }
      ctx.closePath()
    }
    ctx.fillStyle = ctx.strokeStyle = colour
    ctx.lineWidth = 0.5 // else gaps show between neighbours
    ctx.fill()
    ctx.stroke()
  }
  /** @param {Vector} point @param {number} radius
   * @param {string | undefined} fill @param {string} [stroke] */
  dot(point, radius, fill, stroke, width = 1.5) {
    const { ctx } = this,
      [x, y] = this.at(point)
    ctx.beginPath()
    ctx.arc(x, y, radius, 0, 7)
    if (fill) {
      ctx.fillStyle = fill
      ctx.fill()
    }
    if (stroke) {
      ctx.strokeStyle = stroke
      ctx.lineWidth = width
      ctx.stroke()
    }
  }
  axes() {
    const { ctx, plane, edge } = this,
      { low, high, labels } = plane,
      bottom = edge.top + this.high,
      sides = /** @type {const} */ (["left", "center", "right"])
    ctx.strokeStyle = this.tones.ink
    ctx.lineWidth = 1
    ctx.strokeRect(edge.left, edge.top, this.wide, this.high)
    for (const share of [0, 0.5, 1]) {
      const [first, second] = low.map((value, i) => tick(value, high[i] - value, share))
      const x = edge.left + share * this.wide,
        y = bottom - share * this.high
      this.text(first, x, bottom + 15, sides[2 * share])
      if (share !== 0.5 || (second.length < 5 && this.side > 330))
        this.text(second, edge.left - 5, y + [0, 4, 10][2 * share], "right")
    }
    this.text(labels[0], edge.left + this.wide / 2, bottom + 31)
    ctx.save()
    ctx.translate(12, edge.top + this.high / 2)
    ctx.rotate(-Math.PI / 2)
    this.text(labels[1], 0, 0)
    ctx.restore()
  }
}

/** The number at a share of an axis, with as many digits as its range asks for.
 * @param {number} low @param {number} range @param {number} share */
function tick(low, range, share) {
  const digits = clip(1 - Math.floor(Math.log10(range)), 0, 12)
  return String(+(low + share * range).toFixed(digits)).replace("-", "−")
}

/** Make the policy's map: the action where it is a single one, else the cells; and borders.
 * @param {Explorer} view @param {number} n */
export function drawMap(view, n) {
  const { picture, policy } = view,
    cells = new Int16Array(n * n),
    others = new Int16Array(n * n)
  for (let at = 0; at < n * n && !policy.layers; at++)
    [cells[at], others[at]] = tied(policy, view.task.see(picture.middle(at, n)))
  picture.ties = cells.some((cell, at) => cell !== others[at] && cells[at - 1] !== others[at - 1])
  // A cell keeps its colour by its codeword, because numbers move up when a cell goes
  const keys = (policy.codewords ?? [0]).map(String),
    wanted = keys.map((key, i) => picture.known[key] ?? picture.colours[i])
  picture.colours = colouring(cells, n, view.cells, wanted)
  picture.known = Object.fromEntries(keys.map((key, i) => [key, picture.colours[i]]))
  picture.map.width = picture.map.height = n
  picture.map.getContext("2d")?.putImageData(painted(view, cells, others, n), 0, 0)
}

/** The image of a map whose pixels lie in `cells`, or as near to those in `others`.
 * @param {Explorer} view @param {Int16Array} cells @param {Int16Array} others @param {number} n */
function painted(view, cells, others, n) {
  const { picture, scene, policy } = view,
    [paper, ink] = [picture.tones.paper, picture.tones.ink].map(rgb),
    image = new ImageData(n, n),
    pixels = new Uint32Array(image.data.buffer)
  /** @type {(colour: number[]) => number} */
  const packed = ([red, green, blue]) => (255 << 24) | (blue << 16) | (green << 8) | red
  /** @type {(hue: string, share: number) => number[]} */
  const shades = (hue, share) => {
    const plain = mixed(rgb(hue), paper, share)
    return [plain, mixed(ink, plain, 0.13), mixed(ink, plain, Math.min(n / 400, 0.6))].map(packed)
  }
  const single = scene.task.outputs.length === 1,
    tints = picture.colours.map(colour => shades(CELLS[colour], view.cells > 1 ? 0.34 : 0.1)),
    pushes = Array.from({ length: 129 }, (_, i) =>
      shades(i < 64 ? LEFT : RIGHT, (0.7 * Math.abs(i - 64)) / 64),
    )
  for (let at = 0; at < n * n; at++) {
    const [row, column] = [Math.floor(at / n), at % n],
      cell = Math.floor(((row + column) * STRIPES) / n) % 2 ? others[at] : cells[at]
    let hue = tints[cell]
    if (single && !policy.layers) {
      const push = raw(policy.coefficients[cell], view.task.see(picture.middle(at, n)), 0)
      hue = pushes[Math.round(64 + 64 * clip(push / scene.task.actionHigh[0], -1, 1))]
    }
    const edge = (column && cells[at - 1] !== cells[at]) || (row && cells[at - n] !== cells[at])
    pixels[at] = hue[edge ? 2 : Number(view.cells > 1 && cells[at] === view.cell)]
  }
  return image
}

/** Draw everything. @param {Explorer} view */
export function drawAll(view) {
  const { picture } = view
  picture.begin()
  picture.inside(() => {
    drawPlane(view)
    const path = view.played.states.map(view.place),
      { paper, ink } = picture.tones
    picture.line(path, paper, 5)
    picture.line(path, ink, 2)
    path.slice(1).forEach(point => picture.dot(point, 2, ink))
    drawCodewords(view)
    drawFlashes(view)
    picture.dot(view.asked, 9, paper)
    picture.dot(view.asked, 6.5, undefined, ink)
    picture.dot(view.asked, 2.5, ink)
  })
  picture.axes()
}

/** @param {Explorer} view */
function drawPlane(view) {
  const { picture, scene } = view,
    { tones, edge } = picture
  picture.ctx.drawImage(picture.map, edge.left, edge.top, picture.wide, picture.high)
  view.task.places.forEach(place => picture.place(place))
  if (view.regions) picture.polygons(view.regions, tones.failing)
  if (scene.task.outputs.length === 2) drawArrows(view)
  const starts = view.starts ? scene.starts.map(view.place) : []
  starts.forEach((start, i) => {
    const cell = view.failing.get(i)
    if (cell === undefined) picture.dot(start, 1.3, tones.start)
    else picture.dot(start, 2.7, cell === view.cell ? tones.failing : tones.paper, tones.failing)
  })
  view.task.places.forEach(place => picture.name(place))
}

/** Draw the actions as arrows: the teacher's in its colour. @param {Explorer} view */
function drawArrows(view) {
  const { picture, scene, policy } = view,
    { ctx } = picture,
    length = (picture.wide / ARROWS) * 0.42
  ctx.strokeStyle = policy.layers ? picture.tones.teacher : picture.tones.ink
  ctx.lineWidth = policy.layers ? 1.4 : 1
  ctx.beginPath()
  for (let i = 0; i < ARROWS * ARROWS; i++) {
    const point = picture.middle(i, ARROWS)
    const [dx, dy] = policy.arrows?.[i] ?? act(scene, policy, point).action
    if (!dx && !dy) continue // it stands still
    const [x, y] = picture.at(point),
      [ex, ey] = [x + dx * length, y - dy * length],
      turn = Math.atan2(-dy, dx)
    ctx.moveTo(x - dx * length, y + dy * length)
    ctx.lineTo(ex, ey)
    for (const side of [-2.6, 2.6]) {
      ctx.moveTo(ex, ey)
      ctx.lineTo(ex + 4 * Math.cos(turn + side), ey + 4 * Math.sin(turn + side))
    }
  }
  ctx.stroke()
}

/** @param {Explorer} view */
function drawCodewords(view) {
  const { picture, policy } = view,
    { paper, ink } = picture.tones
  if (policy.layers || view.cells === 1) return
  policy.codewords.forEach((codeword, i) => {
    const point = view.placeSeen(codeword),
      [x, y] = picture.at(point)
    picture.dot(point, 5, i === view.cell ? ink : paper, ink)
    const [inner, below] = [x > picture.side - 40, y < 28] // else the frame cuts the number off
    if (view.cells > 30) return
    picture.text(String(i), x + (inner ? -9 : 9), y + (below ? 16 : -6), inner ? "right" : "left")
  })
}

/** A ring grows around a new codeword, or closes in on a lost one. @param {Explorer} view */
function drawFlashes(view) {
  const now = performance.now(),
    { picture } = view
  view.flashes = view.flashes.filter(({ since }) => now - since < FLASH)
  for (const { codeword, kind, since } of view.flashes) {
    const share = (now - since) / FLASH
    const radius = 34 * (kind === "split" ? share : 1 - share)
    picture.ctx.globalAlpha = 1 - share
    picture.dot(view.placeSeen(codeword), radius, undefined, picture.tones.ink, 4)
  }
  picture.ctx.globalAlpha = 1
}
