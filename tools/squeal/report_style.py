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
img { display: block; max-width: 100%; height: auto; margin: 0 auto; }
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
  .pictures { grid-template-columns: minmax(0, 1fr); }
  figure.broad { grid-column: auto; }
  figure img { max-width: none; width: 520px; }
  figure.broad img { width: 760px; }
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
  audio { display: none; }
}
"""
