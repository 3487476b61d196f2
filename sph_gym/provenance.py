"""Where results come from: the version, and the one hash of sources, data files and facts."""

import hashlib
import json
from functools import cache
from pathlib import Path
from typing import Any

VERSION = "0.1.0"
PACKAGE = Path(__file__).parent
SUFFIXES = (".py", ".csv", ".json", ".npz")


def content_hash(*facts: Any) -> str:
    """Return a hash, 20 hex digits, of the facts in their order.

    A Path counts as the bytes of that file, bytes count as they are, anything else as JSON
    with sorted keys. Raises TypeError for what JSON does not know.
    """
    digest = hashlib.sha256()
    for fact in facts:
        if isinstance(fact, Path):
            fact = fact.read_bytes()
        elif not isinstance(fact, bytes):
            fact = json.dumps(fact, sort_keys=True).encode()
        # the length keeps neighbouring facts apart
        digest.update(f"{len(fact)}:".encode() + fact)
    return digest.hexdigest()[:20]


@cache
def source_hash(*places: str) -> str:
    """Return a hash of sources and data of this package below `places`.

    places: folders or files relative to the package, as "solver" or "studies/soak.py". Cards of
    networks don't count: they tell results, and decide none. Raises ValueError if a place does not
    exist.
    """
    facts: list[Any] = []
    for place in places:
        path = PACKAGE / place
        if not path.exists():
            raise ValueError(f"places: expected files or folders of {PACKAGE}, got {place!r}")
        files = [path] if path.is_file() else sorted(path.rglob("*"))
        for file in files:
            if file.suffix in SUFFIXES and file.is_file() and not _is_card(file):
                facts += [file.relative_to(PACKAGE).as_posix(), file]
    return content_hash(*facts)


def _is_card(file: Path) -> bool:
    named = file.suffix == ".json" and file.with_suffix(".npz").exists()
    return named and file.parent == PACKAGE / "controllers" / "networks"
