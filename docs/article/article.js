// @ts-check
// Text and explorer act on each other. Attributes say which scene a section has, what buttons do
// (`data-act`), and which number an output repeats (`data-say`).

import { Explorer } from "../../vsp/show/explorer/explorer.js"
import { floats, network, rSquared, refit } from "../../vsp/show/explorer/model.js"
import { button, count, minus } from "../../vsp/show/explorer/controls.js"
import { read, write } from "./address.js"

const UNLOADED = "A part of the page could not be loaded. Try again."
const UNREAD = "This link is damaged or from a newer version. So here is the first picture."

/** @type {(root: ParentNode, selector: string) => HTMLElement} */
const one = (root, selector) => /** @type {HTMLElement} */ (root.querySelector(selector))
/** @type {(root: ParentNode, selector: string) => HTMLElement[]} */
const all = (root, selector) => Array.from(root.querySelectorAll(selector))
const words = (/** @type {string | undefined} */ text) => text?.split(" ") ?? []

/** A part of the data, in the page or beside it.
 * @template {keyof Parts} N @param {N} name @returns {Promise<Parts[N]>} */
async function data(name) {
  const inner = one(document, `#article-${name}`)
  if (inner.textContent) return JSON.parse(inner.textContent)
  return (await fetch(String(inner.dataset.source))).json()
}

/** Stored numbers, two by two. @param {string} text */
function pairs(text) {
  const numbers = floats(text)
  return Array.from({ length: numbers.length / 2 }, (_, i) => [numbers[2 * i], numbers[2 * i + 1]])
}

/** The moments of the stored run. @param {StoredRun} stored @returns {Moment[]} */
function replayOf({ n, cells, codewords, coefficients, events }) {
  const rows = pairs(coefficients),
    places = new Map(codewords)
  let [at, placed] = [0, /** @type {Vector[]} */ ([])]
  return n.map((iteration, i) => {
    placed = places.get(i) ?? placed
    const maps = Array.from({ length: cells[i] }, () => rows.slice(at, (at += 3))),
      happened = events.filter(event => event.n === iteration)
    return { n: iteration, codewords: placed, coefficients: maps, events: happened }
  })
}

/** The scene of a section as it is at first. @param {HTMLElement} section @returns {State} */
function firstOf({ dataset }) {
  const { policies, at, moment } = dataset
  return { policy: words(policies)[0], at: String(at).split(",").map(Number), moment }
}

/** Text and explorer. */
class Article {
  /** @type {Record<string, Promise<unknown>>} */ parts = {}
  /** @type {Record<string, State>} */ left = {} // the scenes of sections that a reader has left
  /** @type {HTMLElement | undefined} */ section
  /** @type {Promise<void> | null} */ entering = null
  staging = false // whether a scene is being set
  begun = false
  gestured = false
  zoomed = false
  held = -Infinity // when a focus scrolled
  /** @type {Vector[] | null} */ proved = null // failing starts of the policy as it was
  /** @type {Visited | undefined} */ visited // states, and the teacher's actions there
  /** @type {number | undefined} */ r2
  /** @type {Partial<Numbers> | undefined} */ rated // the numbers that have this R²

  /** @param {HTMLElement} root @param {Parts["scene"]} scene */
  constructor(root, scene) {
    this.root = root
    this.scene = scene
    this.policies = Object.fromEntries(scene.policies.map(policy => [String(policy.id), policy]))
    this.sections = all(root, "section[data-policies]")
    this.status = one(root, ".status")
    const settled = () => {
      this.keep()
      this.gestured = true
    }
    const hooks = { bare: true, settled, told: () => this.say() }
    this.view = new Explorer(one(root, ".view"), scene, hooks)
    root.classList.add("live")
    one(root, "[data-http]").hidden = !location.protocol.startsWith("http")
    this.listen()
    this.follow()
  }
  listen() {
    for (const section of this.sections)
      section.addEventListener("focusin", () => {
        this.held = performance.now()
        this.enter(section)
      })
    const begun = (/** @type {Element} */ section) =>
      section.getBoundingClientRect().top < 0.55 * innerHeight
    addEventListener("scroll", () => {
      if (performance.now() - this.held < 200) return // a focus has scrolled
      const section = this.sections.findLast(begun)
      if (section && section !== this.section) this.enter(section)
    })
    this.root.addEventListener("click", event => {
      const target = /** @type {Element} */ (event.target),
        pressed = /** @type {HTMLElement | null} */ (target.closest("[data-act]"))
      if (pressed) this.act(pressed, ...words(pressed.dataset.act))
    })
    this.root.addEventListener("input", event => {
      const target = /** @type {HTMLInputElement} */ (event.target),
        { stops } = target.dataset
      if (stops) this.act(target, "policy", words(stops)[+target.value])
    })
    const { canvas } = this.view
    canvas.addEventListener("pointerdown", () => this.wake())
    canvas.addEventListener("keydown", ({ key }) => {
      if (key !== "Escape") this.wake()
      else if (this.section) one(this.section, ".skip").focus()
    })
    for (const task of all(this.root, ".do")) {
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
  /** A part of the data, loaded once.
   * @template {keyof Parts} N @param {N} name @returns {Promise<Parts[N] | undefined>} */
  part(name) {
    const { parts } = this
    parts[name] ??= data(name).catch(() => {
      delete parts[name]
      this.status.textContent = UNLOADED
    })
    return /** @type {Promise<Parts[N] | undefined>} */ (parts[name])
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
  /** Show a section's scene: as `state` says, as the reader left it, or as it is at first.
   * @param {HTMLElement} section @param {State} [state] @param {Put} [put] */
  enter(section, state, put) {
    if (this.section === section && !state && this.entering) return this.entering
    this.remember()
    Object.assign(this, { section, staging: true })
    this.status.textContent = ""
    for (const each of this.sections) each.classList.toggle("active", each === section)
    this.entering = this.stage(section, state ?? this.left[section.id] ?? firstOf(section), put)
    return this.entering
  }
  /** @param {HTMLElement} section @param {State} state @param {Put} [put] */
  async stage(section, { policy, at, moment, zoomed = false, numbers }, put) {
    const { view } = this,
      { needs, ...about } = section.dataset,
      names = /** @type {(keyof Parts)[]} */ (words(needs)),
      loaded = await Promise.all(names.map(name => this.part(name)))
    if (policy === "teacher" && String(at) !== about.at) await this.wake()
    if (this.section !== section) return // gone on
    if (loaded.includes(undefined)) {
      this.entering = null
      return
    }
    /** @type {Partial<Parts>} */
    const { run, visited, proofs } = Object.fromEntries(names.map((name, i) => [name, loaded[i]]))
    if (visited) this.visited ??= { states: pairs(visited.states), actions: pairs(visited.actions) }
    if (run) this.takeRun(run)
    const proof = proofs?.[policy]
    Object.assign(this, { zoomed, proved: proof?.polygons ?? null })
    const [low, high] = zoomed && proof ? proof.box : [this.scene.plane.low, this.scene.plane.high]
    view.picture.plane = { ...this.scene.plane, low, high }
    Object.assign(view, { fixed: "fixed" in about, starts: !proof, asked: at })
    view.show(this.policies[policy], numbers)
    if (view.run.length && moment !== undefined) view.replay.to(+moment)
    view.regions = this.same ? this.proved : null
    this.arrange(section, policy)
    this.staging = false
    this.keep(put ?? (this.gestured ? history.pushState : history.replaceState))
    this.gestured = put === history.pushState
  }
  /** Put the controls into a section, and set its own.
   * @param {HTMLElement} section @param {string} policy */
  arrange(section, policy) {
    const { replay, form, backs } = this.view,
      slots = new Map(Object.entries({ replay: [replay.row], form: [form, backs] }))
    for (const slot of all(section, "[data-slot]"))
      // What stays keeps the focus
      for (const part of slots.get(String(slot.dataset.slot)) ?? [])
        if (part.parentNode !== slot) slot.append(part)
    for (const slider of /** @type {HTMLInputElement[]} */ (all(section, "[data-stops]"))) {
      slider.value = String(words(slider.dataset.stops).indexOf(policy))
      slider.setAttribute("aria-valuetext", count(this.view.cells, "cell"))
    }
  }
  takeRun(/** @type {StoredRun} */ stored) {
    const { run } = this.policies
    if (run.replay) return
    const replay = (run.replay = replayOf(stored))
    Object.assign(replay[replay.length - 1], this.view.numbers(run)) // exact, unlike the others
    run.limits = { split: stored.split, merge: stored.merge }
  }
  /** Whether the policy is as it was: not one that the reader has changed. */
  get same() {
    const { view } = this
    return JSON.stringify(view.numbers()) === JSON.stringify(view.numbers(view.original))
  }
  /** @returns {State} */
  stateOf(/** @type {HTMLElement} */ section) {
    const { view, zoomed } = this,
      replayed = section.querySelector("[data-slot=replay]"),
      shown = { section: section.id, policy: String(view.original.id), at: view.asked, zoomed }
    if (replayed) return { ...shown, moment: view.replay.at }
    return { ...shown, numbers: this.same ? undefined : view.numbers() }
  }
  remember() {
    if (this.section && !this.staging) this.left[this.section.id] = this.stateOf(this.section)
  }
  /** Remember the scene, and write it into the address: after a gesture, to come back from. */
  keep(put = history.pushState) {
    if (!this.section || this.staging) return
    this.remember()
    const address = write(this.stateOf(this.section))
    if (address !== location.hash && this.begun) put.call(history, null, "", address)
    this.begun = true // the first scene keeps the page's own address
  }
  /** Show what the address says: a state, a section, or the first scene. */
  follow() {
    const hash = location.hash.replaceAll("%2C", ",") // as some programs write it
    const policies = this.sections.map(({ id, dataset }) => [id, words(dataset.policies)]),
      sections = Object.fromEntries(policies)
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
  /** @param {HTMLElement} pressed @param {string[]} words */
  async act(pressed, ...[verb, what]) {
    await this.enter(/** @type {HTMLElement} */ (pressed.closest("section")))
    const { view, section } = this
    if (!section || this.staging) return
    const scene = (/** @type {Partial<State>} */ to) =>
      this.enter(section, { at: view.asked, policy: what, ...to }, history.pushState)
    if (verb === "policy") await scene({ moment: section.dataset.moment })
    else if (verb === "zoom")
      await scene({ at: (await this.part("proofs"))?.[what].at, zoomed: true })
    else if (verb === "reset") view.take(view.original)
    else if (verb === "refit") this.refit(what === "cell")
    else await this.copy(pressed, what)
  }
  refit(/** @type {boolean} */ here) {
    const { view, visited } = this
    view.redo() // just entered, it waits for a frame
    view.judge()
    if (view.policy.layers || !visited) return
    const coefficients = refit(view.policy, visited, here ? [view.cell] : undefined)
    view.take({ ...view.policy, coefficients })
  }
  /** @param {HTMLElement} pressed @param {string} what */
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
      rounded = { mean: mean.toFixed(2), r2: this.r2?.toFixed(2) },
      about = { cell, cells, failures, here, episode: view.from.textContent, ...rounded },
      known = new Map(Object.entries(about))
    for (const output of section.querySelectorAll("output")) {
      const now = minus(String(known.get(String(output.dataset.say)) ?? output.value))
      if (output.value !== now) output.value = now
    }
    const scale = one(this.root, ".scale"),
      [low, high] = [scale.dataset.low, scale.dataset.high].map(Number),
      score = String((mean - low) / (high - low))
    one(scale, "*").style.setProperty("--score", score)
  }
}

export const begin = async () => new Article(one(document, ".vsp-article"), await data("scene"))
