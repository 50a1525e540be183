// @ts-check
// The state of the article in the address of its page: "#v=1&s=cells&p=run&a=0.7,0.7&k=1x2y3z".
// Only known keys and numbers are read, and a checksum tells what is cut: links come from anywhere.

const [VERSION, LONGEST, MOST_CELLS, LARGEST] = ["1", 4096, 16, 1e6]

/** A checksum of a text (FNV-1a). @param {string} text */
function checksum(text) {
  let sum = 0x811c9dc5
  for (const sign of text) sum = Math.imul(sum ^ Number(sign.codePointAt(0)), 0x01000193)
  return (sum >>> 0).toString(36)
}

/** The address of a scene; `numbers` are those of a reader's own policy. @param {State} state */
export function write({ section, policy, at, moment, zoomed, numbers }) {
  const { codewords, coefficients } = numbers ?? {}
  const pairs = { v: VERSION, s: section, p: policy, a: at, n: moment, z: zoomed ? 1 : undefined }
  Object.assign(pairs, { c: codewords?.flat(), m: coefficients?.flat(2) })
  const told = Object.entries(pairs).filter(([, value]) => value !== undefined)
  const text = told.map(([key, value]) => `${key}=${value}`).join("&")
  return `#${text}&k=${checksum(text)}`
}

/** The state in an address, or null if it is not whole and known: with one of the policies of a
 * section, and one of the run's moments. A cell has 2 numbers of its codeword, and 6 of its map.
 * @param {string} hash @param {Record<string, string[]>} sections @param {number} moments */
export function read(hash, sections, moments) {
  const [, text, sum] = hash.slice(0, LONGEST + 1).match(/^#(.*)&k=(\w+)$/) ?? ["", "", ""]
  if (hash.length > LONGEST || checksum(text) !== sum) return null
  const { v, s: section, p: policy, z, n, ...lists } = Object.fromEntries(new URLSearchParams(text))
  if (v !== VERSION || !Object.hasOwn(sections, section)) return null
  if (!sections[section].includes(policy)) return null
  const moment = n === undefined ? undefined : Number(n)
  if (moment !== undefined && !(Number.isInteger(moment) && moment >= 0 && moment < moments))
    return null
  const [at, codewords, maps] = ["a", "c", "m"].map(key =>
    lists[key]?.split(",").map(one => (one ? +one : NaN)),
  )
  const all = [at, codewords ?? [], maps ?? []].flat()
  if (at?.length !== 2 || !all.every(value => Math.abs(value) <= LARGEST)) return null
  const state = { section, policy, at, moment, zoomed: z === "1" }
  if (!codewords && !maps) return state
  if (!codewords || maps?.length !== 3 * codewords.length) return null
  if (codewords.length % 2 || codewords.length > 2 * MOST_CELLS) return null
  /** @type {<T>(list: T[], size: number) => T[][]} */
  const cut = (list, size) => list.flatMap((_, i) => (i % size ? [] : [list.slice(i, i + size)]))
  return { ...state, numbers: { codewords: cut(codewords, 2), coefficients: cut(cut(maps, 2), 3) } }
}
