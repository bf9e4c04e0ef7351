"""Open a page of a report in headless Chromium: everything is drawn, readable and within reach of a keyboard.

Arguments: the page, and optionally a folder for pictures of it.
"""

import base64
import pathlib
import sys
import tempfile

from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

page = pathlib.Path(sys.argv[1]).resolve()
pictures = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None

options = webdriver.ChromeOptions()
options.binary_location = "/usr/bin/chromium"
options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
for argument in (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --hide-scrollbars"
).split():
    options.add_argument(argument)
profile = tempfile.TemporaryDirectory()
options.add_argument(f"--user-data-dir={profile.name}")
browser = webdriver.Chrome(options=options, service=webdriver.ChromeService("/usr/bin/chromedriver"))

# Text whose contrast with what is behind it is too low (WCAG 2.2, 1.4.3).
FAINT = """
const parts = (text) => text.match(/[\\d.]+/g).map(Number);
const light = ([r, g, b]) => [r, g, b].map((c) => c / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
  .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
const behind = (e) => {
  for (; e; e = e.parentElement) {
    const c = parts(getComputedStyle(e).backgroundColor);
    if (c.length < 4 || c[3] > 0) return c;
  }
  return [255, 255, 255];
};
const faint = [];
for (const e of document.querySelectorAll("header *, main *")) {
  const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
  if (!own || e.offsetParent === null) continue;
  const [a, b] = [light(parts(getComputedStyle(e).color)), light(behind(e))];
  const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  if (ratio < 4.5) faint.push(e.tagName + ": " + e.textContent.slice(0, 40) + " " + ratio.toFixed(2));
}
return faint;
"""

# Places of pictures that are visible and empty.
EMPTY = """
const blank = (place) => {
  const canvas = place.querySelector("canvas");
  if (!canvas) return true;
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const colours = new Set();
  for (let k = 0; k < pixels.length; k += 4) colours.add((pixels[k] << 16) | (pixels[k + 1] << 8) | pixels[k + 2]);
  return colours.size < 4;
};
const empty = [...document.querySelectorAll(".plot")].filter((p) => p.clientWidth > 0 && blank(p)).map((p) => p.ariaLabel);
const flat = [...document.querySelectorAll(".figure svg, .share .track, .share i")].filter((e) => {
  const { width, height } = e.getBoundingClientRect();
  return !(width > 0 && height > 10);
});
return [...empty, ...flat.map((e) => e.outerHTML.slice(0, 60))];
"""

KINDS = ("measured", "before", "after")

FOCUSABLE = "return [...document.querySelectorAll('a, summary, .plot, button, input, [tabindex]')].filter((e) => e.checkVisibility()).length"


def media(kind, scheme):
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": kind, "features": features})


def size(width, height):
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    browser.execute_async_script("setTimeout(arguments[0], 400)")


def picture(name):
    if pictures:
        shot = browser.execute_cdp_cmd("Page.captureScreenshot", {"captureBeyondViewport": True})
        (pictures / f"{name}.png").write_bytes(base64.b64decode(shot["data"]))


def looks_right(name):
    empty, faint = browser.execute_script(EMPTY), browser.execute_script(FAINT)
    assert not empty, f"{name}: not drawn: {empty}"
    assert not faint, f"{name}: too faint: {faint}"
    wide = browser.execute_script("return document.scrollingElement.scrollWidth - innerWidth")
    assert wide <= 0, f"{name}: {wide} pixels wider than the window"
    picture(name)


size(1200, 900)
media("screen", "light")
browser.get(page.as_uri())
assert browser.execute_script("return document.querySelectorAll('.plot, .figure svg, .share').length") > 0, "no pictures"
browser.execute_script("document.querySelectorAll('details').forEach((e) => { e.open = true; })")
for name, scheme, shape in [("light", "light", (1200, 900)), ("dark", "dark", (1200, 900)), ("phone", "light", (375, 800))]:
    media("screen", scheme)
    size(*shape)
    looks_right(name)

# Every part that can be used is reached by the tabulator.
size(1200, 900)
media("screen", "light")
wanted = browser.execute_script(FOCUSABLE)
browser.execute_script("window.reached = new Set(); addEventListener('focusin', (e) => reached.add(e.target))")
for _ in range(wanted + 5):
    browser.switch_to.active_element.send_keys(Keys.TAB)
reached = browser.execute_script("return reached.size")
assert reached >= wanted, f"{reached} of {wanted} reached by the keyboard"

# A key zooms.
for place in browser.find_elements(By.CSS_SELECTOR, ".plot")[:1]:
    shown = "return arguments[0].querySelector('canvas').toDataURL()"
    before = browser.execute_script(shown, place)
    place.send_keys("+")
    browser.execute_async_script("setTimeout(arguments[0], 100)")
    assert browser.execute_script(shown, place) != before, "+ does not zoom"

# The rig moves by the slider and by the button; who wants less motion has the slider alone.
player = browser.find_elements(By.CSS_SELECTOR, ".motion")
if player:
    slider, button = (player[0].find_element(By.CSS_SELECTOR, part) for part in ("input", "button"))

    def drawn():
        return {kind: player[0].find_element(By.CSS_SELECTOR, f".{kind}[data-kind]").get_attribute("points") for kind in KINDS}

    def waited(seconds):
        browser.execute_async_script(f"setTimeout(arguments[0], {1000 * seconds})")
        return int(slider.get_attribute("value"))

    still = drawn()
    assert still["before"] != still["measured"], "it does not stand where the two differ"
    slider.send_keys(Keys.HOME)
    first = drawn()
    slider.send_keys(*[Keys.ARROW_RIGHT] * 5)
    later = drawn()
    assert all(first[kind] != later[kind] for kind in KINDS), "the slider does not move it"
    slider.send_keys(Keys.HOME)
    assert drawn() == first, "the slider does not move it back"
    button.send_keys(Keys.ENTER)
    at = waited(0.5)
    assert button.text == "Pause" and 0 < at < waited(0.3), "it does not play"
    button.send_keys(Keys.ENTER)
    assert button.text == "Play" and waited(0) == waited(0.2), "it does not stop"
    reduced = [{"name": "prefers-reduced-motion", "value": "reduce"}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "screen", "features": reduced})
    assert slider.is_displayed() and not button.is_displayed(), "it plays for those who want less motion"

media("print", "light")
if player:
    waited(0.1)
    assert drawn() == still, "paper has another moment than the text says"
assert browser.execute_script("return getComputedStyle(document.querySelector('nav')).display") == "none"
paper = base64.b64decode(browser.execute_cdp_cmd("Page.printToPDF", {"printBackground": False})["data"])
assert paper.startswith(b"%PDF") and len(paper) > 20_000, len(paper)
if pictures:
    (pictures / "print.pdf").write_bytes(paper)

fetched = browser.execute_script("return performance.getEntriesByType('resource').map((e) => e.name)")
assert fetched == [], f"fetched: {fetched}"
said = [entry for entry in browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]
assert not said, said
browser.quit()
