"""A page of the site in a window, and what goes wrong in it."""


class Visit:
    """A page of the site in a window of its own, with everything that went wrong in it."""

    def __init__(self, browser, address: str, name: str = "index.html", **context):
        self.address, self.troubles = address, []
        self.page = browser.new_context(**context).new_page()
        self.page.on("request", self._request)
        self.page.on("requestfailed", lambda request: self.troubles.append(f"failed: {request.url}"))
        self.page.on("response", self._response)
        self.page.on("console", self._console)
        self.page.on("pageerror", lambda error: self.troubles.append(f"script: {error}"))
        self.page.goto(address + name, wait_until="load")
        self.page.evaluate("document.querySelectorAll('img').forEach(image => { image.loading = 'eager' })")
        self.page.wait_for_function("[...document.images].every(image => image.complete)")

    def _request(self, request):
        if not request.url.startswith((self.address, "data:", "blob:")):
            self.troubles.append(f"another host: {request.url}")

    def _response(self, response):
        if response.status >= 400:
            self.troubles.append(f"{response.status}: {response.url}")

    def _console(self, message):
        if message.type == "error":
            self.troubles.append(f"console: {message.text}")

    def close(self):
        self.page.context.close()
