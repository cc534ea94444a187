#!/usr/bin/env python3
"""Uses pages of tools/report as a reader does, in headless Chromium, wide and narrow: turns the view, hides a part, plays a motion,
points at a chart, draws a box in it, clicks a mode.

    tests/evidence/page.py results/tgv/report.html [--shots FOLDER]

Needs chromium and chromium-driver. Prints a line a check, ends with 1 where one fails; pictures of each step go to the folder.
"""

import argparse
import base64
import json
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

PORT = 9517
BROWSER = {"binary": "/usr/bin/chromium", "args": ["--headless=new", "--no-sandbox", "--hide-scrollbars", "--use-gl=angle", "--use-angle=swiftshader",
                                                   "--enable-unsafe-swiftshader"]}
MODE_POINT = """for (const chart of Object.values(report.charts).flat()) for (const [k, data] of chart.chart.data.datasets.entries())
  for (const [j, mode] of (data.source.modes || []).entries())
    if (report.view && report.view.runs.some(r => r.run === data.source.run && r.motions.some(m => m.mode === mode))) {
      chart.canvas.scrollIntoView({block: "center"});
      const at = chart.chart.getDatasetMeta(k).data[j], frame = chart.canvas.getBoundingClientRect();
      return [frame.left + at.x, frame.top + at.y, mode];
    }
return null;"""


class Browser:
    """A session of chromedriver by WebDriver's own requests."""

    def __init__(self, width):
        options = {"capabilities": {"alwaysMatch": {"browserName": "chrome", "goog:chromeOptions": BROWSER, "timeouts": {"script": 120000, "pageLoad": 120000}}}}
        self.session = f"/session/{self.ask('POST', '/session', options)['sessionId']}"
        # A window is 500 pixels wide at least; the device may be narrower.
        metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        self.post("/goog/cdp/execute", {"cmd": "Emulation.setDeviceMetricsOverride", "params": metrics})

    @staticmethod
    def ask(method, path, body=None):
        request = urllib.request.Request(f"http://localhost:{PORT}{path}", json.dumps(body or {}).encode() if method == "POST" else None,
                                         {"Content-Type": "application/json"}, method=method)
        return json.loads(urllib.request.urlopen(request, timeout=150).read())["value"]

    def post(self, path, body):
        return self.ask("POST", self.session + path, body)

    def script(self, words):
        return self.post("/execute/sync", {"script": words, "args": []})

    def until(self, words):
        """Whether it holds within 20 seconds."""
        end = time.time() + 20
        while not self.script(words):
            if time.time() > end:
                return False
            time.sleep(0.2)
        return True

    def pointer(self, *steps):
        """Steps: a place to go to, "down" or "up"."""
        actions = [{"type": "pointerMove", "duration": 150, "x": round(step[0]), "y": round(step[1]), "origin": "viewport"} if not isinstance(step, str)
                   else {"type": f"pointer{step.capitalize()}", "button": 0} for step in steps]
        self.post("/actions", {"actions": [{"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": actions}]})

    def shot(self, file):
        file.write_bytes(base64.b64decode(self.ask("GET", f"{self.session}/screenshot")))

    def box(self, selector):
        """Of an element that is brought into view: left, top, width, height."""
        return self.script(f"const e = document.querySelector({json.dumps(selector)}); e.scrollIntoView({{block: 'center'}}); "
                           "const b = e.getBoundingClientRect(); return [b.left, b.top, b.width, b.height];")


class Checks:
    def __init__(self, browser, width, shots):
        self.browser, self.width, self.shots, self.failed = browser, width, shots, 0

    def __call__(self, words, holds):
        print(f"{self.width:5d}  {words}: {'yes' if holds else 'NO'}")
        self.failed += not holds
        if self.shots:
            self.browser.shot(self.shots / f"{self.width}_{words.replace(' ', '_')}.png")


def look_at_view(browser, check):
    eye = "return report.view.camera.position.toArray()"
    places = "return Array.from(report.view.position.array).reduce((a, b) => a + Math.abs(b), 0)"
    left, top, wide, high = browser.box("#view canvas")
    before, middle = browser.script(eye), (left + wide / 2, top + high / 2)
    browser.pointer(middle, "down", (middle[0] + wide / 5, middle[1] - high / 6), "up")
    check("the view turns", max(abs(a - b) for a, b in zip(before, browser.script(eye))) > 1e-3)
    browser.script("document.querySelector('#view .parts input[type=checkbox]').click()")
    check("a part hides", browser.script("return !report.view.parts[0].mesh.visible && report.view.parts.length > 1"))
    browser.script("document.querySelector('#view .parts input[type=checkbox]').click()")
    if browser.script("return report.view.data.motions.length"):
        still = browser.script(places)
        browser.script("report.view.setPlaying(true)")
        moved = browser.until(f"const still = {still}; {places.replace('return', 'return still !==')}")
        browser.script("report.view.setPlaying(false)")  # before a picture is taken
        check("a motion plays", moved)
    if browser.script("return document.querySelectorAll('#view .sides button').length") > 1:
        browser.script("document.querySelectorAll('#view .sides button')[1].click()")
        check("the contact side shows alone", browser.script("return report.view.parts.filter(p => p.mesh.visible).length < report.view.parts.length"))
        browser.script("document.querySelector('#view .sides button').click()")


def look_at_charts(browser, check):
    browser.box(".charts")
    browser.until("return Object.keys(report.charts).length > 0")
    first = "Object.values(report.charts)[0][0]"
    browser.script(f"{first}.canvas.scrollIntoView({{block: 'center'}})")
    left, top, wide, high = browser.script(f"const b = {first}.canvas.getBoundingClientRect(); return [b.left, b.top, b.width, b.height];")
    browser.pointer((left + 0.5 * wide, top + 0.5 * high))
    check("a chart answers the pointer", browser.until(f"return {first}.chart.tooltip.opacity > 0"))
    scales = f"const s = {first}.chart.scales; return [s.x.min, s.x.max, s.y.min, s.y.max];"
    before = browser.script(scales)
    browser.pointer((left + 0.4 * wide, top + 0.2 * high), "down", (left + 0.8 * wide, top + 0.6 * high), "up")
    after = browser.script(scales)
    check("a box becomes the chart", after[1] - after[0] < 0.8 * (before[1] - before[0]))
    browser.script(f"{first}.reset()")
    check("all of it comes back", browser.script(scales) == before)
    at = browser.script(MODE_POINT)
    if at:
        browser.pointer(at[:2], "down", "up")
        shown = browser.until(f"return report.view.playing && report.view.chosen.mode === {at[2]}")
        browser.script("report.view.setPlaying(false)")
        check("a click on a mode shows its shape", shown)


def look(page, width, shots):
    browser = Browser(width)
    check = Checks(browser, width, shots)
    browser.post("/url", {"url": page.resolve().as_uri()})
    browser.until("return document.body.classList.contains('ready')")
    check("nothing sticks out", browser.script("return document.documentElement.scrollWidth") <= width)
    if browser.script("return Boolean(report.view)"):
        look_at_view(browser, check)
    if browser.script("return Boolean(document.querySelector('.charts'))"):
        look_at_charts(browser, check)
    asked = browser.script("return performance.getEntriesByType('resource').map(e => e.name).filter(n => !/^(data|blob):/.test(n))")
    check("nothing was asked of a network", not asked)
    browser.ask("DELETE", browser.session)
    return check.failed


def wait_for_driver():
    for _ in range(100):
        try:
            return Browser.ask("GET", "/status")
        except OSError:
            time.sleep(0.2)
    sys.exit("page.py: chromedriver does not answer")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", type=Path, nargs="+")
    parser.add_argument("--shots", type=Path, help="folder for a picture of each step")
    a = parser.parse_args()
    driver = subprocess.Popen(["chromedriver", f"--port={PORT}"], stdout=subprocess.DEVNULL)
    failed = 0
    try:
        wait_for_driver()
        for page in a.page:
            print(f"{page}, {page.stat().st_size / 1e6:.2f} MB")
            shots = a.shots / page.stem if a.shots else None
            if shots:
                shots.mkdir(parents=True, exist_ok=True)
            failed += sum(look(page, width, shots) for width in (1280, 390))
    finally:
        driver.terminate()
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
