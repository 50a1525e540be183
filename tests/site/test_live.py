"""The course without Python, opened from disk: one predicts before one may do, and does before one sees."""

import re

import pytest
from axe_playwright_python.sync_playwright import Axe
from visits import Visit

from vsp_course.live import live


@pytest.fixture
def shown(browser, tmp_path):
    (tmp_path / "live.html").write_text(live(), "utf-8")
    visit = Visit(browser, tmp_path.as_uri() + "/", "live.html", viewport={"width": 390, "height": 844})
    yield visit.page
    assert visit.troubles == []


def opened(page, name, answer=1):
    part = page.locator(f"#{name}")
    assert part.locator(".do").is_hidden() and part.locator(".see").is_hidden()
    part.locator(".predict input").nth(answer).check()
    assert part.locator(".do").is_visible() and part.locator(".predict input").first.is_disabled()
    return part


def test_each_part_asks_and_nothing_overflows_a_phone(shown):
    for name in ("borders", "by_hand", "passes", "intervals"):
        part = opened(shown, name)
        assert "You said: " in part.locator("[data-say=said]").inner_text() and part.locator(".see").is_hidden()
        part.locator("canvas").first.click()
        for _ in range(int(part.locator(".see").get_attribute("data-after") or 0)):
            part.get_by_role("button").first.click()
        assert part.locator(".see").is_visible()
    assert shown.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert Axe().run(shown).response["violations"] == []


def test_cells_by_hand_are_fitted_at_once(shown):
    part = opened(shown, "by_hand")
    part.locator("p", has_text="With 1 cell: 100 % of the squared error of one map; 52 of 400").wait_for()
    part.locator(".vsp-stage > canvas").click(position={"x": 80, "y": 250})
    part.get_by_role("button", name="add a cell").click()
    part.locator("p", has_text=re.compile(r"With 2 cells: \d\d % of the squared error")).wait_for()


def test_a_run_is_asked_about_told_and_kept(shown):
    part = opened(shown, "passes")
    run = part.get_by_role("button", name="distil")
    run.click()
    part.locator(".runs tr").nth(1).wait_for()
    assert run.is_disabled() and "100 iterations" in part.inner_text()
    part.get_by_label("max_pol_loss").fill("5")
    part.get_by_label("I expect").select_option("fewer cells")
    run.click()
    part.locator(".runs tr").nth(2).wait_for()
    first, second = part.locator(".runs tr").all_inner_texts()[1:]
    assert "fewer cells" in second and int(first.split()[-2]) > int(second.split()[-2]) == 1


def test_more_episodes_of_the_same_policies_mislead(shown):
    part = opened(shown, "intervals")
    for episodes in ("20", "1000"):
        part.get_by_label("episodes of each").select_option(episodes)
        part.get_by_role("button", name="100 studies").click()
    few, many = (int(row.split()[-1]) for row in part.locator(".runs tr").all_inner_texts()[1:])
    label = f"100 intervals; {many} hold the true mean"
    assert few > 80 and many < 70 and part.locator("canvas").get_attribute("aria-label") == label
