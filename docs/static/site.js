// @ts-check
// Paper is white: a dark page is printed as the light one.
/** @type {string | undefined} */
let shown
addEventListener("beforeprint", () => {
  shown = document.documentElement.dataset.theme
  document.documentElement.dataset.theme = "light"
})
addEventListener("afterprint", () => {
  document.documentElement.dataset.theme = shown
})

// Explorers begin to answer where the page has one.
const folder = /** @type {HTMLScriptElement} */ (document.currentScript).src
addEventListener("DOMContentLoaded", async () => {
  if (document.querySelector(".vsp-explorer"))
    (await import(new URL("explorer.bundle.js", folder).href)).mountAll()
})

// A letter by itself would find every name that has it somewhere; ∞ is no letter.
// (Sphinx's search takes this for its own.)
var splitQuery = (/** @type {string} */ query) =>
  query
    .replaceAll("∞", " infinity ")
    .split(/[^\p{Letter}\p{Number}_]+/u)
    .filter(term => term.length > 1)

// The glossary explains a word; all else only uses it. (Sphinx's search has a place for this.)
document.addEventListener("DOMContentLoaded", () => {
  const { Scorer = {} } = /** @type {any} */ (globalThis)
  Scorer.score = (/** @type {(string | number)[]} */ [page, , anchor, , score]) =>
    page === "glossary" && +score > 6 ? +score + (anchor ? 30 : 20) : score
})

// "What is a cell?" asks for the cell. A hit leads to the words, not to the top of a long page.
{
  const asks = "what which who how why when where is are was do does can an the mean of".split(" ")
  const asked = splitQuery(new URLSearchParams(location.search).get("q") ?? "")
  const terms = asked.filter(word => !asks.includes(word.toLowerCase()))
  if (0 < terms.length && terms.length < asked.length)
    history.replaceState(null, "", `?q=${encodeURIComponent(terms.join(" "))}`)
  addEventListener("DOMContentLoaded", () => {
    const found = document.querySelector("#search-results")
    if (found && terms.length)
      new MutationObserver(() => {
        for (const link of found.querySelectorAll("a:not([href*='#'])"))
          /** @type {HTMLAnchorElement} */ (link).hash = `:~:text=${encodeURIComponent(terms[0])}`
      }).observe(found, { childList: true, subtree: true })
  })
}
