// @ts-check
// Controls: elements, numbers, equations to write in, a player.

import { clip } from "./model.js"


const [CHANGED, SAME] = [250, 30] // milliseconds of a run's moment, with and without a change

/** Make an element with attributes, listeners (functions) and children.
 * @template {keyof HTMLElementTagNameMap} T @param {T} tag @param {Attributes} attributes
 * @param {(Node | string)[]} children */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag)
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name, /** @type {any} */ (value))
    else if (value !== false) made.setAttribute(name, value === true ? "" : String(value))
  }
  made.append(...children)
  return made
}

/** The element that a selector finds, of the kind that is wanted.
 * @template {HTMLElement} [T=HTMLElement] @param {ParentNode} root @param {string} selector */
export const one = (root, selector) => /** @type {T} */ (root.querySelector(selector))
/** The text of an element, or else of a file. @param {Element} inner @param {string} [file] */
export const textOf = async (inner, file = "") => inner.textContent || (await fetch(file)).text()

/** @type {(label: string, click: () => void, name?: string) => HTMLButtonElement} */
export const button = (label, click, name = "") =>
  element("button", { type: "button", class: name, click }, label)
/** @type {(...children: Node[]) => HTMLElement} */
export const row = (...children) => element("div", { class: "vsp-row" }, ...children)
/** @type {(text: string) => string} */
export const minus = text => text.replaceAll("-", "−")
/** @type {(n: number, thing: string) => string} */
export const count = (n, thing) => `${n} ${thing}${n === 1 ? "" : "s"}`
/** @type {(value: number) => string} */
export const digits = value => (Math.abs(value) < 5e-4 ? "0.000" : minus(value.toFixed(3)))

/** Make a table: names of the columns but the first, then rows that begin with their name.
 * @param {string[]} head @param {string[][]} rows */
export function table(head, rows) {
  /** @type {(tag: "td" | "th", scope: string | false, texts: string[]) => Node[]} */
  const cells = (tag, scope, texts) => texts.map(text => element(tag, { scope }, text))
  const lines = [[element("td"), ...cells("th", "col", head)]]
  for (const [name, ...values] of rows)
    lines.push([...cells("th", "row", [name]), ...cells("td", false, values)])
  return element("table", {}, ...lines.map(line => element("tr", {}, ...line)))
}

/** A list to choose from, by the names of the options or by themselves. @template T
 * @param {string} label @param {T[]} options @param {(option: T) => void} take @param {T} chosen */
export function choice(label, options, take, chosen = options[0]) {

  const lines = options.map((option, value) => {
    const about = { value, selected: option === chosen }
    return element("option", about, String(Object(option).name ?? option))
  })
  /** @type {HTMLSelectElement} */
  const list = element("select", { change: () => take(options[+list.value]) }, ...lines)
  return element("label", {}, `${label} `, list)
}

/** A canvas on which a touch chooses a share of its width. @param {(share: number) => void} take
 * @param {Attributes} about */
export function touched(take, about) {
  const touch = (/** @type {PointerEvent} */ { offsetX, buttons, type, target }) => {
    const { clientWidth } = /** @type {Element} */ (target)
    if (buttons || type === "pointerdown") take(clip(offsetX / clientWidth, 0, 1))
  }
  return element("canvas", { role: "img", pointerdown: touch, pointermove: touch, ...about })
}

const LEAST_DRAG = 4 // pixels: less is a click

/** Whether a field takes a number. @type {(value: number, range: Limited) => boolean} */
export const fits = (value, { least = -1e6, most = 1e6, whole }) =>
  value >= least && value <= most && (!whole || Number.isInteger(value))

/** A field for number i of a list, to write in or to drag sideways, which tells what it takes.
 * @param {string} label @param {Record<string | number, any>} list @param {string | number} i
 * @param {() => void} changed @param {Limited} range */
export function field(label, list, i, changed, range) {
  const { step, times, whole } = range
  let from = { x: 0, value: 0 }
  const value = () => +(times ? list[i] : +list[i].toFixed(3)).toPrecision(times ? 3 : 4)
  const take = (/** @type {number} */ given) => {
    if (!fits(given, range)) return
    list[i] = given
    changed()
  }
  const change = () => (made.value = String(value())) // the number that counts
  const pointerdown = (/** @type {PointerEvent} */ { clientX: x, pointerId }) => {
    from = { x, value: list[i] }
    made.setPointerCapture(pointerId)
  }
  const pointermove = (/** @type {PointerEvent} */ { clientX, buttons }) => {
    const by = Math.trunc((clientX - from.x) / LEAST_DRAG)
    if (!buttons || !by) return
    const moved = times ? from.value * 1.1 ** by : from.value + (by * step) / 2
    take(whole ? Math.round(moved) : +(times ? moved.toPrecision(2) : moved.toFixed(2)))
    change()
  }
  const about = { type: "number", step, value: value(), "aria-label": label }
  const acts = { input: () => take(made.valueAsNumber), change, pointerdown, pointermove }
  /** @type {HTMLInputElement} */ const made = element("input", { ...about, ...acts })
  return made
}

/** Fields for the codeword of a cell, where it can be moved, and for its equations.
 * @param {Explorer} view @param {number} cell @param {() => void} changed */
export function equations({ scene, policy, cells, angular, fixed }, cell, changed) {
  if (policy.layers) return []
  const { task, plane } = scene,
    [rows, codeword] = [policy.coefficients[cell], policy.codewords[cell]]
  /** @type {(label: string, list: Vector, i: number, step: number, ...around: string[]) => Node} */
  const term = (label, list, i, step, before, after = "") => {
    const written = field(label, list, i, changed, { step })
    return element("span", { class: "vsp-term" }, before, written, after)
  }
  /** @type {(name: string, terms: Node[]) => Node} */
  const line = (name, terms) => element("div", { class: "vsp-equation" }, `${name} `, ...terms)
  const places = task.inputs.map((name, i) => {
    const range = angular ? 2 : plane.high[i] - plane.low[i]
    return term(`codeword: ${name}`, codeword, i, +(range / 50).toPrecision(1), `${name} = `)
  })
  const lines = task.outputs.map((output, k) => {
    const terms = [...task.inputs, "bias"].map((name, i) =>
      term(`${output}: ${name}`, rows[i], k, 0.1, "", name === "bias" ? "" : `${name} +`),
    )
    return line(`${output} =`, terms)
  })
  return cells > 1 && !fixed ? [line("codeword", places), ...lines] : lines
}

/** A row of controls for the run of a view. */
export class Player {
  playing = false
  slow = matchMedia("(prefers-reduced-motion: reduce)").matches // one picture a second
  said = element("span", { class: "vsp-said" })
  toggle = button("play", () => (this.playing ? this.stop(true) : this.start()))
  /** @type {HTMLInputElement} */ slider
  constructor(/** @type {Explorer} */ view) {
    this.view = view
    const soon = () => view.soon(),
      acts = { input: () => this.go(this.at), change: soon }
    this.slider = element("input", { type: "range", min: 0, "aria-label": "iteration", ...acts })
    this.time = touched(share => this.touch(share), { "aria-label": "failures", pointerup: soon })
    const back = button("previous change", () => this.jump(-1)),
      on = button("next change", () => this.jump(1))
    this.line = element("div", { class: "vsp-line" }, this.time, this.slider)
    this.row = row(this.toggle, back, on, this.said)
  }
  get at() {
    return +this.slider.value
  }
  get last() {
    return this.view.run.length - 1
  }
  /** Show a moment of the run. */
  to(/** @type {number} */ i) {
    this.slider.value = String(i)
    this.view.put(this.view.run[i])
    this.view.afresh()
  }
  /** The same, as a gesture. */
  go(/** @type {number} */ i) {
    this.stop()
    this.to(i)
  }
  /** The run has more moments, or is another one: go to its end, if `follow`. */
  grow(follow = this.at === +this.slider.max) {
    this.slider.max = String(this.last)
    if (follow) this.to(this.last)
    else this.view.changed()
  }
  /** Go to a share of the run; nearby it takes the moment with the most failures.
   * @param {number} share */
  touch(share) {
    const { run } = this.view,
      at = Math.round(share * this.last),
      reach = Math.ceil(this.last / 100),
      near = [...run.keys()].slice(Math.max(at - reach, 0), at + reach + 1),
      fails = (/** @type {number} */ i) => run[i].failures ?? 0
    this.go(near.reduce((best, i) => (fails(i) > fails(best) ? i : best), at))
  }
  /** Go to the next change (1) or the one before (-1). */
  jump(/** @type {1 | -1} */ way) {
    const { run } = this.view,
      stops = [...run.keys()].filter(i => (i - this.at) * way > 0 && run[i].events.length)
    this.go(way > 0 ? (stops[0] ?? this.last) : (stops.at(-1) ?? 0))
    this.view.settle()
  }
  /** Play: a moment with a change stays longer. */
  start() {
    const { run } = this.view,
      [long, short] = this.slow ? [1000, 0] : [CHANGED, SAME],
      lasts = (/** @type {number} */ i) => (run[i].events.length ? long : short)
    this.playing = true
    this.toggle.textContent = "pause"
    if (this.at === this.last) this.to(0)
    let [before, waited] = [performance.now(), 0]
    const frame = (/** @type {number} */ now) => {
      if (!this.playing || !this.slider.isConnected) return
      waited += now - before
      before = now
      let i = this.at
      for (; i < this.last && waited >= lasts(i); i++) waited -= lasts(i)
      if (i > this.at) this.to(i)
      if (this.at < this.last) return requestAnimationFrame(frame)
      this.stop(true)
    }
    requestAnimationFrame(frame)
  }
  stop(gesture = false) {
    this.playing = false
    this.toggle.textContent = "play"
    if (gesture) this.view.settle()
  }
}
