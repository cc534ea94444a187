// Charts of tools/report by Chart.js: they answer a pointer, and a box that is drawn with it becomes the whole chart.
"use strict";

const MARKS = { "o": "circle", ".": "circle", "s": "rect", "D": "rectRot", "^": "triangle", "v": "triangle", "p": "rectRounded", "*": "star", "X": "crossRot", "x": "crossRot",
  "P": "cross", "|": "line" };

function short(value) {
  const size = Math.abs(value);
  return size && (size < 1e-3 || size >= 1e6) ? Number(value.toPrecision(5)).toExponential().replace("e+", "e") : String(Number(value.toPrecision(6)));
}

// A long label on two lines, its unit on the second.
function folded(label) {
  const place = label.length < 30 ? -1 : label.lastIndexOf(" ", Math.max(30, label.lastIndexOf(" [") + 1));
  return place < 0 ? label : [label.slice(0, place), label.slice(place + 1)];
}

// A name and its unit: "frequency [kHz]".
function withUnit(label, value) {
  const [, name, unit] = label.match(/^(.*?)(?: \[(.*)\])?$/s);
  return `${name} ${short(value)}${unit && unit !== "-" ? ` ${unit}` : ""}`;
}

function datasetOf(line) {
  const data = line.x.map((x, k) => ({ x, y: line.y[k], value: line.value ? line.value[k] : line.y[k] }));
  return { label: line.name, data, source: line, showLine: line.line, borderColor: line.colour, backgroundColor: line.colour, borderWidth: line.width, borderDash: line.dash,
    pointStyle: MARKS[line.mark] || (line.line ? "line" : "circle"), pointRotation: line.mark === "v" ? 180 : 0, pointRadius: line.mark ? Math.max(1.5, line.size / 1.7) : 0,
    pointBackgroundColor: line.filling || "rgba(0,0,0,0)", pointBorderColor: line.rim, pointHoverRadius: 6, pointHitRadius: 4, spanGaps: false, clip: 4 };
}

// Images, bars, areas, segments and lines across, below the data.
const below = {
  id: "below",
  beforeDatasetsDraw(chart) {
    const { ctx, chartArea: area, scales: { x, y } } = chart, { at_x, at_y, segments, areas, images } = chart.options.source;
    ctx.save();
    ctx.beginPath();
    ctx.rect(area.left, area.top, area.width, area.height);
    ctx.clip();
    ctx.imageSmoothingEnabled = false;
    for (const { extent, picture } of images) {
      const [left, right, low, high] = [x, x, y, y].map((scale, k) => scale.getPixelForValue(extent[k]));
      if (picture.complete) ctx.drawImage(picture, left, high, right - left, low - high);
    }
    for (const { colour, corners } of areas) {
      ctx.fillStyle = colour;
      ctx.beginPath();
      corners[0].forEach((at, k) => ctx.lineTo(x.getPixelForValue(at), y.getPixelForValue(corners[1][k])));
      ctx.fill();
    }
    const stroke = (look, ...points) => {
      ctx.strokeStyle = look.colour;
      ctx.lineWidth = look.width || 1.4;
      ctx.setLineDash(look.dash || []);
      ctx.beginPath();
      for (const [a, b] of points) ctx.lineTo(a, b);
      ctx.stroke();
    };
    for (const line of at_x) stroke(line, [x.getPixelForValue(line.value), area.top], [x.getPixelForValue(line.value), area.bottom]);
    for (const line of at_y) stroke(line, [area.left, y.getPixelForValue(line.value)], [area.right, y.getPixelForValue(line.value)]);
    for (const { colour, width, ends } of segments) stroke({ colour, width }, ...ends[0].map((at, k) => [x.getPixelForValue(at), y.getPixelForValue(ends[1][k])]));
    ctx.restore();
  },
};

function scaleOf(axis) {
  const [min, max] = axis.range, found = { type: axis.log ? "logarithmic" : "linear", min, max, reverse: Boolean(axis.inverted), title: { display: Boolean(axis.label), text: folded(axis.label), font: { size: 11 } },
    grid: { color: "rgba(0,0,0,0.08)" }, ticks: { maxRotation: 0, autoSkipPadding: 12, maxTicksLimit: 9, includeBounds: false } };
  if (axis.ticks) {
    const words = new Map(axis.ticks);
    found.afterBuildTicks = scale => { scale.ticks = axis.ticks.map(([value]) => ({ value })); };
    Object.assign(found.ticks, { callback: value => words.get(value) ?? "", autoSkip: false });
  } else if (axis.log) {
    // powers of ten alone; of few of them, their doubles and halves too
    const first = value => Number((value / 10 ** Math.floor(Math.log10(value) + 1e-9)).toPrecision(6));
    found.ticks.callback = function (value) { return first(value) === 1 || (this.max < 30 * this.min && [2, 5].includes(first(value))) ? short(value) : ""; };
  } else found.ticks.callback = short;
  return found;
}

// Points of bars, so that they answer: the far end of each.
function barPoints(source) {
  const bars = source.areas.filter(area => area.bar), across = source.y.ticks && !source.x.ticks;
  const point = ({ corners: [x, y] }) => across ? { x: x[2], y: (y[0] + y[2]) / 2, value: (y[0] + y[2]) / 2 } : { x: (x[0] + x[2]) / 2, y: y[2], value: y[2] };
  return { label: "", data: bars.map(point), source: {}, showLine: false, pointRadius: 0, pointHitRadius: 12, pointHoverRadius: 4, borderColor: "#111820", backgroundColor: "#111820" };
}

function tooltip(source, canShow) {
  const said = (axis, value) => axis.ticks && axis.ticks.some(([place, word]) => place === value && isNaN(Number(word.replace("−", "-"))))
    ? axis.ticks.find(([place]) => place === value)[1] : withUnit(axis.label, value);
  return { displayColors: false, callbacks: {
    title: items => items.map(item => item.dataset.label).find(Boolean) || "",
    label: ({ raw }) => [said(source.x, raw.x), said(source.y, raw.value)],
    footer: ([item]) => {
      const { modes, run } = item.dataset.source;
      return modes ? `mode ${modes[item.dataIndex]}` + (canShow(run, modes[item.dataIndex]) ? ": a click shows its shape" : "") : "";
    },
  } };
}

class LiveChart {
  constructor(box, source, canShow, show) {
    this.source = source;
    for (const image of source.images) image.picture = Object.assign(new Image(), { src: image.png, onload: () => this.chart && this.chart.update("none") });
    this.canvas = make("canvas", { tabIndex: 0 });
    this.canvas.setAttribute("aria-label", source.title || `${source.y.label} against ${source.x.label}`);
    const holder = make("div", { className: "plot", style: `aspect-ratio:${Math.min(3, Math.max(1, source.shape))}` }, this.canvas);
    const button = (words, title, act) => make("button", { textContent: words, title, onclick: act });
    const tools = make("div", { className: "tools" }, button("+", "nearer", () => this.zoom(0.5)), button("−", "further", () => this.zoom(2)), button("all", "the whole chart", () => this.reset()));
    box.append(make("div", { className: "chart" }, make("div", { className: "head" }, make("b", { textContent: source.title }), tools), holder, make("div", { className: "key" }, ...source.key.map(([name, colour]) =>
      make("span", {}, make("span", { className: "chip", style: `background:${colour}` }), name)))));
    const labelled = source.lines.filter(line => line.labelled).length;
    this.chart = new Chart(this.canvas, { type: "scatter", data: { datasets: [...source.lines.map(datasetOf), barPoints(source)] }, plugins: [below],
      options: { source, animation: false, maintainAspectRatio: false, parsing: false, interaction: { mode: "nearest", intersect: false, axis: "xy" },
        scales: { x: scaleOf(source.x), y: scaleOf(source.y) }, onClick: (_, found) => this.click(found, canShow, show),
        plugins: { tooltip: tooltip(source, canShow), legend: { display: labelled > 0, position: "bottom", onClick: () => {}, labels: { boxWidth: 7, boxHeight: 7, usePointStyle: true,
          filter: (item, data) => Boolean(item.text) && Boolean(data.datasets[item.datasetIndex].source.labelled) } } } } });
    this.dragged = false;
    this.canvas.addEventListener("pointerdown", event => this.press(event, holder));
    this.canvas.addEventListener("dblclick", () => this.reset());
  }

  click(found, canShow, show) {
    if (this.dragged || !found.length) return;
    const { modes, run } = this.chart.data.datasets[found[0].datasetIndex].source;
    if (modes && canShow(run, modes[found[0].index])) show(run, modes[found[0].index]);
  }

  // A box from where the mouse goes down to where it goes up.
  press(event, holder) {
    this.dragged = false;
    if (event.pointerType === "touch" || event.button !== 0) return;
    const from = [event.offsetX, event.offsetY], box = make("div", { className: "box" });
    const at = end => [Math.min(from[0], end[0]), Math.min(from[1], end[1]), Math.abs(end[0] - from[0]), Math.abs(end[1] - from[1])];
    const place = e => { const frame = this.canvas.getBoundingClientRect(); return [e.clientX - frame.left, e.clientY - frame.top]; };
    const move = e => { const [x, y, w, h] = at(place(e)); box.style.cssText = `left:${x}px;top:${y}px;width:${w}px;height:${h}px`; if (w + h > 12) holder.append(box); };
    const up = e => {
      removeEventListener("pointermove", move);
      removeEventListener("pointerup", up);
      box.remove();
      const [x, y, w, h] = at(place(e));
      if (w < 8 || h < 8) return;
      this.dragged = true;
      const { x: across, y: high } = this.chart.scales;
      this.look([across.getValueForPixel(x), across.getValueForPixel(x + w)], [high.getValueForPixel(y + h), high.getValueForPixel(y)]);
    };
    addEventListener("pointermove", move);
    addEventListener("pointerup", up);
  }

  look(x, y) {
    const sorted = pair => [...pair].sort((a, b) => a - b);
    for (const [name, pair] of [["x", x], ["y", y]]) [this.chart.options.scales[name].min, this.chart.options.scales[name].max] = sorted(pair);
    this.chart.update("none");
    for (const other of this.others || []) {
      [other.chart.options.scales.x.min, other.chart.options.scales.x.max] = sorted(x);
      other.chart.update("none");
    }
  }

  zoom(factor) {
    const about = (scale, log) => {
      const [low, high] = log ? [Math.log(scale.min), Math.log(scale.max)] : [scale.min, scale.max], middle = (low + high) / 2, half = factor * (high - low) / 2;
      return log ? [Math.exp(middle - half), Math.exp(middle + half)] : [middle - half, middle + half];
    };
    this.look(about(this.chart.scales.x, this.source.x.log), about(this.chart.scales.y, this.source.y.log));
  }

  reset() {
    this.look(this.source.x.range, this.source.y.range);
  }
}

// The charts of one figure; those that share an axis of x stay together.
function startCharts(box, sources, canShow, show) {
  box.style.setProperty("--columns", Math.max(...sources.map(source => source.columns)));
  const charts = sources.map(source => new LiveChart(box, source, canShow, show));
  for (const chart of charts) chart.others = charts.filter(other => other !== chart && other.source.shares === chart.source.shares);
  return charts;
}
