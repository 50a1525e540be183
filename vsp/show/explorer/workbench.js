// @ts-check
// The workbench: runs of the method beside each other, each with settings of its own.

import { button, choice, element, one, row, textOf } from "./controls.js"
import { Distiller, allowed } from "./distiller.js"
import { Explorer } from "./explorer.js"
import { network as learnt } from "./model.js"

const MOST = [1, 2, 3, 4] // runs

/** What of a run's settings differs from the paper's, as "name=value", and back. A name or a value
 * that is not known is left out: addresses come from anywhere.
 * @param {Record<string, any>} config @param {Record<string, any>} preset */
export const written = (config, preset) =>
  differing(config, { seed: 0, ...preset }).map(name => `${name}=${config[name]}`).join("&")
/** @param {string} text @param {Record<string, any>} preset @param {Choices} choices */
export function read(text, preset, choices) {
  const known = { seed: 0, ...preset },
    config = { ...known }
  for (const [name, value] of new URLSearchParams(text)) {
    const given = [value, Number(value), value === "true"].find(
      each => String(each) === value && allowed(choices, known, name, each),
    )
    if (given !== undefined) Object.assign(config, { [name]: given })
  }
  return config
}
/** @param {Record<string, any>} config @param {Record<string, any>} preset */
const differing = (config, preset) =>
  Object.keys(preset).filter(name => config[name] !== preset[name])

/** The call of Python that runs these settings. @param {string} task
 * @param {Record<string, any>} config @param {Record<string, any>} preset */
export function python(task, config, preset) {
  const given = differing(config, preset).map(name => {
    const value = JSON.stringify(config[name]) // true is True
    return `, ${name}=${value.replace(/^[tf]/, letter => letter.toUpperCase())}`
  })
  return `import dataclasses, vsp

config = dataclasses.replace(vsp.preset("${task}")${given.join("")})
policy, history = vsp.distill(vsp.load_teacher("${task}"), "${task}", config, seed=${config.seed})
`
}

/** Runs of one task, beside each other. */
export class Workbench {
  /** @type {Distiller[]} */ runs = []
  columns = element("div", { class: "vsp-bench" })
  beside = choice("runs beside each other", MOST, n => this.open(this.task, this.written(), n))
  /** @param {HTMLElement} root @param {BenchScene[]} tasks */
  constructor(root, tasks) {
    this.tasks = tasks
    this.task = tasks[0]
    const options = tasks.map(task => ({ name: task.scene.task.name, task }))
    this.list = choice("task", options, ({ task }) => this.open(task, [""], this.runs.length))
    root.replaceChildren(row(this.list, this.beside), this.columns)
    // Of the address: "#task/run/run", a run being what differs from the paper
    const [name, ...runs] = location.hash.slice(1).split("/"),
      task = tasks.find(({ scene }) => scene.task.name === name) ?? tasks[0]
    this.open(task, runs.length ? runs : [""])
  }
  /** Show n runs of a task; further ones differ by their seeds. Those that are there stay.
   * @param {BenchScene} task @param {string[]} runs */
  open(task, runs, n = Math.min(runs.length, MOST.length)) {
    const stay = task === this.task && runs.join() === this.written().join() ? n : 0
    for (const run of this.runs.splice(stay)) run.stop()
    this.columns.replaceChildren(...[...this.columns.children].slice(0, stay))
    this.task = task
    for (let i = this.runs.length; i < n; i++) this.add(runs[i] ?? `${runs.at(-1)}&seed=${i}`)
    Object.assign(one(this.list, "select"), { selectedIndex: this.tasks.indexOf(task) })
    Object.assign(one(this.beside, "select"), { selectedIndex: n - 1 })
    this.keep()
  }
  written() {
    return this.runs.map(({ config }) => written(config, this.task.preset))
  }
  keep() {
    const parts = [this.task.scene.task.name, ...this.written()]
    history.replaceState(null, "", `#${parts.join("/")}`)
  }
  /** @param {string} text */
  add(text) {
    const { scene, network, preset, choices } = this.task,
      root = element("div", { class: "vsp-explorer" }),
      config = /** @type {Settings & { seed: number }} */ (read(text, preset, choices)),
      net = { name: "the teacher", ...learnt(network), results: scene.teacher },
      view = new Explorer(root, { ...scene, policies: [/** @type {any} */ (net)] }, { bare: true }),
      run = new Distiller(view, config, choices, async () => network, () => this.keep()),
      copied = element("pre", { class: "vsp-code" })
    const copy = button("copy as Python", () => {
      copied.textContent = python(scene.task.name, run.config, preset)
      navigator.clipboard?.writeText(copied.textContent).catch(() => {})
    })
    view.fixed = true
    run.row.firstElementChild?.append(copy)
    const parts = [run.row, copied, view.replay.row, view.replay.line]
    root.append(element("div", { class: "vsp-panel" }, ...parts))
    this.columns.append(root)
    this.runs.push(run)
  }
}

/** Begin the page. */
export async function begin() {
  const root = one(document, "[data-bench]")
  new Workbench(root, JSON.parse(await textOf(one(root, "script") ?? root, root.dataset.bench)))
}
