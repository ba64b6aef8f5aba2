"""How the report looks, on a screen and on paper."""

from __future__ import annotations

CSS = """
:root { --ink: #1c1c1c; --muted: #5f5f5f; --rule: #dcdcdc; --accent: #10389c; }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; }
body {
  margin: 0; color: var(--ink); background: #eef0f2;
  font: 15px/1.5 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif;
}
main {
  max-width: 1080px; margin: 0 auto; padding: 44px 52px 60px; background: white;
  box-shadow: 0 0 24px rgba(0, 0, 0, 0.07);
}
header { border-bottom: 3px solid var(--accent); padding-bottom: 16px; }
h1 { font-size: 30px; line-height: 1.2; margin: 0 0 4px; letter-spacing: -0.01em; }
h2 {
  font-size: 21px; line-height: 1.25; margin: 46px 0 12px; padding-top: 14px;
  border-top: 1px solid var(--rule);
}
h3 { font-size: 15.5px; margin: 24px 0 6px; }
p { margin: 8px 0; max-width: 76ch; }
.lead { color: var(--muted); margin: 0; font-size: 16px; }
.muted, figcaption { color: var(--muted); font-size: 13.5px; }
a { color: var(--accent); text-decoration: none; }
nav { margin: 14px 0 0; font-size: 13.5px; }
nav a { margin-right: 18px; white-space: nowrap; }
.answers {
  display: grid; gap: 14px; margin: 26px 0 8px;
  grid-template-columns: repeat(auto-fit, minmax(215px, 1fr));
}
.answer {
  border: 1px solid var(--rule); border-top: 4px solid var(--accent);
  border-radius: 6px; padding: 12px 16px 14px;
}
.answer .question { color: var(--muted); font-size: 13px; margin: 0; }
.answer .reply {
  font-size: 22px; font-weight: 650; line-height: 1.25; margin: 3px 0 6px;
}
.answer .why { font-size: 13.5px; margin: 0; color: #3a3a3a; }
.absent { border-top-color: #b5b5b5; }
.absent .reply { color: var(--muted); font-weight: 500; }
.note {
  border-left: 4px solid #d39b00; background: #fdf7e6; padding: 10px 16px;
  margin: 18px 0; border-radius: 0 6px 6px 0; font-size: 14px;
}
.note p, .note ul { margin: 2px 0; }
.note ul { padding-left: 20px; }
code {
  font: 0.9em ui-monospace, "DejaVu Sans Mono", monospace; background: #f1f2f4;
  padding: 1px 4px; border-radius: 3px; overflow-wrap: anywhere;
}
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: 8px 0 14px; font-size: 13.5px; }
th {
  text-align: left; font-weight: 600; color: var(--muted);
  border-bottom: 1.5px solid #b9b9b9; padding: 4px 18px 4px 0; vertical-align: bottom;
}
td {
  padding: 4px 18px 4px 0; border-bottom: 1px solid #ececec; vertical-align: top;
}
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
td.n { white-space: nowrap; }
th.n { max-width: 132px; }
tr.best td { background: #eef3fd; font-weight: 600; }
.facts td:first-child { white-space: nowrap; color: #333; }
.facts b { font-weight: 600; }
.small table, table.small { font-size: 12.5px; }
.facts td:last-child { overflow-wrap: anywhere; }
figure { margin: 18px 0 22px; }
img { max-width: 100%; height: auto; display: block; }
figcaption { margin-top: 6px; max-width: 88ch; }
.pair { display: flex; flex-wrap: wrap; gap: 8px 44px; align-items: flex-start; }
footer {
  margin-top: 48px; padding-top: 12px; border-top: 1px solid var(--rule);
  color: var(--muted); font-size: 12.5px;
}
@page { size: A4; margin: 14mm 13mm; }
@media print {
  body { background: white; font-size: 10.2pt; }
  main { max-width: none; padding: 0; box-shadow: none; }
  nav { display: none; }
  h2 { break-after: avoid; margin-top: 26px; }
  h3 { break-after: avoid; }
  figure, .answer, .note, tr { break-inside: avoid; }
  img { max-height: 235mm; width: auto; max-width: 100%; }
  a { color: inherit; }
  * { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
}
@media (max-width: 700px) { main { padding: 24px 18px; } }
"""
