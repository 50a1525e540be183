// The scripts by themselves: what needs neither Python nor a browser. `make test-js` runs it.

import assert from "node:assert/strict"
import { execFileSync } from "node:child_process"
import { existsSync, mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs"
import inspector from "node:inspector"
import { tmpdir } from "node:os"
import { test } from "node:test"
import { fileURLToPath } from "node:url"

const ROOT = new URL("../../", import.meta.url)
const NAMES = ["model", "controls", "picture", "texts", "episodes", "explorer", "algorithms", "worker", "distiller", "workbench"] // use those before
const EXPLORER = NAMES.map(name => `vsp/show/explorer/${name}.js`)
const ARTICLE = ["address", "opening", "article"].map(name => `docs/article/${name}.js`)
const LIVE = ["studies", "live"].map(name => `vsp_course/live/${name}.js`)
const SCRIPTS = [...EXPLORER, ...ARTICLE, "docs/static/site.js", ...LIVE]
const BUNDLES = ["vsp/show/explorer/explorer", "docs/article/article", "vsp_course/live/live", "vsp/show/explorer/workbench"].map(
  name => `${name}.bundle.js`,
)
const skip = !existsSync(at("docs/node_modules")) && "it needs `npm --prefix docs ci`"

function at(path) {
  return new URL(path, ROOT)
}
const textOf = path => readFileSync(at(path), "utf8")
const npm = (...words) =>
  execFileSync("npm", ["--prefix", fileURLToPath(at("docs")), "run", "-s", ...words])

const [model, controls, picture, texts, { Episodes, differs }, , algorithms, , , workbench, address, studies] = await Promise.all(
  [...EXPLORER, ARTICLE[0], LIVE[0]].map(path => import(at(path))),
)

/** Numbers from 0 to 1, the same each time (a linear congruential generator). */
function random(seed) {
  return () => (seed = (seed * 1664525 + 1013904223) % 2 ** 32) / 2 ** 32
}
function voronoi(draw, k, about) {
  const codewords = Array.from({ length: k }, () => [draw(), draw(), draw()])
  return { codewords, scale: [1, 0.5, 2], coefficients: [], ...about }
}
/** The cell by the distance as it is defined. */
function nearest({ codewords, scale }, seen, p) {
  const gaps = word => word.map((value, i) => Math.abs(seen[i] - value) / scale[i])
  const far = codewords.map(word =>
    p === Infinity
      ? Math.max(...gaps(word))
      : gaps(word).reduce((sum, gap) => sum + gap ** p, 0) ** (1 / p),
  )
  return far.indexOf(Math.min(...far))
}

// What the model computes

for (const order of [0.5, 1, 1.5, 2, 3, 10, null])
  test(`the nearest codeword by the Minkowski distance of order ${order}`, () => {
    const draw = random(1)
    for (const k of [1, 2, 30]) {
      const policy = model.ready(voronoi(draw, k, { metric: "minkowski", order }))
      for (let n = 0; n < 2000; n++) {
        const seen = [draw(), draw(), draw()],
          cell = nearest(policy, seen, order ?? Infinity)
        for (const slack of [0, 1e-9]) assert.equal(model.cellOf(policy, seen, slack), cell)
      }
    }
  })

test("a metric without an order is one of three, and gives the same distances to the bit", () => {
  for (const [metric, order] of Object.entries({ manhattan: 1, euclidean: 2, chebyshev: null })) {
    const [named, ordered] = [{ metric }, { metric, order }].map(about =>
      model.ready(voronoi(random(2), 9, about)),
    )
    for (const policy of [named, ordered]) model.cellOf(policy, [0.3, 0.4, 0.5])
    assert.deepEqual(named.far, ordered.far)
  }
  assert.throws(() => model.ready(voronoi(random(2), 9, { metric: "cosine" })), /cosine/)
})

test("the polygon of a cell holds the states that are nearest to its codeword, and no others", () => {
  const draw = random(3),
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
  for (const k of [2, 3, 12]) {
    const words = Array.from({ length: k }, () => [3 * draw() - 1, draw()]), // also outside
      policy = model.ready({ codewords: words, scale: [0.5, 2], metric: "euclidean" })
    const shapes = words.map(word =>
      words.reduce((left, other) => picture.nearer(left, word, other, policy.scale), square),
    )
    for (let n = 0; n < 1000; n++) {
      const [x, y] = [draw(), draw()],
        left = ([ax, ay], [bx, by]) => (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0,
        inside = shape => shape.length > 0 && shape.every((a, i) => left(a, shape[(i + 1) % shape.length]))
      assert.deepEqual(shapes.map(inside).indexOf(true), model.cellOf(policy, [x, y]))
    }
  }
})

test("a codeword keeps its number and colour for life, unlike those that live nearby", () => {
  const named = model.births([1, 2]),
    words = Array.from({ length: 8 }, (_, i) => [i / 8, (i * 3) % 2]),
    split = codeword => ({ kind: "split", codeword, cause: 1 })
  const all = named(words, words.slice(1).map(split))
  assert.deepEqual(all, { born: [0, 1, 2, 3, 4, 5, 6, 7], tints: [0, 1, 2, 3, 4, 5, 6, 7] })
  const [, , ...later] = words.map(word => word.map(value => value + 5e-5)), // rounded
    gone = [0.4, 0.9] // born and merged at once
  const now = named([...later, [0.9, 0.9]], [split(gone), split([0.9, 0.9])])
  assert.deepEqual(now.born, [2, 3, 4, 5, 6, 7, 9])
  assert.deepEqual(now.tints, [2, 3, 4, 5, 6, 7, 2])
  const next = named([...later, [0.9, 0.9], [0.3, 0.3], [0.26, 0]]) // as near to cell 2
  assert.deepEqual([next.tints[7], next.tints[8]], [0, 1])
})

// What is said

test("what is said of results and changes", () => {
  const told = { policy: {}, scene: { starts: [0, 1, 2], lost: [2], teacher: { mean: 2 } } },
    results = { played: 3, failures: 2, mean: -1.5 },
    base = { failures: 1, mean: -1 },
    split = { kind: "split", codeword: [0.5, -0.25], cause: 0.0123 },
    merge = { ...split, kind: "merge" },
    where = "at (0.50, −0.25): "
  assert.deepEqual([-1e-5, -1.5].map(controls.digits), ["0.000", "−1.500"])
  for (const [said, expected] of [
    [
      texts.resultOf({ ...told, results }),
      "2 of 3 fail, mean return −1.50 (teacher 2.00).",
    ],
    [
      texts.resultOf({ ...told, results, base }),
      "1 → 2 of 3 fail, mean return −1.00 → −1.50.",
    ],
    [
      texts.resultOf({ policy: {}, scene: { ...told.scene, lost: [], teacher: null }, results: { ...results, played: 1 } }),
      "mean return about −1.50.",
    ],
    [texts.causeOf(split), `split ${where}loss 0.0123; the new map was untrained`],
    [texts.causeOf(split, { max_pol_loss: 0.01 }), `split ${where}loss 0.0123, above 0.01; the new map was untrained`],
    [texts.causeOf(merge, { min_param_distance: 0.02 }), `merge ${where}maps differ by 0.0123, below 0.02`],
  ])
    assert.equal(said, expected)
})

test("a run of the workbench is written as what differs, read back, and said in Python", () => {
  const preset = { n_split: 20, max_pol_loss: 1e-4, one_split: false, fit: "adam" },
    choices = { one_split: [false, true], fit: ["adam", "closed_form"] },
    config = { ...preset, seed: 3, max_pol_loss: 0.02, one_split: true, fit: "closed_form" },
    text = "seed=3&max_pol_loss=0.02&one_split=true&fit=closed_form",
    read = text => workbench.read(text, preset, choices)
  assert.equal(workbench.written(config, preset), text)
  assert.deepEqual([read(text), read("")], [config, { ...preset, seed: 0 }])
  for (const wrong of ["n_split=2.5", "n_split=-1", "fit=<b>", "one_split=1", "seed=-1", "a=1", "n_split=1e9", "max_pol_loss="])
    assert.deepEqual(read(wrong), read(""), wrong)
  const given = 'vsp.preset("T"), max_pol_loss=0.02, one_split=True, fit="closed_form")'
  assert.ok(workbench.python("T", config, preset).includes(given))
})

test("an address is read as it was written, and none that is damaged", () => {
  const numbers = { codewords: [[0.25, 0.5]], coefficients: [[0, 1, 2].map(n => [n, -n])] }
  const state = { section: "you", policy: "three", at: [0.2, -1e-7], moment: 3, zoomed: true }
  for (const scene of [state, { ...state, moment: undefined, zoomed: false, numbers }]) {
    const written = address.write(scene),
      read = text => address.read(text, { you: ["three"] }, 4)
    assert.equal(JSON.stringify(read(written)), JSON.stringify(scene))
    for (const wrong of [written.slice(0, -1), `${written}0`, written.replace("0.2", "0.3")])
      assert.equal(read(wrong), null)
  }
  assert.equal(address.read(address.write(state), { you: ["three"] }, 3), null) // no such moment
})

test("by hand: two actions differ by a twentieth of their range, or by their side of the middle", () => {
  assert.deepEqual([0.59, 0.61].map(theirs => differs(0.5, theirs, -1, 1)), [false, true])
  assert.deepEqual([-0.01, 0.01].map(theirs => differs(0.02, theirs, -1, 1)), [true, false])
  assert.equal(differs(1.05, 0.95, 0, 2), true)
})

test("by hand: the smallest change of an input, on either side, and none beyond its range", () => {
  const scene = { task: { inputs: ["x", "y", "z"] } },
    changes = Episodes.prototype.changes.bind({ scene, ranges: [[-1, 2], [-0.5, 1], [0, 0]] })
  assert.equal(changes([1, 0, 0], ([x, y]) => x < 0.5 || y > 0.1), "y were 0.101 more, or x were 0.501 less")
  assert.equal(changes([1, 0, 0], ([x]) => x > 1.9 && " (cell 2)"), "x were 0.901 more (cell 2)")
  assert.match(changes([1, 0, 0], ([x, , z]) => z !== 0 || x > 2), /no change of one input/)
})

// Bundles, types and limits

test("the committed bundles are made of the scripts as they are", { skip }, () => {
  const folder = mkdtempSync(`${tmpdir()}/bundles-`)
  npm("build", "--", `--outdir=${folder}`, "--log-level=error")
  for (const path of BUNDLES)
    assert.equal(readFileSync(`${folder}/${path}`, "utf8"), textOf(path), `${path} is stale`)
  rmSync(folder, { recursive: true })
})

test("types fit", { skip }, () => {
  npm("check")
})

test("a page that contains a bundle finds what it calls", async () => {
  for (const [path, name] of [
    [BUNDLES[0], "mountAll"],
    [BUNDLES[1], "begin"],
    [BUNDLES[2], "begin"],
    [BUNDLES[3], "begin"],
  ]) {
    const page = `${textOf(path)}\nexport const called = ${name}`,
      { called } = await import(`data:text/javascript,${encodeURIComponent(page)}`)
    assert.equal(typeof called, "function")
  }
  const { default: widget } = await import(at(BUNDLES[0]))
  assert.equal(typeof widget.render, "function")
})

test("Delaunay neighbours: squares, lines, and what lies on an edge", () => {
  const near = points => algorithms.neighbours(points).map(each => [...each].sort())
  assert.deepEqual(near([[0, 0]]), [[]])
  assert.deepEqual(near([[0, 0], [1, 0], [3, 0], [2, 0]]), [[1], [0, 3], [3], [1, 2]])
  assert.deepEqual(near([[0, 0], [1, 0], [0, 1], [2, 2]]), [[1, 2], [0, 2, 3], [0, 1, 3], [1, 2]])
})

test("in a hundred studies the interval from all episodes misses as often as arithmetic says", () => {
  // Policies differ by 1, episodes by 6: of 8 policies with 1000 episodes the mean varies by 0.4, not 0.07
  const means = Array.from({ length: 85 }, (_, i) => Math.sqrt(3) * (i / 42 - 1)),
    reruns = { means, sds: means.map(() => 6) },
    draw = model.random(1)
  const held = (episodes, whole) =>
    Array.from({ length: 2000 }, () => studies.interval(reruns, 8, episodes, whole, draw)).filter(
      ([low, high]) => low <= 0 && 0 <= high,
    ).length / 2000
  assert.ok(Math.abs(held(10, false) - 0.93) < 0.03)
  assert.ok(Math.abs(held(1000, false) - 0.29) < 0.04)
  assert.ok(Math.abs(held(1000, true) - 0.89) < 0.03)
  assert.deepEqual([model.random(3)(), model.random(3)()], Array(2).fill(model.random(3)()))
})

test("modules import only those before them, and scripts are short with short lines", () => {
  EXPLORER.forEach((path, i) => {
    for (const [, used] of textOf(path).matchAll(/^import .*"\.\/(.*)\.js"/gm))
      assert.ok(NAMES.slice(0, i).includes(used), `${path} imports ${used}`)
  })
  for (const path of BUNDLES) assert.ok(Buffer.byteLength(textOf(path)) <= 100 * 1024, path)
  const code = path => textOf(path).replace(/\/\*[^]*?\*\/|^ *\/\/.*$/gm, "").split("\n")
  assert.ok(SCRIPTS.flatMap(code).filter(line => line.trim()).length <= 2300)
  for (const path of SCRIPTS) {
    const [first, ...lines] = textOf(path).split("\n")
    assert.equal(first, "// @ts-check")
    for (const line of lines) assert.ok([...line].length <= 100, line)
  }
  const there = ["vsp/show/explorer/", "docs/article/", "docs/static/", "vsp_course/live/"].flatMap(folder =>
    readdirSync(at(folder)).map(name => folder + name),
  )
  const scripts = there.filter(path => path.endsWith(".js") && !path.endsWith(".bundle.js"))
  assert.deepEqual(scripts.sort(), [...SCRIPTS].sort())
})

test("no function is longer than forty lines", async () => {
  // As V8 finds them: top-level functions and methods. Those inside of them are shorter.
  globalThis.addEventListener = () => {}
  globalThis.document = { currentScript: { src: "" }, addEventListener: () => {} }
  globalThis.location = { search: "" }
  const session = new inspector.Session()
  let found = []
  session.connect()
  session.post("Profiler.enable")
  session.post("Profiler.startPreciseCoverage", { callCount: true, detailed: false })
  for (const path of SCRIPTS) await import(`${at(path)}?again`)
  session.post("Profiler.takePreciseCoverage", (_, { result }) => (found = result))
  session.disconnect()
  for (const path of SCRIPTS) {
    const { functions } = found.find(({ url }) => url === `${at(path)}?again`),
      written = functions.filter(({ functionName: name }) => name && !name.startsWith("<"))
    assert.ok(written.length)
    for (const { ranges } of written) {
      const part = textOf(path).slice(ranges[0].startOffset, ranges[0].endOffset)
      assert.ok(part.split("\n").length <= 40, part)
    }
  }
})
