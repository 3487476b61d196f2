import sys
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"

# what the site is built with is no part of a package
sys.path.insert(0, str(DOCS))
