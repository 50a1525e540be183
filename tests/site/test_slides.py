"""The slides of the lessons, opened from disk: few words, a picture on each, and nothing is asked from elsewhere."""

import pytest
from visits import Visit

from vsp_course.build import read_sources
from vsp_course.slides import NOTE, is_slide, slides

LESSONS = read_sources()
OVERFLOWS = """() => [...document.querySelectorAll('section')].map((slide, i) => {
  Reveal.slide(i)
  const box = slide.getBoundingClientRect(), page = document.querySelector('.slides').getBoundingClientRect()
  const picture = slide.lastElementChild.clientHeight
  const fits = box.top >= page.top - 1 && box.bottom <= page.bottom + 1 && slide.scrollWidth <= slide.clientWidth + 1
  return [i, fits, picture > 380]
}).filter(([, fits, large]) => !fits || !large)"""
WORDS = """all => all.map(slide => [...slide.querySelectorAll(':scope > p, :scope > ul, :scope > ol, :scope > table')]
  .map(part => part.textContent).join(' ').split(/\\s+/).filter(Boolean).length)"""


@pytest.fixture(scope="module", params=LESSONS, ids=lambda name: name.split(".")[0])
def shown(request, browser, tmp_path_factory):
    path = tmp_path_factory.mktemp("slides") / "slides.html"
    path.write_text(slides(LESSONS[request.param]), "utf-8")
    visit = Visit(browser, path.parent.as_uri() + "/", path.name, viewport={"width": 1280, "height": 720})
    visit.page.wait_for_function("window.Reveal?.isReady()")
    yield visit.page, visit.troubles, LESSONS[request.param]
    visit.page.context.close()


def test_each_text_is_a_slide_none_overflows_and_pictures_are_large(shown):
    page, troubles, lesson = shown
    assert page.locator("section").count() == sum(is_slide(c) and c.cell_type == "markdown" for c in lesson.cells) >= 8
    assert page.evaluate(OVERFLOWS) == []
    assert troubles == []


def test_keys_turn_the_slides(shown):
    page = shown[0]
    page.evaluate("Reveal.slide(0)")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("Reveal.getIndices().h") == 1


def test_a_key_opens_the_speakers_view_with_what_is_said(shown):
    page, troubles, lesson = shown
    page.evaluate("Reveal.slide(0)")
    with page.context.expect_page() as opened:
        page.keyboard.press("s")
    first = next(cell.source for cell in lesson.cells if is_slide(cell)).partition(NOTE)[2].split()[:5]
    opened.value.locator(".speaker-controls-notes", has_text=" ".join(first)).wait_for()
    opened.value.close()
    assert troubles == []


def test_a_slide_has_ten_words_at_most_and_one_picture_or_the_explorer(shown):
    slides = shown[0].locator("section")
    assert max(slides.evaluate_all(WORDS)) <= 10
    parts = [(slide.locator("figure > img").count(), slide.locator("iframe").count()) for slide in slides.all()]
    assert set(parts) == {(1, 0), (0, 1)} and parts.count((0, 1)) == 1  # so three in three lessons
    alts = slides.locator("figure > img").evaluate_all("all => all.map(image => image.alt)")
    assert all(len(alt) > 40 for alt in alts)


def test_the_explorer_is_alive(shown):
    page = shown[0]
    at = page.evaluate("[...document.querySelectorAll('section')].findIndex(slide => slide.querySelector('iframe'))")
    page.evaluate(f"Reveal.slide({at})")
    page.frame_locator("section.present iframe").locator(".vsp-explorer canvas").first.wait_for()
