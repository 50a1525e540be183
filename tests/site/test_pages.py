"""Every page of the site: it is whole, asks nobody else, and can be read by everyone, on paper and on a phone."""

import io
import os
import re
import unicodedata
from pathlib import Path

import pytest
from visits import Visit

SITE = Path(os.environ.get("SITE", "nowhere"))
APART = {"_static", "live.html"}  # the page without Python is no page of Sphinx: test_live.py
NAMES = sorted(path.relative_to(SITE).as_posix() for path in SITE.rglob("*.html") if not APART & {*path.parts})
# Paper: A4 less its margins
DESK, PHONE, PAPER = ({"width": w, "height": h} for w, h in ((1280, 900), (390, 844), (680, 960)))
NAVIGATION = ".bd-sidebar-primary, .bd-sidebar-secondary, .bd-header-article, .prev-next-footer, #pst-back-to-top"


@pytest.fixture(scope="module", params=NAMES or ["none"])
def opened(request, browser, address):
    """A page, opened once for all that is asked of it."""
    visit = Visit(browser, address, request.param, viewport=DESK, color_scheme="light", reduced_motion="reduce")
    visit.name = request.param
    yield visit
    visit.page.context.close()


@pytest.fixture
def page(opened):
    yield opened.page
    opened.page.emulate_media(media="null", color_scheme="light")
    opened.page.set_viewport_size(DESK)


@pytest.fixture
def start(browser, address):
    """The first page, in a window that may go elsewhere."""
    return Visit(browser, address, viewport=DESK).page


def test_the_pages_that_are_promised_are_there():
    notebooks = {f"notebooks/{path.stem}.html" for path in Path("figures").glob("**/executed/*.ipynb")}
    assert len(notebooks) >= 6 and notebooks | {"index.html", "course.html", "api.html", "search.html"} <= set(NAMES)


def test_the_site_can_be_read_and_its_sidebar_overlooked(start):
    from bs4 import BeautifulSoup

    pages = [BeautifulSoup((SITE / name).read_text("utf-8"), "html.parser").article for name in NAMES]
    texts = [text for page in pages if page for text in page(string=True) if not text.find_parent(["pre", "code"])]
    assert 20_000 < len(" ".join(texts).split()) <= 42_000
    assert sum(link.is_visible() for link in start.locator(".bd-sidebar-primary a.reference").all()) <= 14
    assert start.locator(".bd-sidebar-primary .caption").count() == 4


def test_nothing_fails_and_no_other_host_is_asked(opened, page):
    page.wait_for_load_state("networkidle")
    assert opened.troubles == []


def test_every_picture_is_there_says_what_it_shows_has_its_room_and_leads_to_its_full_size(page):
    pictures = page.evaluate("""[...document.images].map(i => ({src: i.currentSrc, wide: i.naturalWidth,
        alt: i.getAttribute('alt'), shown: !!i.closest('article'), link: i.closest('a')?.href,
        room: i.getAttribute('height') / i.getAttribute('width'), ratio: i.naturalHeight / i.naturalWidth}))""")
    shown = [p for p in pictures if p["shown"]]
    assert [p["src"] for p in pictures if not p["wide"] or p["alt"] is None] == []
    assert [p["src"] for p in shown if len(p["alt"]) < 20 or p["link"] != p["src"]] == []
    assert [p["src"] for p in shown if abs(p["room"] - p["ratio"]) > 0.01] == []
    assert page.evaluate("document.body.innerHTML.includes('data:image')") is False


def test_it_says_in_a_sentence_what_it_is_about(opened, page):
    text = page.locator("meta[name=description]").get_attribute("content")
    assert 30 < len(text) <= 200
    image = page.locator("meta[property='og:image']").get_attribute("content")
    assert (SITE / opened.name).parent.joinpath(image).is_file() and ("article" in image or opened.name != "index.html")
    others = [name for name in NAMES if name != opened.name]
    assert not any(f'content="{text}"' in (SITE / name).read_text("utf-8") for name in others)


def test_no_code_is_cut_off_and_all_can_be_copied(page):
    cells = page.evaluate("""[...document.querySelectorAll('div.cell_input')].map(cell => [
        cell.querySelectorAll('button.copybtn').length,
        cell.querySelector('pre').scrollWidth - cell.querySelector('pre').clientWidth])""")
    assert all(buttons == 1 and over <= 2 for buttons, over in cells)
    blocks = "article section > div[class^='highlight-'] pre"
    assert page.evaluate(f"[...document.querySelectorAll({blocks!r})].every(b => b.scrollWidth <= b.clientWidth + 2)")


def test_no_caption_is_cut_off(page):
    over = page.evaluate("""[...document.querySelectorAll('.pst-scrollable-table-container caption')].map(caption =>
        caption.getBoundingClientRect().right - caption.closest('div').getBoundingClientRect().right)""")
    assert all(right <= 1 for right in over)


def test_every_figure_of_a_notebook_has_its_number_and_caption_and_every_table_a_caption(opened, page):
    if not re.search(r"notebooks/\d", opened.name):
        return
    labels = page.locator("figure:has(img) figcaption b").all_inner_texts()
    assert labels == [f"Figure {int(opened.name[10:12])}.{i}." for i in range(1, len(labels) + 1)]
    assert page.locator("article figure:has(img):not(:has(figcaption))").count() == 0
    tables = page.evaluate("""[...document.querySelectorAll('table.dataframe')].filter(t => !t.closest('.vsp-strip'))
        .map(table => [table.caption?.textContent.length ?? 0, table.tHead.rows[0].cells[0].textContent])""")
    assert all(length > 10 and heading for length, heading in tables)


def test_no_dollar_is_left_outside_of_code_and_tables_have_headers(page):
    text = page.evaluate("""[...document.querySelectorAll('article')].map(article => {
        const copy = article.cloneNode(true)
        copy.querySelectorAll('pre, code').forEach(code => code.remove())
        return copy.textContent
    }).join()""")
    assert re.findall(r".{20}\$.{20}", text) == []
    bare = "[...document.querySelectorAll('article table')].filter(t => !t.querySelector('th')).map(t => t.innerText)"
    assert page.evaluate(bare) == []


def test_headings_descend_in_order_below_one_title(page):
    headings = page.locator("main :is(h1, h2, h3, h4, h5, h6)").filter(visible=True)
    levels = headings.evaluate_all("found => found.map(heading => Number(heading.tagName[1]))")
    assert levels[0] == 1 == levels.count(1) == page.locator("main").count()
    assert all(below - above <= 1 for above, below in zip(levels, levels[1:]))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_serious(page, scheme):
    from axe_playwright_python.sync_playwright import Axe

    page.emulate_media(color_scheme=scheme)
    page.wait_for_function(f"document.documentElement.dataset.theme == '{scheme}'")
    page.wait_for_timeout(400)  # the theme marks what scrolls, and what can be reached by keys, a little later
    violations = Axe().run(page).response["violations"]
    grave = [rule for rule in violations if rule["impact"] in ("serious", "critical")]
    assert [(rule["help"], node["html"][:160]) for rule in grave for node in rule["nodes"]] == []


def test_a_phone_shows_it_without_scrolling_sideways(page):
    page.set_viewport_size(PHONE)
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    beyond = page.evaluate("""[...document.querySelectorAll('article *')].filter(element => {
        const cut = e => e && (getComputedStyle(e).overflowX != 'visible' || cut(e.parentElement))
        return element.getBoundingClientRect().right > innerWidth + 1 && !cut(element.parentElement)
    }).map(element => element.outerHTML.slice(0, 160))""")
    assert beyond == []
    spaces = "found => found.map(code => getComputedStyle(code).whiteSpace)"  # code scrolls; no line is broken
    assert {*page.locator("article div.highlight pre").evaluate_all(spaces)} <= {"pre"}


def test_what_goes_on_beyond_the_edge_says_so(page):
    page.set_viewport_size(PHONE)
    boxes = "[...document.querySelectorAll('article :is(pre, .pst-scrollable-table-container)')]"
    page.evaluate("document.querySelectorAll('article details').forEach(folded => { folded.open = true })")
    page.evaluate(f"{boxes}.forEach(box => {{ box.scrollLeft = 0 }})")
    wide = f"{boxes}.filter(box => box.scrollWidth > box.clientWidth + 2)"
    marked = "box => getComputedStyle(box).maskImage != 'none'"
    page.wait_for_function(f"{wide}.every({marked}) && {boxes}.filter({marked}).length == {wide}.length")
    page.evaluate(f"{boxes}.forEach(box => {{ box.scrollLeft = box.scrollWidth }})")
    page.wait_for_function(f"!{boxes}.some({marked})")


def test_paper_shows_the_text_whole_and_no_navigation(opened, page):
    page.set_viewport_size(PAPER)
    page.emulate_media(media="print")
    assert [part.get_attribute("class") for part in page.locator(NAVIGATION).all() if part.is_visible()] == []
    if opened.name != "search.html":
        assert page.locator("article").first.is_visible()
    right = page.evaluate("[...document.querySelectorAll('article table')].map(t => t.getBoundingClientRect().right)")
    assert all(edge <= PAPER["width"] for edge in right)
    sizes = page.evaluate("[...document.querySelectorAll('article table')].map(t => getComputedStyle(t).fontSize)")
    assert all(float(size.removesuffix("px")) >= 7 * 96 / 72 - 0.01 for size in sizes)  # 7 points


def test_the_printer_gets_every_word_of_tables_and_code(page):
    from pypdf import PdfReader

    words = page.evaluate(
        "[...document.querySelectorAll('article :is(th, td, pre)')]"
        ".filter(e => !e.closest('details:not([open])') && !e.querySelector('math'))"
        ".flatMap(e => e.innerText.split(/\\s+/)).filter(word => word.length > 3)"
    )
    sheets = PdfReader(io.BytesIO(page.pdf(format="A4"))).pages
    text = "".join(sheet.extract_text() for sheet in sheets)
    text = re.sub(r"\s+", "", unicodedata.normalize("NFKC", text))  # some fonts join fi and the like
    assert sorted({word for word in words if unicodedata.normalize("NFKC", word) not in text}) == []


def test_a_dark_page_is_light_while_it_is_printed(browser, address):
    visit = Visit(browser, address, color_scheme="dark")
    theme_at = "event => dispatchEvent(new Event(event)) && document.documentElement.dataset.theme"
    assert [visit.page.evaluate(theme_at, event) for event in ("beforeprint", "afterprint")] == ["light", "dark"]


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


@pytest.mark.parametrize("name", ["index.html", "notebooks/06_few_equations.html", "api.html"])
def test_little_comes_along_with_a_page(browser, address, name):
    page, sizes = browser.new_context(viewport=DESK).new_page(), []
    page.on("response", lambda response: sizes.append(int(response.headers.get("content-length", 0))))
    page.goto(address + name, wait_until="networkidle")
    assert sum(sizes) < 1_000_000


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", ["index.html", "notebooks/02_distillation.html"])
def test_the_place_of_the_keyboard_is_seen_at_every_stop(browser, address, name, scheme):
    visit = Visit(browser, address, name, viewport=DESK, color_scheme=scheme, reduced_motion="reduce")
    unseen, stops = [], 0
    while visit.page.keyboard.press("Tab") or visit.page.evaluate("document.activeElement != document.body"):
        stops += 1
        with_it, without = visit.page.evaluate("""() => {
            const stop = document.activeElement, looks = () => [stop, ...stop.querySelectorAll('*')]
                .map(part => getComputedStyle(part).outline + getComputedStyle(part).boxShadow).join()
            const before = looks()
            stop.blur()
            const after = looks()
            stop.focus({focusVisible: true})
            return [before, after]
        }""")
        if with_it == without:
            unseen.append(visit.page.evaluate("document.activeElement.outerHTML.slice(0, 160)"))
    assert unseen == [] and stops > 30


def test_without_a_script_a_page_is_light_on_a_dark_system_too(browser, address):
    page = browser.new_context(color_scheme="dark", java_script_enabled=False).new_page()
    page.goto(address + "use.html")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"


def test_a_search_quotes_the_text_and_leads_to_the_words(start, address):
    start.goto(address + "search.html?q=Delaunay")
    assert start.locator("main input[name=q]").evaluate("field => parseFloat(getComputedStyle(field).paddingLeft)") > 30
    start.wait_for_selector("#search-results a[href$='02_distillation.html#:~:text=Delaunay']")
    assert not any("On this page" in text for text in start.locator("#search-results p.context").all_inner_texts())
    for nothing in ("L", "DecisionTreeClassifier"):  # one letter; code of a notebook
        start.goto(f"{address}search.html?q={nothing}")
        start.wait_for_selector(".search-summary:has-text('did not match')")
    start.goto(address + "search.html?q=What+is+a+cell%3F")
    start.wait_for_selector("#search-results li:first-child a[href='glossary.html#term-Cell']")
    start.goto(address + "search.html?q=L∞")
    start.locator("#search-results a", has_text="Distillation").first.wait_for()
