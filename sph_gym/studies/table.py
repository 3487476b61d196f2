"""Rows, the results of studies: measured values, with bounds that some must keep."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from sph_gym.extras import needs_extra, progress_bar
from sph_gym.files import write_csv

# Characters in a line of a table.
WIDEST = 1000


class Row(NamedTuple):
    """One measurement: the quantity, the case that it was measured on, value, unit and bound.

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
        """True if the value is a number and within its bound."""
        if self.bound is None:
            return self.value == self.value
        return self.value >= self.bound if self.at_least else self.value <= self.bound

    @property
    def verdict(self) -> str:
        """Markup for the terminal that says if the bound holds; empty where there is none."""
        if not self.holds:
            return "[bold red]FAILS[/]"
        return "" if self.bound is None else "holds"

    @property
    def demand(self) -> str:
        """The bound as text."""
        if self.bound is None:
            return ""
        return f"{'at least' if self.at_least else 'at most'} {self.bound:.4g}"


# The title of a part of a study, and how its rows are measured.
Part = tuple[str, Callable[[], Iterable[Row]]]


def measure_parts(parts: Sequence[Part]) -> Iterator[Row]:
    """Yield the rows of all parts, with a progress bar that shows the title of the present one.

    Raises ImportError that names the extra to install.
    """
    with progress_bar(len(parts), unit="part") as bar:
        for title, rows in parts:
            bar.set_description(title)
            yield from rows()
            bar.update()


def print_table(title: str, headings: list[str], rows: list[list[str]], n_text: int) -> None:
    """Print rows of text to the terminal; the columns after the first `n_text` are flush right.

    Raises ImportError that names the extra to install.
    """
    with needs_extra("studies"):
        from rich.box import SIMPLE
        from rich.console import Console
        from rich.table import Table
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
    write_csv(path, [*Row._fields, "holds"], ([*row, row.holds] for row in rows))
