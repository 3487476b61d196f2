import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
# Bounds (left, bottom, right, top), and walls in the form of a box.
TWICE = {"Box"}


def named(module: ast.Module) -> Iterator[str]:
    """Yield classes and aliases of types, but no aliases of arrays, nor variables of types."""
    for node in module.body:
        if isinstance(node, ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Subscript):
            text = ast.unparse(node.value)
            if text.startswith(("Callable[", "Mapping[", "Sequence[", "dict[", "tuple[")):
                yield from (each.id for each in node.targets if isinstance(each, ast.Name))


def test_no_class_name_has_two_meanings():
    places = defaultdict(list)
    for folder in ("sph_gym", "agents"):
        for path in (ROOT / folder).rglob("*.py"):
            for name in named(ast.parse(path.read_text())):
                places[name].append(str(path.relative_to(ROOT)))
    found = {name: where for name, where in places.items() if len(where) > 1}
    assert set(found) == TWICE, found
