"""How a study reports: rows of a measured value and of what it must keep, if anything."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

# Characters in a line of a table.
WIDEST = 1000


class Row(NamedTuple):
    """One measurement: what, of which run, how much, in which unit, and its bound.

    bound: the value must be at most that, or at least that if `at_least`; None: for information.
    """

    quantity: str
    case: str
    value: float
    unit: str
    bound: float | None = None
    at_least: bool = False

    @property
    def holds(self) -> bool:
        """Whether the value is a number and within its bound."""
        if self.bound is None:
            return self.value == self.value
        return self.value >= self.bound if self.at_least else self.value <= self.bound

    @property
    def verdict(self) -> str:
        """The same in a word, for the terminal; nothing where nothing is demanded."""
        if not self.holds:
            return "[bold red]FAILS[/]"
        return "" if self.bound is None else "holds"

    @property
    def demand(self) -> str:
        """The bound as text."""
        if self.bound is None:
            return ""
        return f"{'at least' if self.at_least else 'at most'} {self.bound:.4g}"


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
    needed = Console(width=WIDEST).measure(grid).maximum
    Console(width=max(Console().width, needed)).print(grid)


def show(title: str, rows: Sequence[Row], path: Path) -> None:
    """Print the rows as a table and write them as CSV."""
    lines = [
        [row.quantity, row.case, row.verdict, f"{row.value:.4g}", row.demand, row.unit]
        for row in rows
    ]
    print_table(title, ["quantity", "case", "", "measured", "bound", "unit"], lines, n_text=3)
    write(rows, path)
    print(f"table: {path}")


def write(rows: Sequence[Row], path: Path) -> None:
    """Write the rows as CSV, and make the folder if there is none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*Row._fields, "holds"])
        writer.writerows([*row, row.holds] for row in rows)
