"""The style of blocks as HTML: light, dark and print."""

from typing import Final

STYLE: Final = """
.scancell { --ink: #1b1f24; --soft: #59636e; --line: #d5dae0; --accent: #0b62c4; --second: #9a4d00;
  --third: #6f3fb0; --band: #e6eef8; --pass: #13703d; --warn: #8a5200; --fail: #b3261e;
  --paper: #fff; color: var(--ink); }
@media (prefers-color-scheme: dark) {
  .scancell { --ink: #e8ebee; --soft: #9da7b1; --line: #3a424b; --accent: #6cb0ff; --second: #f0a95a;
    --third: #c3a2f5; --band: #22303f; --pass: #5fd08f; --warn: #f0b45a; --fail: #ff8a80; --paper: #12171c; }
}
.scancell.notebook { background: var(--paper); padding: 1px 12px; }
.scancell h3 { margin: 22px 0 6px; font-size: 16px; }
.scancell table { border-collapse: collapse; max-width: 100%; margin: 6px 0; font-variant-numeric: tabular-nums; }
.scancell th { text-align: left; font-weight: 500; }
.scancell th, .scancell td { padding: 4px 14px 4px 0; border-bottom: 1px solid var(--line); vertical-align: top; }
.scancell .n { text-align: right; white-space: nowrap; }
.scancell .n + :not(.n) { padding-left: 8px; }
.scancell .words { overflow-wrap: anywhere; white-space: normal; }
.scancell .wide { overflow-x: auto; }
.scancell .headline td.n { font-size: 20px; font-weight: 600; }
.scancell .frame td.n { font-size: 17px; }
.scancell .out th, .scancell .out .n { text-decoration: line-through; color: var(--soft); }
.scancell .pass { color: var(--pass); } .scancell .warn { color: var(--warn); }
.scancell .fail { color: var(--fail); }
.scancell .soft { color: var(--soft); }
.scancell p { max-width: 75ch; overflow-wrap: anywhere; margin: 6px 0; }
.scancell summary { cursor: pointer; margin: 10px 0 6px; font-weight: 600; }
.scancell svg { width: 100%; max-width: 960px; height: auto; display: block; margin: 8px 0; }
.scancell img { width: 100%; max-width: 480px; display: block; margin: 8px 0; }
.scancell svg text { fill: var(--soft); font: 12px system-ui, sans-serif; }
.scancell svg .band { fill: var(--band); } .scancell svg .grid { stroke: var(--line); stroke-width: 1; }
.scancell svg .empty { fill: none; stroke: var(--line); }
.scancell .s0 { fill: var(--accent); color: var(--accent); }
.scancell .s1 { fill: var(--second); color: var(--second); }
.scancell .s2 { fill: var(--third); color: var(--third); }
.scancell svg .line { fill: none; stroke: currentColor; stroke-width: 2; }
.scancell svg .rejected { stroke: var(--fail); stroke-width: 2.5; fill: none; }
@media print {
  .scancell { --ink: #000; --soft: #444; --line: #bbb; --accent: #0b62c4; --second: #9a4d00; --third: #6f3fb0;
    --band: #eef3fa; --pass: #13703d; --warn: #8a5200; --fail: #b3261e; --paper: #fff; }
  .scancell details::details-content { content-visibility: visible; height: auto; }
  .scancell details.numbers { display: none; }
  .scancell summary { list-style: none; }
  .scancell .wide { overflow: visible; }
  .scancell .wide table { width: 100%; font-size: 10px; }
  .scancell .wide th, .scancell .wide td { padding: 2px 5px 2px 0; }
  .scancell .wide th { white-space: normal; }
  .scancell .wide th.n { vertical-align: bottom; }
  .scancell thead { display: table-header-group; break-after: avoid; }
  .scancell table:not(:has(tr:nth-child(9))), .scancell ul:not(:has(li:nth-child(5))) { break-inside: avoid; }
  .scancell tbody tr:nth-child(-n+2):not(:last-child) { break-after: avoid; }
  .scancell tbody tr:nth-last-child(-n+2):not(:first-child) { break-before: avoid; }
}
"""
