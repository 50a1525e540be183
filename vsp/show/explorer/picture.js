// @ts-check
// A canvas with the coordinates of a plane, and what an explorer draws on it.

import { act, cellOf, clip, dot, numberOf, raw } from "./model.js"

const ARROWS = 14 // along each axis
const ON_BORDER = 1e-9 // distances that differ by less are equal, or rounding makes a checkerboard
const SMALL = 330 // pixels: narrower pictures have small letters
const [TICK, END] = [10, 8] // pixels: of a tick, and half of a slider's knob
// Colours without a meaning of their own (vsp/show/style.py), as pale tints
export const CELLS =
  "#56b4e9 #ece133 #73502e #581799 #95e6bd #732e62 #86bf4d #2222e6".split(" ")
const [LEFT, RIGHT] = ["#7f4fa8", "#c9730f"] // the force maps of the figures

const CLEAR = "transparent"

/** @type {(colour: string) => number[]} */
const rgb = colour => [1, 3, 5].map(i => parseInt(colour.slice(i, i + 2), 16))
/** @type {(colour: number[], ground: number[], share: number) => number[]} */
const mixed = (colour, ground, share) =>
  colour.map((part, i) => ground[i] + share * (part - ground[i]))
/** @type {(colour: number[]) => string} */
const css = colour => `rgb(${colour.join(" ")})`

/** Begin to draw on a canvas, as wide as the page makes it, `high` pixels high (by default as high
 * as wide): its context, its width and the page's colours.
 * @param {HTMLCanvasElement} canvas @param {number} [high] */
export function begun(canvas, high) {
  const [wide, ratio] = [canvas.clientWidth || 440, devicePixelRatio],
    style = getComputedStyle(canvas),
    ctx = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"))
  canvas.width = Math.round(wide * ratio)
  canvas.height = Math.round((high ?? wide) * ratio)
  ctx.scale(ratio, ratio)
  ctx.font = `${wide < SMALL ? 11 : 13}px ${style.fontFamily}`
  const names = ["paper", "ink", "start", "goal", "pit", "failing", "teacher"],
    tones = names.map(name => [name, style.getPropertyValue(`--vsp-${name}`).trim() || "#888888"])
  return { ctx, wide, tones: Object.fromEntries(tones) }
}

/** The canvas. `plane` is the part of the plane that it shows; `tones` are the page's colours. */
export class Picture {
  map = new OffscreenCanvas(1, 1)
  edge = { left: 0, right: 0, top: 0, bottom: 0 }
  side = 0
  wide = 0
  high = 0
  /** @type {Record<string, string>} */ tones = {}
  /** @type {CanvasRenderingContext2D} */ ctx

  /** `bare`: without axes. @param {HTMLCanvasElement} canvas @param {Plane} plane */
  constructor(canvas, plane, bare = false) {
    this.canvas = canvas
    this.plane = plane
    this.bare = bare
  }
  /** Take size and colours from the page, and clear: all is cut off at the frame, but `axes`. */
  begin() {
    const { ctx, wide: side, tones } = begun(this.canvas),
      [left, right] = side < SMALL ? [46, 4] : [54, 8] // the rest is a square
    Object.assign(this, { ctx, side, tones })
    if (!this.bare) this.edge = { left, right, top: right, bottom: left }
    this.wide = side - this.edge.left - this.edge.right
    this.high = side - this.edge.top - this.edge.bottom
    ctx.save()
    ctx.beginPath()
    ctx.rect(this.edge.left, this.edge.top, this.wide, this.high)
    ctx.clip()
  }
  shows(/** @type {Vector} */ at) {
    const { low, high } = this.plane
    return at.length === 2 && at.every((value, i) => value >= low[i] && value <= high[i])
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
    const { low, high } = this.plane,
      shares = [(px - this.edge.left) / this.wide, 1 - (py - this.edge.top) / this.high]
    return this.spot(shares).map((value, i) => {
      const digits = clip(2 - Math.floor(Math.log10(high[i] - low[i])), 2, 12) // that one sees
      return +clip(value, low[i], high[i]).toFixed(digits)
    })
  }

  /** The middle of one of n by n parts of the plane, counted from the top left.
   * @param {number} at @param {number} n */
  middle(at, n) {
    return this.spot([((at % n) + 0.5) / n, (n - 0.5 - Math.floor(at / n)) / n])
  }
  /** The point of the plane at shares of its width and height. @param {Vector} shares */
  spot(shares) {
    const { low, high } = this.plane
    return shares.map((share, i) => low[i] + share * (high[i] - low[i]))
  }
  /** @type {(words: string, x: number, y: number, align?: CanvasTextAlign) => void} */
  text(words, x, y, align = "center") {
    const { ctx, tones } = this
    Object.assign(ctx, { strokeStyle: tones.paper, fillStyle: tones.ink, lineWidth: 3 })
    ctx.textAlign = align
    ctx.strokeText(words, x, y)
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
    let before = Infinity
    for (const [x, y] of points.map(point => this.at(point))) {
      const far = Math.abs(x - before) > this.wide / 2 // where an angle wraps around
      ctx[far ? "moveTo" : "lineTo"](x, y)
      before = x
    }
    Object.assign(ctx, { strokeStyle: colour, lineWidth: width })
    ctx.stroke()
  }
  /** Draw arrows between pixels. @param {Arrow[]} arrows @param {number} head its length
   * @param {string} colour @param {number} width */
  arrows(arrows, head, colour, width) {
    const { ctx } = this
    ctx.beginPath()
    for (const { start, tip: [x, y] } of arrows) {
      const turn = Math.atan2(y - start[1], x - start[0])
      ctx.moveTo(start[0], start[1])
      for (const side of [-2.6, 2.6]) {
        ctx.lineTo(x, y)
        ctx.lineTo(x + head * Math.cos(turn + side), y + head * Math.sin(turn + side))
      }
    }
    Object.assign(ctx, { strokeStyle: colour, lineWidth: width })
    ctx.stroke()
  }
  /** @param {Vector[]} shapes @param {string} colour @param {string} [border] */
  polygons(shapes, colour, border = colour, width = 0.5) {
    const { ctx } = this
    ctx.beginPath()
    for (const shape of shapes) {
      for (let i = 0; i < shape.length; i += 2) {
        const [x, y] = this.at([shape[i], shape[i + 1]])
        ctx[i ? "lineTo" : "moveTo"](x, y)
      }
      ctx.closePath()
    }
    Object.assign(ctx, { fillStyle: colour, strokeStyle: border, lineWidth: width })
    ctx.fill()
    ctx.stroke()
  }
  /** @param {Vector} point @param {number} radius
   * @param {string} [fill] @param {string} [stroke] */
  dot(point, radius, fill = CLEAR, stroke = CLEAR, width = 1.5) {
    const { ctx } = this,
      [x, y] = this.at(point)
    ctx.beginPath()
    ctx.arc(x, y, radius, 0, 7)
    Object.assign(ctx, { fillStyle: fill, strokeStyle: stroke, lineWidth: width })
    ctx.fill()
    ctx.stroke()
  }
  axes() {
    const { ctx, plane, edge } = this,
      { low, high, labels } = plane,
      bottom = edge.top + this.high,
      sides = /** @type {const} */ (["left", "center", "right"])
    ctx.restore()
    Object.assign(ctx, { strokeStyle: this.tones.ink, lineWidth: 1 })
    ctx.strokeRect(edge.left, edge.top, this.wide, this.high)
    for (const share of [0, 0.5, 1]) {
      const [first, second] = low.map((value, i) => tick(value, high[i] - value, share))
      const y = bottom - share * this.high + [0, 4, 10][2 * share]
      this.text(first, edge.left + share * this.wide, bottom + 15, sides[2 * share])
      if (share !== 0.5 || (second.length < 5 && this.side > SMALL))
        this.text(second, edge.left - 5, y, "right")
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

/** Make the map, of n by n points: the action where it is a single one, else the cells; and
 * borders that bend. @param {Mapped} view @param {number} n */
function drawMap(view, n) {
  const { picture, scene, policy } = view,
    cells = new Int16Array(n * n),
    image = new ImageData(n, n),
    pixels = new Uint32Array(image.data.buffer),
    tints = tintsOf(view),
    { far } = /** @type {Linear} */ (policy),
    by = [...Array(129).keys()].map(i => (i - 64) / 64),
    hues = by.map(by => shades(view, by < 0 ? LEFT : RIGHT, 0.7 * Math.abs(by))),
    bent = !straight(view)
  for (let at = 0; at < n * n; at++) {
    const seen = view.task.see(picture.middle(at, n)),
      cell = (cells[at] = policy.layers ? 0 : cellOf(policy, seen, ON_BORDER)),
      tied = far?.findLastIndex(each => Math.abs(each - far[cell]) < ON_BORDER), // so stripes
      striped = Math.floor((((at % n) + Math.floor(at / n)) * 50) / n) % 2
    let hue = tints[(striped && tied) || cell]
    if (scene.task.outputs.length === 1 && !policy.layers) {
      const push = raw(policy.coefficients[cell], seen, 0)
      hue = hues[Math.round(64 + 64 * clip(push / scene.task.actionHigh[0], -1, 1))]
    }
    const edge = (at % n && cells[at - 1] !== cell) || (at >= n && cells[at - n] !== cell),
      [red, green, blue] = hue[edge && bent ? 2 : +(view.cells > 1 && cell === view.marked)]
    pixels[at] = (255 << 24) | (blue << 16) | (green << 8) | red
  }
  picture.map.width = picture.map.height = n
  picture.map.getContext("2d")?.putImageData(image, 0, 0)
}

/** A colour on the page's paper: in a cell, in the cell that stands out, on a border.
 * @param {Mapped} view @param {string} hue @param {number} share */
function shades({ picture: { tones } }, hue, share) {
  const [paper, ink] = [tones.paper, tones.ink].map(rgb),
    plain = mixed(rgb(hue), paper, share)
  return [plain, mixed(ink, plain, 0.13), mixed(ink, plain, 0.5)]
}
/** Those of each cell; on a dark page colours are less unlike. @param {Mapped} view */
function tintsOf(view) {
  const full = view.cells === 1 ? 0.1 : rgb(view.picture.tones.paper)[0] < 128 ? 0.6 : 0.42
  return (view.policy.tints ?? [0]).map(tint => shades(view, CELLS[tint], full))
}

/** Whether borders are straight lines of the plane. @param {Mapped} view */
const straight = ({ policy, scene: { task, plane } }) =>
  !policy.layers && policy.power === 2 && task.inputs.length === plane.low.length

/** Draw the cells: as polygons where they are, else as a map, made anew if it shall have other
 * points. @param {Mapped} view @param {number} [points] of the map, along each axis */
export function drawCells(view, points) {
  const { picture, policy, scene } = view,
    { edge, wide, high } = picture,
    { low: [left, low], high: [right, top] } = picture.plane,
    plain = straight(view) && scene.task.outputs.length === 2
  if (points && !plain) drawMap(view, points)
  if (!plain) picture.ctx.drawImage(picture.map, edge.left, edge.top, wide, high)
  if (policy.layers || !straight(view)) return
  const all = [[left, low], [right, low], [right, top], [left, top]],
    { codewords, scale } = policy
  tintsOf(view).forEach((hue, i) => {
    const fill = plain ? css(hue[Number(i === view.marked && view.cells > 1)]) : CLEAR,
      shape = codewords.reduce((left, other) => nearer(left, codewords[i], other, scale), all)
    picture.polygons([shape.flat()], fill, css(hue[2]), 1.5)
  })
}

/** The part of a polygon that is nearer to one point than to another, by the scaled Euclidean
 * distance.
 * @param {Vector[]} shape @param {Vector} one @param {Vector} other @param {Vector} scale */
export function nearer(shape, one, other, scale) {
  const normal = one.map((value, i) => (other[i] - value) / scale[i] ** 2),
    middle = one.map((value, i) => (value + other[i]) / 2),
    beyond = shape.map(corner => dot(normal, corner) - dot(normal, middle))
  return shape.flatMap((corner, i) => {
    const [before, from, to] = [shape.at(i - 1) ?? corner, beyond.at(i - 1) ?? 0, beyond[i]],
      cut = before.map((value, k) => value + (from / (from - to)) * (corner[k] - value))
    return [...(from * to < 0 ? [cut] : []), ...(to <= 0 ? [corner] : [])]
  })
}

/** Draw everything.
 * @param {Explorer} view @param {number} [points] of a new map, along each axis */
export function drawAll(view, points) {
  const { picture, scene, task } = view
  picture.begin()
  drawCells(view, points)
  const path = view.played.states.slice(0, 250).map(view.place), // more are a blob
    { paper, ink, failing, start } = picture.tones
  task.places.forEach(place => picture.place(place))
  if (view.regions) picture.polygons(view.regions, failing)
  if (scene.task.outputs.length === 2) drawArrows(view)
  for (const [i, place] of view.starts ? scene.starts.map(view.place).entries() : []) {
    const cell = view.failing.get(i)
    if (cell === undefined) picture.dot(place, 1.3, start)
    else if (cell === view.cell) picture.dot(place, 3.4, failing, paper, 1)
    else picture.dot(place, 2.7, paper, failing)
  }
  picture.line(path, paper, 5)
  picture.line(path, ink, 2)
  path.slice(1).forEach(point => picture.dot(point, 2, ink))
  drawCodewords(view)
  picture.arrows(view.arrows, 9, paper, 6)
  picture.arrows(view.arrows, 9, ink, 3)
  task.places.forEach(place => picture.name(place))
  if (view.ring) picture.dot(view.ring, 14, CLEAR, failing, 3)
  picture.dot(view.asked, 7, paper, ink)
  picture.dot(view.asked, 2.5, ink)
  picture.axes()
}

/** Draw the actions as arrows: the teacher's in its colour. @param {Explorer} view */
function drawArrows(view) {
  const { picture, scene, policy } = view,
    { teacher, ink } = picture.tones,
    length = (picture.wide / ARROWS) * 0.42
  const arrows = Array.from({ length: ARROWS * ARROWS }, (_, i) => {
    const point = picture.middle(i, ARROWS),
      [dx, dy] = (policy.arrows?.[i] ?? act(scene, policy, point).action).map(by => by * length),
      [x, y] = picture.at(point)
    return { start: [x - dx, y + dy], tip: [x + dx, y - dy] }
  })
  const moving = arrows.filter(({ start: [x, y], tip }) => x !== tip[0] || y !== tip[1])
  picture.arrows(moving, 4, policy.layers ? teacher : ink, policy.layers ? 1.4 : 1)
}

/** Where the arrow of a cell begins and ends, in pixels: its action at the codeword, to be dragged.
 * @param {Explorer} view @param {number} cell */
export function ownArrow({ picture, policy, cells }, cell) {
  const { codewords = [], coefficients = [] } = policy,
    word = cells > 1 ? codewords[cell] : picture.spot([0.5, 0.5]),
    rows = coefficients[cell],
    [x, y] = picture.at(word),
    own = picture.wide / 10, // pixels for an action of 1: a step
    [dx, dy] = [0, 1].map(k => clip(raw(rows, word, k), -1, 1) * own)
  return { start: [x, y], tip: [x + dx, y - dy], word, rows, own }
}


/** @param {Explorer} view */
function drawCodewords(view) {
  const { picture, policy } = view,
    { paper, ink } = picture.tones
  if (policy.layers || view.cells === 1) return
  policy.codewords.forEach((codeword, i) => {
    const point = view.task.place(codeword),
      [x, y] = picture.at(point)
    picture.dot(point, 5, i === view.marked ? ink : paper, ink)
    // Else it would lie under the finger
    if (view.held?.finger && i === view.held.cell) picture.dot(point, 34, CLEAR, ink, 2)
    if (view.cells > 30 && i !== view.marked) return
    const inner = x > picture.side - 40 // else the frame cuts the number off
    const [right, down] = [inner ? -9 : 9, y < 28 ? 16 : -6]
    picture.text(String(numberOf(policy, i)), x + right, y + down, inner ? "right" : "left")
  })
}

/** Draw how many starts fail along a run, on a scale of roots, so that small changes show. Ticks: a
 * split above, a merge below. Lines: settings that a reader changed. @param {Explorer} view */
export function drawTime({ run, scene: { starts }, replay: { time: canvas, at } }) {
  const high = canvas.clientHeight,
    { ctx, wide, tones } = begun(canvas, high),
    x = (/** @type {number} */ i) => END + (i / Math.max(run.length - 1, 1)) * (wide - 2 * END),
    y = (/** @type {number} */ share) => high - TICK - 4 - Math.sqrt(share) * (high - 2 * TICK - 14)
  Object.assign(ctx, { fillStyle: tones.ink, textAlign: "right", strokeStyle: tones.failing })
  for (const share of [0, 1 / 4, 1]) {
    ctx.fillRect(END, y(share), wide - 2 * END, 0.3)
    ctx.fillText(String(Math.round(share * starts.length)), wide - END - 6, y(share) - 3)
  }
  run.forEach(({ events, set }, i) => {
    for (const { kind } of events)
      ctx.fillRect(x(i) - 0.5, kind === "split" ? 0 : high - TICK, 1, TICK)
    ctx.fillRect(x(i) - 0.5, 0, set ? 1.5 : 0, high)
    ctx.fillText(set ?? "", Math.max(x(i) - 4, 160), 36)
  })
  ctx.fillRect(x(at) - 1, 0, 2, high)
  ctx.beginPath()
  run.forEach(({ failures = 0 }, i) => ctx.lineTo(x(i), y(failures / starts.length)))
  ctx.lineWidth = 1.5
  ctx.stroke()
}
