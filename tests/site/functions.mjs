// For test_explorer_modules.py: where V8 finds functions in the module whose address is given.

import inspector from "inspector"

globalThis.addEventListener = () => {}
globalThis.document = { currentScript: { src: "" } }
const session = new inspector.Session(),
  [, , address] = process.argv
session.connect()
session.post("Profiler.enable")
session.post("Profiler.startPreciseCoverage", { callCount: true, detailed: false })
await import(address)
session.post("Profiler.takePreciseCoverage", (_, { result }) => {
  const { functions } = result.find(({ url }) => url === address)
  const written = functions.filter(({ functionName }) => !functionName.startsWith("<"))
  const places = written.map(({ ranges: [{ startOffset, endOffset }] }) => [startOffset, endOffset])
  console.log(JSON.stringify(places))
})
