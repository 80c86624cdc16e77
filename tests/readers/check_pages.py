"""Reads pages in headless Chromium as people do: light and dark, wide and narrow, on paper; no network, no script.

    python tests/readers/check_pages.py PAGE|FOLDER… [--screenshots FOLDER]
    python tests/readers/check_pages.py --self-test

Of a folder every page in it is read. Checked in each layout (look_at_page.js): nothing runs or comes from elsewhere;
the verdict comes first; headings in order, ids unique, anchors lead somewhere; charts have words, a size, and writing that
is large enough and not over other writing; text has a contrast of 4.5 and marks one of 3; nothing sticks out to the side. Besides: what
is seen is not blank, light is light and dark is dark; on paper it is black on white and has sheets. The self-test breaks
a sound page in each of these ways, and every one has to be named.
"""

import argparse
import io
import pathlib
import sys
import tempfile

from PIL import Image

from chromium import Chromium, ChromiumError

PROBE = (pathlib.Path(__file__).parent / "look_at_page.js").read_text()
LAYOUTS = [
    {"width": 1280, "height": 900, "colours": "light"},
    {"width": 1280, "height": 900, "colours": "dark"},
    {"width": 400, "height": 800, "colours": "light"},
    {"width": 400, "height": 800, "colours": "dark"},
    # A4 without its margins, by somebody whose screen is dark.
    {"width": 688, "height": 970, "colours": "dark", "media": "print"},
]
# Of the pixels at first sight so many are other than the ground's.
LEAST_SHARE_PRINTED = 0.002
# Text is drawn in many shades where it is smoothed.
LEAST_COLOURS = 12


def name_of(layout):
    return f"{layout.get('media', 'screen')}-{layout['width']}-{layout['colours']}"


def seen(png, is_dark):
    """What is wrong with what is seen."""
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    colours = sorted(picture.getcolors(picture.width * picture.height), reverse=True)
    often, ground = colours[0]
    share = 1 - often / (picture.width * picture.height)
    if share < LEAST_SHARE_PRINTED or len(colours) < LEAST_COLOURS:
        yield f"what is seen is blank: {100 * share:.2f} % of it is not the ground, in {len(colours)} colours"
    brightness = sum(ground) / 3
    if (brightness > 64) if is_dark else (brightness < 224):
        yield f"the ground is {ground} where it should be {'dark' if is_dark else 'light'}"


def check(chromium, path, screenshots=None):
    """What is wrong with a page, each with the layout in which it is met first."""
    problems = {}
    page = chromium.open(path)
    for layout in LAYOUTS:
        page.show(**layout)
        found = page.look(PROBE)
        is_dark = layout["colours"] == "dark" and "media" not in layout
        found += seen(page.screenshot(), is_dark)
        for problem in found:
            problems.setdefault(problem, name_of(layout))
        if screenshots:
            (screenshots / f"{path.stem}-{name_of(layout)}.png").write_bytes(page.screenshot(whole=True))
    for address in page.asked_for():
        problems.setdefault(f"the page asked for {address}", "any layout")
    pdf, sheets = page.pdf()
    if sheets == 0:
        problems["on paper it has no sheet"] = "print"
    if screenshots:
        (screenshots / f"{path.stem}.pdf").write_bytes(pdf)
    page.close()
    return [f"{problem} ({layout})" for problem, layout in problems.items()], sheets


SOUND = """<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>A sound page</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>:root { color-scheme: light dark } html { background: #fff; color: #222 } svg text { fill: #222; font: 13px sans-serif }
@media (prefers-color-scheme: dark) { html { background: #111; color: #eee } svg text { fill: #eee } }
@media print { html { background: #fff; color: #000 } svg text { fill: #000 } }
a { color: inherit }</style></head><body>
<h1>Tolerance met</h1><p>Words enough to be seen by whoever opens this, in a line or two of text.</p><nav><a href="#one">One</a></nav>
<section id="one"><h2>One</h2><svg role="img" viewBox="0 0 200 100" width="200"><title>A chart</title>
<text x="10" y="20">left</text><text x="120" y="20">right</text><path d="M0 50H200" stroke="#777"></path></svg>
<table><tr><th>a</th></tr><tr><td>1</td></tr></table></section></body></html>"""

# What is broken, how, and what has to be said of it.
FAULTS = [
    ("white on white", "<h2>", '<h2 style="background: #fff; color: #fff">', "text with a contrast of 1.00"),
    ("a legend as faint as its ground", '<text x="10"', '<text style="fill: #888; opacity: 0.4" x="10"', "text with a contrast"),
    ("faint in the dark only", "color: #eee }", "color: #333 }", "(screen-1280-dark)"),
    ("white ink on paper", "color: #000 }", "color: #fff }", "(print-688-dark)"),
    ("a mark of its ground's colour", 'stroke="#777"', 'stroke="#fff" style="stroke: Canvas"', "a mark with a contrast"),
    ("a picture without words", "<table>", '<img src="data:image/gif;base64,R0lGODlhAQABAAAAACw=" width="9"><table>', "a picture without words"),
    ("a script", "<table>", "<script>document.title = 'run'</script><table>", "a script: "),
    ("a script in an attribute", "<table>", '<table onclick="go()">', "a script in onclick"),
    ("a picture from elsewhere", "<table>", '<img alt="x" src="https://example.org/x.png"><table>', "the page asked for https://example.org/x.png"),
    ("a link to elsewhere", "#one", "https://example.org", "href leads out of the page"),
    ("a link to nothing", "#one", "#two", "a link to #two, which is not there"),
    ("a style from elsewhere", "a { color", "@import 'http://example.org/x.css'; a { color", "a style that loads something"),
    ("a table that sticks out", "<table>", '<table style="width: 1500px">', "the page is 1"),
    ("a line that sticks out of a telephone", "<table>", '<p style="width: 30rem">a</p><table>', "(screen-400-light)"),
    ("a part for the mouse alone", "<table>", '<div style="overflow-x: auto"><p style="width: 2000px">a</p></div><table>', "a part that keys cannot scroll"),
    ("a heading left out", "<h2>One</h2>", "<h3>One</h3>", "a heading of level 3 after one of level 1"),
    ("an id twice", "<h2>", '<h2 id="one">', "the id one twice"),
    ("a verdict at the end", "<h1>Tolerance met</h1>", '<div style="height: 500px"></div><h1>Tolerance met</h1>', "the verdict does not come first"),
    ("a table before the verdict", "<h1>", "<table><tr><th>a</th></tr></table><h1>", "the verdict does not come first"),
    ("a chart that is no picture", 'role="img"', "", "a chart without the role img"),
    ("a chart without a name", "<title>A chart</title>", "", "a chart without a name"),
    ("a chart of no size", 'width="200"', 'width="0"', "a chart of 0 by"),
    ("a crowded legend", '<text x="120" y="20">right</text>', '<g class="legend"><text x="120" y="20">right</text><path d="M140 16h20" stroke="#777"></path></g>', "a legend that runs into the next name"),
    ("a chart of nothing", "M0 50H200", "M0 50", "a chart with nothing drawn in it"),
    ("writing over writing", 'x="120"', 'x="20"', 'writing over "right"'),
    ("writing out of the chart", 'x="120"', 'x="190"', "writing that leaves the chart"),
    ("tiny writing", "13px sans-serif", "6px sans-serif", "writing of 6.0 pixels"),
    ("a table without headings", "<th>a</th>", "<td>a</td>", "a table without headings"),
    ("no language", ' lang="en"', "", "the page names no language"),
    ("nothing to see", "color-scheme: light dark }", "color-scheme: light dark } body { visibility: hidden }", "what is seen is blank"),
    ("no dark", "html { background: #111; color: #eee } svg text { fill: #eee }", "", "where it should be dark"),
]


def self_test(chromium, folder):
    """Faults that are not named, and what a sound page is blamed for."""
    page = folder / "page.html"
    page.write_text(SOUND)
    problems, _ = check(chromium, page)
    yield from (f"a sound page: {problem}" for problem in problems)
    for fault, sound, broken, named in FAULTS:
        if SOUND.count(sound) == 0:
            yield f"{fault}: {sound!r} is not in the sound page"
        page.write_text(SOUND.replace(sound, broken, 1))
        problems, _ = check(chromium, page)
        if not any(named in problem for problem in problems):
            yield f"{fault}: not named among {problems}"


def pages_of(paths):
    for path in paths:
        if path.is_dir():
            yield from sorted(path.rglob("*.html"))
        else:
            yield path


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("pages", nargs="*", type=pathlib.Path)
    parser.add_argument("--screenshots", type=pathlib.Path, help="a folder to leave what is seen in")
    parser.add_argument("--self-test", action="store_true")
    args = parser.parse_args()
    pages = list(pages_of(args.pages))
    if not pages and not args.self_test:
        sys.exit("no page to read")
    if args.screenshots:
        args.screenshots.mkdir(parents=True, exist_ok=True)
    failures = 0
    with Chromium() as chromium:
        print(chromium.version())
        if args.self_test:
            with tempfile.TemporaryDirectory() as folder:
                problems = list(self_test(chromium, pathlib.Path(folder)))
            print(f"self-test: {len(FAULTS)} faults, {len(problems)} problems")
            for problem in problems:
                print(f"  {problem}")
            failures += len(problems)
        for page in pages:
            problems, sheets = check(chromium, page, args.screenshots)
            print(f"{page}: {len(LAYOUTS)} layouts, {sheets} sheets of paper, {len(problems)} problems")
            for problem in problems:
                print(f"  {problem}")
            failures += len(problems)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    try:
        main()
    except ChromiumError as error:
        sys.exit(f"{error}")
