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

    places: folders or files relative to the package, as "solver" or "studies/soak.py". Networks
    don't count: a result says by itself which one it is of, and the next one changes no other's.
    Raises ValueError if a place does not exist.
    """
    facts, networks = list[Any](), PACKAGE / "controllers" / "networks"
    for place in places:
        path = PACKAGE / place
        if not path.exists():
            raise ValueError(f"places: expected files or folders of {PACKAGE}, got {place!r}")
        files = [path] if path.is_file() else sorted(path.rglob("*"))
        for file in files:
            if file.suffix in SUFFIXES and file.is_file() and file.parent != networks:
                facts += [file.relative_to(PACKAGE).as_posix(), file]
    return content_hash(*facts)
