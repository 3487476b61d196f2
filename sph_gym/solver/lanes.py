"""Lanes: several particles in one number. The only file that knows LLVM.

A term that is written with + - * / < and the functions below runs unchanged on one particle and
on as many as the processor's vectors hold. Each function is given twice: as plain Python, which
is what it means (and what runs with NUMBA_DISABLE_JIT=1), and as the LLVM instructions that numba
puts in its place, which are the same for a plain float and for a vector of lanes. In plain Python
arithmetic may also be done on arrays of numbers at once.

`load` makes lanes of consecutive array elements and `broadcast` repeats one element in all lanes;
`like` does that with a literal. A comparison gives a mask, for `select`, `store` and `append`.
Loads and appends may touch up to MOST_LANES elements behind the last one that counts: see
`state.column`.
"""

import operator
import os
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.registry import cpu_target
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import (
    NativeValue,
    lower_builtin,
    lower_cast,
    register_model,
    unbox,
)

from sph_gym.solver.jit import FASTMATH
from sph_gym.solver.target import HAS_AVX512, n_lanes

# --- The types ------------------------------------------------------------------------------

ELEMENTS = {
    types.float64: ir.DoubleType(),
    types.float32: ir.FloatType(),
    types.boolean: ir.IntType(1),
}


class Lanes(types.Type):
    """`count` numbers, or truth values, of type `element` in one vector register."""

    def __init__(self, element: types.Type, count: int) -> None:
        self.element, self.count = element, count
        super().__init__(name=f"Lanes({element} x {count})")

    @property
    def key(self) -> tuple[types.Type, int]:
        """The parts that make two such types equal."""
        return self.element, self.count


@register_model(Lanes)
class LanesModel(models.PrimitiveModel):
    """An LLVM vector."""

    def __init__(self, manager: Any, kind: Lanes) -> None:
        super().__init__(manager, kind, ir.VectorType(ELEMENTS[kind.element], kind.count))


def _lanes_of(element: types.Type) -> types.Type:
    """The type that a load from an array of `element` gives: a plain number where one lane is."""
    count = n_lanes(str(element))
    return element if count == 1 else Lanes(element, count)


def _mask_of(kind: types.Type) -> types.Type:
    return Lanes(types.boolean, kind.count) if isinstance(kind, Lanes) else types.boolean


def _is_number(kind: types.Type) -> bool:
    return isinstance(kind, (types.Float, types.Integer))


def _common(*kinds: types.Type) -> types.Type | None:
    """The type of lanes that all of `kinds` can be turned into, or of the plain floats."""
    lanes = {kind for kind in kinds if isinstance(kind, Lanes) and kind.element != types.boolean}
    if len(lanes) == 1 and all(kind in lanes or _is_number(kind) for kind in kinds):
        return lanes.pop()
    if not lanes and all(map(_is_number, kinds)):
        return max((kind for kind in kinds if isinstance(kind, types.Float)), default=None)
    return None


# --- From Python to LLVM --------------------------------------------------------------------

Typing = Callable[..., Any]


def _typed(function: Any, typing: Typing) -> None:
    """Tell numba which signature, if any, `function` has for arguments of given types."""

    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            return None if kws else typing(*args)

    infer_global(function)(Template)


def _emits(function: Any, typing: Typing) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorator: `emit(code, *values)` makes the instructions of `function`."""

    def register(emit: Callable[..., Any]) -> Callable[..., Any]:
        def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return emit(Code(context, builder, sig), *args)

        _typed(function, typing)
        lower_builtin(function, types.VarArg(types.Any))(lower)
        return emit

    return register


class Code:
    """An LLVM builder, and the few things that the functions below ask of it."""

    def __init__(self, context: Any, builder: Any, sig: Any) -> None:
        self.context, self.builder, self.sig = context, builder, sig

    @property
    def out(self) -> Any:
        """LLVM type of the result."""
        return self.context.get_value_type(self.sig.return_type)

    def count(self, llvm: Any) -> int:
        """Number of lanes of an LLVM type."""
        return int(llvm.count) if isinstance(llvm, ir.VectorType) else 1

    def splat(self, value: Any, llvm: Any) -> Any:
        """`value` in all lanes of type `llvm`."""
        if not isinstance(llvm, ir.VectorType):
            return value
        if isinstance(value, ir.Constant):
            return ir.Constant(llvm, [value] * llvm.count)
        nothing = ir.Constant(llvm, ir.Undefined)
        first = self.builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
        zeros = ir.Constant(ir.VectorType(ir.IntType(32), llvm.count), None)
        return self.builder.shuffle_vector(first, nothing, zeros)

    def constant(self, llvm: Any, value: float) -> Any:
        """A literal in all lanes."""
        element = llvm.element if isinstance(llvm, ir.VectorType) else llvm
        return self.splat(ir.Constant(element, value), llvm)

    def numbers(self, like: Any) -> Any:
        """0, 1, 2 ... (int32) in the lanes of a type shaped as `like`."""
        integer = ir.IntType(32)
        if not isinstance(like, ir.VectorType):
            return ir.Constant(integer, 0)
        each = [ir.Constant(integer, k) for k in range(like.count)]
        return ir.Constant(ir.VectorType(integer, like.count), each)

    def address(self, array: Any, index: Any) -> Any:
        """Return the address of element `index` of the array that is the first argument."""
        data = self.context.make_array(self.sig.args[0])(self.context, self.builder, array).data
        return self.builder.gep(data, [index], inbounds=True)

    def as_vector(self, address: Any, llvm: Any) -> Any:
        """The address seen as that of lanes."""
        return self.builder.bitcast(address, llvm.as_pointer())

    def call(self, name: str, result: Any, *args: Any) -> Any:
        """Call an LLVM intrinsic by its full name."""
        kind = ir.FunctionType(result, [arg.type for arg in args])
        function = cgutils.get_or_insert_function(self.builder.module, kind, name)
        return self.builder.call(function, args)

    def suffix(self, llvm: Any) -> str:
        """The end of an intrinsic's name: v8f64 for eight lanes of float64, f64 for one."""
        element = llvm.element if isinstance(llvm, ir.VectorType) else llvm
        if isinstance(element, ir.IntType):
            text = f"i{element.width}"
        else:
            text = "f64" if isinstance(element, ir.DoubleType) else "f32"
        return f"v{llvm.count}{text}" if isinstance(llvm, ir.VectorType) else text

    def fma(self, a: Any, b: Any, c: Any) -> Any:
        """a b + c, rounded once."""
        return self.call(f"llvm.fma.{self.suffix(a.type)}", a.type, a, b, c)

    def below(self, like: Any, n: Any) -> Any:
        """Mask of the lanes before lane `n`."""
        numbers = self.numbers(like)
        end = self.splat(self.builder.trunc(n, ir.IntType(32)), numbers.type)
        return self.builder.icmp_signed("<", numbers, end)

    def bits(self, mask: Any) -> Any:
        """A mask as an integer, lane 0 in its lowest bit."""
        return self.builder.bitcast(mask, ir.IntType(self.count(mask.type)))


@lower_cast(types.Number, Lanes)
def _cast(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    number = context.cast(builder, value, fromty, toty.element)
    return Code(context, builder, None).splat(number, context.get_value_type(toty))


# --- Arithmetic -----------------------------------------------------------------------------


def _arithmetic(*kinds: types.Type) -> Any:
    common = _common(*kinds)
    return signature(common, *[common] * len(kinds)) if isinstance(common, Lanes) else None


def _comparison(a: types.Type, b: types.Type) -> Any:
    common = _common(a, b)
    return signature(_mask_of(common), common, common) if isinstance(common, Lanes) else None


def _register_operators() -> None:
    binary = {
        operator.add: "fadd", operator.sub: "fsub", operator.mul: "fmul", operator.truediv: "fdiv",
    }  # fmt: skip
    in_place = {
        operator.add: operator.iadd, operator.sub: operator.isub,
        operator.mul: operator.imul, operator.truediv: operator.itruediv,
    }  # fmt: skip
    for symbol, name in binary.items():

        def emit(code: Code, a: Any, b: Any, name: str = name) -> Any:
            return getattr(code.builder, name)(a, b, flags=tuple(FASTMATH))

        _emits(symbol, _arithmetic)(emit)
        _emits(in_place[symbol], _arithmetic)(emit)
    for symbol, name in {operator.lt: "<", operator.gt: ">"}.items():

        def compare(code: Code, a: Any, b: Any, name: str = name) -> Any:
            return code.builder.fcmp_ordered(name, a, b)

        _emits(symbol, _comparison)(compare)


_register_operators()


@_emits(operator.neg, _arithmetic)
def _neg(code: Code, a: Any) -> Any:
    return code.builder.fneg(a)


@_emits(abs, _arithmetic)
def _abs(code: Code, a: Any) -> Any:
    return code.call(f"llvm.fabs.{code.suffix(a.type)}", a.type, a)


@_emits(operator.pow, _arithmetic)
def _pow(code: Code, a: Any, b: Any) -> Any:
    return code.call(f"llvm.pow.{code.suffix(a.type)}", a.type, a, b)


@_emits(operator.and_, lambda a, b: signature(a, a, a) if a == b and isinstance(a, Lanes) else None)
def _and(code: Code, a: Any, b: Any) -> Any:
    return code.builder.and_(a, b)


def like(x: Any, value: float) -> Any:
    """`value` in the type of `x`, so that a literal doesn't widen a float32 sum."""
    return x.dtype.type(value) if isinstance(x, np.ndarray) else type(x)(value)


@_emits(
    like,
    lambda x, value: (
        signature(x, x, types.float64)
        if isinstance(x, (Lanes, types.Float)) and _is_number(value)
        else None
    ),
)
def _like(code: Code, x: Any, value: Any) -> Any:
    kind = code.sig.args[0]
    element = kind.element if isinstance(kind, Lanes) else kind
    number = code.context.cast(code.builder, value, types.float64, element)
    return code.splat(number, x.type)


def _smooth(*kinds: types.Type) -> Any:
    common = _common(*kinds)
    return signature(common, *[common] * len(kinds)) if common is not None else None


def minimum(a: Any, b: Any) -> Any:
    """The smaller of the two; `b` where either is not a number."""
    return select(a < b, a, b)


@_emits(minimum, _smooth)
def _minimum(code: Code, a: Any, b: Any) -> Any:
    return code.builder.select(code.builder.fcmp_ordered("<", a, b), a, b)


def maximum(a: Any, b: Any) -> Any:
    """The larger of the two; `b` where either is not a number."""
    return select(a > b, a, b)


@_emits(maximum, _smooth)
def _maximum(code: Code, a: Any, b: Any) -> Any:
    return code.builder.select(code.builder.fcmp_ordered(">", a, b), a, b)


def select(condition: Any, a: Any, b: Any) -> Any:
    """`a` where the condition holds, else `b`."""
    if isinstance(condition, np.ndarray):
        return np.where(condition, a, b)
    return a if condition else b


def _select_typing(condition: types.Type, a: types.Type, b: types.Type) -> Any:
    common = _common(a, b)
    return None if common is None else signature(common, _mask_of(common), common, common)


@_emits(select, _select_typing)
def _select(code: Code, condition: Any, a: Any, b: Any) -> Any:
    return code.builder.select(condition, a, b)


# Seeds of 14 bits, refined with one correction of high order: as accurate as a division and a
# root (a few units in the last place), at a third of their cost. Not for 0 and infinity.


def _seed(code: Code, name: str, x: Any) -> Any:
    """`rcp14` or `rsqrt14` of lanes of 128, 256 or 512 bits."""
    count = code.count(x.type)
    double = isinstance(x.type.element, ir.DoubleType)
    mask = ir.IntType(8 if count <= 8 else 16)
    name = f"llvm.x86.avx512.{name}.{'pd' if double else 'ps'}.{count * (64 if double else 32)}"
    return code.call(name, x.type, x, ir.Constant(x.type, None), ir.Constant(mask, -1))


def _has_seed(llvm: Any) -> bool:
    if not (HAS_AVX512 and isinstance(llvm, ir.VectorType)):
        return False
    return llvm.count * (64 if isinstance(llvm.element, ir.DoubleType) else 32) in (128, 256, 512)


def reciprocal(x: Any) -> Any:
    """1 / x."""
    return 1 / x


@_emits(reciprocal, _smooth)
def _reciprocal(code: Code, x: Any) -> Any:
    one = code.constant(x.type, 1.0)
    if not _has_seed(x.type):
        return code.builder.fdiv(one, x)
    y = _seed(code, "rcp14", x)
    error = code.fma(code.builder.fneg(x), y, one)
    series = error
    if isinstance(x.type.element, ir.DoubleType):
        # y (1 + e + e^2 + e^3), the error e being 2^-14
        series = code.fma(error, code.fma(error, error, error), error)
    return code.fma(y, series, y)


def rsqrt(x: Any) -> Any:
    """1 / sqrt(x)."""
    return 1 / np.sqrt(x)


@_emits(rsqrt, _smooth)
def _rsqrt(code: Code, x: Any) -> Any:
    one = code.constant(x.type, 1.0)
    if not _has_seed(x.type):
        root = code.call(f"llvm.sqrt.{code.suffix(x.type)}", x.type, x)
        return code.builder.fdiv(one, root)
    y = _seed(code, "rsqrt14", x)
    error = code.fma(code.builder.fneg(code.builder.fmul(x, y)), y, one)
    # y (1 - e)^(-1/2) = y (1 + e/2 + 3 e^2/8 + 5 e^3/16)
    series = code.constant(x.type, 0.5)
    if isinstance(x.type.element, ir.DoubleType):
        inner = code.fma(code.constant(x.type, 0.3125), error, code.constant(x.type, 0.375))
        series = code.fma(inner, error, series)
    return code.fma(code.builder.fmul(y, error), series, y)


# --- Arrays ---------------------------------------------------------------------------------


def width(array: Any) -> int:
    """Return the number of elements of `array` that one load takes."""
    return 1


@_emits(width, lambda array: signature(types.intp, array))
def _width(code: Code, array: Any) -> Any:
    return ir.Constant(code.out, n_lanes(str(code.sig.args[0].dtype)))


def _from_array(array: types.Type, i: types.Type) -> Any:
    if not isinstance(array, types.Array):
        return None
    return signature(_lanes_of(array.dtype), array, types.intp)


def load(array: Any, i: int) -> Any:
    """array[i], array[i + 1] ... in the lanes."""
    return array[i]


@_emits(load, _from_array)
def _load(code: Code, array: Any, i: Any) -> Any:
    address = code.as_vector(code.address(array, i), code.out)
    return code.builder.load(address, align=_alignment(code.out))


def _alignment(llvm: Any) -> int:
    """Return the alignment of one element: vectors lie anywhere."""
    element = llvm.element if isinstance(llvm, ir.VectorType) else llvm
    return 8 if isinstance(element, ir.DoubleType) else 4


def broadcast(array: Any, i: int) -> Any:
    """array[i] in all lanes."""
    return array[i]


@_emits(broadcast, _from_array)
def _broadcast(code: Code, array: Any, i: Any) -> Any:
    return code.splat(code.builder.load(code.address(array, i)), code.out)


def store(array: Any, i: int, value: Any, n: int) -> None:
    """array[i], array[i + 1] ... = the first n lanes of `value`."""
    array[i] = value


@_emits(
    store,
    lambda array, i, value, n: signature(
        types.none, array, types.intp, _lanes_of(array.dtype), types.intp
    ),
)
def _store(code: Code, array: Any, i: Any, value: Any, n: Any) -> Any:
    address, align = code.as_vector(code.address(array, i), value.type), _alignment(value.type)
    if isinstance(value.type, ir.VectorType):
        name = f"llvm.masked.store.{code.suffix(value.type)}.p0"
        width = ir.Constant(ir.IntType(32), align)
        code.call(name, ir.VoidType(), value, address, width, code.below(value.type, n))
    else:
        code.builder.store(value, address, align=align)
    return code.context.get_dummy_value()


def entry(array: Any, k: int) -> int:
    """array[k], without numba's test for a negative index, which costs a loop its speed."""
    return int(array[k])


@_emits(entry, lambda array, k: signature(types.intp, array, types.intp))
def _entry(code: Code, array: Any, k: Any) -> Any:
    return code.builder.sext(code.builder.load(code.address(array, k)), code.out)


def first_lanes(x: Any, n: int) -> Any:
    """Mask of the first n lanes, all of them if there are fewer; n is below 2^31."""
    return n > 0


@_emits(first_lanes, lambda x, n: signature(_mask_of(x), x, types.intp))
def _first_lanes(code: Code, x: Any, n: Any) -> Any:
    return code.below(x.type, n)


def lane(x: Any, k: int) -> Any:
    """Mask of lane k alone; of none if there is no such lane."""
    return k == 0


@_emits(lane, lambda x, k: signature(_mask_of(x), x, types.intp))
def _lane(code: Code, x: Any, k: Any) -> Any:
    numbers = code.numbers(x.type)
    here = code.splat(code.builder.trunc(k, ir.IntType(32)), numbers.type)
    return code.builder.icmp_signed("==", numbers, here)


def append(entries: Any, k: int, j: int, mask: Any) -> int:
    """Write j + lane to entries[k], entries[k + 1] ... for the lanes in `mask`; the new k."""
    entries[k] = j
    return k + int(mask)


@_emits(
    append,
    lambda entries, k, j, mask: signature(types.intp, entries, types.intp, types.intp, mask),
)
def _append(code: Code, entries: Any, k: Any, j: Any, mask: Any) -> Any:
    builder, count = code.builder, code.count(mask.type)
    numbers = code.numbers(mask.type)
    index = builder.add(numbers, code.splat(builder.trunc(j, ir.IntType(32)), numbers.type))
    if HAS_AVX512 and count in (4, 8, 16):
        name = f"llvm.x86.avx512.mask.compress.v{count}i32"
        chosen = code.call(name, index.type, index, ir.Constant(index.type, None), mask)
        builder.store(chosen, code.as_vector(code.address(entries, k), index.type), align=4)
        found = builder.ctpop(code.bits(mask))
        return builder.add(k, builder.zext(found, k.type))
    for q in range(count):
        # written in any case, and counted if it is wanted: no branch
        place = ir.Constant(ir.IntType(32), q)
        vector = isinstance(mask.type, ir.VectorType)
        builder.store(
            builder.extract_element(index, place) if vector else index, code.address(entries, k)
        )
        wanted = builder.extract_element(mask, place) if vector else mask
        k = builder.add(k, builder.zext(wanted, k.type))
    return k


# --- From lanes to one number ---------------------------------------------------------------


def lowest(x: Any) -> Any:
    """The smallest of the lanes."""
    return x


def highest(x: Any) -> Any:
    """The largest of the lanes."""
    return x


def _reduction(x: types.Type) -> Any:
    return signature(x.element if isinstance(x, Lanes) else x, x)


def _reduced(code: Code, name: str, x: Any) -> Any:
    if not isinstance(x.type, ir.VectorType):
        return x
    full = f"llvm.vector.reduce.{name}.{code.suffix(x.type)}"
    function = cgutils.get_or_insert_function(
        code.builder.module, ir.FunctionType(x.type.element, [x.type]), full
    )
    # without a promise about NaN, LLVM would not use the processor's own minimum
    return code.builder.call(function, [x], fastmath=("nnan", "nsz"))


@_emits(lowest, _reduction)
def _lowest(code: Code, x: Any) -> Any:
    return _reduced(code, "fmin", x)


@_emits(highest, _reduction)
def _highest(code: Code, x: Any) -> Any:
    return _reduced(code, "fmax", x)


def first_true(mask: Any) -> int:
    """Number of the first lane in the mask; -1 if there is none."""
    return 0 if mask else -1


@_emits(first_true, lambda mask: signature(types.intp, mask))
def _first_true(code: Code, mask: Any) -> Any:
    builder = code.builder
    bits = code.bits(mask)
    found = builder.cttz(bits, ir.Constant(ir.IntType(1), 0))
    nothing = builder.icmp_unsigned("==", bits, ir.Constant(bits.type, 0))
    return builder.select(nothing, ir.Constant(code.out, -1), builder.zext(found, code.out))


# --- Threads --------------------------------------------------------------------------------


def atomic_add(array: Any, i: int, value: int) -> int:
    """array[i] += value, for several threads at once; what was there before."""
    before = int(array[i])
    array[i] += value
    return before


@_emits(atomic_add, lambda array, i, value: signature(types.int64, array, types.intp, types.int64))
def _atomic_add(code: Code, array: Any, i: Any, value: Any) -> Any:
    return code.builder.atomic_rmw("add", code.address(array, i), value, "seq_cst")


def atomic_load(array: Any, i: int) -> int:
    """array[i], as the other threads have left it."""
    return int(array[i])


@_emits(atomic_load, lambda array, i: signature(types.int64, array, types.intp))
def _atomic_load(code: Code, array: Any, i: Any) -> Any:
    return code.builder.load_atomic(code.address(array, i), "seq_cst", 8)


def give_way() -> None:
    """Let another thread have this processor, if one waits for it."""


@_emits(give_way, lambda: signature(types.none))
def _give_way(code: Code) -> Any:
    if os.name == "posix":
        code.call("sched_yield", ir.IntType(32))
    return code.context.get_dummy_value()


# --- Records --------------------------------------------------------------------------------
#
# A tuple of arrays as a row of bytes, so that one compiled call can go through many of them. A
# record holds addresses: it is of use only as long as the arrays that it was made from live.


class ShapeType(types.Type):
    """The type of a `Shape`; of: that of the value."""

    def __init__(self, of: Any) -> None:
        self.of = of
        super().__init__(name=f"Shape({of})")

    @property
    def key(self) -> Any:
        """The parts that make two such types equal."""
        return self.of


class Shape:
    """The type of a value, as an argument that costs little."""

    def __init__(self, value: Any) -> None:
        looks = _looks(value)
        if looks not in _SHAPES:
            _SHAPES[looks] = ShapeType(numba.typeof(value))
        self._numba_type_ = _SHAPES[looks]


# Numba takes milliseconds to find the type of a whole world; most worlds look alike.
_SHAPES: dict[Any, ShapeType] = {}


def _looks(value: Any) -> Any:
    """All that numba's type of nested tuples of numbers and arrays depends on."""
    if isinstance(value, tuple):
        return type(value), *map(_looks, value)
    if isinstance(value, np.ndarray):
        flags = value.flags
        order = flags.c_contiguous, flags.f_contiguous, flags.aligned, flags.writeable
        return value.dtype, value.ndim, order
    return type(value)


register_model(ShapeType)(models.OpaqueModel)


@unbox(ShapeType)
def _unbox_shape(typ: Any, value: Any, context: Any) -> Any:
    return NativeValue(context.context.get_dummy_value())


def record_size(value: Any) -> int:
    """Return the bytes that `pack` needs for nested tuples of numbers and arrays."""
    context = cpu_target.target_context
    return int(context.get_abi_sizeof(context.get_value_type(numba.typeof(value))))


def pack(record: Any, value: Any) -> None:
    """Write `value` into an array of bytes."""
    raise NotImplementedError("records are for compiled code")


@_emits(pack, lambda record, value: signature(types.none, record, value))
def _pack(code: Code, record: Any, value: Any) -> Any:
    address = code.as_vector(code.address(record, ir.Constant(ir.IntType(64), 0)), value.type)
    code.builder.store(value, address, align=1)
    return code.context.get_dummy_value()


def unpack(records: Any, i: int, shape: Any) -> Any:
    """The value of which row i of `records` was made, and of whose `shape` it is."""
    return records[i]


@_emits(unpack, lambda records, i, shape: signature(shape.of, records, types.intp, shape))
def _unpack(code: Code, records: Any, i: Any, shape: Any) -> Any:
    array = code.context.make_array(code.sig.args[0])(code.context, code.builder, records)
    stride = code.builder.extract_value(array.strides, 0)
    start = code.builder.gep(array.data, [code.builder.mul(i, stride)])
    return code.builder.load(code.as_vector(start, code.out), align=1)


# --- Named tuples ---------------------------------------------------------------------------


def replaced(value: Any, name: str, part: Any) -> Any:
    """Return the named tuple `value` with another `part`, of the same type, called `name`."""
    return value._replace(**{name: part})


def _replaced_typing(value: Any, name: Any, part: Any) -> Any:
    if not (isinstance(value, types.BaseNamedTuple) and isinstance(name, types.StringLiteral)):
        return None
    kinds: Any = value
    own = kinds.types[kinds.fields.index(name.literal_value)]
    return signature(value, value, name, own)


@_emits(replaced, _replaced_typing)
def _replaced(code: Code, value: Any, name: Any, part: Any) -> Any:
    kind = code.sig.args[0]
    index = kind.fields.index(code.sig.args[1].literal_value)
    return code.builder.insert_value(value, part, index)
