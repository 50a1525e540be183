// Text and explorer act on each other. Attributes say which scene a section has, what a button does
// (`data-act`), and which number an output repeats (`data-say`).

import { Explorer } from "../../vsp/show/explorer/explorer.js"
import { floats, network, rSquared, refit, visits } from "../../vsp/show/explorer/model.js"
import { minus } from "../../vsp/show/explorer/controls.js"
import { read, write } from "./address.js"

const UNLOADED = "A part of the page could not be loaded. Try again."
const UNREAD = "This link is damaged or from a newer version. So here is the first picture."

/** A part of the data, in the page or beside it. */
async function data(name) {
  const inner = document.querySelector(`#article-${name}`)
  if (inner.textContent) return JSON.parse(inner.textContent)
  return (await fetch(inner.dataset.source)).json()
}

/** The moments of the stored run. */
function replayOf({ n, cells, codewords, coefficients, events }) {
  const numbers = floats(coefficients),
    places = new Map(codewords)
  let [at, words] = [0, null]
  return n.map((iteration, i) => {
    words = places.get(i) ?? words
    const row = () => [...numbers.subarray(at, (at += 2))]
    const maps = Array.from({ length: cells[i] }, () => [row(), row(), row()])
    const happened = events.filter(event => event.n === iteration)
    return { n: iteration, codewords: words, coefficients: maps, events: happened }
  })
}

/** The policies that a section can show. */
const policiesOf = section => section.dataset.policies.split(" ")

/** The scene of a section as it is at first. */
function firstOf({ dataset }) {
  const { policies, at, moment } = dataset
  return { policy: policies.split(" ")[0], at: at.split(",").map(Number), moment }
}

/** Text and explorer of one article. */
class Article {
  constructor(root, scene) {
    Object.assign(this, { root, scene, parts: {}, left: {} })
    this.policies = Object.fromEntries(scene.policies.map(policy => [policy.id, policy]))
    this.sections = [...root.querySelectorAll("section[data-policies]")]
    this.status = root.querySelector(".status")
    const settled = () => {
      this.keep()
      this.gestured = true
    }
    const hooks = { settled, told: () => this.say() }
    this.view = new Explorer(root.querySelector(".view"), this.scene, { bare: true, ...hooks })
    root.classList.add("live")
    const online = location.protocol.startsWith("http")
    for (const one of root.querySelectorAll("[data-http]")) one.hidden = !online
    this.listen()
    this.follow()
  }
  listen() {
    const seen = entries => entries.forEach(one => one.isIntersecting && this.enter(one.target))
    const watch = new IntersectionObserver(seen, { rootMargin: "-60% 0px -40% 0px" })
    for (const section of this.sections) {
      watch.observe(section)
      section.addEventListener("focusin", () => this.enter(section))
    }
    this.root.addEventListener("click", ({ target }) => {
      const pressed = target.closest("[data-act]")
      if (pressed) this.act(pressed, ...pressed.dataset.act.split(" "))
    })
    this.root.addEventListener("input", ({ target }) => {
      const { stops } = target.dataset
      if (stops) this.act(target, "policy", stops.split(" ")[target.value])
    })
    for (const kind of ["pointerdown", "keydown"])
      this.view.canvas.addEventListener(kind, () => this.wake())
    addEventListener("popstate", () => this.follow())
    addEventListener("beforeprint", () => {
      for (const output of this.root.querySelectorAll("output")) output.value = output.defaultValue
    })
  }
  /** A part of the data, loaded once; nothing if that fails. */
  part(name) {
    this.parts[name] ??= data(name).catch(() => {
      delete this.parts[name]
      this.status.textContent = UNLOADED
    })
    return this.parts[name]
  }
  /** Load the network when a reader asks it. Before that, its arrows and one episode are known. */
  async wake() {
    const { teacher } = this.policies,
      known = teacher.episode
    if (this.section?.id !== "teacher" || !known?.states.length) return
    teacher.episode = { states: [] } // of another start nothing is known yet
    const stored = await this.part("teacher")
    Object.assign(teacher, stored ? { ...network(stored), episode: null } : { episode: known })
    this.view.changed()
  }

  // -- Scenes
  /** Show a section's scene: as `state` says, as the reader left it, or as it is at first. */
  enter(section, state, put) {
    if (this.section === section && !state) return this.entering
    this.remember()
    Object.assign(this, { section, staging: true })
    this.status.textContent = ""
    for (const one of this.sections) one.classList.toggle("active", one === section)
    this.entering = this.stage(section, state ?? this.left[section.id] ?? firstOf(section), put)
    return this.entering
  }
  async stage(section, { policy, at, moment, zoomed = false, numbers }, put) {
    const { view } = this,
      names = section.dataset.needs?.split(" ") ?? [],
      loaded = await Promise.all(names.map(name => this.part(name)))
    if (policy === "teacher" && String(at) !== section.dataset.at) await this.wake()
    if (this.section !== section || loaded.includes(undefined)) return // gone on, or not there
    const { run, visited, proofs } = Object.fromEntries(names.map((name, i) => [name, loaded[i]]))
    if (visited) this.visited ??= visits(this.scene, visited)
    if (run) this.takeRun(run)
    const proof = proofs?.[policy]
    Object.assign(this, { zoomed, proved: proof?.polygons ?? null })
    const [low, high] = zoomed && proof ? proof.box : [this.scene.plane.low, this.scene.plane.high]
    view.picture.plane = { ...this.scene.plane, low, high }
    const { fixed, starts } = section.dataset
    Object.assign(view, { fixed: Boolean(fixed), starts: !proof && !starts, asked: at })
    view.show(this.policies[policy], numbers)
    if (view.run && moment !== undefined) view.replay.to(+moment)
    view.regions = this.same ? this.proved : null
    this.arrange(section, policy)
    this.staging = false
    this.keep(put ?? (this.gestured ? history.pushState : history.replaceState))
    this.gestured = false
  }
  /** Put the controls into a section, and set its own. */
  arrange(section, policy) {
    const { replay, form, backs } = this.view,
      slots = { replay: [replay.row], form: [form, backs] }
    for (const slot of section.querySelectorAll("[data-slot]"))
      slot.append(...slots[slot.dataset.slot])
    for (const one of section.querySelectorAll("[data-stops]"))
      one.value = one.dataset.stops.split(" ").indexOf(policy)
    for (const one of section.querySelectorAll("[data-act^=zoom]"))
      one.textContent = this.zoomed ? "show the whole square" : "enlarge the sliver"
  }
  takeRun(stored) {
    const { run } = this.policies,
      { codewords, coefficients } = run // exact, unlike those of the moments
    if (run.replay) return
    run.replay = replayOf(stored)
    Object.assign(run.replay.at(-1), { codewords, coefficients })
    run.limits = { split: stored.split, merge: stored.merge }
  }
  /** Whether the policy is as it was: not one that the reader has changed. */
  get same() {
    const { codewords, coefficients } = this.view.original
    return JSON.stringify(this.view.numbers()) === JSON.stringify({ codewords, coefficients })
  }
  get state() {
    const { view, section, zoomed } = this,
      replayed = section.querySelector("[data-slot=replay]"),
      shown = { section: section.id, policy: view.original.id, at: view.asked, zoomed }
    if (replayed) return { ...shown, moment: view.replay.at }
    return { ...shown, numbers: this.same ? undefined : view.numbers() }
  }
  remember() {
    if (this.section && !this.staging) this.left[this.section.id] = this.state
  }
  /** Remember the scene, and write it into the address: after a gesture, to come back from. */
  keep(put = history.pushState) {
    if (!this.section || this.staging) return
    this.remember()
    const address = write(this.state)
    if (address !== location.hash && this.begun) put.call(history, null, "", address)
    this.begun = true // the first scene keeps the page's own address
  }
  /** Show what the address says: a state, a section, or the first scene. */
  async follow() {
    const { hash } = location
    const sections = Object.fromEntries(this.sections.map(one => [one.id, policiesOf(one)]))
    const state = read(hash, sections, this.scene.moments)
    const named = state?.section ?? hash.slice(1)
    const section = this.sections.find(({ id }) => id === named) ?? this.sections[0]
    if (hash || this.section) section.scrollIntoView()
    const shown = this.enter(section, state ?? firstOf(section))
    if (hash.startsWith("#v=") && !state) this.status.textContent = UNREAD
    await shown
  }

  // -- What buttons do
  async act(pressed, verb, what) {
    await this.enter(pressed.closest("section") ?? this.section)
    const { view, section } = this
    const scene = to =>
      this.enter(section, { at: view.asked, policy: what, ...to }, history.pushState)
    if (verb === "policy") await scene({ moment: section.dataset.moment })
    else if (verb === "zoom" && this.zoomed) await scene({ at: [0.6, 0.7] })
    else if (verb === "zoom")
      await scene({ at: (await this.part("proofs"))[what].at, zoomed: true })
    else if (verb === "reset") view.take(view.original)
    else if (verb === "refit") {
      const { codewords } = view.policy,
        cells = what === "cell" ? [view.cell] : undefined
      view.take({ codewords, coefficients: refit(view.policy, this.visited, cells) })
    } else await this.copy(pressed, what)
  }
  async copy(pressed, what) {
    const { href } = location,
      frame = `<iframe src="${href}" allow="clipboard-write" width="100%" height="800"></iframe>`,
      text = what === "link" ? href : frame
    const written = navigator.clipboard?.writeText(text) ?? Promise.reject(text)
    const done = await written.then(
      () => true,
      () => false,
    )
    if (done) pressed.textContent = `${what} copied`
    else this.status.textContent = text
  }

  // -- What the text says of the picture
  say() {
    const { view, section } = this
    if (!section || this.staging || !view.played.states.length) return
    if (this.proved && !this.same) view.regions = null // they are not proved for another policy
    const { results, policy, cell, played } = view,
      [x, y] = view.asked.map(value => value.toFixed(this.proved ? 4 : 2))
    const ends = ["does not end", "reaches the goal", "falls into the pit"][played.outcome]
    const n = played.states.length - 1,
      steps = `${n} step${n === 1 ? "" : "s"}`
    const known = { x, y, cell, ends, steps, cells: view.cells }
    Object.assign(known, { failures: results.failures, mean: results.mean.toFixed(2) })
    if (this.visited && !policy.layers && this.rated !== view.kept) {
      this.r2 = this.same ? view.original.r2 : rSquared(this.scene, policy, this.visited)
      this.rated = view.kept
    }
    known.r2 = this.r2?.toFixed(2)
    for (const output of section.querySelectorAll("output")) {
      const now = minus(known[output.dataset.say] ?? output.value)
      if (output.value !== now) output.value = now
    }
    const { low, high } = this.root.querySelector(".scale").dataset
    this.root.style.setProperty("--score", (results.mean - low) / (high - low))
  }
}

export async function begin() {
  const root = document.querySelector(".vsp-article")
  return new Article(root, await data("scene"))
}
