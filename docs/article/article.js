// Text and explorer act on each other. Attributes say which scene a section has, what buttons do
// (`data-act`), and which number an output repeats (`data-say`).

import { Explorer } from "../../vsp/show/explorer/explorer.js"
import { floats, network, rSquared, refit } from "../../vsp/show/explorer/model.js"
import { button, count, minus } from "../../vsp/show/explorer/controls.js"
import { read, write } from "./address.js"

const UNLOADED = "A part of the page could not be loaded. Try again."
const UNREAD = "This link is damaged or from a newer version. So here is the first picture."

/** A part of the data, in the page or beside it. */
async function data(name) {
  const inner = document.querySelector(`#article-${name}`)
  if (inner.textContent) return JSON.parse(inner.textContent)
  return (await fetch(inner.dataset.source)).json()
}

/** Stored numbers, two by two. */
function pairs(text) {
  const numbers = floats(text)
  return Array.from({ length: numbers.length / 2 }, (_, i) => [numbers[2 * i], numbers[2 * i + 1]])
}

/** The moments of the stored run. */
function replayOf({ n, cells, codewords, coefficients, events }) {
  const rows = pairs(coefficients),
    places = new Map(codewords)
  let [at, words] = [0, null]
  return n.map((iteration, i) => {
    words = places.get(i) ?? words
    const maps = Array.from({ length: cells[i] }, () => rows.slice(at, (at += 3))),
      happened = events.filter(event => event.n === iteration)
    return { n: iteration, codewords: words, coefficients: maps, events: happened }
  })
}

/** The scene of a section as it is at first. */
function firstOf({ dataset }) {
  const { policies, at, moment } = dataset
  return { policy: policies.split(" ")[0], at: at.split(",").map(Number), moment }
}

/** Text and explorer. */
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
    const hooks = { bare: true, settled, told: () => this.say() }
    this.view = new Explorer(root.querySelector(".view"), scene, hooks)
    root.classList.add("live")
    root.querySelector("[data-http]").hidden = !location.protocol.startsWith("http")
    this.listen()
    this.follow()
  }
  listen() {
    for (const section of this.sections)
      section.addEventListener("focusin", () => {
        this.held = performance.now()
        this.enter(section)
      })
    const begun = section => section.getBoundingClientRect().top < 0.55 * innerHeight
    addEventListener("scroll", () => {
      if (performance.now() - this.held < 200) return // a focus has scrolled
      const section = this.sections.findLast(begun)
      if (section && section !== this.section) this.enter(section)
    })
    this.root.addEventListener("click", ({ target }) => {
      const pressed = target.closest("[data-act]")
      if (pressed) this.act(pressed, ...pressed.dataset.act.split(" "))
    })
    this.root.addEventListener("input", ({ target }) => {
      const { stops } = target.dataset
      if (stops) this.act(target, "policy", stops.split(" ")[target.value])
    })
    const { canvas } = this.view
    for (const kind of ["pointerdown", "keydown"])
      canvas.addEventListener(kind, ({ key }) =>
        key === "Escape" ? this.section?.querySelector(".skip").focus() : this.wake(),
      )
    for (const task of this.root.querySelectorAll(".do")) {
      const skip = button("to the picture (arrows; Escape: back)", () => canvas.focus())
      skip.className = "skip"
      task.append(skip)
    }
    addEventListener("popstate", () => this.follow())
    addEventListener("beforeprint", () => {
      for (const output of this.root.querySelectorAll("output")) output.value = output.defaultValue
    })
    addEventListener("afterprint", () => this.say())
  }
  /** A part of the data, loaded once. */
  part(name) {
    this.parts[name] ??= data(name).catch(() => {
      delete this.parts[name]
      this.status.textContent = UNLOADED
    })
    return this.parts[name]
  }
  /** Load the network when a reader asks it. Before that, its arrows and one episode are known. */
  async wake() {
    const { teacher } = this.policies
    if (this.section?.id !== "teacher" || !teacher.episode) return
    teacher.episode = { states: [] } // of another start nothing is known yet
    const stored = await this.part("teacher")
    if (stored && teacher.episode) Object.assign(teacher, network(stored), { episode: null })
    this.view.changed()
  }

  // -- Scenes
  /** Show a section's scene: as `state` says, as the reader left it, or as it is at first. */
  enter(section, state, put) {
    if (this.section === section && !state && this.entering) return this.entering
    this.remember()
    Object.assign(this, { section, staging: true })
    this.status.textContent = ""
    for (const one of this.sections) one.classList.toggle("active", one === section)
    this.entering = this.stage(section, state ?? this.left[section.id] ?? firstOf(section), put)
    return this.entering
  }
  async stage(section, { policy, at, moment, zoomed = false, numbers }, put) {
    const { view } = this,
      { needs, ...about } = section.dataset,
      names = needs?.split(" ") ?? [],
      loaded = await Promise.all(names.map(name => this.part(name)))
    if (policy === "teacher" && String(at) !== about.at) await this.wake()
    if (this.section !== section) return // gone on
    if (loaded.includes(undefined)) return (this.entering = null)
    const { run, visited, proofs } = Object.fromEntries(names.map((name, i) => [name, loaded[i]]))
    const { states, actions } = visited ?? {}
    if (states) this.visited ??= { states: pairs(states), actions: pairs(actions) }
    if (run) this.takeRun(run)
    const proof = proofs?.[policy]
    Object.assign(this, { zoomed, proved: proof?.polygons ?? null })
    const [low, high] = zoomed && proof ? proof.box : [this.scene.plane.low, this.scene.plane.high]
    view.picture.plane = { ...this.scene.plane, low, high }
    Object.assign(view, { fixed: "fixed" in about, starts: !proof, asked: at })
    view.show(this.policies[policy], numbers)
    if (view.run && moment !== undefined) view.replay.to(+moment)
    view.regions = this.same ? this.proved : null
    this.arrange(section, policy)
    this.staging = false
    this.keep(put ?? (this.gestured ? history.pushState : history.replaceState))
    this.gestured = put === history.pushState
  }
  /** Put the controls into a section, and set its own. */
  arrange(section, policy) {
    const { replay, form, backs } = this.view,
      slots = { replay: [replay.row], form: [form, backs] }
    for (const slot of section.querySelectorAll("[data-slot]"))
      // What stays keeps the focus
      for (const part of slots[slot.dataset.slot]) if (part.parentNode !== slot) slot.append(part)
    for (const one of section.querySelectorAll("[data-stops]")) {
      one.value = one.dataset.stops.split(" ").indexOf(policy)
      one.setAttribute("aria-valuetext", count(this.view.cells, "cell"))
    }
  }
  takeRun(stored) {
    const { run } = this.policies
    if (run.replay) return
    run.replay = replayOf(stored)
    Object.assign(run.replay.at(-1), this.view.numbers(run)) // exact, unlike those of the moments
    run.limits = { split: stored.split, merge: stored.merge }
  }
  /** Whether the policy is as it was: not one that the reader has changed. */
  get same() {
    const { view } = this
    return JSON.stringify(view.numbers()) === JSON.stringify(view.numbers(view.original))
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
  follow() {
    const hash = location.hash.replaceAll("%2C", ",") // as some programs write it
    const policies = ({ id, dataset }) => [id, dataset.policies.split(" ")],
      sections = Object.fromEntries(this.sections.map(policies))
    const state = read(hash, sections, this.scene.moments),
      named = state?.section ?? hash.slice(1),
      known = this.sections.find(({ id }) => id === named)
    if (!known && document.getElementById(named))
      // another part of the page
      return this.section ?? this.enter(this.sections[0])
    const section = known ?? this.sections[0]
    if (hash || this.section) section.scrollIntoView()
    if (this.section) this.held = performance.now()
    this.enter(section, state ?? firstOf(section), history.replaceState)
    if (hash && !known) this.status.textContent = UNREAD
  }

  // -- What buttons do
  async act(pressed, verb, what) {
    await this.enter(pressed.closest("section"))
    const { view, section } = this
    if (this.staging) return
    const scene = to =>
      this.enter(section, { at: view.asked, policy: what, ...to }, history.pushState)
    if (verb === "policy") await scene({ moment: section.dataset.moment })
    else if (verb === "zoom")
      await scene({ at: (await this.part("proofs"))[what].at, zoomed: true })
    else if (verb === "reset") view.take(view.original)
    else if (verb === "refit") {
      view.redo() // just entered, it waits for a frame
      view.judge()
      const cells = what === "cell" ? [view.cell] : undefined
      view.take({ ...view.policy, coefficients: refit(view.policy, this.visited, cells) })
    } else await this.copy(pressed, what)
  }
  async copy(pressed, what) {
    const { href } = location,
      frame = `<iframe src="${href}" allow="clipboard-write" width="100%" height="800"></iframe>`,
      text = what === "link" ? href : frame
    try {
      await navigator.clipboard.writeText(text)
      pressed.textContent = `${what} copied`
    } catch {
      this.status.textContent = text
    }
  }

  // -- What the text says of the picture
  say() {
    const { view, section } = this
    if (!section || this.staging || !view.played.states.length) return
    if (this.proved && !this.same) view.regions = null // they are not proved for another policy
    const { results, policy, cell, cells } = view
    if (this.visited && !policy.layers && this.rated !== view.kept) {
      this.r2 = this.same ? view.original.r2 : rSquared(this.scene, policy, this.visited)
      this.rated = view.kept
    }
    const here = [...view.failing.values()].filter(last => last === cell).length,
      { failures, mean } = results,
      known = { cell, cells, failures, here, episode: view.from.textContent }
    Object.assign(known, { mean: mean.toFixed(2), r2: this.r2?.toFixed(2) })
    for (const output of section.querySelectorAll("output")) {
      const now = minus(known[output.dataset.say] ?? output.value)
      if (output.value !== now) output.value = now
    }
    const scale = this.root.querySelector(".scale"),
      { low, high } = scale.dataset
    scale.firstChild.style.setProperty("--score", (mean - low) / (high - low))
  }
}

export const begin = async () =>
  new Article(document.querySelector(".vsp-article"), await data("scene"))
