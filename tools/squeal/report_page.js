// Starts what is alive on the page of tools/report. Where a browser cannot, the pictures stay.
"use strict";

// Bytes of base64 text, unpacked.
async function inflate(text) {
  const bytes = Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

async function textOf(id) {
  const element = document.getElementById(id);
  return element ? new TextDecoder().decode(await inflate(element.textContent)) : "";
}

async function library(id) {
  document.head.append(Object.assign(document.createElement("script"), { textContent: await textOf(id) }));
}

async function startPage() {
  let view = null;
  const canShow = (run, mode) => Boolean(view) && view.runs.some(r => r.run === run && r.motions.some(m => m.mode === mode));
  const show = (run, mode) => { view.show(run, mode); document.getElementById("view").scrollIntoView({ behavior: "smooth", block: "nearest" }); };
  const place = document.getElementById("view");
  if (place) {
    try {
      for (const id of ["library-three", "library-orbit"]) await library(id);
      view = await startView(place, JSON.parse(await textOf("views")));
      document.body.classList.add("turns");
    } catch (reason) {
      place.replaceChildren(`This browser shows no 3D view (${reason.message}): the pictures below stand for it.`);
    }
    place.parentElement.hidden = false;
  }
  const charts = {};
  if (document.getElementById("library-chart")) {
    await library("library-chart");
    Chart.defaults.font.family = "system-ui, sans-serif";
    const found = JSON.parse(await textOf("charts"));
    const begin = box => {
      if (charts[box.id]) return;
      charts[box.id] = startCharts(box, found[box.id], canShow, show);
      box.closest("figure").classList.add("started");
    };
    const seen = new IntersectionObserver(entries => entries.filter(e => e.isIntersecting).forEach(e => begin(e.target.querySelector(".charts"))), { rootMargin: "900px" });
    const boxes = [...document.querySelectorAll(".charts")];
    boxes.forEach(box => { box.hidden = false; seen.observe(box.closest("figure")); });
    const rest = () => { if (boxes.length) { begin(boxes.shift()); setTimeout(rest, 30); } }; // those beyond the window, one by one
    setTimeout(rest, 300);
  }
  window.report = { view, charts }; // to look at from the console
}

addEventListener("beforeprint", () => document.querySelectorAll("details.print").forEach(d => { d.open = true; }));
document.querySelectorAll("figure img").forEach(image => { image.onclick = () => image.closest("figure").classList.toggle("large"); });
startPage().catch(reason => console.error(reason)).finally(() => document.body.classList.add("ready"));
