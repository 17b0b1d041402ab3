"""Four numbers at once: arithmetic, choice, memory and the scatter of forces, each against plain numpy."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dem_cli.geometry import lanes
from dem_cli.geometry.lanes import first_half_last, last_half_first, maximum, minimum, pack, root, spread, unpack, where
from dem_cli.geometry.rows import gather_difference, gather_sum, load, scatter_action, store
from dem_cli.jit import kernel

WIDTH = lanes.WIDTH


@kernel()
def arithmetic(x, y, c, out):
    """Operators on lanes x and y and the float c, one row of out (12, 4) flat each."""
    a, b = load(x, 0), load(y, 0)
    results = (
        a + b, a - b, a * b, a / b, -a, a + c, c - a, c * b, a / c, c / b, maximum(a, b), minimum(a, b),
    )  # fmt: skip
    for k in range(12):
        store(out, 4 * k, results[k])


@kernel()
def choices(x, y, c, out):
    """Comparisons and choices, one row of out (6, 4) flat each."""
    a, b = load(x, 0), load(y, 0)
    store(out, 0, where(a > b, a, b))
    store(out, 4, where(a < b, a, c))
    store(out, 8, where(a > c, 0.0, b))
    store(out, 12, maximum(a, c))
    store(out, 16, minimum(c, a))
    store(out, 20, where(c < a, spread(1.0), 0.0))


@kernel()
def roots(x, out):
    """Square roots of lanes, and of a float."""
    store(out, 0, root(load(x, 0)))
    return root(x[0])


@kernel()
def scalar_choices(x, y):
    """The same functions on floats."""
    return maximum(x, y), minimum(x, y), where(x > y, x, y), root(x * x)


@kernel()
def memory(x, k, out):
    """Loads from any place, packing, halves."""
    a = load(x, k)
    store(out, 0, a)
    store(out, 4, first_half_last(a))
    store(out, 8, last_half_first(a))
    p, q, r, s = unpack(a)
    store(out, 12, pack(s, r, q, p))
    store(out, 16, spread(q))


@kernel()
def gather(rows, first, second, k, column, out):
    """Four columns of differences and two of sums, one row of out (6, 4) flat each."""
    d = gather_difference(rows, first, second, k, column)
    for m in range(4):
        store(out, 4 * m, d[m])
    s = gather_sum(rows, first, second, k, column)
    for m in range(2):
        store(out, 16 + 4 * m, s[m])


@kernel()
def scatter(rows, first, second, k, column, x, y, turn):
    """Action and reaction of four pairs."""
    scatter_action(rows, first, second, k, column, load(x, 0), load(y, 0), load(turn, 0))


numbers = st.floats(-1e6, 1e6).filter(lambda v: v == 0.0 or abs(v) > 1e-6)
some = settings(max_examples=100, deadline=None)
fours = arrays(np.float64, WIDTH, elements=numbers)


@some
@given(fours, fours, numbers)
def test_arithmetic(x, y, c):
    out = np.empty((12, WIDTH))
    with np.errstate(all="ignore"):
        wanted = [x + y, x - y, x * y, x / y, -x, x + c, c - x, c * y, x / c, c / y, np.maximum(x, y), np.minimum(x, y)]
        arithmetic(x, y, c, out.reshape(-1))
    np.testing.assert_array_equal(out, wanted)


@some
@given(fours, fours, numbers)
def test_choices(x, y, c):
    out = np.empty((6, WIDTH))
    choices(x, y, c, out.reshape(-1))
    wanted = [
        np.where(x > y, x, y), np.where(x < y, x, c), np.where(x > c, 0.0, y), np.maximum(x, c), np.minimum(c, x),
        np.where(c < x, 1.0, 0.0),
    ]  # fmt: skip
    np.testing.assert_array_equal(out, wanted)


@some
@given(numbers, numbers)
def test_scalars(x, y):
    assert scalar_choices(x, y) == (max(x, y), min(x, y), max(x, y), abs(x))


@some
@given(arrays(np.float64, WIDTH, elements=st.floats(0.0, 1e12)))
def test_root(x):
    out = np.empty(WIDTH)
    assert roots(x, out) == np.sqrt(x[0])
    np.testing.assert_array_equal(out, np.sqrt(x))


def test_nan():
    # `maximum` and `minimum` give the second one where either is NaN; comparisons with NaN are false.
    nan = np.nan
    x, y = np.array([nan, 1.0, nan, 1.0]), np.array([2.0, nan, nan, 3.0])
    out = np.empty((12, WIDTH))
    arithmetic(x, y, 1.0, out.reshape(-1))
    np.testing.assert_array_equal(out[10], [2.0, nan, nan, 3.0])
    np.testing.assert_array_equal(out[11], [2.0, nan, nan, 1.0])
    np.testing.assert_array_equal(out[0], [nan, nan, nan, 4.0])
    chosen = np.empty((6, WIDTH))
    choices(x, y, 5.0, chosen.reshape(-1))
    np.testing.assert_array_equal(chosen[0], [2.0, nan, nan, 3.0])


def test_memory():
    x = np.arange(11.0)
    for k in range(8):
        out = np.empty((5, WIDTH))
        memory(x, k, out.reshape(-1))
        a = x[k : k + 4]
        np.testing.assert_array_equal(out, [a, [0, 0, *a[:2]], [*a[2:], 0, 0], a[::-1], [a[1]] * 4])


@some
@given(
    arrays(np.float64, (6, 12), elements=numbers), st.lists(st.tuples(*[st.integers(0, 5)] * 2), min_size=7, max_size=7)
)
def test_gather(rows, pairs):
    first, second = (np.array(side, dtype=np.int32) * 12 for side in zip(*pairs, strict=True))
    for k in (0, 3):
        for column in (0, 4, 8):
            out = np.empty((6, WIDTH))
            gather(rows.reshape(-1), first, second, k, column, out.reshape(-1))
            one, two = (rows.reshape(-1)[side[k : k + 4, None] + column + np.arange(4)] for side in (first, second))
            np.testing.assert_array_equal(out[:4], (two - one).T)
            np.testing.assert_array_equal(out[4:], (two + one).T[:2])


@some
@given(
    arrays(np.float64, (5, 12), elements=numbers),
    st.lists(st.tuples(*[st.integers(0, 4)] * 2).filter(lambda p: p[0] != p[1]), min_size=4, max_size=4),
    fours, fours, fours,
)  # fmt: skip
def test_scatter(rows, pairs, x, y, turn):
    # One pair after the other, also where grains occur in several of the four: none may be lost.
    first, second = (np.array(side, dtype=np.int32) * 12 for side in zip(*pairs, strict=True))
    wanted = rows.copy()
    for m, (i, j) in enumerate(pairs):
        wanted[i, 8:] += [-x[m], -y[m], 0.0, turn[m]]
        wanted[j, 8:] += [x[m], y[m], 0.0, turn[m]]
    found = rows.copy()
    scatter(found.reshape(-1), first, second, 0, 8, x, y, turn)
    np.testing.assert_array_equal(found, wanted)
