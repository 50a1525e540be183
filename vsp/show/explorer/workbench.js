// @ts-check
// The workbench: runs of the method beside each other, each with settings of its own.

import { button, choice, element, one, row, textOf } from "./controls.js"
import { Distiller, allowed } from "./distiller.js"
import { Explorer } from "./explorer.js"


const MOST = 4 // runs

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
  more = button("a run beside", () => this.add(String(this.written().at(-1))))
  /** @param {HTMLElement} root @param {BenchScene[]} tasks */
  constructor(root, tasks) {
    this.tasks = tasks
    this.task = tasks[0]
    const options = tasks.map(task => ({ name: task.scene.task.name, task }))
    this.list = choice("task", options, ({ task }) => this.open(task, [""]))
    root.replaceChildren(row(this.list, this.more), this.columns)
    addEventListener("popstate", () => this.follow())
    this.follow()
  }
  /** Show what the address says: "#task/run/run", a run being what differs from the paper. */
  follow() {
    const [name, ...runs] = location.hash.slice(1).split("/"),
      task = this.tasks.find(({ scene }) => scene.task.name === name) ?? this.tasks[0]
    this.open(task, runs.length ? runs.slice(0, MOST) : [""])
  }
  /** @param {BenchScene} task @param {string[]} runs */
  open(task, runs) {
    for (const run of this.runs) run.stop()
    Object.assign(this, { task, runs: [] })
    Object.assign(one(this.list, "select"), { selectedIndex: this.tasks.indexOf(task) })
    this.columns.replaceChildren()
    for (const run of runs) this.add(run)
  }
  written() {
    return this.runs.map(({ config }) => written(config, this.task.preset))
  }
  keep() {
    this.more.disabled = this.runs.length === MOST
    const { name } = this.task.scene.task
    history.replaceState(null, "", `#${[name, ...this.written()].join("/")}`)
  }
  /** @param {string} text */
  add(text) {
    const { scene, network, preset, choices } = this.task,
      numbers = Object.keys(preset).filter(name => !choices[name]),
      groups = { "Table T2": numbers, readings: Object.keys(choices) },
      root = element("div", { class: "vsp-explorer" }),
      config = /** @type {Settings & { seed: number }} */ (read(text, preset, choices)),
      view = new Explorer(root, scene, { bare: true }),
      run = new Distiller(view, config, choices, async () => network, groups, () => this.keep()),
      copied = element("pre", { class: "vsp-code" })
    const copy = button("copy as Python", () => {
      copied.textContent = python(scene.task.name, run.config, preset)
      navigator.clipboard?.writeText(copied.textContent).catch(() => {})
    })
    const drop = button("remove", () => {
      if (this.runs.length === 1) return
      run.stop()
      root.remove()
      this.runs = this.runs.filter(other => other !== run)
      this.keep()
    })
    const parts = [run.row, view.replay.row, row(copy, drop), copied]
    view.fixed = true
    root.append(element("div", { class: "vsp-panel" }, ...parts))
    this.columns.append(root)
    this.runs.push(run)
    this.keep()
  }
}

/** Begin the page. */
export async function begin() {
  const root = one(document, "[data-bench]")
  new Workbench(root, JSON.parse(await textOf(one(root, "script") ?? root, root.dataset.bench)))
}
