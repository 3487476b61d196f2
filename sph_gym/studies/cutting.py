"""A copy of the package in which the code of one effect doesn't exist.

A term that can be absent is a function that begins with `if effect is None: return ...`. Where it
is called with the effect in question, the copy has what that line returns instead; a function that
nobody calls any more is gone, and so is what nobody reads of that which a pair shares and sums up.
"""

import ast
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import sph_gym

# The tuples that the pair loop hands round.
TUPLES = ("Pair", "Sums")
Trees = dict[Path, ast.Module]


class Guard(NamedTuple):
    """A function that may be handed None: its parameters, which one, what it then returns."""

    parameters: tuple[str, ...]
    place: int
    value: ast.expr


def copy_without(effect: str, folder: Path) -> Path:
    """Copy the package to `folder` / sph_gym, without the code of an effect; the copy's path.

    Raises ValueError if there is no such code.
    """
    copy = folder / "sph_gym"
    source = Path(sph_gym.__file__).parent
    shutil.copytree(source, copy, ignore=shutil.ignore_patterns("__pycache__"))
    trees = {path: ast.parse(path.read_text("utf-8")) for path in sorted(copy.rglob("*.py"))}
    solver = {path: tree for path, tree in trees.items() if path.parent.name == "solver"}
    cut(effect, solver, trees)
    for path, tree in solver.items():
        path.write_text(ast.unparse(ast.fix_missing_locations(tree)) + "\n", "utf-8")
    return copy


def cut(effect: str, solver: Trees, package: Trees) -> None:
    """Cut the code of an effect out of the solver, in place. ValueError if there is none."""
    known = {name: guard for tree in solver.values() for name, guard in guards(tree)}
    calls = _Calls(effect, known)
    for tree in solver.values():
        calls.visit(tree)
    if not calls.gone:
        raise ValueError(f"effect: no code is guarded by {effect!r} being None")
    gone = calls.gone - {name for tree in package.values() for name in _used(tree)}
    for tree in solver.values():
        _Definitions(gone).visit(tree)
        _inline_carried(tree, calls.changed)
    for name in TUPLES:
        _drop_unread(name, list(solver.values()))


def guards(tree: ast.Module) -> Iterable[tuple[str, Guard]]:
    """Every function of a file that begins with `if parameter is None: return ...`.

    Constants may be given names before that.
    """
    for node in tree.body:
        if not isinstance(node, ast.FunctionDef):
            continue
        start: dict[str, ast.expr] = {}
        for statement in node.body:
            match statement:
                case ast.Expr(ast.Constant()):
                    continue
                case ast.Assign([ast.Name(name)], ast.Constant() as value):
                    start[name] = value
                    continue
                case ast.If(test=test, body=[ast.Return(value=value)]):
                    name = _what_is_none(test)
                    parameters = tuple(a.arg for a in node.args.args)
                    if name in parameters:
                        result = _substituted(value or ast.Constant(None), start)
                        yield node.name, Guard(parameters, parameters.index(name), result)
            break


def _what_is_none(test: ast.expr) -> str:
    """The name in `name is None` or `name is None or ...`; empty if that isn't it."""
    match test.values[0] if isinstance(test, ast.BoolOp) else test:
        case ast.Compare(ast.Name(name), [ast.Is()], [ast.Constant(None)]):
            return name
    return ""


class _Calls(ast.NodeTransformer):
    """Put what a guard returns in the place of calls with the absent effect."""

    def __init__(self, effect: str, known: dict[str, Guard]) -> None:
        self.effect, self.known = effect, known
        self.gone: set[str] = set()
        # assignments that now only take something out of a tuple
        self.changed: list[ast.Assign] = []

    def visit_Assign(self, node: ast.Assign) -> ast.stmt | None:
        """An assignment; nothing is left of one from names to themselves."""
        was_call = isinstance(node.value, ast.Call)
        self.generic_visit(node)
        if not was_call or isinstance(node.value, ast.Call):
            return node
        if ast.unparse(node.targets[0]) == ast.unparse(node.value):
            return None
        self.changed.append(node)
        return node

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """A call, whose arguments may hold further calls."""
        self.generic_visit(node)
        guard = self.known.get(node.func.id) if isinstance(node.func, ast.Name) else None
        if guard is None or len(node.args) <= guard.place:
            return node
        match node.args[guard.place]:
            case ast.Name(name) | ast.Attribute(attr=name) if name == self.effect:
                assert isinstance(node.func, ast.Name)
                self.gone.add(node.func.id)
                return _substituted(
                    guard.value, dict(zip(guard.parameters, node.args, strict=True))
                )
        return node

    def visit_Expr(self, node: ast.Expr) -> ast.stmt:
        """A call for what it does: nothing is left of it."""
        was_call = isinstance(node.value, ast.Call)
        self.generic_visit(node)
        return ast.Pass() if was_call and not isinstance(node.value, ast.Call) else node


class _Definitions(ast.NodeTransformer):
    """Remove functions of a file, not methods of that name, and their imports."""

    def __init__(self, gone: set[str]) -> None:
        self.gone = gone

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.stmt:
        """A class stays as it is."""
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.stmt | None:
        """The function itself."""
        return None if node.name in self.gone else node

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.stmt | None:
        """Its import; the whole line if it imports nothing else."""
        node.names = [alias for alias in node.names if alias.name not in self.gone]
        return node if node.names else None


class _Names(ast.NodeTransformer):
    """Put values in the place of names."""

    def __init__(self, values: dict[str, ast.expr]) -> None:
        self.values = values

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """A name, wherever it is read."""
        return self.values.get(node.id, node)


def _used(tree: ast.Module) -> set[str]:
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}


def _substituted(expression: ast.expr, values: dict[str, ast.expr]) -> ast.expr:
    """A copy of the expression with values in the place of names."""
    fresh: ast.expr = ast.parse(ast.unparse(expression), mode="eval").body
    found: ast.expr = _Names(values).visit(fresh)
    return found


def _inline_carried(tree: ast.Module, changed: list[ast.Assign]) -> None:
    """Where a changed assignment is `a, b = s.a, s.b`, use s.a and s.b instead of a and b."""
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef):
            continue
        for statement in list(function.body):
            carried = _carried(statement) if statement in changed else {}
            if carried:
                function.body.remove(statement)
                function.body = [_Names(carried).visit(s) for s in function.body]


def _carried(statement: ast.stmt) -> dict[str, ast.expr]:
    """Names that a statement merely takes out of a tuple, and from where."""
    match statement:
        case ast.Assign([ast.Tuple(names)], ast.Tuple(values)):
            pairs = list(zip(names, values, strict=True))
        case _:
            return {}
    found: dict[str, ast.expr] = {}
    for name, value in pairs:
        match name, value:
            case ast.Name(a), ast.Attribute(ast.Name(), b) if a == b:
                found[a] = value
            case _:
                return {}
    return found


def _drop_unread(name: str, trees: list[ast.Module]) -> None:
    """Remove the fields of a tuple that are at most handed on from one such tuple to the next."""
    nodes = [node for tree in trees for node in ast.walk(tree)]
    [kind] = [node for node in nodes if isinstance(node, ast.ClassDef) and node.name == name]
    fields = [node for node in kind.body if isinstance(node, ast.AnnAssign)]
    labels = [ast.unparse(node.target) for node in fields]
    made = [
        node
        for node in nodes
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == name
    ]
    handed_on = {
        id(argument)
        for call in made
        for label, argument in zip(labels, call.args, strict=True)
        if isinstance(argument, ast.Attribute) and argument.attr == label
    }
    read = {n.attr for n in nodes if isinstance(n, ast.Attribute) and id(n) not in handed_on}
    kept = [k for k, label in enumerate(labels) if label in read]
    for call in made:
        call.args = [call.args[k] for k in kept]
    dropped = [field for k, field in enumerate(fields) if k not in kept]
    kind.body = [node for node in kind.body if node not in dropped]
