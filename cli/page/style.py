"""The style sheet of the page: light and dark, on a screen, a phone and paper.

Every colour is a variable with two values. What a colour says a word or a sign says too. Nothing is loaded: fonts are
those that the reader has.
"""

from typing import Final

STYLE: Final = """
:root{color-scheme:light dark;
--ground:#f6f7f9;--paper:#fff;--ink:#1a2230;--soft:#56606f;--line:#dfe3e9;--shade:#f0f2f6;
--good:#12693f;--good-ground:#e3f4ea;--bad:#a3122f;--bad-ground:#fbe6ea;
--open:#7a5300;--open-ground:#fbf0d6;--plain-ground:#e9edf3;
--link:#1d4f91;--sends:#8a4300;--measure:74rem}
@media (prefers-color-scheme:dark){:root{
--ground:#11161d;--paper:#181f29;--ink:#e4e9f0;--soft:#9aa6b6;--line:#2c3644;--shade:#202937;
--good:#7fd8a5;--good-ground:#143424;--bad:#ff97a8;--bad-ground:#431c26;
--open:#f0c46c;--open-ground:#3a2d10;--plain-ground:#273140;
--link:#8ab8f5;--sends:#f0a563}}
*{box-sizing:border-box}
html{scroll-padding-top:5.5rem;-webkit-text-size-adjust:100%}
body{margin:0;background:var(--ground);color:var(--ink);
font:16px/1.55 system-ui,-apple-system,'Segoe UI','Helvetica Neue',Arial,'DejaVu Sans',sans-serif}
main,.masthead>div,nav>div,footer{max-width:var(--measure);margin:0 auto;padding:0 1.25rem}
a{color:var(--link)}
:focus-visible{outline:2px solid var(--link);outline-offset:2px}
.masthead{background:var(--paper);padding:2.2rem 0 1.6rem}
.masthead h1{margin:0;font-size:1.9rem;line-height:1.2;letter-spacing:-.01em;overflow-wrap:anywhere}
.masthead p{margin:.35rem 0 0;color:var(--soft);max-width:60rem}
.verdict-line{display:flex;flex-wrap:wrap;gap:.5rem 1.5rem;align-items:center;margin-top:1.2rem}
.verdict-line .badge{font-size:1.05rem;padding:.35rem .9rem}
.counts{display:flex;flex-wrap:wrap;gap:.3rem 1.4rem;margin:0;padding:0;list-style:none;color:var(--soft)}
.counts b{color:var(--ink);font-variant-numeric:tabular-nums}
nav{position:sticky;top:0;z-index:2;background:var(--paper);border-bottom:1px solid var(--line);
border-top:1px solid var(--line)}
nav ul{display:flex;flex-wrap:wrap;gap:0 1.1rem;margin:0;padding:.3rem 0;list-style:none;white-space:nowrap}
nav a{display:block;padding:.35rem 0;color:var(--soft);text-decoration:none;font-size:.93rem}
nav a:hover{color:var(--ink);text-decoration:underline}
section{background:var(--paper);border:1px solid var(--line);border-radius:10px;margin:1.4rem 0;padding:1.4rem 1.5rem}
section>h2{margin:0 0 .2rem;font-size:1.25rem}
section>.lead{margin:0 0 1rem;color:var(--soft);max-width:52rem}
h3{margin:1.5rem 0 .4rem;font-size:1.02rem}
h3:first-child{margin-top:.4rem}
table{border-collapse:collapse;width:100%;font-size:.93rem}
th,td{text-align:left;vertical-align:top;padding:.5rem .7rem;border-bottom:1px solid var(--line)}
thead th{font-size:.82rem;font-weight:600;color:var(--soft);border-bottom:2px solid var(--line);white-space:nowrap}
tbody tr:last-child>*{border-bottom:0}
tbody th{font-weight:600}
th:first-child{padding-left:.1rem}
td>p{margin:.3rem 0}td>p:first-child{margin-top:0}
.strip td>.fact{font-size:.83rem;padding-left:1.1em;text-indent:-1.1em}
.fact>span{font-size:.8em}
.wide{position:relative;overflow-x:auto;margin:0 -.3rem;padding:0 .3rem}
.code,.part-name,.part,.comes,.leaves,.held,.sends{font-family:ui-monospace,Menlo,Consolas,'DejaVu Sans Mono',monospace;
font-size:.83rem}
.code{overflow-wrap:anywhere}.part-name{white-space:nowrap}
.soft,.says{color:var(--soft)}
.fit{width:1%;white-space:nowrap}
.badge{display:inline-block;border-radius:99px;padding:.08rem .65rem;font-size:.83rem;font-weight:600;
white-space:nowrap;background:var(--plain-ground);color:var(--ink)}
.badge.good{background:var(--good-ground);color:var(--good)}
.badge.bad{background:var(--bad-ground);color:var(--bad)}
.badge.open{background:var(--open-ground);color:var(--open)}
.share{display:flex;align-items:center;gap:.7rem;font-variant-numeric:tabular-nums;white-space:nowrap}
.share i{display:block;flex:0 0 5.5rem;height:.45rem;border-radius:9px;background:var(--bad-ground);overflow:hidden}
.share i b{display:block;height:100%;background:var(--good)}
details{border-bottom:1px solid var(--line)}
details:last-child{border-bottom:0}
summary{cursor:pointer;padding:.55rem .2rem}
summary:hover{background:var(--shade)}
details>.inside{padding:.1rem .2rem 1rem 1.2rem}
.family{display:inline-grid;grid-template-columns:9.5rem 17rem 1fr;gap:.2rem 1rem;width:calc(100% - 1.4rem);
vertical-align:top}
.family b{overflow-wrap:anywhere}
.verdict{display:grid;grid-template-columns:7.2rem 1fr;gap:.15rem .9rem;padding:.6rem 0;
border-bottom:1px solid var(--line)}
.verdict:last-child{border-bottom:0}
.verdict p{margin:.1rem 0}p,ul{overflow-wrap:anywhere}
.verdict .code{color:var(--soft)}
.hint{color:var(--soft);border-left:3px solid var(--line);padding-left:.7rem}
.outcome{font-weight:600;border-left:3px solid var(--bad);padding-left:.7rem;margin:.9rem 0;overflow-wrap:anywhere}
.counter{padding:.9rem 0 1.2rem;border-bottom:1px solid var(--line);scroll-margin-top:0}
.counter:last-child{border-bottom:0}
.counter h3{margin:0 0 .2rem;overflow-wrap:anywhere}
.strip{font-size:.88rem}
.strip th[scope=row]{min-width:15rem;max-width:24rem;font-weight:400;position:sticky;left:0;background:var(--paper)}
.strip th[scope=row]>div{display:inline-block;width:calc(100% - 2.4rem);vertical-align:top}
.strip th b,.strip th .says{display:block;overflow-wrap:anywhere}
.strip thead th:first-child{position:sticky;left:0;background:var(--paper)}
.strip td:last-child{min-width:11rem}
.lanes th[scope=row]{min-width:5rem;width:5rem;white-space:nowrap}
.lanes thead th:first-child{width:5rem}.lanes{table-layout:fixed}
.lanes td>span{margin-bottom:.15rem}
details.head{margin:.6rem 0}details.head>summary{color:var(--soft)}
.strip td{min-width:8.2rem;border-left:1px solid var(--line)}
.strip td>span{display:block}
.strip .across{text-align:center;color:var(--soft);border-left:0}
.strip tfoot th,.strip tfoot td{border-top:2px solid var(--line);border-bottom:0;background:var(--shade)}
.strip tfoot th[scope=row]{font-weight:600;background:var(--shade)}
.number{display:inline-block;width:2rem;color:var(--soft);font-variant-numeric:tabular-nums}
.comes{color:var(--good);font-weight:600}
.comes>span:first-child,.leaves>span:first-child{margin-right:.35rem}
.leaves{color:var(--soft)}
.sends{color:var(--sends)}
.sends::before{content:'\\2197\\00a0'}
.part{color:var(--soft);border-bottom:1px dotted var(--line)}
.values{width:auto}
.told{font-family:ui-monospace,Menlo,Consolas,'DejaVu Sans Mono',monospace;font-size:.85rem}
.picture{overflow-x:auto;border-radius:8px}
.picture svg{display:block;max-width:100%;height:auto;min-width:46rem}
@media (prefers-color-scheme:dark){.picture svg{filter:invert(.9) hue-rotate(180deg)}}
dl.facts{display:grid;grid-template-columns:max-content 1fr;gap:.25rem 1.2rem;margin:0}
dl.facts dt{color:var(--soft)}
dl.facts dd{margin:0;overflow-wrap:anywhere}
footer{color:var(--soft);font-size:.86rem;padding-top:.4rem;padding-bottom:2.5rem;overflow-wrap:anywhere}
.unseen{position:absolute;width:1px;height:1px;overflow:hidden;clip-path:inset(50%);white-space:nowrap}
.failing{margin:1rem 0 0;padding:0;list-style:none}
.failing li{margin:.25rem 0}
.failing a{color:var(--ink);text-decoration-color:var(--bad)}
@media (max-width:44rem){
html{scroll-padding-top:.5rem}nav{position:static}
body{font-size:15.5px}
main,.masthead>div,nav>div,footer{padding-left:.9rem;padding-right:.9rem}
.masthead{padding:1.4rem 0 1.1rem}.masthead h1{font-size:1.5rem}
section{padding:1.1rem .9rem;border-radius:8px}
.family{grid-template-columns:1fr auto}.family .says{grid-column:1/-1}
.verdict{grid-template-columns:1fr}
.strip th[scope=row],.strip td,.strip td:last-child{position:static;min-width:0;max-width:none;border:0}
.strip.stack td{padding-left:2rem}.strip td[data-of]::before{display:block;font-size:.8rem;content:attr(data-of)}
.stack thead{display:none}
.stack tr{display:block;padding:.5rem 0;border-bottom:1px solid var(--line)}
.stack tr:last-child{border-bottom:0}
.stack th,.stack td{display:block;border:0;padding:.12rem 0;width:auto;white-space:normal}
.stack td[data-of]::before{content:attr(data-of) ': ';color:var(--soft)}
.stack td:empty{display:none}
.strip tfoot th,.strip tfoot td{border:0;background:none}
dl.facts{grid-template-columns:1fr}dl.facts dd{margin-bottom:.5rem}}
@media print{
:root{--ground:#fff;--paper:#fff;--ink:#000;--soft:#444;--line:#bbb;--shade:#f3f3f3}
body{font-size:10.5pt}nav{display:none}
section{border:0;border-radius:0;padding:.4rem 0;margin:.8rem 0}
.wide,.picture{overflow:visible}.picture svg{min-width:0;filter:none}
tfoot{display:table-row-group}tr,.verdict{break-inside:avoid}h2,h3{break-after:avoid}
#controllers details::details-content{content-visibility:visible;block-size:auto}}
""".strip()
