"""Optional dependencies: what to say where one is missing, and the progress bar."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

from tqdm import tqdm

Item = TypeVar("Item")


@contextmanager
def needs_extra(extra: str) -> Iterator[None]:
    """Make a failed import inside the block name the extra that provides the module.

    Raises ImportError with the command that installs `extra`, such as "studies" or "agents".
    """
    try:
        yield
    except ImportError as error:
        raise ImportError(
            f'{error.name} is missing: pip install "sph_gym[{extra}]"', name=error.name
        ) from None


def progress_bar(total: float, title: str = "", unit: str = "run") -> Any:
    """Return a tqdm progress bar on stderr, to be used in a `with` statement.

    It appears after two seconds or with the first line that `say` prints, on a terminal only.
    """
    return tqdm(
        total=total, desc=title or None, unit=unit, file=sys.stderr, leave=False, delay=2,
        disable=None,
    )  # fmt: skip


def say(text: str) -> None:
    """Print a line to stdout, above the progress bars that there may be."""
    tqdm.write(text, file=sys.stdout)
    sys.stdout.flush()


def progress(items: Sequence[Item], title: str = "", unit: str = "run") -> Iterator[Item]:
    """Yield the items, with a progress bar of how many are done."""
    with progress_bar(len(items), title, unit) as bar:
        for item in items:
            yield item
            bar.update()
