"""Opens a report in Chromium, uses its controls, and checks its accessibility with axe-core.

    report.py REPORT.html AXE.js PICTURES
"""

import pathlib
import sys
import time

from playwright.sync_api import sync_playwright

REPORT, AXE, PICTURES = map(pathlib.Path, sys.argv[1:4])
VIEWER = REPORT.with_name(REPORT.name.replace(".report.", ".viewer."))
SECTIONS = [
    "Output", "Figures", "A square before and after", "Nearest distances, in spacings",
    "δ by iteration", "Distances between input and output, in spacings", "Map", "Least even squares", "Tiles, coloured by δ", "Seams",
    "Time and memory", "Inputs", "Settings",
]
CHROMIUM = next(
    path for path in map(pathlib.Path, ("/usr/bin/chromium", "/usr/bin/chromium-browser")) if path.exists()
)

assert REPORT.stat().st_size <= 5_000_000, REPORT.stat().st_size
with sync_playwright() as playwright:
    browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox"])
    for width, scheme in ((390, "dark"), (820, "light"), (1280, "light")):
        page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
        said = []
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: said.append(request.url)
                if not request.url.startswith(("file:", "data:")) else None)
        began = time.monotonic()
        page.goto(REPORT.resolve().as_uri(), wait_until="load")
        seconds = time.monotonic() - began
        assert seconds < 2.0, f"{seconds:.1f} s to open"
        headings = page.locator("h2").all_inner_texts()
        assert [h for h in headings if h not in ("Levels", "Mesh", "Notes")] == SECTIONS, headings
        assert page.locator(".card").count() == 4
        overflow = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert overflow <= 0, f"{overflow} pixels too wide at {width}"
        image = page.locator("img.overview")
        assert image.evaluate("image => image.naturalWidth") == 1280

        link = page.locator("a.viewer").evaluate("link => link.href")
        assert link == VIEWER.resolve().as_uri(), link

        # The map is drawn, redrawn by its controls, and tells what is under the pointer.
        painted = lambda: page.evaluate("document.getElementById('map').toDataURL()")
        seen = {painted()}
        for choice in ("output", "input", "spacing"):
            page.select_option("#map-by", choice)
            seen.add(painted())
        page.check("#map-tiles")
        seen.add(painted())
        assert len(seen) == 5, len(seen)
        page.locator("#map").scroll_into_view_if_needed()
        page.locator("#map").hover()
        assert page.inner_text("#map-says").startswith("at "), page.inner_text("#map-says")
        page.focus("#map")
        page.keyboard.press("ArrowRight")
        before = page.inner_text("#map-says")
        page.keyboard.press("ArrowLeft")
        assert page.inner_text("#map-says") != before

        page.add_script_tag(path=str(AXE))
        found = page.evaluate("axe.run().then(result => result.violations)")
        serious = [v for v in found if v["impact"] in ("serious", "critical")]
        assert not serious, [(v["id"], v["nodes"][0]["html"][:120]) for v in serious]
        assert not said, said
        page.screenshot(path=str(PICTURES / f"report-{width}.png"), full_page=True)
        page.emulate_media(media="print")
        print(f"{width} pixels, {scheme}: opened in {seconds:.2f} s, {len(found)} minor findings")
    browser.close()
