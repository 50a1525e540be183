// @ts-check
// The state of the article in the address of its page: "#v=1&s=cells&p=run&a=0.7,0.7&k=1x2y3z".
// Only what would be written so is read, with a checksum: links come from anywhere.

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

/** @type {<T>(list: T[], size: number) => T[][]} */
const cut = (list, size) => list.flatMap((_, i) => (i % size ? [] : [list.slice(i, i + size)]))

/** The state in an address, or null if it is not whole and known: with one of the policies of a
 * section, and one of the run's moments. A cell has 2 numbers of its codeword, and 6 of its map.
 * @param {string} hash @param {Record<string, string[]>} sections @param {number} moments */
export function read(hash, sections, moments) {
  const text = new URLSearchParams(hash.slice(1, LONGEST)),
    { s: section, p: policy, n, z, ...lists } = Object.fromEntries(text),
    [at, words, maps] = ["a", "c", "m"].map(key => lists[key]?.split(",").map(Number) ?? []),
    own = { codewords: cut(words, 2), coefficients: cut(cut(maps, 2), 3) },
    moment = n === undefined ? undefined : Number(n),
    shown = { section, policy, at, moment, zoomed: z === "1" },
    state = { ...shown, numbers: words.length ? own : undefined }
  const known = Object.hasOwn(sections, section) && sections[section].includes(policy),
    small = [...at, ...words, ...maps].every(value => Math.abs(value) <= LARGEST),
    sized = at.length === 2 && words.length % 2 === 0 && maps.length === 3 * words.length,
    played = moment === undefined || (Number.isInteger(moment) && moment >= 0 && moment < moments)
  if (words.length > 2 * MOST_CELLS) return null
  return known && small && sized && played && write(state) === hash ? state : null
}
