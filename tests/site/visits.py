"""A page of the site in a window, what goes wrong in it, and gestures in the picture of an explorer."""


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


class Gestures:
    """What a reader does in an explorer's picture in `self.page`: with a finger on a phone, else with the mouse."""

    @property
    def finger(self):
        return self.page.evaluate("navigator.maxTouchPoints > 0")

    def at(self, x, y):
        """Where a point of the unit square is on the page."""
        box = self.page.locator(".vsp-stage > canvas").first.bounding_box()
        left, right = (46, 4) if box["width"] < 330 else (54, 8)
        side = box["width"] - left - right
        return box["x"] + left + x * side, box["y"] + right + (1 - y) * side

    def drag(self, *places):
        start, end = self.at(*places[0]), self.at(*places[-1])
        if self.finger:
            send = self.page.context.new_cdp_session(self.page).send
            for kind, *points in (("touchStart", start), ("touchMove", end), ("touchEnd",)):
                send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": y} for x, y in points]})
            return
        self.page.mouse.move(*start)
        self.page.mouse.down()
        self.page.mouse.move(*end, steps=5)
        self.page.mouse.up()

    click = drag
