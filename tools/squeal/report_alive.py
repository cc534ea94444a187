"""What makes the page of tools/report alive: libraries of the machine, the page's own scripts, and their data, all within the page."""

import base64
import html
import json
import os
import zlib
from pathlib import Path

from squeal.report_view import views

# Of Debian's packages libjs-three and libjs-chart.js, which tools/setup installs.
LIBRARIES = {"library-three": "three/three.min.js", "library-orbit": "three/examples/js/controls/OrbitControls.js",
             "library-chart": "chart.js/chart.min.js"}
FOLDER = Path(os.environ.get("SQUEAL_JAVASCRIPT", "/usr/share/javascript"))
SCRIPTS = ("report_view.js", "report_charts.js", "report_page.js")
LACKING = ("This page has pictures alone: the 3D view and the charts that answer a pointer need three.js and Chart.js, which "
           "tools/setup installs (libjs-three, libjs-chart.js).")


def squeezed(text):
    return base64.b64encode(zlib.compress(text.encode(), 9)).decode()


def libraries():
    """Text of each by its id; empty where one is not there, since an update may have taken it away."""
    files = {name: FOLDER / file for name, file in LIBRARIES.items()}
    return {name: file.read_text(encoding="utf-8") for name, file in files.items()} if all(map(Path.exists, files.values())) else {}


class Alive:
    """Collects charts while pictures are drawn, and writes what the page needs at its end."""

    def __init__(self, runs):
        self.libraries, self.charts = libraries(), {}
        self.views, self.without = views(runs) if self.libraries else ([], [])

    def add(self, charts, title):
        """Keeps the charts of a figure; returns their place in the page, below the figure's title."""
        if not charts or not self.libraries:
            return ""
        name = f"charts-{len(self.charts)}"
        self.charts[name] = charts
        head = f'<p class="title">{html.escape(title)}</p>' if title else ""
        many = " many" if max(chart["columns"] for chart in charts) > 2 else ""
        return f'{head}<div class="charts{many}" id="{name}" hidden></div>'

    def stage(self):
        """Where the 3D view comes, or why there is none."""
        if not self.libraries:
            return f'<section class="still"><p>{LACKING}</p></section>'
        return '<section hidden class="stand"><h2>In 3D</h2><div id="view"></div></section>' if self.views else ""

    def scripts(self):
        data = {"charts": json.dumps(self.charts)} if self.charts else {}
        if self.views:
            data["views"] = json.dumps(self.views)
        wanted = {name: text for name, text in self.libraries.items()
                  if (self.charts if name == "library-chart" else self.views)}
        packed = "".join(f'<script type="text/plain" id="{name}">{squeezed(text)}</script>' for name, text in (wanted | data).items())
        own = "\n".join((Path(__file__).parent / name).read_text() for name in SCRIPTS)
        return f"{packed}<script>{own}</script>"
