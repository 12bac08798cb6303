"""How the pages look and feel: on a phone, by touch, in both schemes, without colours, and as news comes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

import pytest
from playwright.sync_api import Browser, Page, expect
from report.scripted import search_in

from openeureka.report import html
from openeureka.report.view import RunView
from openeureka.testing.scripted import reply
from openeureka.ui import guard

from .conftest import broken_rules, comes_true
from .serving import TOKEN
from .test_browser import running


def test_a_choice_of_light_or_dark_is_kept(page: Page):
    ground = "getComputedStyle(document.documentElement).backgroundColor"
    before = page.evaluate(ground)
    page.get_by_role("button", name="Light or dark").click()
    chosen = page.evaluate(ground)
    assert chosen != before
    page.reload()
    assert page.evaluate(ground) == chosen


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_page_breaks_a_rule_of_accessibility(page: Page, searched: Path, scheme: Literal["light", "dark"]):
    (searched / "report.html").write_text(html.report(RunView.read(searched), searched))
    page.emulate_media(color_scheme=scheme)
    pages = ["/", "/runs/run/", "/runs/run/candidates?show=g1s0&show=g0s1", "/compare?run=run"]
    for address in [*pages, (searched / "report.html").as_uri()]:
        page.goto(address)
        assert not (broken := broken_rules(page)), (address, broken)


@pytest.mark.parametrize("width", [320, 400, 1400])
def test_no_page_is_wider_than_its_window(page: Page, searched: Path, width: int):
    page.set_viewport_size({"width": width, "height": 900})
    (searched / "report.html").write_text(html.report(RunView.read(searched), searched))
    pages = ("/", "/runs/run/", "/runs/run/candidates?show=g1s0", "/compare?run=run")
    for address in (*pages, (searched / "report.html").as_uri()):
        page.goto(address)
        assert page.evaluate("document.documentElement.scrollWidth") <= width, address


def test_every_field_of_a_new_run_stands_below_its_name(page: Page, tmp_path: Path):
    for width in (390, 1280):
        page.set_viewport_size({"width": width, "height": 900})
        page.goto("/")
        page.get_by_text("Start a run").click()
        lefts = page.locator(".fields label").evaluate_all(
            "labels => labels.map((label) => [label, label.querySelector('input, select')].map((element) =>"
            " element.getBoundingClientRect().left))"
        )
        assert len(lefts) == 9 and all(name == field for name, field in lefts), (width, lefts)


@pytest.mark.parametrize("width", [320, 375])
def test_a_phone_shows_where_one_is_and_the_look_in_one_line(page: Page, searched: Path, width: int):
    page.set_viewport_size({"width": width, "height": 900})
    for address in ("/", "/runs/run/"):
        page.goto(address)
        theme = page.get_by_role("button", name="Light or dark").bounding_box()
        assert theme is not None and theme["height"] < 40 and theme["x"] + theme["width"] <= width
    way = page.get_by_label("Where you are").bounding_box()
    assert way is not None and way["width"] > 120
    expect(page.get_by_label("Where you are")).to_have_text("Runs / run")


@pytest.mark.parametrize("width", [375, 1400])
def test_the_notice_of_a_lost_server_is_wholly_seen_by_who_reads_far_below(page: Page, searched: Path, width: int):
    page.set_viewport_size({"width": width, "height": 900})
    page.goto("/runs/run/")
    # In a single call, because the first news for the page hides the notice again.
    below, top, padding = page.evaluate("""() => {
        lost.hidden = false;
        scrollTo(0, 1000);
        const header = document.querySelector("header").getBoundingClientRect();
        return [header.height, lost.getBoundingClientRect().top, getComputedStyle(lost).paddingTop];
    }""")
    assert below <= top < below + 20 and padding != "0px"


def test_a_table_stays_scrolled_as_news_comes(page: Page, tmp_path: Path):
    page.set_viewport_size({"width": 375, "height": 900})
    with running(tmp_path / "run", [reply(n) for n in (7, 8, 9, 5)]) as model:
        model.allowed.release()
        page.goto("/")
        page.get_by_role("link", name="run", exact=True).click()
        expect(page.locator("#candidates")).to_contain_text("g0s0")
        page.evaluate("document.querySelector('[aria-label=Candidates]').scrollLeft = 90")
        model.allowed.release()
        expect(page.locator("#candidates")).to_contain_text("g0s1")
        assert page.evaluate("document.querySelector('[aria-label=Candidates]').scrollLeft") == 90
        expect(page.get_by_text("The run is waiting for your feedback.")).to_be_visible()
        page.get_by_role("button", name="Send and continue").click()


def test_a_line_that_is_pointed_at_stands_out_and_beyond_four_lines_have_dashes(page: Page, tmp_path: Path):
    for number in range(5):
        search_in(tmp_path / f"run-{number}", [reply(7 + number), reply(8 + 2 * number)])
    page.goto("/compare?" + "&".join(f"run=run-{number}" for number in range(5)))
    chart, drawn = page.locator(".chart"), "canvas => canvas.toDataURL()"
    canvas = chart.locator("canvas")
    expect(canvas).to_be_visible()
    before = canvas.evaluate(drawn)
    entry = chart.get_by_role("button", name="run-1")
    for begin, end in ((entry.hover, page.mouse.move), (lambda: page.keyboard.press("Tab"), lambda *_: entry.blur())):
        begin()
        assert comes_true(page, f"document.querySelector('canvas').toDataURL() !== {before!r}")
        end(0, 0)
        assert comes_true(page, f"document.querySelector('canvas').toDataURL() === {before!r}")
        chart.get_by_role("button", name="run-0").evaluate("button => button.focus({focusVisible: false})")
    signs = chart.locator(".legend i").evaluate_all("signs => signs.map((sign) => sign.className)")
    assert [sign.endswith("d1") for sign in signs] == [False, False, False, False, True]


SAID = """window.said = []; const own = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (...told) { said.push(told[0]); own.call(this, ...told); };"""
"""Records the text that is drawn on any canvas."""


def test_candidates_are_counted_in_whole_numbers(page: Page, tmp_path: Path):
    for name in ("one", "two"):
        search_in(tmp_path / name, [reply(7), reply(8)])
    page.add_init_script(SAID)
    page.goto("/compare?run=one&run=two")
    assert comes_true(page, "said.includes('2')")
    assert not page.evaluate("said.includes('1.5')")


def test_the_slots_of_a_single_generation_are_named_below_their_points(page: Page, tmp_path: Path):
    search_in(tmp_path / "run", [reply(7), reply(8)])
    page.add_init_script(SAID)
    page.goto("/runs/run/")
    assert comes_true(page, "said.includes('g0s1')")
    assert not page.evaluate("said.includes('gen. 0')")


def test_paper_keeps_headings_and_the_keys_of_charts(page: Page, searched: Path):
    page.goto("/runs/run/")
    expect(page.locator(".chart canvas")).to_be_visible()
    page.emulate_media(media="print")
    expect(page.get_by_role("heading", name="Candidates", exact=True)).to_be_visible()
    expect(page.get_by_label("Find")).to_be_hidden()
    adjusted = page.locator(".legend i").evaluate_all("all => all.map(one => getComputedStyle(one).printColorAdjust)")
    assert set(adjusted) == {"exact"}  # otherwise browsers print no backgrounds


def test_a_phone_scrolls_code_as_it_was_written_and_breaks_long_titles_of_columns(page: Page, searched: Path):
    page.set_viewport_size({"width": 390, "height": 900})
    page.goto("/runs/run/")
    code = page.locator("pre.code").first
    assert code.evaluate("pre => getComputedStyle(pre).whiteSpace") == "pre"
    title = page.get_by_role("columnheader", name="F, training maximum")
    assert title.evaluate("cell => cell.clientHeight / parseFloat(getComputedStyle(cell).lineHeight)") > 2


def test_only_what_can_be_scrolled_is_a_stop_of_the_keyboard(page: Page, searched: Path):
    page.goto("/runs/run/")
    box = page.get_by_role("group", name="Candidates", exact=True)
    assert comes_true(page, "document.querySelector('[aria-label=Candidates]').tabIndex === -1")
    page.set_viewport_size({"width": 375, "height": 900})
    assert comes_true(page, "document.querySelector('[aria-label=Candidates]').tabIndex === 0")
    assert box.evaluate("box => box.scrollWidth > box.clientWidth")


def test_a_component_has_one_colour_in_its_chart_and_in_its_bar(page: Page, searched: Path):
    page.goto("/runs/run/candidates?show=g0s0")
    chart = page.locator(".chart", has_text="Components")
    expect(chart.locator("canvas")).to_be_visible()
    color = "all => all.map(one => getComputedStyle(one).color)"
    lines, bars = chart.locator(".legend i").evaluate_all(color), page.locator(".shares svg").evaluate_all(color)
    assert lines == bars and lines


def test_a_title_stands_level_with_its_badge(page: Page, searched: Path):
    page.goto("/runs/run/candidates?show=g0s0")
    middles = page.locator(".candidate .title > *").evaluate_all(
        "all => all.map(one => one.getBoundingClientRect()).map(({ top, bottom }) => (top + bottom) / 2)"
    )
    assert max(middles) - min(middles) < 1


def test_a_finger_reads_the_chart_first_and_only_a_point_leads_on(chromium: Browser, address: str, searched: Path):
    with chromium.new_context(base_url=address, has_touch=True, viewport={"width": 375, "height": 900}) as context:
        page = context.new_page()
        page.goto(f"{address.replace('//', f'//{guard.USER}:{TOKEN}@')}/open")
        page.goto("/runs/run/")
        chart = page.locator(".chart", has_text="F when played")
        chart.scroll_into_view_if_needed()
        expect(chart.locator("canvas")).to_be_visible()
        box = chart.locator(".u-over").bounding_box()
        assert box is not None
        # The x axis goes from -0.6 to 3.6: the first of four points is at 0.6 / 4.2 of the width. F goes from 0 to 7.5.
        x = box["x"] + 0.6 / 4.2 * box["width"]
        page.touchscreen.tap(x, box["y"] + box["height"] - 4)  # nothing is there
        page.touchscreen.tap(x, box["y"] + box["height"] - 4)
        expect(chart.locator(".tip")).to_contain_text("g0s0")
        top = page.evaluate(
            "(() => { const { plot, chart } = eureka.of(document.querySelector('.chart'));"
            "return plot.valToPos(chart.lines[0].values[0], 'y'); })()"
        )
        page.touchscreen.tap(x, box["y"] + top)
        page.wait_for_timeout(300)
        assert page.url.endswith("/runs/run/")
        page.touchscreen.tap(x, box["y"] + top)
        expect(page).to_have_url(re.compile(r"candidates\?show=g0s0$"))


def test_a_phone_does_not_enlarge_the_page_when_a_field_is_touched(chromium: Browser, address: str, searched: Path):
    fields = "[...document.querySelectorAll('input, select, textarea')]"
    sizes = f"{fields}.map(one => parseFloat(getComputedStyle(one).fontSize))"
    with chromium.new_context(base_url=address, has_touch=True, is_mobile=True) as context:
        page = context.new_page()
        page.set_viewport_size({"width": 375, "height": 900})
        page.goto(f"{address.replace('//', f'//{guard.USER}:{TOKEN}@')}/open")
        for place in ("/", "/runs/run/"):
            page.goto(place)
            assert min(page.evaluate(sizes)) >= 16, place  # for smaller text iOS enlarges the page


def test_only_the_newest_and_the_best_generation_are_unfolded_and_a_person_folds_them(page: Page, tmp_path: Path):
    script = [reply(n) for n in (3, 4, 9, 5, 6, 7)]
    with running(tmp_path / "run", script, iteration=3) as model:
        model.allowed.release(4)
        page.goto("/")
        page.get_by_role("link", name="run", exact=True).click()
        expect(page.get_by_text("The run is waiting for your feedback.")).to_be_visible()
        page.get_by_role("button", name="Send and continue").click()
        expect(page.locator("#g1s1")).to_contain_text("trained")
        expect(page.get_by_text("The run is waiting for your feedback.")).to_be_visible()
        page.get_by_role("button", name="Send and continue").click()
        model.allowed.release()
        expect(page.locator("#g2s0")).to_be_visible()
        page.reload()
        for place, seen in (("g0s1", False), ("g1s0", True), ("g2s0", True)):
            expect(page.locator(f"#{place}")).to_be_visible(visible=seen)
        fold = page.locator("summary", has_text="Generation 2")
        fold.click()
        expect(page.locator("#g2s0")).to_be_hidden()
        page.locator("summary", has_text="Generation 0").click()
        expect(page.locator("#g0s1")).to_be_visible()
        model.allowed.release()
        expect(page.locator("#candidates")).to_contain_text("g2s1")
        expect(page.locator("#g2s1")).to_be_hidden()
        expect(page.locator("#g0s1")).to_be_visible()


CONTRAST = """element => {
  const parts = (color) => color.match(/[\\d.]+/g).slice(0, 3).map((part) => part / 255);
  const light = (color) => parts(color).map((c) => (c <= .04045 ? c / 12.92 : ((c + .055) / 1.055) ** 2.4))
    .reduce((sum, c, i) => sum + c * [.2126, .7152, .0722][i], 0);
  const found = [getComputedStyle(element).borderTopColor, getComputedStyle(element.closest(".panel")).backgroundColor];
  const [low, high] = found.map(light).sort((a, b) => a - b);
  return (high + .05) / (low + .05);
}"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_boxes_and_fields_are_seen(page: Page, searched: Path, scheme: Literal["light", "dark"]):
    page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
    page.goto("/runs/run/")
    for field in (page.get_by_label("compare g0s0"), page.get_by_label("Find")):
        assert field.evaluate(CONTRAST) >= 3.0  # WCAG 2.2, 1.4.11
