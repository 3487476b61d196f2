"""How a study reports: rows of a measured value and what it must not exceed."""

import csv
from pathlib import Path
from typing import NamedTuple


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


def show(title: str, rows: list[Row], path: Path) -> None:
    """Print the rows as a table and write them as CSV.

    Raises ImportError that names the extra to install.
    """
    try:
        from rich.console import Console
        from rich.table import Table
    except ImportError:
        raise ImportError('studies need more: pip install "sph_gym[studies]"') from None
    table = Table("quantity", "case", title=title, header_style="bold")
    for heading in ("measured", "at most", "unit"):
        table.add_column(heading, justify="right")
    table.add_column("")
    for row in rows:
        verdict = "holds" if row.holds else "[bold red]FAILS[/]"
        table.add_row(
            row.quantity, row.case, f"{row.value:.4g}", f"{row.bound:.4g}", row.unit, verdict
        )
    Console().print(table)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*Row._fields, "holds"])
        writer.writerows([*row, row.holds] for row in rows)
    print(f"table: {path}")
