"""The curve of a table: seconds over transitions, and milliseconds for each transition, as GitHub draws them.

What is drawn is read off the rows of the table and nothing else, so the pictures say what the table says, of whatever
run. The chart of Mermaid sets its points at equal distances, whatever their sizes are. Sizes that grow tenfold so
stand where a logarithmic axis has them, and growth in proportion is no straight line: it is drawn beside what was
measured, as a line, from the smallest net's time. In the second picture what grows in proportion is level. A
logarithmic axis for the seconds, which would make a straight line of it, is nothing that these charts have.
"""

from __future__ import annotations

from collections.abc import Sequence

from measuring import Table


def curves(table: Table, title: str, seconds: str, each: str) -> str:
    """Two charts in Markdown, of a table with a column `transitions`, one of `seconds`, and milliseconds for `each`."""
    sizes, taken, per = (_column(table, name) for name in ("transitions", seconds, each))
    proportional = [per[0] * size / 1e3 for size in sizes]
    about = (
        "Drawn from the table. The bars are measured; the line is what growth in proportion to the transitions gives, "
        "from the smallest net on. The sizes stand at equal distances, however far apart they are, so in the first "
        "picture the line has a bend as well, and in the second, where each figure is divided by the transitions, it "
        "is level."
    )
    return "\n".join(
        [
            about,
            "",
            *_chart(f"{title}: seconds over transitions", "seconds", sizes, taken, proportional),
            "",
            *_chart(f"{title}: milliseconds for each transition", "milliseconds", sizes, per, [per[0]] * len(per)),
            "",
        ]
    )


def _column(table: Table, name: str) -> list[float]:
    """The figures of a column, without the goals beside them."""
    at = table.columns.index(name)
    return [float(row[at].split()[0].replace(",", "")) for row in table.rows]


def _chart(title: str, unit: str, sizes: Sequence[float], bars: Sequence[float], line: Sequence[float]) -> list[str]:
    names = ", ".join(f'"{size:,.0f}"' for size in sizes)
    return [
        "```mermaid",
        "xychart-beta",
        f'    title "{title}"',
        f'    x-axis "transitions" [{names}]',
        f'    y-axis "{unit}" 0 --> {max(*bars, *line) * 1.05:.3g}',
        f"    bar [{', '.join(f'{value:.2f}' for value in bars)}]",
        f"    line [{', '.join(f'{value:.2f}' for value in line)}]",
        "```",
    ]
