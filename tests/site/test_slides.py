"""The slides of the lessons, opened from disk: none overflows, keys turn them, and nothing is asked from elsewhere."""

import pytest

from vsp_course.build import read_sources
from vsp_course.slides import is_slide, slides

LESSONS = read_sources()
OVERFLOWS = """() => [...document.querySelectorAll('section')].map((slide, i) => {
  Reveal.slide(i)
  const box = slide.getBoundingClientRect(), page = document.querySelector('.slides').getBoundingClientRect()
  return [i, box.top >= page.top - 1, box.bottom <= page.bottom + 1, slide.scrollWidth <= slide.clientWidth + 1]
}).filter(([, ...fits]) => !fits.every(Boolean))"""


@pytest.fixture(scope="module", params=LESSONS, ids=lambda name: name.split(".")[0])
def shown(request, browser, tmp_path_factory):
    path = tmp_path_factory.mktemp("slides") / "slides.html"
    path.write_text(slides(LESSONS[request.param]), "utf-8")
    page, said, asked = browser.new_context(viewport={"width": 1280, "height": 720}).new_page(), [], []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(path.as_uri())
    page.wait_for_function("window.Reveal?.isReady()")
    yield page, said, asked, LESSONS[request.param]
    page.context.close()


def test_there_is_a_slide_for_each_cell_and_none_overflows(shown):
    page, said, asked, lesson = shown
    assert page.locator("section").count() == sum(map(is_slide, lesson.cells)) >= 12
    assert page.evaluate(OVERFLOWS) == []
    assert said == [] and all(url.startswith(("file:", "data:")) for url in asked)


def test_keys_turn_the_slides(shown):
    page = shown[0]
    page.evaluate("Reveal.slide(0)")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("Reveal.getIndices().h") == 1


def test_every_figure_says_what_it_shows(shown):
    alts = shown[0].locator("img").evaluate_all("all => all.map(image => image.alt)")
    assert len(alts) >= 2 and all(len(alt) > 30 for alt in alts)
