"""Every operation on lanes against NumPy: compiled, as plain Python, and for other processors."""

import os
import runpy

import numba
import numpy as np
import pytest

from sph_gym.solver import target
from sph_gym.solver.jit import jit
from sph_gym.solver.lanes import (
    Shape,
    append,
    atomic_add,
    atomic_load,
    broadcast,
    entry,
    first_lanes,
    first_true,
    give_way,
    highest,
    lane,
    like,
    load,
    lowest,
    maximum,
    minimum,
    pack,
    reciprocal,
    record_size,
    rsqrt,
    select,
    store,
    unpack,
    width,
)
from sph_gym.solver.target import MOST_LANES, WIDTHS
from tests.paths import every_path, run_tests

N = 4 * MOST_LANES
DTYPES = ("float64", "float32")
both_ways = pytest.mark.parametrize("way", ["compiled", "plain"])
dtypes = pytest.mark.parametrize("dtype", DTYPES)
not_compiled = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")


def call(way, function, *arguments):
    """The compiled function, or what it was made from."""
    return (function if way == "compiled" else getattr(function, "py_func", function))(*arguments)


def lanes(way, dtype):
    """How many there are."""
    return target.n_lanes(dtype) if way == "compiled" else 1


def numbers(dtype, seed=0):
    """N numbers of both signs, none of them near 0."""
    rng = np.random.default_rng(seed)
    return (rng.uniform(0.1, 3.0, N) * rng.choice([-1.0, 1.0], N)).astype(dtype)


def assert_rows(out, expected, ulps=()):
    """Bit by bit, but for the rows that may be off by some units in the last place."""
    ulps = dict(ulps)
    for row, (name, values) in zip(out.reshape(-1, N), expected.items(), strict=True):
        values = np.asarray(values, out.dtype)
        tolerance = ulps.get(name, 0) * np.finfo(out.dtype).eps
        np.testing.assert_allclose(row, values, rtol=tolerance, atol=0.0, err_msg=name)


# --- Arithmetic -----------------------------------------------------------------------------


@jit
def arithmetic(a, b, out):
    n, w = a.size, width(a)
    for i in range(0, n, w):
        x, y = load(a, i), load(b, i)
        store(out, i, x + y, w)
        store(out, n + i, x - y, w)
        store(out, 2 * n + i, x * y, w)
        store(out, 3 * n + i, x / y, w)
        store(out, 4 * n + i, -x, w)
        store(out, 5 * n + i, abs(x), w)
        store(out, 6 * n + i, abs(x) ** y, w)
        store(out, 7 * n + i, abs(x) ** 5.5, w)
        z = x
        z += y
        store(out, 8 * n + i, z, w)
        z = x
        z -= y
        store(out, 9 * n + i, z, w)
        z = x
        z *= y
        store(out, 10 * n + i, z, w)
        z = x
        z /= y
        store(out, 11 * n + i, z, w)


@both_ways
@dtypes
@pytest.mark.without_jit
def test_arithmetic(dtype, way):
    a, b = numbers(dtype), numbers(dtype, seed=1)
    out = np.zeros(12 * N, dtype)
    call(way, arithmetic, a, b, out)
    expected = {
        "+": a + b,
        "-": a - b,
        "*": a * b,
        "/": a / b,
        "neg": -a,
        "abs": abs(a),
        "**": abs(a).astype(float) ** b,
        "** number": abs(a).astype(float) ** 5.5,
        "+=": a + b,
        "-=": a - b,
        "*=": a * b,
        "/=": a / b,
    }
    # a quotient may be a product with the reciprocal
    assert_rows(out, expected, {"/": 2, "/=": 2, "**": 4, "** number": 4})


@jit
def with_numbers(a, c, out):
    n, w = a.size, width(a)
    for i in range(0, n, w):
        x = load(a, i)
        store(out, i, x + 0.25, w)
        store(out, n + i, 0.25 + x, w)
        store(out, 2 * n + i, x - 3, w)
        store(out, 3 * n + i, 3 - x, w)
        store(out, 4 * n + i, c * x, w)
        store(out, 5 * n + i, x * c, w)
        store(out, 6 * n + i, x / c, w)
        store(out, 7 * n + i, c / x, w)
        store(out, 8 * n + i, select(x < c, x, 0.0), w)
        store(out, 9 * n + i, select(c < x, 1.5, x), w)
        store(out, 10 * n + i, minimum(x, c), w)
        store(out, 11 * n + i, maximum(c, x), w)


@both_ways
@dtypes
@pytest.mark.without_jit
def test_a_plain_number_counts_for_all_lanes(dtype, way):
    a, c = numbers(dtype), np.dtype(dtype).type(0.625)
    out = np.zeros(12 * N, dtype)
    call(way, with_numbers, a, c, out)
    expected = {
        "x + number": a + a.dtype.type(0.25),
        "number + x": a + a.dtype.type(0.25),
        "x - number": a - a.dtype.type(3),
        "number - x": a.dtype.type(3) - a,
        "scalar * x": c * a,
        "x * scalar": c * a,
        "x / scalar": a / c,
        "scalar / x": c / a,
        "x < scalar": np.where(a < c, a, 0.0),
        "scalar < x": np.where(c < a, 1.5, a),
        "minimum": np.minimum(a, c),
        "maximum": np.maximum(a, c),
    }
    assert_rows(out, expected, {"x / scalar": 2, "scalar / x": 2})


# --- Choosing -------------------------------------------------------------------------------

SPECIAL = (0.0, 1.0, -1.0, 2.5, np.inf, -np.inf, np.nan)


@jit
def choosing(a, b, out):
    n, w = a.size, width(a)
    for i in range(0, n, w):
        x, y = load(a, i), load(b, i)
        one, zero = like(x, 1.0), like(x, 0.0)
        store(out, i, select(x < y, one, zero), w)
        store(out, n + i, select(x > y, one, zero), w)
        store(out, 2 * n + i, select((x < y) & (x > -y), one, zero), w)
        store(out, 3 * n + i, select(x < y, x, y), w)
        store(out, 4 * n + i, minimum(x, y), w)
        store(out, 5 * n + i, maximum(x, y), w)
        store(out, 6 * n + i, abs(x), w)
        store(out, 7 * n + i, -x, w)
        store(out, 8 * n + i, like(x, 0.1), w)


@both_ways
@dtypes
@pytest.mark.without_jit
def test_comparisons_and_choices_also_of_what_is_no_number(dtype, way):
    a, b = (np.resize(part.ravel(), N).astype(dtype) for part in np.meshgrid(SPECIAL, SPECIAL))
    assert len(set(zip(a.astype(str), b.astype(str), strict=True))) == len(SPECIAL) ** 2
    out = np.zeros(9 * N, dtype)
    call(way, choosing, a, b, out)
    expected = {
        "<": a < b,
        ">": a > b,
        "&": (a < b) & (a > -b),
        "select": np.where(a < b, a, b),
        "minimum": np.where(np.isnan(a) | np.isnan(b), b, np.minimum(a, b)),
        "maximum": np.where(np.isnan(a) | np.isnan(b), b, np.maximum(a, b)),
        "abs": np.abs(a),
        "neg": -a,
        "like": np.full(N, 0.1, dtype),
    }
    assert_rows(out, expected)


# --- Reciprocals ----------------------------------------------------------------------------


@jit
def reciprocals(a, inverse, inverse_root):
    for i in range(0, a.size, width(a)):
        x = load(a, i)
        store(inverse, i, reciprocal(x), width(a))
        store(inverse_root, i, rsqrt(x), width(a))


@both_ways
@dtypes
@pytest.mark.without_jit
def test_reciprocals_are_as_good_as_divisions_and_roots(dtype, way):
    rng = np.random.default_rng(0)
    n = 40 * MOST_LANES if way == "plain" else 4000 * MOST_LANES
    magnitudes = 10.0 ** rng.uniform(-30.0, 30.0, n)
    # and the powers of two, around which a seed is at its worst
    magnitudes[: n // 4] = 2.0 ** rng.integers(-90, 90, n // 4)
    magnitudes[n // 8 : n // 4] *= 1.0 - 2.0**-22
    a = magnitudes.astype(dtype)
    inverse, inverse_root = np.zeros_like(a), np.zeros_like(a)
    call(way, reciprocals, a, inverse, inverse_root)
    exact = a.astype(np.longdouble)
    tolerance = 4 * np.finfo(dtype).eps
    assert np.abs(inverse * exact - 1).max() <= tolerance
    assert np.abs(inverse_root * np.sqrt(exact) - 1).max() <= tolerance


@both_ways
@dtypes
@pytest.mark.without_jit
def test_the_reciprocal_of_a_negative_number_and_of_none(dtype, way):
    a = np.resize(np.array([-4.0, -1e-20, -1e20, np.nan], dtype), N)
    inverse, inverse_root = np.zeros_like(a), np.zeros_like(a)
    with np.errstate(invalid="ignore"):
        call(way, reciprocals, a, inverse, inverse_root)
    np.testing.assert_allclose(inverse, 1 / a, rtol=4 * np.finfo(dtype).eps)
    assert np.isnan(inverse_root).all()


# --- Arrays ---------------------------------------------------------------------------------


@jit
def how_wide(a):
    return width(a)


@both_ways
@dtypes
@pytest.mark.without_jit
def test_width(dtype, way):
    n = call(way, how_wide, np.zeros(1, dtype))
    assert n == lanes(way, dtype)
    assert n in WIDTHS
    chosen = os.environ.get("SPH_GYM_LANES")
    if chosen and way == "compiled" and not numba.config.DISABLE_JIT:
        assert n == int(chosen)


@jit
def loads(a, out):
    w = width(a)
    for i in range(w):
        store(out, 2 * i * w, load(a, i), w)
        store(out, (2 * i + 1) * w, broadcast(a, i), w)


@both_ways
@dtypes
@pytest.mark.without_jit
def test_a_load_takes_neighbours_and_a_broadcast_one_element(dtype, way):
    a, w = numbers(dtype), lanes(way, dtype)
    out = np.zeros(2 * w * w, dtype)
    call(way, loads, a, out)
    for i, (loaded, spread) in enumerate(out.reshape(w, 2, w)):
        assert (loaded == a[i : i + w]).all()
        assert (spread == a[i]).all()


# a store of n lanes may not touch what lies before and behind
SPAN, BEFORE, UNTOUCHED = 4 * MOST_LANES, 5, -7.0


@jit
def stores(a, out):
    for n in range(1, 2 * width(a) + 1):
        store(out, n * SPAN + BEFORE, load(a, 1), n)


@both_ways
@dtypes
@pytest.mark.without_jit
def test_a_store_writes_the_first_lanes_and_nothing_else(dtype, way):
    a, w = numbers(dtype), lanes(way, dtype)
    out = np.full((2 * w + 1, SPAN), UNTOUCHED, dtype)
    call(way, stores, a, out.reshape(-1))
    for n, row in enumerate(out):
        written = min(n, w)
        assert (row[BEFORE : BEFORE + written] == a[1 : 1 + written]).all()
        assert (row[:BEFORE] == UNTOUCHED).all()
        assert (row[BEFORE + written :] == UNTOUCHED).all()


# --- Masks ----------------------------------------------------------------------------------

LEAST, MOST = -40, 40


@jit
def masks(a, out, numbers):
    w = width(a)
    x = load(a, 0)
    one, zero = like(x, 1.0), like(x, 0.0)
    for n in range(LEAST, MOST):
        row = n - LEAST
        store(out, 2 * row * w, select(first_lanes(x, n), one, zero), w)
        store(out, (2 * row + 1) * w, select(lane(x, n), one, zero), w)
        numbers[3 * row] = first_true(first_lanes(x, n))
        numbers[3 * row + 1] = first_true(lane(x, n))
        numbers[3 * row + 2] = first_true(lane(x, n) & first_lanes(x, 3))


@both_ways
@dtypes
@pytest.mark.without_jit
def test_masks_of_lanes_by_their_number(dtype, way):
    w = lanes(way, dtype)
    out, found = np.zeros(2 * (MOST - LEAST) * w, dtype), np.zeros(3 * (MOST - LEAST), np.int64)
    call(way, masks, numbers(dtype), out, found)
    rows = zip(range(LEAST, MOST), out.reshape(-1, 2, w), found.reshape(-1, 3), strict=True)
    for n, (first, alone), (of_first, of_alone, of_both) in rows:
        assert first.tolist() == [k < n for k in range(w)]
        assert alone.tolist() == [k == n for k in range(w)]
        assert of_first == (0 if n > 0 else -1)
        assert of_alone == (n if 0 <= n < w else -1)
        assert of_both == (n if 0 <= n < min(w, 3) else -1)


@jit
def first_below(a, limit, out):
    w = width(a)
    for i in range(0, a.size, w):
        out[i // w] = first_true(load(a, i) < limit)


@both_ways
@dtypes
@pytest.mark.without_jit
def test_first_true_is_the_first_of_several(dtype, way):
    a, w = numbers(dtype), lanes(way, dtype)
    out = np.zeros(N // w, np.int64)
    call(way, first_below, a, a.dtype.type(-0.5), out)
    below = (a < -0.5).reshape(-1, w)
    assert (out == np.where(below.any(axis=1), below.argmax(axis=1), -1)).all()


@jit
def listing(a, first, last, limit, entries, ends):
    k = 3
    w = width(a)
    for j in range(first, last, w):
        x = load(a, j)
        k = append(entries, k, j, (x < limit) & first_lanes(x, last - j))
        ends[(j - first) // w] = k
    return k


@both_ways
@dtypes
@pytest.mark.without_jit
@pytest.mark.parametrize("limit", [-9.0, -0.5, 0.0, 1.0, 9.0])
@pytest.mark.parametrize(("first", "last"), [(0, N), (1, N - 5), (7, 8), (3, 3)])
def test_append_lists_the_lanes_of_a_mask_in_order(first, last, limit, dtype, way):
    a, w = np.append(numbers(dtype), np.zeros(MOST_LANES, dtype)), lanes(way, dtype)
    entries, ends = np.full(N + 3 + MOST_LANES, -1, np.int32), np.zeros(N, np.int64)
    k = call(way, listing, a, first, last, a.dtype.type(limit), entries, ends)
    expected = first + np.flatnonzero(a[first:last] < limit)
    assert entries[:3].tolist() == [-1] * 3
    assert entries[3:k].tolist() == expected.tolist()
    # and what it may use behind the end, but no more
    assert (entries[k + w :] == -1).all()
    blocks = range(first, last, w)
    counts = [(expected < min(j + w, last)).sum() for j in blocks]
    assert ends[: len(blocks)].tolist() == [3 + count for count in counts]


@jit
def entries_and_extremes(a, indices, out, low, high):
    w = width(a)
    for i in range(0, a.size, w):
        low[i // w], high[i // w] = lowest(load(a, i)), highest(load(a, i))
    for k in range(indices.size):
        out[k] = entry(indices, k)


@both_ways
@dtypes
@pytest.mark.parametrize("integers", ["int32", "int64"])
@pytest.mark.without_jit
def test_entries_and_extremes(integers, dtype, way):
    a, w = numbers(dtype), lanes(way, dtype)
    indices = np.array([3, 0, -5, 2**31 - 1], integers)
    out, low, high = np.zeros(4, np.int64), np.zeros(N // w, dtype), np.zeros(N // w, dtype)
    call(way, entries_and_extremes, a, indices, out, low, high)
    assert (out == indices).all()
    assert (low == a.reshape(-1, w).min(axis=1)).all()
    assert (high == a.reshape(-1, w).max(axis=1)).all()


# --- Threads and records --------------------------------------------------------------------


@jit
def counters(array):
    before = atomic_add(array, 1, 5)
    after = atomic_add(array, 1, -2)
    give_way()
    return before, after, atomic_load(array, 1)


@both_ways
@pytest.mark.without_jit
def test_an_atomic_sum_gives_what_was_there_before(way):
    array = np.array([1, 10, 100])
    assert call(way, counters, array) == (10, 15, 13)
    assert array.tolist() == [1, 13, 100]


@jit
def write_record(record, value):
    pack(record, value)


@jit
def read_record(records, i, shape):
    return unpack(records, i, shape)[0], unpack(records, i, shape)[1][0][2]


@not_compiled
def test_a_record_gives_back_what_was_packed():
    values = [(k + 0.5, (np.arange(3.0) + k, None, k)) for k in range(4)]
    records = np.zeros((4, record_size(values[0])), np.uint8)
    for record, value in zip(records, values, strict=True):
        write_record(record, value)
    for k in range(4):
        assert read_record(records, k, Shape(values[0])) == (k + 0.5, k + 2.0)


# --- The target -----------------------------------------------------------------------------


def fresh_target():
    """What target.py finds out when it is read now."""
    return runpy.run_path(target.__file__)


@pytest.mark.without_jit
@pytest.mark.parametrize("text", ["0", "3", "32", "-1", "two", "2.0", " 2"])
def test_an_impossible_number_of_lanes_is_named(text, monkeypatch):
    monkeypatch.setenv("SPH_GYM_LANES", text)
    with pytest.raises(ValueError, match="SPH_GYM_LANES"):
        fresh_target()


@not_compiled
@dtypes
@pytest.mark.parametrize("n", WIDTHS)
def test_the_number_of_lanes_can_be_chosen(n, dtype, monkeypatch):
    monkeypatch.setenv("SPH_GYM_LANES", str(n))
    assert fresh_target()["n_lanes"](dtype) == n


@not_compiled
@pytest.mark.parametrize(
    ("features", "avx", "in_float64", "in_float32"),
    [
        ("+sse2", 1, 2, 4),
        ("+neon", 1, 2, 4),
        ("+avx,+avx2,-avx512f", 1, 4, 8),
        ("+avx2,+avx512f", 1, 4, 8),
        ("+avx2,+avx512f,+avx512vl", 1, 8, 16),
        ("+sse2,+avx2,+avx512f,+avx512vl", 0, 2, 4),
    ],
)
def test_the_lanes_fill_the_vectors_of_the_processor(
    features, avx, in_float64, in_float32, monkeypatch
):
    monkeypatch.delenv("SPH_GYM_LANES", raising=False)
    monkeypatch.setattr(numba.config, "CPU_FEATURES", features)
    monkeypatch.setattr(numba.config, "ENABLE_AVX", avx)
    n_lanes = fresh_target()["n_lanes"]
    assert (n_lanes("float64"), n_lanes("float32")) == (in_float64, in_float32)


@pytest.mark.without_jit
def test_one_lane_where_nothing_is_compiled(monkeypatch):
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 1)
    assert [fresh_target()["n_lanes"](dtype) for dtype in DTYPES] == [1, 1]


# --- Other processors -----------------------------------------------------------------------


@pytest.mark.slow
@every_path
def test_all_that_is_here_on_every_path(path, tmp_path):
    run_tests(path, tmp_path, __file__, "-k", "compiled or record")
