"""How the signs of a net look, wherever they stand; the classes are what pages restyle them by."""

from __future__ import annotations

from typing import Final

STYLE: Final = """
.lane{font-size:15px;font-weight:700}
.name{font-size:13px;font-weight:600}
.note{font-size:10.5px;fill:#6a7683}
.command{font-size:10.5px;font-family:Menlo,Consolas,'DejaVu Sans Mono',monospace;fill:#9a4b00}
.signal{font-size:10.5px;font-family:Menlo,Consolas,'DejaVu Sans Mono',monospace;fill:#0b6b74}
.step{font-size:10.5px;font-weight:700;fill:#b3123b}
.place{fill:#fff;stroke:#1d2733;stroke-width:1.8}
.macro{fill:#fff;stroke:#1d2733;stroke-width:1.6}
.token{fill:#1d2733}
.bar{fill:#1d2733}
.fired{fill:#b3123b}
.tie{stroke:#1d2733;stroke-width:1.6}
.leader{stroke:#9aa6b2;stroke-width:1;stroke-dasharray:1.5 3.5}
.arc{fill:none;stroke:#3b4855;stroke-width:1.5}
.gate{fill:none;stroke:#3b4855;stroke-width:1.5;stroke-dasharray:5 3.5}
.stub{fill:none;stroke:#0b6b74;stroke-width:1.3;stroke-dasharray:3 2.2}
.send{fill:none;stroke:#9a4b00;stroke-width:1.3}
.dot{fill:#1d2733}
.hollow{fill:#fff;stroke:#1d2733;stroke-width:1.4}
.head{fill:#3b4855}
.sendhead{fill:#9a4b00}
""".strip()
