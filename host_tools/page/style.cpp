#include "host_tools/page/style.hpp"

namespace fxdyn::page {

const char* const style = R"(
:root { color-scheme: light dark; --text: #222; --quiet: #595959; --page: #fff; --head: #f2f2f2; --line: #d8d8d8;
  --accent: #b8380f; --link: #0b57a4; --good: #e2f2e4; --amber: #fdeec8; --bad: #fbdfd8; --unknown: #ebebeb;
  --good-mark: #1f6f43; --amber-mark: #8a5a00; --bad-mark: #b3261e; --unknown-mark: #5a5a5a; --mark-text: #fff;
  --measured: #222; --predicted: #d9480f; --residual: #2e6fb7; }
@media screen and (prefers-color-scheme: dark) {
  :root { --text: #e6e6e6; --quiet: #a8a8a8; --page: #16181b; --head: #24272b; --line: #3b3f45; --accent: #ff9a73;
    --link: #8ec5ff; --good: #1d3a28; --amber: #4a3a10; --bad: #54231d; --unknown: #303338; --good-mark: #7fd6a2;
    --amber-mark: #f0c350; --bad-mark: #ff9c8f; --unknown-mark: #bdbdbd; --mark-text: #16181b; --measured: #e6e6e6; --predicted: #ff8c5a; --residual: #7cb8f5; }
  svg.plot { filter: invert(.91) hue-rotate(180deg); }
}
* { box-sizing: border-box; }
body { font: 15px/1.45 system-ui, sans-serif; color: var(--text); background: var(--page); margin: 0 auto;
  max-width: 1200px; padding: 1em 1.5em; overflow-wrap: anywhere; }
a { color: var(--link); } :focus-visible { outline: 3px solid var(--link); outline-offset: 2px; }
.skip { position: absolute; left: -100vw; } .skip:focus { position: static; }
h1 { font-size: 1.5em; margin: 0; } h2 { font-size: 1.25em; margin: 1.8em 0 .4em; border-bottom: 2px solid var(--accent); }
h2.first { margin: .5em 0; border: 0; } h3 { font-size: 1em; margin: 1.6em 0 .2em; }
p { margin: .4em 0; max-width: 52em; } .quiet { color: var(--quiet); font-size: .9em; max-width: none; }
nav ul { list-style: none; margin: .3em 0; padding: 0; display: flex; flex-wrap: wrap; gap: .1em 1.1em; font-size: .9em; }
nav a { display: inline-block; padding: .15em 0; }
.overview { display: grid; grid-template-columns: 340px minmax(0, 1fr); gap: 1em; align-items: start; }
.overview.one { grid-template-columns: minmax(0, 1fr); gap: 0; } .overview.one .plot { max-height: 380px; }
figure { margin: .6em 0; } figcaption { font-weight: 600; font-size: .95em; margin: .2em 0; }
ol.joints { list-style: none; margin: 0; padding: 0; } ol.joints li { display: flex; gap: .7em; padding: .2em 0; }
.mark { flex: none; width: 1.8em; height: 1.8em; line-height: 1.8em; border-radius: 50%; text-align: center; font-weight: 600;
  color: var(--mark-text); background: var(--unknown-mark); }
.mark.good { background: var(--good-mark); } .mark.amber { background: var(--amber-mark); } .mark.bad { background: var(--bad-mark); }
.word { font-size: .85em; font-weight: 600; color: var(--unknown-mark); } .word.good { color: var(--good-mark); }
.word.amber { color: var(--amber-mark); } .word.bad { color: var(--bad-mark); }
svg { display: block; width: 100%; height: auto; }
.plot g.k { fill: none; color: #000; stroke: currentColor; stroke-width: 1; } .plot .t { stroke: none; fill: #333; font-family: sans-serif; }
.plot .b { fill: #000; } .plot .r { stroke: #e4e4e4; } .plot .a { stroke: #888; }
.sketch { max-height: 430px; } .sketch line { stroke: var(--quiet); stroke-linecap: round; }
.sketch .link { stroke-width: 9; opacity: .45; } .sketch .ground { stroke-width: 4; } .sketch .axis { stroke-width: 1.5; stroke-dasharray: 5 3; }
.sketch .leader { stroke-width: 1; } .disc { fill: var(--unknown-mark); } .disc.good { fill: var(--good-mark); }
.disc.amber { fill: var(--amber-mark); } .disc.bad { fill: var(--bad-mark); }
.disc text { fill: var(--mark-text); text-anchor: middle; font-weight: 600; }
.live.on > svg.plot { display: none; } .live-plot { margin: .3em 0; } .live-plot .uplot { font: inherit; }
.live-plot .u-select { background: var(--link); opacity: .2; }
.tools { display: flex; flex-wrap: wrap; gap: .2em .9em; align-items: center; max-width: none; font-size: .85em; font-variant-numeric: tabular-nums; }
.tools > span { display: flex; flex-wrap: wrap; gap: .1em .9em; } .tools i { display: inline-block; width: 1em; height: .3em; margin-right: .35em; vertical-align: middle; }
.tools button { font: inherit; color: var(--text); background: var(--head); border: 1px solid var(--line); border-radius: 4px; padding: .2em .6em; }
table { border-collapse: collapse; margin: .6em 0; font-size: .92em; }
caption { text-align: left; font-weight: 600; padding: .2em 0; }
th, td { padding: .22em .7em; border-bottom: 1px solid var(--line); text-align: left; vertical-align: top; font-weight: normal; }
thead th { background: var(--head); font-weight: 600; overflow-wrap: normal; } td { min-width: 3.5em; max-width: 26em; } tbody th { min-width: 5em; max-width: 26em; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; } td.n { white-space: nowrap; }
td.bad { background: var(--bad); } td.good { background: var(--good); } td.amber { background: var(--amber); }
.scroll { overflow-x: auto; }
@media screen and (min-width: 641px) { td, tbody th { overflow-wrap: break-word; } }
@media screen and (max-width: 640px) {
  body { padding: .8em; } .overview { grid-template-columns: minmax(0, 1fr); } .sketch { max-height: 300px; }
  table, caption, tbody, tr, td, tbody th { display: block; max-width: none; } thead { display: none; }
  tr { border-bottom: 2px solid var(--line); padding: .3em 0; } tbody th { font-weight: 600; border: 0; }
  td, td.n { display: flex; justify-content: space-between; gap: 1em; border: 0; padding: .1em .4em; text-align: right; white-space: normal; }
  td::before { content: attr(data-label); color: var(--quiet); text-align: left; flex: none; max-width: 45%; }
  td.good::before, td.amber::before, td.bad::before { color: inherit; } td:empty { display: none; }
}
@media print {
  @page { size: A4; margin: 12mm; }
  body { font-size: 8pt; line-height: 1.25; max-width: none; padding: 0; } nav, .skip { display: none; }
  p { max-width: none; } h2 { margin-top: 1em; } h2, h3, figcaption, caption { break-after: avoid; } h3 { margin-top: .7em; }
  .scroll { overflow: visible; } table { font-size: 6.6pt; width: 100%; margin: .3em 0; }
  th, td { padding: .12em .35em; min-width: 3.4em; } tbody th { min-width: 4.6em; } td.n { white-space: normal; } thead th { overflow-wrap: anywhere; }
  tr, figure, ol.joints li { break-inside: avoid; } thead { display: table-header-group; }
  .overview { grid-template-columns: 58mm minmax(0, 1fr); } .mark, td, thead th, .disc { print-color-adjust: exact; }
  .overview:has(#joint-9) { display: block; columns: 2; }
  .live.on > svg.plot { display: block; } .live-plot { display: none; }
  .figures { display: grid; grid-template-columns: 1fr 1fr; gap: 1mm 4mm; } .figures figure { margin: 0; }
}
)";

}  // namespace fxdyn::page
