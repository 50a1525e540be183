// @ts-check
// Controls: elements, numbers, equations to write in, a player.

const SPEEDS = [0.25, 1, 4]

/** Make an element with attributes, listeners (functions) and children.
 * @template {keyof HTMLElementTagNameMap} T @param {T} tag @param {Attributes} attributes
 * @param {(Node | string)[]} children */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag)
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function")
      made.addEventListener(name, /** @type {EventListener} */ (value))
    else if (value !== false) made.setAttribute(name, value === true ? "" : String(value))
  }
  made.append(...children)
  return made
}

/** @type {(label: string, click: () => void) => HTMLButtonElement} */
export const button = (label, click) => element("button", { type: "button", click }, label)
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
  /** @type {(first: Node, tag: "td" | "th", about: Attributes, values: string[]) => Node} */
  const line = (first, tag, about, values) =>
    element("tr", {}, first, ...values.map(value => element(tag, about, value)))
  const body = rows.map(([name, ...values]) =>
    line(element("th", { scope: "row" }, name), "td", {}, values),
  )
  return element("table", {}, line(element("td"), "th", { scope: "col" }, head), ...body)
}

/** A list to choose from; `take` gets the index.
 * @param {string} label @param {string[]} names @param {(i: number) => void} take */
export function choice(label, names, take, at = 0) {
  const options = names.map((name, i) => element("option", { value: i, selected: i === at }, name))
  const change = () => void take(+list.value)
  const list = element("select", { change }, ...options)
  return element("label", {}, `${label} `, list)
}

/** A field for number i of a list, which takes every number that is written, and tells it.
 * @param {string} label @param {Vector} list @param {number} i @param {number} step
 * @param {() => void} changed */
function field(label, list, i, step, changed) {
  const value = () => +(+list[i].toFixed(3)).toPrecision(4)
  const input = () => {
    const given = made.valueAsNumber
    if (!(Math.abs(given) <= 1e6)) return
    list[i] = given
    changed()
  }
  const change = () => (made.value = String(value())) // the number that counts
  const about = { type: "number", step, value: value(), "aria-label": label }
  const made = element("input", { ...about, input, change })
  return made
}

/** Fields for the codeword, where it can be moved, and the equations of the chosen cell of a view.
 * `changed` is called after each change. @param {Explorer} view @param {() => void} changed */
export function equations({ scene, policy, cell, cells, angular }, changed) {
  if (policy.layers) return []
  const { task, plane } = scene,
    rows = policy.coefficients[cell],
    codeword = policy.codewords[cell]
  const range = (/** @type {number} */ i) => (angular ? 2 : plane.high[i] - plane.low[i])
  /** @type {(label: string, list: Vector, i: number, step: number, ...around: string[]) => Node} */
  const term = (label, list, i, step, before, after = "") => {
    const written = field(label, list, i, step, changed)
    return element("span", { class: "vsp-term" }, before, written, after)
  }
  /** @type {(name: string, terms: Node[]) => Node} */
  const line = (name, terms) => element("div", { class: "vsp-equation" }, `${name} `, ...terms)
  const places = task.inputs.map((name, i) =>
    term(`codeword: ${name}`, codeword, i, +(range(i) / 50).toPrecision(1), `${name} = `),
  )
  const lines = task.outputs.map((output, k) => {
    const names = [...task.inputs, "bias"]
    const terms = names.map((name, i) =>
      term(`${output}: ${name}`, rows[i], k, 0.1, "", name === "bias" ? "" : `${name} +`),
    )
    return line(`${output} =`, terms)
  })
  return cells > 1 ? [line("codeword", places), ...lines] : lines
}

/** A row of controls for the run of a view, which shows and describes moment i in `turn(i)`;
 * `lasts(i)` says for how many milliseconds. */
export class Player {
  text = ""
  speed = 1
  playing = false
  /** @type {HTMLInputElement} */ slider
  constructor(/** @type {Explorer} */ view) {
    this.view = view
    this.slow = matchMedia("(prefers-reduced-motion: reduce)").matches // one picture a second
    const go = (/** @type {1 | -1} */ way) => (this.stop(), view.jump(way))
    const input = () => (this.stop(), this.to(+this.slider.value))
    const settled = { input, change: () => view.soon() }
    this.slider = element("input", { type: "range", min: 0, "aria-label": "iteration", ...settled })
    this.toggle = button("play", () => (this.playing ? this.pause() : this.start()))
    this.said = element("span", { class: "vsp-said" })
    const steps = [button("previous change", () => go(-1)), button("next change", () => go(1))]
    const names = SPEEDS.map(speed => `${speed} ×`)
    const speeds = choice("speed", names, i => (this.speed = SPEEDS[i]), 1)
    this.row = row(this.toggle, ...steps, speeds, this.slider, this.said)
  }
  get at() {
    return +this.slider.value
  }
  /** Set the number of moments and go to the last one. */
  restart(/** @type {number} */ count) {
    this.slider.max = String(count - 1)
    this.to(count - 1)
  }
  to(/** @type {number} */ i) {
    this.slider.value = String(i)
    this.text = this.view.turn(this.at)
  }
  /** Say where it is: with the next frame, as all texts. */
  tell() {
    this.said.textContent = this.text
    this.slider.setAttribute("aria-valuetext", this.text)
  }
  start() {
    const last = +this.slider.max
    this.playing = true
    this.toggle.textContent = "pause"
    if (this.at === last) this.to(0)
    let [before, waited] = [performance.now(), 0]
    const frame = (/** @type {number} */ now) => {
      if (!this.playing || !this.slider.isConnected) return
      waited += (now - before) * this.speed
      before = now
      let i = this.at
      for (; i < last && waited >= this.view.lasts(i); i++) waited -= this.view.lasts(i)
      if (i > this.at) this.to(i)
      if (this.at < last) return requestAnimationFrame(frame)
      this.pause()
    }
    requestAnimationFrame(frame)
  }
  pause() {
    this.stop()
    this.view.settle()
  }
  stop() {
    this.playing = false
    this.toggle.textContent = "play"
  }
}
