"""Opens a viewer in Chromium, uses its controls, and checks its accessibility with axe-core.

    viewer.py VIEWER.html AXE.js PICTURES

Chromium draws without a graphics card here (SwiftShader).
"""

import pathlib
import sys
import time

from playwright.sync_api import sync_playwright

VIEWER, AXE, PICTURES = map(pathlib.Path, sys.argv[1:4])
CHROMIUM = next(
    path for path in map(pathlib.Path, ("/usr/bin/chromium", "/usr/bin/chromium-browser")) if path.exists()
)
ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]

with sync_playwright() as playwright:
    browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=ARGUMENTS)
    for width, height, scheme in ((390, 844, "dark"), (820, 1100, "light"), (1280, 900, "light")):
        page = browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
        said = []
        page.on("console", lambda message: said.append(message.text)
                if "GPU stall due to ReadPixels" not in message.text else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: said.append(request.url)
                if not request.url.startswith(("file:", "data:", "blob:")) else None)
        began = time.monotonic()
        page.goto(VIEWER.resolve().as_uri(), wait_until="load")
        drawn = lambda: page.evaluate("Number(document.getElementById('view').dataset.drawn ?? 0)")
        page.wait_for_function("document.getElementById('view').dataset.drawn > 0")
        # What the output can be shown as; nothing without a mesh.
        ways = page.eval_on_selector_all("#as option", "all => all.map(option => option.value)")
        if ways:
            page.wait_for_function("document.getElementById('view').dataset.as")
        seconds = time.monotonic() - began
        canvas = page.locator("#view")

        def seen(act):
            """What is seen once `act` has had its effect."""
            before = drawn()
            act()
            page.wait_for_function(f"document.getElementById('view').dataset.drawn > {before}")
            page.wait_for_timeout(100)
            return canvas.screenshot()

        # Each control shows something else; each view, too, from wherever one is.
        pictures = {canvas.screenshot()}
        choices = page.eval_on_selector_all("#by option", "all => all.map(option => option.value)")
        assert {"color", "height", "intensity", "distance"} <= set(choices), choices
        for choice in choices[1:]:
            pictures.add(seen(lambda: page.select_option("#by", choice)))
            assert page.inner_text("#legend")
        pictures.add(seen(lambda: page.check("#borders")))
        for view in ("above", "street"):
            pictures.add(seen(lambda: page.click(f"#{view}")))
        pictures.add(seen(lambda: page.fill("#size", "2")))
        # The levels of the output, if it has any: fewer points.
        has_levels = page.locator("#level").count()
        if has_levels:
            deepest = page.get_attribute("#level", "max")
            whole = page.inner_text("#level-says")
            pictures.add(seen(lambda: page.fill("#level", "0")))
            assert page.inner_text("#level-says") != whole
            seen(lambda: page.fill("#level", deepest))
        page.focus("#view")
        for key in ("+", "ArrowLeft", "Shift+ArrowUp"):
            pictures.add(seen(lambda: page.keyboard.press(key)))
        for way in ways[1:]:
            pictures.add(seen(lambda: page.select_option("#as", way)))
        box = canvas.bounding_box()
        page.mouse.move(box["x"] + 60, box["y"] + 60)
        page.mouse.down()
        pictures.add(seen(lambda: page.mouse.move(box["x"] + 120, box["y"] + 80)))
        page.mouse.up()
        assert len(pictures) == len(choices) + 8 + has_levels + len(ways[1:]), len(pictures)

        page.add_script_tag(path=str(AXE))
        found = page.evaluate("axe.run().then(result => result.violations)")
        serious = [v for v in found if v["impact"] in ("serious", "critical")]
        assert not serious, [(v["id"], v["nodes"][0]["html"][:120]) for v in serious]
        overflow = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert overflow <= 0, f"{overflow} pixels too wide at {width}"
        assert not said, said
        page.select_option("#by", "color")
        page.uncheck("#borders")
        page.fill("#size", "0.8")
        if ways:
            page.select_option("#as", ways[0])
        seen(lambda: page.click("#aslant"))
        page.screenshot(path=str(PICTURES / f"viewer-{width}.png"))
        print(f"{width} pixels, {scheme}: seen after {seconds:.2f} s, {len(found)} minor findings")
    browser.close()
