"""Every page of the site: it is whole, asks nobody else, and can be read by everyone, on paper and on a phone."""

import os
from pathlib import Path

import pytest
from visits import Visit

SITE = Path(os.environ.get("SITE", "nowhere"))
NAMES = sorted(path.relative_to(SITE).as_posix() for path in SITE.rglob("*.html") if "_static" not in path.parts)
DESK, PHONE, PAPER = (
    {"width": w, "height": h} for w, h in ((1280, 900), (390, 844), (680, 960))
)  # A4 less its margins
NAVIGATION = ".bd-sidebar-primary, .bd-sidebar-secondary, .bd-header-article, .prev-next-footer, #pst-back-to-top"


@pytest.fixture(scope="module", params=NAMES or ["none"])
def opened(request, browser, address):
    """A page, opened once for all that is asked of it."""
    one = Visit(browser, address, request.param, viewport=DESK, color_scheme="light", reduced_motion="reduce")
    one.name = request.param
    yield one
    one.close()


@pytest.fixture
def page(opened):
    yield opened.page
    opened.page.emulate_media(media="screen", color_scheme="light")
    opened.page.set_viewport_size(DESK)


@pytest.fixture
def start(browser, address):
    """The first page, in a window that may go elsewhere."""
    one = Visit(browser, address, viewport=DESK)
    yield one.page
    one.close()


def test_the_pages_that_are_promised_are_there():
    notebooks = {f"notebooks/{path.stem}.html" for path in Path("figures/executed").glob("*.ipynb")}
    assert len(notebooks) >= 6 and notebooks | {"index.html", "course.html", "api.html", "search.html"} <= set(NAMES)


def test_nothing_fails_and_no_other_host_is_asked(opened, page):
    page.wait_for_load_state("networkidle")
    assert opened.troubles == []


def test_every_picture_is_there_and_says_what_it_shows(page):
    pictures = page.evaluate(
        "[...document.images].map(i => ({src: i.currentSrc, wide: i.naturalWidth, alt: i.getAttribute('alt'),"
        " shown: !!i.closest('article')}))"
    )
    assert [p["src"] for p in pictures if not p["wide"]] == []
    assert [p["src"] for p in pictures if p["alt"] is None or (p["shown"] and len(p["alt"]) < 20)] == []


def test_headings_descend_in_order_below_one_title(page):
    levels = page.evaluate(
        "[...document.querySelectorAll('main :is(h1, h2, h3, h4, h5, h6)')]"
        ".filter(h => h.checkVisibility()).map(h => Number(h.tagName[1]))"
    )
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(below - above <= 1 for above, below in zip(levels, levels[1:]))
    assert page.locator("main").count() == 1


def test_tables_have_headers(page):
    bare = "[...document.querySelectorAll('article table')].filter(t => !t.querySelector('th')).map(t => t.innerText)"
    assert page.evaluate(bare) == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_serious(page, scheme):
    from axe_playwright_python.sync_playwright import Axe

    page.emulate_media(color_scheme=scheme)
    page.wait_for_function(f"document.documentElement.dataset.theme == '{scheme}'")
    page.wait_for_timeout(400)  # the theme marks what scrolls, and what can be reached by keys, a little later
    found = Axe().run(page).response["violations"]
    grave = [rule for rule in found if rule["impact"] in ("serious", "critical")]
    assert [(rule["help"], node["html"][:160]) for rule in grave for node in rule["nodes"]] == []


def test_a_phone_shows_it_without_scrolling_sideways(page):
    page.set_viewport_size(PHONE)
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    beyond = page.evaluate("""[...document.querySelectorAll('article *')].filter(element => {
        const cut = e => e && (getComputedStyle(e).overflowX != 'visible' || cut(e.parentElement))
        return element.getBoundingClientRect().right > innerWidth + 1 && !cut(element.parentElement)
    }).map(element => element.outerHTML.slice(0, 160))""")
    assert beyond == []


def test_paper_shows_the_text_whole_and_no_navigation(opened, page):
    page.set_viewport_size(PAPER)
    page.emulate_media(media="print")
    assert [part.get_attribute("class") for part in page.locator(NAVIGATION).all() if part.is_visible()] == []
    if opened.name != "search.html":
        assert page.locator("article").first.is_visible()
    right = page.evaluate("[...document.querySelectorAll('article table')].map(t => t.getBoundingClientRect().right)")
    assert all(edge <= PAPER["width"] for edge in right)


def test_links_within_the_site_lead_somewhere(page, address):
    missing = []
    for link in page.evaluate("[...document.querySelectorAll('a[href]')].map(a => a.href)"):
        target, _, anchor = link.partition("#")
        path = SITE / target.removeprefix(address).partition("?")[0]
        if not link.startswith(address):
            assert link.startswith("https://"), link
        elif not path.exists() or (anchor and path.is_file() and f'id="{anchor}"' not in path.read_text("utf-8")):
            missing.append(link.removeprefix(address))
    assert missing == []


def test_mathematics_is_mathml_and_no_dollar_is_left(start, address):
    start.goto(address + "notebooks/04_appendix_tables.html")
    assert start.locator("article table math").count() > 200
    assert "$" not in "".join(start.locator("article table").all_inner_texts())


def test_a_search_for_merge_finds_the_distillation(start):
    start.keyboard.press("Control+k")
    start.keyboard.type("merge")
    start.keyboard.press("Enter")
    start.locator("#search-results a", has_text="Distillation").first.click()
    start.wait_for_url("**/notebooks/02_distillation.html*")


def test_a_reader_can_choose_the_dark_page(start):
    before = start.evaluate("getComputedStyle(document.body).backgroundColor")
    start.get_by_role("button", name="Color mode").click()
    start.locator(".dropdown-menu.show").get_by_text("Dark").click()
    assert start.evaluate("document.documentElement.dataset.theme") == "dark"
    assert start.evaluate("getComputedStyle(document.body).backgroundColor") != before
