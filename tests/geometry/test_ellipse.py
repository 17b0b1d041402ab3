"""Gaps of ellipses with each other and with walls, against a search over all directions and against sampled outlines."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from dem_cli.geometry.ellipse import gap_slopes, outline, support, wall_gap, widest_gap

some = settings(max_examples=200, deadline=None)
angles = st.floats(0.0, 2.0 * math.pi)
ratios = st.one_of(st.just(1.0), st.just(5.0), st.floats(1.0, 5.0))
# (a, b, angle) of one ellipse, b of 0.3 to 3
ellipses = st.builds(lambda b, ratio, angle: (b * ratio, b, angle), st.floats(0.3, 3.0), ratios, angles)
# Over the smaller semi-axis b of the two: max_overlap ends a run at 0.1 of a radius, and b >= r / sqrt(5).
depths = st.one_of(st.just(0.0), st.floats(0.0, 0.2), st.floats(1e-9, 1e-4))
gaps = st.one_of(st.floats(0.0, 3.0), st.floats(1e-9, 1e-4))

Ellipse = tuple[float, float, float]


def reach(ellipse: Ellipse, direction: np.ndarray) -> np.ndarray:
    """How far an ellipse reaches in directions (angles [rad]): the definition, by its own axes."""
    a, b, angle = ellipse
    return np.sqrt((a * np.cos(direction - angle)) ** 2 + (b * np.sin(direction - angle)) ** 2)


def furthest(ellipse: Ellipse, direction: float) -> np.ndarray:
    """The point of an ellipse about the origin that lies furthest in a direction."""
    a, b, angle = ellipse
    c, s = math.cos(direction - angle), math.sin(direction - angle)
    h = math.hypot(a * c, b * s)
    x, y = a * a * c / h, b * b * s / h
    return np.array([x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle)])


def points(ellipse: Ellipse, parameter: np.ndarray) -> np.ndarray:
    """(k, 2): points of the outline about the origin."""
    a, b, angle = ellipse
    x, y = a * np.cos(parameter), b * np.sin(parameter)
    return np.stack([x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle)], axis=1)


def zoomed(function, low: float, high: float) -> tuple[float, float]:
    """Where a function of an array is largest, and its value there: a fine search, repeated about its best."""
    for _ in range(5):
        where = np.linspace(low, high, 2001)
        values = function(where)
        best = int(np.argmax(values))
        step = where[1] - where[0]
        low, high = where[best] - 2.0 * step, where[best] + 2.0 * step
    return float(where[best]), float(values[best])


def widest(one: Ellipse, two: Ellipse, delta: np.ndarray) -> tuple[float, float]:
    """Direction [rad] and size of the largest gap, by a search over all directions."""
    return zoomed(
        lambda n: np.cos(n) * delta[0] + np.sin(n) * delta[1] - reach(one, n) - reach(two, n), 0.0, 2.0 * math.pi
    )


def apart(one: np.ndarray, two: np.ndarray) -> tuple[float, int, int]:
    squares = ((one[:, None, :] - two[None, :, :]) ** 2).sum(axis=2)
    i, j = np.unravel_index(np.argmin(squares), squares.shape)
    return math.sqrt(squares[i, j]), int(i), int(j)


def nearest(one: Ellipse, two: Ellipse, delta: np.ndarray) -> float:
    """Distance of the outline `one` about the origin from `two` about delta, by sampling."""
    s = t = np.linspace(0.0, 2.0 * math.pi, 181)
    for _ in range(16):
        distance, i, j = apart(points(one, s), delta + points(two, t))
        s = np.linspace(s[i] - 10.0 * (s[1] - s[0]), s[i] + 10.0 * (s[1] - s[0]), 61)
        t = np.linspace(t[j] - 10.0 * (t[1] - t[0]), t[j] + 10.0 * (t[1] - t[0]), 61)
    return distance


def nearest_to_segment(ellipse: Ellipse, ends: np.ndarray) -> float:
    """Distance of an outline about the origin from a segment, by sampling the outline."""
    way = ends[1] - ends[0]

    def nearness(s):
        from_first = points(ellipse, s) - ends[0]
        share = np.clip(from_first @ way / (way @ way), 0.0, 1.0)
        return -np.hypot(*(from_first - share[:, None] * way).T)

    return -zoomed(nearness, 0.0, 2.0 * math.pi)[1]


def placed(one: Ellipse, two: Ellipse, normal: float, gap: float) -> np.ndarray:
    """Centre of `two` from that of `one` such that their gap seen along a normal is stationary and `gap`."""
    return furthest(one, normal) + furthest(two, normal) + gap * np.array([math.cos(normal), math.sin(normal)])


def found(
    one: Ellipse, two: Ellipse, delta: np.ndarray, start: tuple[float, float] = (0.0, 0.0)
) -> tuple[np.ndarray, float]:
    nx, ny, gap = widest_gap(delta[0], delta[1], *outline(*one), *outline(*two), *start)
    return np.array([nx, ny]), gap


def size(one: Ellipse, two: Ellipse = (0.0, 0.0, 0.0)) -> float:
    return one[0] + two[0]


@some
@given(ellipses, angles)
def test_support(ellipse, direction):
    h, h1, h2 = support(*outline(*ellipse), math.cos(direction), math.sin(direction))
    point = furthest(ellipse, direction)
    n = np.array([math.cos(direction), math.sin(direction)])
    assert h == pytest.approx(reach(ellipse, np.array(direction)), rel=1e-14)
    np.testing.assert_allclose(h * n + h1 * np.array([-n[1], n[0]]), point, rtol=0, atol=1e-13 * ellipse[0])
    # h + h'' is the radius of curvature a^2 b^2 / h^3 of the outline there.
    assert h + h2 == pytest.approx((ellipse[0] * ellipse[1]) ** 2 / h**3, rel=1e-11)


@some
@given(ellipses, ellipses, angles, angles, st.floats(0.0, 20.0))
def test_slopes(one, two, at, place, distance):
    def gap(n):
        return gap_slopes(
            distance * math.cos(place), distance * math.sin(place), *outline(*one), *outline(*two),
            math.cos(n), math.sin(n),
        )  # fmt: skip

    step = 1e-4
    (low, low1, _), (middle, slope, bend), (high, high1, _) = (gap(at + k * step) for k in (-1, 0, 1))
    scale = size(one, two) + distance
    assert slope == pytest.approx((high - low) / (2.0 * step), abs=1e-5 * scale)
    assert bend == pytest.approx((high1 - low1) / (2.0 * step), abs=1e-4 * scale)
    assert np.isfinite(middle)


@some
@given(ellipses, ellipses, angles, st.one_of(gaps, depths.map(lambda depth: -depth)))
def test_gap_of_a_pair(one, two, normal, gap):
    """The largest over all directions, and the two contact points lie on one normal: p_i + gap n = p_j."""
    gap *= min(one[1], two[1])
    delta = placed(one, two, normal, gap)
    n, seen = found(one, two, delta)
    direction, wanted = widest(one, two, delta)
    scale = size(one, two)
    assert math.hypot(*n) == pytest.approx(1.0, abs=1e-14)
    assert seen == pytest.approx(wanted, abs=1e-13 * scale)
    angle = math.atan2(n[1], n[0])
    np.testing.assert_allclose(
        furthest(one, angle) + seen * n, delta + furthest(two, angle + math.pi), rtol=0, atol=1e-11 * scale
    )
    if gap > 1e-6:  # one normal only
        assert seen == pytest.approx(gap, abs=1e-13 * scale)
        np.testing.assert_allclose(n, [math.cos(normal), math.sin(normal)], rtol=0, atol=1e-12 * scale / one[1])
        assert math.cos(direction - angle) == pytest.approx(1.0, abs=1e-12)


@settings(max_examples=40, deadline=None)
@given(ellipses, ellipses, angles, st.floats(0.01, 3.0))
def test_gap_is_the_distance_of_the_outlines(one, two, normal, gap):
    delta = placed(one, two, normal, gap)
    assert found(one, two, delta)[1] == pytest.approx(nearest(one, two, delta), abs=1e-7 * size(one, two))


@some
@given(ellipses, ellipses, angles, depths, st.floats(0.0, 2.0))
def test_pulled_apart_along_the_normal(one, two, normal, depth, way):
    """The overlap is how far the two must be moved apart, in the best direction, until they touch."""
    delta = placed(one, two, normal, -depth * min(one[1], two[1]))
    n, gap = found(one, two, delta)
    n2, gap2 = found(one, two, delta + (way - gap) * n)
    assert gap2 == pytest.approx(way, abs=1e-13 * size(one, two))
    if way > 1e-3:
        np.testing.assert_allclose(n2, n, rtol=0, atol=1e-9)


@some
@given(ellipses, ellipses, angles, st.one_of(gaps, depths.map(lambda depth: -depth)))
def test_the_other_way_round(one, two, normal, gap):
    delta = placed(one, two, normal, gap * min(one[1], two[1]))
    n, seen = found(one, two, delta)
    back, same = found(two, one, -delta)
    assert same == pytest.approx(seen, abs=1e-14 * size(one, two))
    if gap > -0.02:
        np.testing.assert_allclose(back, -n, rtol=0, atol=1e-10)


@some
@example((5.0, 1.0, 0.0), (5.0, 1.0, 0.5), 1.5, 1e-3, 5.5)  # a false maximum lies near
@given(ellipses, ellipses, angles, st.one_of(gaps, depths.map(lambda depth: -depth)), angles)
def test_any_start(one, two, normal, gap, start):
    """A direction to begin with, however wrong, changes nothing; where they overlap it must lie within 90 degrees."""
    delta = placed(one, two, normal, gap * min(one[1], two[1]))
    n, seen = found(one, two, delta)
    if seen <= 0.0:
        start = normal + 0.25 * (start - math.pi)
    n2, seen2 = found(one, two, delta, (math.cos(start), math.sin(start)))
    assert seen2 == pytest.approx(seen, abs=1e-13 * size(one, two))
    np.testing.assert_allclose(n2, n, rtol=0, atol=1e-10)


@some
@given(ellipses, ellipses, angles, depths, st.integers(0, 500))
def test_false_maxima_are_far_off(one, two, normal, depth, start):
    """Why a start within 90 degrees is right, and why one that turns by more than a little is not trusted among overlapping outlines."""
    delta = placed(one, two, normal, -depth * min(one[1], two[1]))
    n, seen = found(one, two, delta)
    start = 2.0 * math.pi * start / 500
    n2, seen2 = found(one, two, delta, (math.cos(start), math.sin(start)))
    if abs(seen2 - seen) > 1e-12 * size(one, two):
        assert n2 @ n < 0.1
        assert math.cos(start - math.atan2(n2[1], n2[0])) > math.cos(0.011)
    else:
        assert seen2 == pytest.approx(seen, abs=1e-12 * size(one, two))


@some
@given(st.floats(0.1, 5.0), st.floats(0.1, 5.0), angles, angles, angles, st.floats(1e-3, 20.0))
def test_equal_axes_are_a_disc(r1, r2, turn1, turn2, place, distance):
    delta = distance * np.array([math.cos(place), math.sin(place)])
    n, gap = found((r1, r1, turn1), (r2, r2, turn2), delta)
    assert gap == pytest.approx(distance - r1 - r2, abs=1e-13 * (r1 + r2 + distance))
    np.testing.assert_allclose(n, delta / distance, rtol=0, atol=1e-12)


@some
@given(ellipses, angles, st.floats(0.0, 3.0))
def test_gap_to_a_point(ellipse, normal, gap):
    delta = furthest(ellipse, normal) + gap * np.array([math.cos(normal), math.sin(normal)])
    nx, ny, seen = widest_gap(delta[0], delta[1], *outline(*ellipse), 0.0, 0.0, 0.0, 0.0, 0.0)
    assert seen == pytest.approx(gap, abs=1e-13 * (ellipse[0] + gap))
    np.testing.assert_allclose([nx, ny], [math.cos(normal), math.sin(normal)], rtol=0, atol=1e-12 * (1.0 + ellipse[0]))


# -- walls -------------------------------------------------------------------------------------------------------------


def widest_to_wall(ellipse: Ellipse, ends: np.ndarray) -> float:
    """Largest gap between an ellipse about the origin and a segment: the nearer end counts in each direction."""

    def gap(n):
        along = np.cos(n)[:, None] * ends[:, 0] + np.sin(n)[:, None] * ends[:, 1]
        return along.min(axis=1) - reach(ellipse, n)

    return zoomed(gap, 0.0, 2.0 * math.pi)[1]


def to_wall(ellipse: Ellipse, ends: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, float]:
    nx, ny, gap = wall_gap(place[0], place[1], *outline(*ellipse), *(ends + place).ravel())
    return np.array([nx, ny]), gap


walls_of = st.tuples(st.floats(0.2, 2.0), st.floats(0.2, 50.0), st.booleans(), st.booleans())


def wall_at(ellipse: Ellipse, normal: float, gap: float, before: float, after: float) -> np.ndarray:
    """A wall that faces the ellipse: from `before` to `after` the point nearest to it, in semi-axes a; ends (2, 2) seen from the centre."""
    n = np.array([math.cos(normal), math.sin(normal)])
    t = np.array([-n[1], n[0]])
    point = furthest(ellipse, normal) + gap * n
    return np.stack([point - before * ellipse[0] * t, point + after * ellipse[0] * t])


@some
@given(ellipses, angles, st.one_of(gaps, depths.map(lambda depth: -depth)), walls_of, angles)
def test_face_of_a_wall(ellipse, normal, gap, wall, place):
    before, after, turned, _ = wall
    gap *= ellipse[1]
    ends = wall_at(ellipse, normal, gap, before, after)[:: -1 if turned else 1]
    n, seen = to_wall(ellipse, ends, 7.0 * np.array([math.cos(place), math.sin(place)]))
    scale = ellipse[0] * (before + after) + 7.0
    assert seen == pytest.approx(gap, abs=1e-14 * scale)
    np.testing.assert_allclose(
        n, [math.cos(normal), math.sin(normal)], rtol=0, atol=1e-13 * scale / min(ellipse[0], 1.0)
    )
    assert seen == pytest.approx(widest_to_wall(ellipse, ends), abs=1e-12 * scale)


@some
@example(
    (5.0, 1.0, 6.0), 1.5, 0.0, 1.0, (1.0, 1.0, False, False)
)  # beyond the wall's line the outline lies beside the wall
@example((5.0, 1.0, 6.0), 1.5, -0.01, 1.0, (1.0, 1.0, True, False))
@example((5.0, 1.0, 0.5), 4.7, 0.3, 1.5, (1.0, 20.0, False, False))  # nearly along the wall, the centre beside it
@example((5.0, 1.0, 0.5), 4.7, 0.3, -1.5, (1.0, 20.0, False, False))
@example((5.0, 1.0, -0.5), 4.7, 0.3, 1.5, (1.0, 20.0, True, False))
@given(ellipses, angles, st.one_of(gaps, depths.map(lambda depth: -depth)), st.floats(-1.5, 1.5), walls_of)
def test_end_of_a_wall(ellipse, normal, gap, lean, wall):
    """A wall whose end is what is nearest: it leads away from a point in front of the ellipse at some slant."""
    _, length, turned, _ = wall
    gap *= ellipse[1]
    n = np.array([math.cos(normal), math.sin(normal)])
    end = furthest(ellipse, normal) + gap * n
    away = np.array([math.cos(normal + lean), math.sin(normal + lean)])
    ends = np.stack([end, end + length * away])[:: -1 if turned else 1]
    _, wanted = widest(ellipse, (0.0, 0.0, 0.0), end)
    assume(wanted < gap + 1e-9)  # else the point lies so deep that another side is nearer
    seen_n, seen = to_wall(ellipse, ends, np.zeros(2))
    scale = ellipse[0] + length
    assert seen == pytest.approx(widest_to_wall(ellipse, ends), abs=1e-12 * scale)
    assert seen == pytest.approx(gap, abs=1e-12 * scale)
    if gap > -0.02 * ellipse[1]:
        np.testing.assert_allclose(seen_n, n, rtol=0, atol=1e-11 * scale)


@settings(max_examples=40, deadline=None)
@given(ellipses, angles, st.floats(0.01, 3.0), angles, st.floats(0.2, 5.0))
def test_gap_is_the_distance_from_the_wall(ellipse, normal, gap, lean, length):
    first = furthest(ellipse, normal) + gap * np.array([math.cos(normal), math.sin(normal)])
    segment = np.stack([first, first + length * np.array([math.cos(lean), math.sin(lean)])])
    distance = nearest_to_segment(ellipse, segment)
    a, b, angle = ellipse
    x, y = (segment[0] + np.linspace(0.0, 1.0, 721)[:, None] * (segment[1] - segment[0])).T
    c, sine = math.cos(angle), math.sin(angle)
    inside = ((x * c + y * sine) / a) ** 2 + ((y * c - x * sine) / b) ** 2 <= 1.01
    assume(not inside.any() and distance > 0.01)
    assert to_wall(ellipse, segment, np.zeros(2))[1] == pytest.approx(distance, abs=1e-7 * (ellipse[0] + length))


@some
@example((5.0, 1.0, 0.3), 0.1, 1e-3, True)
@given(ellipses, angles, depths, st.booleans())
def test_continuous_from_face_to_end(ellipse, normal, depth, turned):
    """As the wall is drawn away along itself, face and end take over from each other without a jump of gap or normal."""
    step = 1e-9 * ellipse[0]
    seen = []
    for shift in (-step, step):
        ends = wall_at(ellipse, normal, -depth * ellipse[1], 0.0, 3.0)
        along = (ends[1] - ends[0]) / np.hypot(*(ends[1] - ends[0]))
        seen.append(to_wall(ellipse, (ends + shift * along)[:: -1 if turned else 1], np.zeros(2)))
    (n1, gap1), (n2, gap2) = seen
    assert gap2 == pytest.approx(gap1, abs=1e-14 * ellipse[0] * 20.0)
    np.testing.assert_allclose(n2, n1, rtol=0, atol=1e-6)


def test_turned_through_all_angles():
    """Gap and normal of two turning ellipses change no faster than they can: no jump from one maximum to another at shallow depth."""
    a, b = 5.0, 1.0
    turns = np.linspace(0.0, 2.0 * math.pi, 4001)
    rise = turns[1] * a
    last = None
    for turn in turns:
        _, gap = found((a, b, turn), (a, b, 2.0 * turn + 0.3), np.array([5.0, 0.5]))
        assert last is None or abs(gap - last) < 3.1 * rise
        last = gap
