// Paper is white: a dark page is printed as the light one.
let shown
addEventListener("beforeprint", () => {
  shown = document.documentElement.dataset.theme
  document.documentElement.dataset.theme = "light"
})
addEventListener("afterprint", () => { document.documentElement.dataset.theme = shown })
