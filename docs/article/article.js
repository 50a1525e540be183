// @ts-check
// Text and explorer act on each other. Attributes say which scene a section has, what buttons do
// (`data-act`), and which number an output repeats (`data-say`).

import { Explorer } from "../../vsp/show/explorer/explorer.js"
import { floats, network, rSquared, refit } from "../../vsp/show/explorer/model.js"
import { button, count, minus, one, textOf } from "../../vsp/show/explorer/controls.js"
import { Distiller } from "../../vsp/show/explorer/distiller.js"

import { read, write } from "./address.js"
import { Opening } from "./opening.js"

const ZOOM = 1500 // milliseconds
const NARROW = 800 // pixels: here the picture is above the text (article.css)
const UNLOADED = "A part of the page could not be loaded. Try again."
const UNREAD = "This link is damaged or from a newer version. So here is the first picture."
const WON = "No failure. Now the return."
const BEATEN = "No failure, and more than section 5: send it!"

/** @type {(root: ParentNode, selector: string) => HTMLElement[]} */
const all = (root, selector) => Array.from(root.querySelectorAll(selector))
const words = (/** @type {string | undefined} */ text) => text?.split(" ") ?? []

/** A part of the data, in the page or beside it.
 * @template {keyof Parts} N @param {N} name @returns {Promise<Parts[N]>} */
async function data(name) {
  const inner = one(document, `#article-${name}`)
  return JSON.parse(await textOf(inner, inner.dataset.source))
}

/** Stored numbers, two by two. @param {string} text */
function pairs(text) {
  const numbers = floats(text)
  return Array.from({ length: numbers.length / 2 }, (_, i) => [numbers[2 * i], numbers[2 * i + 1]])
}

/** The moments of the stored run. @param {StoredRun} stored @returns {Moment[]} */
function replayOf({ n, cells, codewords, coefficients, events, failures }) {
  const rows = pairs(coefficients),
    places = new Map(codewords)
  let [at, placed] = [0, /** @type {Vector[]} */ ([])]
  return n.map((iteration, i) => {
    placed = places.get(i) ?? placed
    const maps = Array.from({ length: cells[i] }, () => rows.slice(at, (at += 3))),
      happened = events.filter(event => event.n === iteration)
    const numbers = { codewords: placed, coefficients: maps }
    return { n: iteration, ...numbers, events: happened, failures: failures[i] }
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
  /** @type {Record<string, State>} */ left = {} // the scenes of sections, as a reader left them
  /** @type {HTMLElement | undefined} */ section
  /** @type {Promise<void> | null} */ entering = null
  staging = false // whether a scene is being set
  begun = false
  gestured = false
  zoomed = false
  held = -Infinity // when a focus scrolled
  /** @type {Vector[] | null} */ proved = null // failing starts of the policy as it was
  /** @type {Visited | undefined} */ visited // states, and the teacher's actions there

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
      this.tell("gesture")
    }
    const hooks = { bare: true, settled, told: () => this.say() }
    this.view = new Explorer(one(root, ".view"), scene, hooks)
    root.classList.add("live")
    new Opening(one(root, ".opening"), scene, /** @type {Linear} */ (this.policies.faithful_3))
    this.listen()
    this.follow()
  }
  listen() {
    const { root, sections, view: { canvas } } = this
    for (const section of sections)
      section.addEventListener("focusin", () => {
        this.held = performance.now()
        this.enter(section)
      })
    addEventListener("scroll", () => {
      if (performance.now() - this.held < 200) return // a focus has scrolled
      const line = (innerWidth < NARROW ? 0.6 : 0.4) * innerHeight,
        section = sections.findLast(each => each.getBoundingClientRect().top < line)
      if (section && section !== this.section) this.enter(section)
    })
    for (const pressed of all(root, "[data-act]"))
      pressed.addEventListener("click", () => this.act(pressed, ...words(pressed.dataset.act)))
    const slider = /** @type {HTMLInputElement} */ (one(root, "[data-stops]")),
      stops = words(slider.dataset.stops)
    slider.addEventListener("input", () => this.act(slider, "policy", stops[+slider.value]))
    canvas.addEventListener("focus", () => this.section ?? this.enter(sections[0]))
    canvas.addEventListener("keydown", ({ key }) => {
      if (key === "Escape" && this.section) one(this.section, ".skip").focus()
    })
    for (const task of all(root, ".do")) {
      const skip = button("to the picture (arrows; Escape: back)", () => canvas.focus())
      skip.className = "skip"
      task.append(skip)
    }
    addEventListener("popstate", () => this.follow())
    addEventListener("beforeprint", () => {
      for (const output of root.querySelectorAll("output")) output.value = output.defaultValue
    })
    addEventListener("afterprint", () => this.say())
  }
  /** A part of the data, loaded once.
   * @template {keyof Parts} N @param {N} name @returns {Promise<Parts[N] | undefined>} */
  part(name) {
    this.parts[name] ??= data(name).catch(() => {
      delete this.parts[name]
      this.entering = null
      this.status.textContent = UNLOADED
    })
    return /** @type {Promise<Parts[N] | undefined>} */ (this.parts[name])
  }

  // -- Scenes
  /** Show a section's scene: as `state` says, as the reader left it, or as it is at first.
   * @param {HTMLElement} section @param {State} [state] @param {Put} [put] */
  enter(section, state, put) {
    if (this.section === section && !state && this.entering) return this.entering
    this.remember()
    Object.assign(this, { section, staging: true })
    if (!this.distiller?.run.policy) this.distiller?.stop() // else it goes on
    this.status.textContent = ""
    for (const each of this.sections) each.classList.toggle("active", each === section)
    this.entering = this.stage(section, state ?? this.left[section.id] ?? firstOf(section), put)
    return this.entering
  }
  /** @param {HTMLElement} section @param {State} state @param {Put} [put] */
  async stage(section, { policy, at, moment, zoomed = false, numbers, own }, put) {
    const { view, scene } = this
    /** @type {<N extends keyof Parts>(name: N) => Promise<Parts[N] | undefined> | null} */
    const load = name => (words(section.dataset.needs).includes(name) ? this.part(name) : null)
    const loaded = await Promise.all(
      /** @type {const} */ ([load("run"), load("visited"), load("proofs"), load("teacher")]),
    )
    if (this.section !== section || loaded.includes(undefined)) return // gone on, or without them
    const [run, visited, proofs, teacher] = loaded
    // Before that, its arrows and one episode are known
    if (teacher) Object.assign(this.policies.teacher, network(teacher), { episode: null })
    if (visited) this.visited ??= { states: pairs(visited.states), actions: pairs(visited.actions) }
    if (run) this.takeRun(run)
    const proof = proofs?.[policy]
    Object.assign(this, { zoomed, proved: proof?.polygons ?? null })
    const [low, high] = zoomed && proof ? proof.box : [scene.plane.low, scene.plane.high],
      small = proof && proof.box[1][0] - proof.box[0][0] < 0.1,
      moves = view.original.id === policy && put && !view.replay.slow
    view.zoom({ low, high }, moves ? ZOOM : 0)
    view.ring = small && !zoomed ? proof.at : null
    Object.assign(view, { fixed: Boolean(section.dataset.fixed), starts: !proof, asked: at })
    view.show((own && this.distiller?.run.policy) || this.policies[policy], numbers)
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
    const { replay, form, backs, cells } = this.view,
      distil = this.distiller ? [this.distiller.row] : [],
      slots = new Map(Object.entries({ replay: [replay.row], form: [form, backs], distil }))
    for (const slot of all(section, "[data-slot]"))
      // What stays keeps the focus
      for (const part of slots.get(String(slot.dataset.slot)) ?? [])
        if (part.parentNode !== slot) slot.append(part)
    for (const slider of /** @type {HTMLInputElement[]} */ (all(section, "[data-stops]"))) {
      slider.value = String(words(slider.dataset.stops).indexOf(policy))
      slider.setAttribute("aria-valuetext", count(cells, "cell"))
    }
  }
  takeRun(/** @type {StoredRun} */ stored) {
    const { run } = this.policies
    if (run.replay) return
    run.replay = replayOf(stored)
    Object.assign(run.replay[run.replay.length - 1], this.view.numbers(run)) // exact, not as others
    run.limits = stored.config
    this.distiller = new Distiller(this.view, stored.config, {}, () => this.part("teacher"))
  }
  /** What a section tells comes after a gesture, or after the one that it names.
   * @param {string} done */
  tell(done) {
    const { section } = this
    if (section && done === (section.dataset.tells ?? done)) section.classList.add("done")
  }
  /** Whether the policy is as it was: not one that the reader has changed. */
  get same() {
    const { view } = this
    return JSON.stringify(view.numbers()) === JSON.stringify(view.numbers(view.original))
  }
  /** Remember the scene of a section. */
  remember() {
    const { view, zoomed, section } = this
    if (!section || this.staging) return
    const { id = "run" } = view.original, // or the run that the reader has made
      shown = { section: section.id, policy: id, at: view.asked, zoomed, own: !view.original.id },
      replayed = section.querySelector("[data-slot=replay]"),
      numbers = this.same ? undefined : view.numbers()
    this.left[section.id] = { ...shown, ...(replayed ? { moment: view.replay.at } : { numbers }) }
  }
  /** Remember the scene, and write it into the address: after a gesture, to come back from. */
  keep(put = history.pushState) {
    if (!this.section || this.staging) return
    this.remember()
    const address = write(this.left[this.section.id])
    if (address !== location.hash && this.begun) put.call(history, null, "", address)
    this.begun = true // the first scene keeps the page's own address
  }
  /** Show what the address says: a state, a section, or the first scene. */
  follow() {
    const hash = location.hash.replaceAll("%2C", ","), // as some programs write it
      policies = this.sections.map(({ id, dataset }) => [id, words(dataset.policies)]),
      state = read(hash, Object.fromEntries(policies), this.scene.moments),
      named = state?.section ?? hash.slice(1),
      known = this.sections.find(({ id }) => id === named),
      section = known ?? this.sections[0]
    // Another part of the page
    if (!known && document.getElementById(named)) return this.section ?? this.enter(section)
    if (!hash && !this.section) return void (this.begun = true) // nothing loads
    section.scrollIntoView()
    if (this.section) this.held = performance.now()
    this.enter(section, state ?? firstOf(section), history.replaceState)
    if (hash && !known) this.status.textContent = UNREAD
  }

  // -- What buttons do
  /** @param {HTMLElement} pressed @param {string[]} words */
  async act(pressed, ...[verb, what]) {
    const section = /** @type {HTMLElement} */ (pressed.closest("section"))
    await this.enter(section)
    const { view } = this
    if (section !== this.section || this.staging) return
    this.tell(`${verb} ${what}`)
    const scene = (/** @type {Partial<State>} */ to) =>
      this.enter(section, { at: view.asked, policy: what, ...to }, history.pushState)
    if (verb === "policy") await scene({ moment: section.dataset.moment })
    else if (verb === "zoom")
      await scene({ at: (await this.part("proofs"))?.[what].at, zoomed: true })
    else if (verb === "reset") view.take(view.original)
    else if (verb === "refit") this.refit(what === "cell")
    else if (verb === "copy") this.copy(pressed)
    else if (verb === "guess") {
      section.dataset.guess = what
      one(section, ".guess").textContent = `You said: the ${what}. `
    }
  }
  refit(/** @type {boolean} */ here) {
    const { view, visited } = this
    view.redo() // just entered, it waits for a frame
    view.judge()
    if (view.policy.layers || !visited) return
    view.take({ coefficients: refit(view.policy, visited, here ? [view.cell] : undefined) })
  }
  /** @param {HTMLElement} pressed */
  copy(pressed) {
    const copied = () => (pressed.textContent = "link copied"),
      forbidden = () => (this.status.textContent = location.href)
    ;(navigator.clipboard?.writeText(location.href) ?? Promise.reject()).then(copied, forbidden)
  }

  // -- What the text says of the picture
  say() {
    const { view, section } = this
    if (!section || this.staging || !view.played.states.length) return
    if (this.proved && !this.same) view.regions = null // they are not proved for another policy
    const { policy, cells } = view,
      { failures, mean, played } = view.results,
      { visited } = this,
      r2 = visited && !this.same ? rSquared(this.scene, policy, visited) : view.original.r2,
      rounded = { mean: mean.toFixed(2), exactly: mean.toFixed(3), r2: r2?.toFixed(2) },
      about = { cells, failures, ...rounded },
      known = new Map(Object.entries({ ...about, episode: view.from.textContent }))
    for (const output of section.querySelectorAll("output")) {
      const now = minus(String(known.get(String(output.dataset.say)) ?? output.value))
      if (output.value !== now) output.value = now
    }
    const [scale, won] = [".scale", ".won"].map(selector => one(this.root, selector)),
      done = !failures && played === this.scene.starts.length && section.id === "you"
    one(scale, ".own").style.setProperty("--score", String(mean))
    scale.classList.toggle("near", done)
    won.textContent = done ? (mean.toFixed(3) > String(won.dataset.aim) ? BEATEN : WON) : ""
  }
}

/** Begin the page. */
export async function begin() {
  return new Article(one(document, ".vsp-article"), await data("scene"))
}
