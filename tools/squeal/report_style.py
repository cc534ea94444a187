"""The style sheet of tools/report: wide and narrow screens, and paper."""

STYLE = """
:root { --ink: #1d252d; --soft: #5b6874; --line: #d8dee4; --paper: #fff; --ground: #f4f6f8; --red: #a3102a; --blue: #1b6ca8; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink); font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 1.5rem 1rem 3rem; }
header p { margin: 0; color: var(--soft); letter-spacing: 0.08em; }
h1 { margin: 0 0 1rem; font-size: 1.7rem; line-height: 1.25; }
h2 { margin: 0 0 0.8rem; font-size: 1.25rem; }
h2.run { margin-top: 2.5rem; border-top: 3px solid var(--blue); padding-top: 0.8rem; }
h3 { margin: 1.6rem 0 0.5rem; font-size: 1.02rem; }
h4 { margin: 1.1rem 0 0.4rem; font-size: 0.95rem; }
section p { margin: 0.4rem 0; }
.wide + h2, p + h2, details + h2 { margin-top: 1.4rem; }
section { background: var(--paper); border: 1px solid var(--line); border-radius: 6px; padding: 1.1rem 1.2rem; margin: 0 0 1.2rem; }
.heard { margin: 0 0 1rem; font-size: 1.25rem; line-height: 1.4; }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(190px, 1fr)); gap: 0.7rem; margin: 0; }
.cards div { border-left: 3px solid var(--blue); padding: 0.1rem 0.7rem; }
dt { color: var(--soft); font-size: 0.85rem; }
dd { margin: 0; font-weight: 600; overflow-wrap: anywhere; }
.warnings { border-color: var(--red); border-left-width: 5px; }
.warnings ul { margin: 0; padding-left: 1.2rem; }
.pictures { display: grid; grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 1.2rem; align-items: start;
  grid-auto-flow: dense; }
figure { margin: 0; }
figure.broad { grid-column: 1 / -1; }
img { display: block; max-width: 100%; height: auto; margin: 0 auto; cursor: zoom-in; }
figure.large img { max-width: none; width: max(100%, 900px); cursor: zoom-out; }
.charts { display: grid; grid-template-columns: repeat(var(--columns, 1), minmax(0, 1fr)); gap: 0.8rem; }
.charts[hidden] { display: none; }
.chart .head { display: flex; justify-content: space-between; align-items: baseline; gap: 0.5rem; font-size: 0.9rem; min-height: 1.6rem; }
.chart .tools { margin-left: auto; white-space: nowrap; }
.title { display: none; font-weight: 600; font-size: 0.95rem; }
.key { display: flex; flex-wrap: wrap; gap: 0 0.9rem; justify-content: center; font-size: 0.85rem; color: var(--soft); }
.plot { position: relative; min-height: 250px; width: 100%; touch-action: pan-y; }
.plot canvas { position: absolute; inset: 0; }
.plot .box { position: absolute; border: 1px solid var(--blue); background: rgba(27, 108, 168, 0.12); pointer-events: none; }
button, select { font: inherit; font-size: 0.88rem; color: var(--ink); background: var(--paper); border: 1px solid var(--line);
  border-radius: 4px; padding: 0.12rem 0.5rem; cursor: pointer; max-width: 100%; }
button:hover { border-color: var(--blue); }
#view { display: grid; grid-template-columns: minmax(0, 1fr) 300px; gap: 0.4rem 1.2rem; }
#view .stage { grid-column: 1; min-height: 200px; }
#view .stage canvas { display: block; cursor: grab; }
#view .legend { grid-column: 1; display: flex; flex-wrap: wrap; gap: 0.3rem 0.9rem; align-items: center; justify-content: center;
  font-size: 0.88rem; color: var(--soft); }
#view .bar { width: 180px; height: 12px; border: 1px solid var(--line); }
.chip { display: inline-block; width: 0.85em; height: 0.85em; margin-right: 0.35em; border: 1px solid #8a949e; vertical-align: -0.05em; }
#view .controls { grid-column: 2; grid-row: 1 / 3; display: flex; flex-direction: column; gap: 0.6rem; font-size: 0.9rem; }
#view .controls > label { display: flex; gap: 0.5rem; align-items: center; justify-content: space-between; }
#view .controls > label[hidden] { display: none; }
#view .controls select { min-width: 0; flex: 1; }
#view .row, #view .sides { display: flex; flex-wrap: wrap; gap: 0.4rem 0.8rem; align-items: center; }
#view .parts { border-top: 1px solid var(--line); border-bottom: 1px solid var(--line); padding: 0.4rem 0; max-height: 240px; overflow-y: auto; }
#view .parts div { display: flex; justify-content: space-between; align-items: center; gap: 0.5rem; }
#view .parts label { overflow-wrap: anywhere; }
#view input[type="range"] { width: 110px; }
#view .parts input[type="range"] { width: 84px; flex: none; }
#view output { min-width: 4.6rem; }
#view .words { margin: 0; color: var(--soft); }
figcaption { color: var(--soft); font-size: 0.9rem; margin-top: 0.3rem; }
audio { width: 100%; max-width: 480px; }
.wide { overflow-x: auto; }
.wide + .wide { margin-top: 0.8rem; }
table { border-collapse: collapse; font-size: 0.9rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 0.25rem 0.9rem 0.25rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td { white-space: nowrap; }
td.words { white-space: normal; min-width: 16rem; overflow-wrap: anywhere; }
th { color: var(--soft); font-weight: 600; }
pre { white-space: pre-wrap; overflow-wrap: anywhere; background: var(--ground); padding: 0.6rem 0.8rem; border-radius: 4px; font-size: 0.85rem; }
details { margin: 0.5rem 0; }
summary { cursor: pointer; color: var(--blue); }
.pictures details { grid-column: 1 / -1; }
@media screen and (max-width: 720px) {
  main { padding: 0.8rem 0.5rem 2rem; }
  h1 { font-size: 1.3rem; }
  .heard { font-size: 1.08rem; }
  section { padding: 0.8rem; }
  th, td { padding-right: 0.6rem; }
  td { white-space: normal; }
  td.words { min-width: 9rem; }
  .answers td:first-child { overflow-wrap: anywhere; min-width: 6.5rem; }
  .plot { min-height: 300px; }
  .pictures, .charts { grid-template-columns: minmax(0, 1fr); }
  figure.broad { grid-column: auto; }
  #view { grid-template-columns: minmax(0, 1fr); }
  #view .controls { grid-column: 1; grid-row: auto; }
}
@media screen {
  figure.live.started > .wide, .turns figure.turned { display: none; }
  figure.started .title { display: block; }
}
@media print {
  @page { margin: 14mm; }
  body { background: none; font-size: 10.5pt; }
  main { max-width: none; padding: 0; }
  section { border: 0; padding: 0; margin: 0 0 6mm; }
  .warnings { border-left: 1.2mm solid var(--red); padding-left: 3mm; }
  figure, tr { break-inside: avoid; }
  h2, h3, h4 { break-after: avoid; }
  .pictures { grid-template-columns: minmax(0, 1fr); }
  figure.broad { grid-column: auto; }
  img { max-height: 120mm; }
  .wide { overflow: visible; }
  table { font-size: 8pt; }
  th, td { padding-right: 0.5rem; }
  td.words { min-width: 0; }
  audio, .charts, .stand, .still, .tools { display: none; }
}
"""
