"""Energy tracking: the article's compression and release in small quanta of impulse, with Stronge's e^2 = W_release / W_compression.

The contact that approaches fastest is slowed down by a quantum of velocity, all that tie with it together, until none approaches; the work
that the normal impulses take up is kept, contact by contact. Its share e^2 is then given back, the contact with most left first. The pair
of phases is repeated until nothing approaches any more.
"""

from __future__ import annotations

import math

import numpy as np

from dem_cli.engines.impulse.pgs import aim_of, is_small
from dem_cli.engines.impulse.rows import (
    FRICTION,
    INVERSE,
    MATRIX,
    NORMAL,
    RESTITUTION,
    STIFF,
    push,
    relative,
    symmetric,
    vector,
)
from dem_cli.engines.impulse.symmetric import symmetric_times
from dem_cli.engines.impulse.vectors import along, dot, times
from dem_cli.jit import kernel

TIE = 1e-6  # contacts this close to the extreme, as a share of the extreme at the start of the phase, are treated together
LEFT = 1e-8  # share of the largest work below which nothing is left to be released
ROUNDING = 1e-13  # share of the fastest approach below which speeds are rounding
PAIRS = 50  # compressions with release at most
GUARD = 0.05  # least n.K.(n + mu t) over n.K.n: below, sliding feeds the approach (Painleve)


@kernel(inline=True, inner=True)
def quantum(row, u, gain):
    """The impulse [N s] that changes u.n by `gain` [m/s], and stops the slip u_t where friction suffices: J = K^-1 (gain n - u_t), if that
    lies in the friction cone. Else J = J_n n + J_t t with J_t = mu J_n, J_n = gain / n.K.(n + mu t), up to the end of the slip.

    t is against the slip that there would be after this quantum without friction, not against the slip before it as in the article: bodies
    that land flat have no slip but rounding, whose direction would turn them.
    """
    n, mu = vector(row, NORMAL), row[FRICTION]
    if mu <= 0.0:
        return times(n, gain / row[STIFF])
    slip = along(u, n, -dot(u, n))
    still = symmetric_times(symmetric(row, INVERSE), along(times(n, gain), slip, -1.0))
    pressing = dot(still, n)
    if pressing > 0.0 and dot(still, still) - pressing * pressing <= mu * mu * pressing * pressing:
        return still
    k = symmetric(row, MATRIX)
    moved = along(slip, symmetric_times(k, n), gain / row[STIFF])
    coming = along(moved, n, -dot(moved, n))
    speed = math.sqrt(dot(coming, coming))
    if speed <= 1e-12 * gain:
        return times(n, gain / row[STIFF])
    t = times(coming, -1.0 / speed)
    kt = symmetric_times(k, t)
    coupling = dot(n, kt)
    divisor = row[STIFF] + mu * coupling
    pressing = gain / (divisor if divisor >= GUARD * row[STIFF] else row[STIFF])
    across = min(mu * pressing, max(0.0, -(dot(slip, t) + pressing * coupling) / dot(t, kt)))
    return along(times(n, pressing), t, across)


@kernel()
def link_contacts(i, j, bodies):
    """Contacts of each body as chains: head (bodies + 1,) and following (2 c,); entry 2 c is contact c at body i, 2 c + 1 at j; -1 ends a chain.

    What never moves, number `bodies`, has none.
    """
    head, following = np.full(bodies + 1, -1), np.full(2 * len(i), -1)
    for c in range(len(i) - 1, -1, -1):
        following[2 * c], head[i[c]] = head[i[c]], 2 * c
        if j[c] < bodies:
            following[2 * c + 1], head[j[c]] = head[j[c]], 2 * c + 1
    return head, following


@kernel(inline=True, inner=True)
def look_again(body, i, j, rows, velocity, head, following, speed):
    """Refreshes speed = u.n of the contacts of one body."""
    entry = head[body]
    while entry >= 0:
        c = entry // 2
        speed[c] = dot(relative(rows[c], velocity[i[c]], velocity[j[c]]), vector(rows[c], NORMAL))
        entry = following[entry]


@kernel(inner=True)
def apply_quanta(
    first, last, chosen, i, j, rows, velocity, inverse, head, following, speed, gain, quanta, impulse, work
):
    """One quantum for each contact that is `chosen`, all from the same velocities; speed, impulse, velocity and work follow.

    The work of the normal impulse, -(v_n before + v_n after)/2 J_n with all quanta applied, is added to `work`.
    """
    for c in range(first, last):
        if chosen[c]:
            one = quantum(rows[c], relative(rows[c], velocity[i[c]], velocity[j[c]]), gain[c])
            for axis in range(3):
                quanta[c, axis] = one[axis]
            gain[c] = speed[c]
    for c in range(first, last):
        if chosen[c]:
            one = vector(quanta[c], 0)
            push(rows[c], one, velocity[i[c]], velocity[j[c]], inverse[i[c]], inverse[j[c]])
            for axis in range(3):
                impulse[c, axis] += one[axis]
    for c in range(first, last):
        if chosen[c]:
            look_again(i[c], i, j, rows, velocity, head, following, speed)
            look_again(j[c], i, j, rows, velocity, head, following, speed)
    for c in range(first, last):
        if chosen[c]:
            work[c] -= 0.5 * (gain[c] + speed[c]) * dot(vector(quanta[c], 0), vector(rows[c], NORMAL))


@kernel(inner=True)
def choose(first, last, values, least, slack, chosen):
    """Marks the contacts whose value lies within `slack` of the largest and above `least`; returns their number."""
    largest = least
    for c in range(first, last):
        largest = max(largest, values[c])
    number = 0
    for c in range(first, last):
        chosen[c] = values[c] > least and values[c] >= largest - slack
        number += chosen[c]
    return number


@kernel(inner=True)
def track_energy(first, last, i, j, rows, velocity, inverse, impulse, head, following, quanta, tolerance, most):
    """Solves the impact of the contacts first..last - 1 of an island; returns iterations and the fastest approach left [m/s].

    quanta: steps into which a compression, and a release, is divided (the article's alpha_0). Ends once no contact approaches faster than
    `tolerance` [m/s], or after `most` iterations. impulse (c, 3) [N s] and velocity (n + 1, 6) are changed in place.
    """
    contacts = len(i)
    speed, work, gain, bound = np.zeros(contacts), np.zeros(contacts), np.zeros(contacts), np.zeros(contacts)
    approach, chosen, parts = np.zeros(contacts), np.zeros(contacts, np.bool_), np.zeros((contacts, 3))
    for c in range(first, last):
        speed[c] = dot(relative(rows[c], velocity[i[c]], velocity[j[c]]), vector(rows[c], NORMAL))
    iterations, aim = 0, aim_of(is_small(first, last, i, j, len(velocity) - 1), tolerance)
    for _ in range(PAIRS):
        start = 0.0
        for c in range(first, last):
            start = max(start, -speed[c])
            work[c] = 0.0
        aim = max(aim, ROUNDING * start)
        if start <= aim:
            break
        while iterations < most:
            for c in range(first, last):
                approach[c] = -speed[c]
            number = choose(first, last, approach, aim, TIE * start, chosen)
            if number == 0:
                break
            for c in range(first, last):
                whole = approach[c] <= 4.0 * aim
                gain[c] = (approach[c] if whole else min(approach[c], start / quanta)) / number
            apply_quanta(first, last, chosen, i, j, rows, velocity, inverse, head, following, speed, gain, parts, impulse, work)  # fmt: skip
            iterations += 1
        stored = 0.0
        for c in range(first, last):
            work[c] = max(0.0, work[c]) * rows[c, RESTITUTION] ** 2
            bound[c] = math.sqrt(speed[c] ** 2 + 2.0 * work[c] * rows[c, STIFF]) - speed[c]
            stored = max(stored, work[c])
        while iterations < most and stored > 0.0:
            number = choose(first, last, work, LEFT * stored, TIE * stored, chosen)
            if number == 0:
                break
            for c in range(first, last):
                if chosen[c]:
                    all_of_it = math.sqrt(speed[c] ** 2 + 2.0 * work[c] * rows[c, STIFF]) - speed[c]
                    gain[c] = min(all_of_it, bound[c] / quanta) / number
            apply_quanta(first, last, chosen, i, j, rows, velocity, inverse, head, following, speed, gain, parts, impulse, work)  # fmt: skip
            iterations += 1
        if iterations >= most:
            break
    left = 0.0
    for c in range(first, last):
        left = max(left, -speed[c])
    return iterations, left
