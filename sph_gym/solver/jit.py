"""Compilation: `jit` for what Python calls, `jitable` for helpers, `dispatch` for families."""

import gc
import hashlib
import sys
import time
import uuid
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast

import numba
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.typed_passes import IRLegalization
from numba.extending import overload, register_jitable

from sph_gym.files import cache_home
from sph_gym.solver import target

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

Function = TypeVar("Function", bound=Callable[..., Any])

# Fast math without nnan and ninf, which would delete the NaN tripwire (numba #2919, #8708), and
# without reassoc: the last bit of a sum then depended on the function that a step is compiled into.
FASTMATH = {"contract", "arcp", "afn", "nsz"}
# LLVM's level of optimisation.
OPT: Any = numba.config.OPT  # type: ignore[attr-defined]
# How long a process waits for another that compiles the same version, and between two looks [s].
PATIENCE, PAUSE = 120.0, 0.1
# A C function around each helper, for other libraries to call, would be an eighth of compile time.
OPTIONS: Any = {
    "error_model": "numpy",
    "nogil": True,
    "fastmath": FASTMATH,
    "_nrt": False,
    "no_cfunc_wrapper": True,
}


@cache
def source_hash() -> str:
    """Return a hash of the solver's sources and of the compiler: the key of all they produce."""
    versions = f"{numba.__version__} {sys.version} {target.KEY} {OPT}"
    digest = hashlib.sha256(versions.encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


class _HelperLibrary(JITCodeLibrary):
    """Code of a helper: neither optimised nor made machine code, but kept for its callers.

    alone: whether it is linked without what it calls; only entry points look deeper themselves.
    """

    alone = False
    _whole: Any = None

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def finalize(self) -> None:
        """Take no more code; what this one calls is linked together with it."""
        self._finalize_dynamic_globals()
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """Return the code of this helper, and for functions of numba's all that it calls."""
        module = super()._get_module_for_linking()
        if self.alone:
            return module
        if self._whole is None:
            self._whole = module.clone()
            for called in self._linking_libraries:
                self._whole.link_in(called._get_module_for_linking(), preserve=True)
        return self._whole

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: there is nothing that could be called."""
        return 0

    @property
    def codegen(self) -> Any:
        """A stand-in, since code that never runs needs no environment."""
        return _NoEnvironment()


class _NoEnvironment:
    def set_env(self, *arguments: Any) -> None:
        """Do nothing."""


class _EntryLibrary(JITCodeLibrary):
    """Code that Python calls: optimised together with all helpers, however deep."""

    def finalize(self) -> None:
        """Link all helpers, optimise the whole, and make machine code of it."""
        found: dict[Any, None] = {}
        _collect(self, found)
        self._linking_libraries = list(found)
        # each helper once, not once more within every caller; compilations take turns
        _HelperLibrary.alone = True
        try:
            super().finalize()
        finally:
            _HelperLibrary.alone = False


def _collect(library: Any, found: dict[Any, None]) -> None:
    """Add what a library calls, directly or through helpers, to `found`."""
    for called in library._linking_libraries:
        if called not in found:
            found[called] = None
            if isinstance(called, _HelperLibrary):
                _collect(called, found)


class _LightHelpers(Compiler):
    """Numba's pipeline, but helpers are optimised only as part of what they are compiled into.

    Numba optimises every function on its own, makes machine code of it, and does so once more in
    each of its callers. In a tree of small helpers that is most of the compiler's work, for code
    that never runs.
    """

    def compile_extra(self, func: Any) -> Any:
        """Compile `func`; its helpers are compiled meanwhile, before its own lowering."""
        codegen = self.state.targetctx.codegen()
        codegen._library_class = _HelperLibrary
        # numba makes millions of objects, which the collector would walk through again and again
        collecting = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            codegen._library_class = JITCodeLibrary
            if collecting:
                gc.enable()

    def define_pipelines(self) -> list[Any]:
        """The default pipeline with one more pass right before code is made."""
        [pipeline] = super().define_pipelines()
        pipeline.add_pass_after(_BeginEntry, IRLegalization)
        pipeline.finalize()
        return [pipeline]


@register_pass(mutates_CFG=False, analysis_only=True)
class _BeginEntry(AnalysisPass):
    _name = "sph_gym_begin_entry"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        """From here on it is the entry point's own code that is made."""
        state.targetctx.codegen()._library_class = _EntryLibrary
        return True


def jit(function: Function) -> Function:
    """Compile a function that Python calls, on first use, without the GIL, cached on disk.

    Numba looks only at a function's own file to see whether its cache is stale, so an edited
    helper would go on running as it was (numba #1833). A folder named by the hash of all sources
    makes that impossible. Where no folder can be written, compilation works without a cache; so it
    does on a full disk and after files were damaged, with a warning.
    """
    config: Any = numba.config
    if config.DISABLE_JIT:
        return function
    options = OPTIONS | {"pipeline_class": _LightHelpers}
    previous = config.CACHE_DIR
    config.CACHE_DIR = str(cache_home() / "jit" / source_hash())
    try:
        return cast(Function, _forgiving(numba.njit(cache=True, **options)(function)))
    except (OSError, RuntimeError):
        return numba.njit(**options)(function)
    finally:
        config.CACHE_DIR = previous


# The function whose compilation takes long enough to be announced.
LONGEST = "advance"
_announcing = False


def announce_compilation() -> None:
    """From now on, print a line to stderr when the solver is compiled for a new kind of scene."""
    global _announcing
    _announcing = True


def _forgiving(dispatcher: Any) -> Any:
    """Let a compiled function do without its cache where that fails: it only saves time."""
    stored = dispatcher._cache
    stored._cache_file.save = partial(_save, stored._cache_file)
    load, save, compile_it = stored.load_overload, stored.save_overload, dispatcher.compile
    locks: dict[Any, Any] = {}

    def try_to_load(*arguments: Any) -> Any:
        try:
            return load(*arguments)
        except Exception as error:  # whatever a torn file raises when it is unpickled
            _say(f"machine code in {stored.cache_path} is damaged and made anew: {error!r}")
            with suppress(OSError):
                stored.flush()
        return None

    def careful_load(signature: Any, *arguments: Any) -> Any:
        found = try_to_load(signature, *arguments)
        announced = _announcing and dispatcher.__name__ == LONGEST
        if found is None:
            version = f"{dispatcher.__name__} {signature}"
            text = "another process compiles the solver for this kind of scene: waiting for it"
            locks[signature] = _wait_for_others(
                Path(stored.cache_path), version, text if announced else ""
            )
            # another one may have compiled it meanwhile
            found = try_to_load(signature, *arguments)
        if found is None and announced:
            text = "compiling the solver for this kind of scene: some 10 s, once on this machine"
            print(text, file=sys.stderr, flush=True)
        return found

    def careful_save(signature: Any, *arguments: Any) -> None:
        try:
            save(signature, *arguments)
        except OSError as error:
            _say(f"machine code can't be kept in {stored.cache_path}: {error}")

    def careful_compile(signature: Any) -> Any:
        try:
            return compile_it(signature)
        finally:  # also after an error or Ctrl-C
            _release(locks.pop(signature, None))

    stored.load_overload, stored.save_overload = careful_load, careful_save
    dispatcher.compile = careful_compile
    return dispatcher


def _wait_for_others(folder: Path, what: str, text: str = "") -> Any:
    """Return an open file that keeps other processes from doing the same meanwhile.

    what: a version to compile, or an index to write; text: printed to stderr if a wait begins.
    None where there are no such locks, or if another process holds this one for too long.
    """
    if fcntl is None:
        return None
    name = hashlib.sha256(what.encode()).hexdigest()[:16]
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / f"{name}.lock").open("w")
        held = False
        try:
            for attempt in range(int(PATIENCE / PAUSE)):
                with suppress(BlockingIOError):
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    held = True
                    return lock
                if text and attempt == 0:
                    print(text, file=sys.stderr, flush=True)
                time.sleep(PAUSE)
        finally:  # after Ctrl-C too, and where there are no locks
            if not held:
                lock.close()
    return None


def _release(lock: Any) -> None:
    """Let others go on; lock: of `_wait_for_others`."""
    if lock is not None:
        # closing is not enough where a fork has the file too
        fcntl.flock(lock, fcntl.LOCK_UN)
        lock.close()


def _save(file: Any, key: Any, data: Any) -> None:
    """Keep machine code under a random name, which no other process takes.

    Numba numbers the files by what its index holds. Two processes that compile two versions at
    once take the same number, and one then runs the code of the other: a crash, or wrong numbers.
    Both write the index, so they take turns, else it would lose what one of them has added.
    """
    name = file._data_name(uuid.uuid4().int)
    file._save_data(name, data)
    # only now: the index must not name a file that isn't there
    index = Path(file._index_path)
    lock = _wait_for_others(index.parent, index.name)
    try:
        file._save_index(file._load_index() | {key: name})
    finally:
        _release(lock)


def _say(text: str) -> None:
    warnings.warn(text, stacklevel=2)


def jitable(function: Function) -> Function:
    """Make a helper that is compiled into the `jit` functions which call it."""
    return register_jitable(**OPTIONS)(function)


def inlined(function: Function) -> Function:
    """Make a `jitable` helper that is always made part of its callers' machine code.

    For helpers that work on many arrays and are called once a group: LLVM finds some of them too
    long, and a call hands over every array in seven words on the stack.
    """
    return register_jitable(**OPTIONS, forceinline=True)(function)


class Family(Protocol):
    """A function whose implementation depends on the class of its first argument."""

    def __call__(self, first: Any, /, *rest: Any) -> Any:
        """Call the member for `type(first)`."""

    def member(self, kind: type) -> Callable[[Function], Function]:
        """Decorator that adds the implementation for one class."""


def dispatch(function: Callable[..., Any]) -> Family:
    """Make `function` a family whose member is chosen by the class of its first argument.

    The choice is made at compile time, so a family costs nothing in a loop. Members are added
    with `@family.member(SomeNamedTuple)` and take the same positional arguments.
    """
    members: dict[Any, Callable[..., Any]] = {}

    def family(first: Any, *rest: Any) -> Any:
        return members[type(first)](first, *rest)

    def choose(first: Any, *rest: Any) -> Callable[..., Any] | None:
        return members.get(getattr(first, "instance_class", None))

    def member(kind: type) -> Callable[[Function], Function]:
        def register(implementation: Function) -> Function:
            members[kind] = implementation
            return implementation

        return register

    family.__name__, family.__doc__ = function.__name__, function.__doc__
    family.member = member  # type: ignore[attr-defined]
    overload(family, strict=False, jit_options=OPTIONS)(choose)
    return cast(Family, family)
