// @ts-check
// Controls of a live distillation: settings of `vsp.Config`, which a reader may change while it
// runs, and a view that follows the run.

import { button, choice, element, field, fits, one, row, textOf } from "./controls.js"
import { work } from "./worker.js"
import SETTINGS from "./settings.json" with { type: "json" }

/** @type {(pace: number) => string} */
const nameOf = pace => (pace < 1e6 ? `${pace} a second` : "as fast as it can")
const PACES = [300, 1e6, 30, 3].map(pace => ({ pace, name: nameOf(pace) })) // iterations a second
const MOST = 1e5 // of a setting
const ANEW = "n_epochs metric scale fit inclusive seed".split(" ") // count from the next run on

/** What numbers a setting may be, by one.
 * @type {(name: string, value: number) => Limited} */
const rangeOf = (name, value) => {
  const whole = Number.isInteger(value),
    least = name === "seed" ? 0 : whole ? 1 : 1e-9
  return { step: 1, times: name !== "seed", least, most: MOST, whole }
}

/** Whether a setting may have a value. @param {Choices} choices @param {Record<string, any>} preset
 * @param {string} name @param {unknown} value */
export function allowed(choices, preset, name, value) {
  if (choices[name]) return choices[name].some(each => each === value)
  if (typeof value !== "number" || typeof preset[name] !== "number") return false
  return fits(value, rangeOf(name, preset[name]))
}

/** A control for a setting: a number, or one of some words.
 * @param {Record<string, any>} config @param {string} name @param {string} meaning
 * @param {(string | boolean)[] | undefined} words @param {(value?: unknown) => void} changed */
function control(config, name, meaning, words, changed) {
  const range = rangeOf(name, config[name]),
    take = (/** @type {string | boolean} */ word) => changed((config[name] = word)),
    list = words && choice("", words, take, config[name]),
    part = list ?? element("label", {}, field(name, config, name, changed, range))
  part.prepend(`${meaning} `, element("code", {}, name))
  return part
}

/** Distils into a view. `choices`: the words of settings that are no numbers; `network()` loads the
 * teacher; `told(this)` is called after each change; `groups`: what settings mean. */
export class Distiller {
  /** @type {Run} */ run = { moments: [], done: true, counted: true, rate: 0 }
  pace = PACES[0].pace
  go = button("distil", () => (this.run.done ? this.begin() : this.stop()), "vsp-go")
  said = element("p", { class: "vsp-note", role: "status" })
  /** @param {Explorer} view @param {Settings & { seed?: number }} config @param {Choices} choices
   * @param {() => Promise<StoredNetwork | Visited[] | undefined>} network
   * @param {(distiller: Distiller) => void} told @param {Record<string, object>} groups */
  constructor(view, config, choices, network, told = () => {}, groups = SETTINGS) {
    this.view = view
    this.network = network
    this.told = told
    this.config = { seed: 0, ...config }
    const pace = choice("iterations", PACES, ({ pace }) => this.tell({ pace: (this.pace = pace) }))
    /** @type {(setting: [name: string, meaning: string]) => Node} */
    const made = ([name, meaning]) =>
      control(this.config, name, meaning, choices[name], () => this.changed(name))
    /** @param {[string, string]} setting */
    const known = ([name]) => choices[name] || typeof Reflect.get(config, name) === "number"
    const parts = Object.entries(groups).map(([title, settings], i) => {
      const shown = Object.entries(settings).filter(known).map(made),
        fields = element("div", { class: "vsp-settings" }, ...shown)
      return element("details", { open: i === 0 }, element("summary", {}, title), fields)
    })
    this.row = element("div", {}, row(this.go, pace, made(["seed", ""])), this.said, ...parts)
  }

  /** @param {string} name */
  changed(name) {
    const later = !this.run.done && ANEW.includes(name)
    const value = Reflect.get(this.config, name),
      now = this.run.moments.at(-1)
    if (!later) this.tell({ config: { [name]: value } })
    if (!later && now && !this.run.done) now.set = `${name} = ${value}`
    this.say(later ? "This counts from the next run on." : "")
    this.told(this)
  }
  /** @param {ToWorker} changes */
  tell(changes) {
    this.run.worker?.postMessage(changes)
  }
  stop() {
    this.run.worker?.terminate()
    this.run.done = true
    this.say()
  }
  async begin() {
    const { config, pace } = this,
      { n_freeze: freeze, n_epochs: epochs } = config
    if (freeze > epochs) return this.say(`n_freeze is ${freeze}: at most n_epochs, ${epochs}.`)
    const scene = { ...this.view.scene, policies: [] },
      script = /** @type {HTMLScriptElement} */ (one(document, "#vsp-script"))
    /** @type {Run} */ const run = (this.run = { moments: [], done: false, rate: 0 })
    this.say()
    const [text, network] = await Promise.all([textOf(script, script.src), this.network()])
    if (run.done) return // stopped meanwhile
    if (!network) return this.stop()
    // The page's own script, which works instead of beginning a page; from a file it is no module
    const plain = text.replace(/^export \{[^}]*\};?/gm, ""),
      parts = [plain.replace(/begin\(\)\s*$/, `${work.name}()`)]
    run.worker = new Worker(URL.createObjectURL(new Blob(parts, { type: "text/javascript" })))
    run.worker.onmessage = ({ data }) => this.grown(run, data)
    run.worker.postMessage({ scene, network, config, seed: config.seed, pace })
  }
  /** Moments have come. @param {Run} run @param {FromWorker} found */
  grown(run, { moments, done, rate }) {
    const { view } = this
    run.moments.push(...moments)
    run.rate = rate || run.rate
    if (!run.policy && moments.length) {
      const about = { name: "your run", replay: run.moments }
      run.policy = /** @type {Linear} */ (/** @type {Numbers} */ ({ ...moments[0], ...about }))
      view.show(run.policy)
    } else if (view.original === run.policy && moments.length) view.replay.grow()
    if (run.policy) run.policy.limits = this.config
    if (!done) return this.say()
    this.stop()
    this.told(this)
  }
  say(words = "") {
    const { done, moments, rate } = this.run,
      n = moments.at(-1)?.n ?? 0,
      now = `iteration ${n}: ${Math.round(rate).toLocaleString("en")} a second`
    if (moments.length) words ||= done ? `${n + 1} iterations` : now
    this.go.textContent = done ? "distil" : "stop"
    this.said.textContent = words
  }
}
