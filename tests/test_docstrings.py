import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
# First words that tell neither what a thing is nor what it does.
VAGUE = re.compile(r"(What|Of|Whether|The same|That|How)\b")


def test_docstrings_begin_with_a_noun_or_a_verb():
    found = [
        f"{path.relative_to(ROOT)}: {text.splitlines()[0]}"
        for folder in ("sph_gym", "agents")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef))
        and (text := ast.get_docstring(node))
        and VAGUE.match(text)
    ]
    assert not found, found
