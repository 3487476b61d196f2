import ast
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[1]
# A recording is shown by the window or read by the doctor; an episode is played, or written down.
TWICE = {"Recording", "Episode"}


def test_no_class_name_has_two_meanings():
    places = defaultdict(list)
    for folder in ("sph_gym", "agents"):
        for path in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.ClassDef):
                    places[node.name].append(str(path.relative_to(ROOT)))
    found = {name: where for name, where in places.items() if len(where) > 1}
    assert set(found) == TWICE, found
