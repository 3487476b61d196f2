"""How a study reports: rows of a measured value and what it must not exceed."""

import csv
from pathlib import Path
from typing import NamedTuple

WIDTH = 110


class Row(NamedTuple):
    """One measurement: what, of which run, how much, in which unit, and its upper bound."""

    quantity: str
    case: str
    value: float
    unit: str
    bound: float

    @property
    def holds(self) -> bool:
        """Whether the value is within its bound."""
        return self.value <= self.bound


def print_table(title: str, headings: list[str], rows: list[list[str]], n_text: int) -> None:
    """Print rows of text to the terminal; the columns after the first `n_text` are flush right.

    Raises ImportError that names the extra to install.
    """
    try:
        from rich.box import SIMPLE
        from rich.console import Console
        from rich.table import Table
    except ImportError:
        raise ImportError('tables need more: pip install "sph_gym[studies]"') from None
    grid = Table(title=title, header_style="bold", box=SIMPLE, pad_edge=False)
    for k, heading in enumerate(headings):
        grid.add_column(heading, justify="left" if k < n_text else "right", no_wrap=True)
    for row in rows:
        grid.add_row(*row)
    # a table that is cut is of no use where the output goes to a file or a narrow window
    Console(width=max(Console().width, WIDTH)).print(grid)


def show(title: str, rows: list[Row], path: Path) -> None:
    """Print the rows as a table and write them as CSV."""
    verdicts = ["holds" if row.holds else "[bold red]FAILS[/]" for row in rows]
    lines = [
        [row.quantity, row.case, verdict, f"{row.value:.4g}", f"{row.bound:.4g}", row.unit]
        for row, verdict in zip(rows, verdicts, strict=True)
    ]
    print_table(title, ["quantity", "case", "", "measured", "at most", "unit"], lines, n_text=3)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*Row._fields, "holds"])
        writer.writerows([*row, row.holds] for row in rows)
    print(f"table: {path}")
