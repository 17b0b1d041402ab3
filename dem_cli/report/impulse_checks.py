"""Runs beside closed forms: a body dropped on a plane, one on a slope, two that collide, a row of which the first one comes.

`[output] check` names the closed form. All of them are those of the article on impulse-based DEM, for any masses and coefficients.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from dem_cli.report.impulse_histories import History, depth_along, histories
from dem_cli.results import BodyResults
from dem_cli.state import Floats

CHECKS = ("drop", "slope", "collision", "row")
MOST_BOUNCES = 8
MOST_BODIES = 8
SLOPE_TIMES = 5


@dataclass(frozen=True)
class Check:
    """One table. columns: key of a row -> (header, SI unit); rows: a value for each column, NaN where there is none."""

    kind: str
    title: str
    columns: dict[str, tuple[str, str]]
    rows: tuple[dict[str, float], ...]
    notes: tuple[str, ...] = field(default=())


def check_of(results: BodyResults) -> str:
    """The closed form that the scenario asks for, "" if none."""
    found = str(results.scenario.get("output", {}).get("check", ""))
    return found if found in CHECKS else ""


def checks(results: BodyResults) -> tuple[Check, ...]:
    """The tables of the check that the scenario asks for; one with a note in place of rows where the file does not hold what it needs."""
    kind = check_of(results)
    if not kind or results.n_frames == 0:
        return ()
    make = {"drop": drop_check, "slope": slope_check, "collision": collision_check, "row": row_check}[kind]
    return make(results)


def time_step(results: BodyResults) -> float:
    """Median of the time steps in use [s], NaN if there is none."""
    steps = results.series["time_step"]
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if len(steps) else math.nan


def pair_value(results: BodyResults, table: Floats, body: int, other: int) -> float:
    """Entry of a table over materials for a body and another one, or for a plane: other = -1 - w."""
    material = results.scene.bodies.material
    second = material[other] if other >= 0 else results.planes.material[-1 - other]
    return float(table[material[body], second])


# ------------------------------------------------------------------------------------------------ drop


@dataclass(frozen=True)
class Bounces:
    """Closed form of a body that starts `gap` [m] over a plane with velocity `start` [m/s] along its normal; gravity [m/s^2] pulls back."""

    gap: float
    start: float
    gravity: float
    restitution: float

    @property
    def impact(self) -> float:
        """Speed of the first impact."""
        return math.sqrt(self.start**2 + 2.0 * self.gravity * self.gap)

    def time(self, k: int) -> float:
        """Time of bounce k from 1 [s]."""
        flights = sum(2.0 * self.restitution**n * self.impact / self.gravity for n in range(1, k))
        return (self.start + self.impact) / self.gravity + flights

    def rebound(self, k: int) -> float:
        """Speed after bounce k from 1 [m/s]."""
        return self.restitution**k * self.impact

    def velocity(self, time: Floats) -> Floats:
        """Along the normal at times [s] from the start (t,), 0 once the bounces have come to their end."""
        found = self.start - self.gravity * time
        k = 1
        while k < 200 and self.time(k) < time.max(initial=0.0) and self.rebound(k) > 1e-9:
            after = time >= self.time(k)
            found = np.where(after, self.rebound(k) - self.gravity * (time - self.time(k)), found)
            k += 1
        rest = self.time(k) if self.restitution < 1.0 else math.inf
        return np.where(time >= rest, 0.0, found) if self.rebound(k) <= 1e-9 else found


def drop_setting(results: BodyResults, body: int) -> tuple[Bounces, Floats, int]:
    """Closed form of a body over the plane that faces gravity most, the plane's normal, and its number."""
    planes, start = results.planes, results.scene.bodies
    plane = int(np.argmax(planes.normal @ -results.gravity))
    normal = planes.normal[plane]
    below = depth_along(start, results.scene_shapes, normal)[body]
    gap = float((start.x[body] - planes.point[plane]) @ normal - below)
    e = pair_value(results, results.restitution, body, -1 - plane)
    return Bounces(gap, float(start.v[body] @ normal), float(-results.gravity @ normal), e), normal, plane


def bounces_of(history: History, normal: Floats, gravity: float, dt: float) -> list[tuple[float, float, float, float]]:
    """Time [s], speed before and after [m/s], spin after [rad/s] of each bounce in a history; gravity [m/s^2] against the normal.

    Between two instants with a bounce the body flies freely before and behind it, which tells its time exactly. An impact acts
    in the middle of a step on the velocity that the step began with: speeds are those just before and behind it, without that step's gravity.
    """
    t, z, v = history.time, history.x @ normal, history.v @ normal
    found: list[tuple[float, float, float, float]] = []
    for k in range(len(t) - 1):
        span = float(t[k + 1] - t[k])
        jump = float(v[k + 1] - v[k] + gravity * span)
        if v[k] >= 0.0 or jump <= 1e-3 * abs(float(v[k])) or v[k + 1] <= 0.0:
            continue
        after = (z[k + 1] - z[k] - v[k + 1] * span - 0.5 * gravity * span**2) / -jump
        step = max(0.0, round(float(after) / dt - 0.5)) * dt  # start of the step of the impact
        if step > span:
            continue
        before, behind = -float(v[k]) + gravity * step, float(v[k + 1]) + gravity * (span - step)
        found.append(
            (float(t[k]) + step + 0.5 * min(dt, span), before, behind, float(np.linalg.norm(history.w[k + 1])))
        )
    return found


def drop_check(results: BodyResults) -> tuple[Check, ...]:
    columns = {
        "bounce": ("bounce", "1"),
        "time": ("time [s]", "s"),
        "time_closed": ("closed form", "s"),
        "time_error": ("error / dt", "1"),
        "impact": ("impact [m/s]", "m/s"),
        "rebound": ("rebound [m/s]", "m/s"),
        "rebound_closed": ("closed form", "m/s"),
        "rebound_error": ("error", "1"),
        "ratio": ("rebound/impact", "1"),
        "spin": ("spin [rad/s]", "rad/s"),
    }
    title = "Check against the closed form: drop"
    if len(results.planes) == 0:
        return (Check("drop", title, columns, (), ("there is no plane to fall on",)),)
    closed, normal, plane = drop_setting(results, 0)
    history = histories(results, [0]).get(0)
    dt = time_step(results)
    if history is None or not closed.gravity > 0.0 or math.isnan(dt):
        return (Check("drop", title, columns, (), ("the file holds too little of body 0",)),)
    rows = []
    for k, (time, impact, rebound, spin) in enumerate(
        bounces_of(history, normal, closed.gravity, dt)[:MOST_BOUNCES], 1
    ):
        want_time, want = closed.time(k), closed.rebound(k)
        rows.append(
            {
                "bounce": float(k),
                "time": time,
                "time_closed": want_time,
                "time_error": (time - float(history.time[0]) - want_time) / dt,
                "impact": impact,
                "rebound": rebound,
                "rebound_closed": want,
                "rebound_error": rebound / want - 1.0 if want > 0.0 else math.nan,
                "ratio": rebound / impact,
                "spin": spin,
            }
        )
    e = f"{closed.restitution:g}"
    notes = (
        f"body 0 falls {closed.gap:.6g} m on {results.planes.name[plane]}, restitution {e}: rebound k is {e}^k sqrt(2 g h)",
        f"a step is {dt:.4g} s, in which gravity changes the speed by {closed.gravity * dt:.2g} m/s",
    )
    return (Check("drop", title, columns, tuple(rows), notes if rows else (*notes, "no bounce was seen")),)


# ------------------------------------------------------------------------------------------------ slope


@dataclass(frozen=True)
class Slide:
    """Closed form on a plane: starts with `start` [m/s] downhill, unit vector `along`; `pull` and `brake` [m/s^2]: g sin q, mu g cos q."""

    along: Floats
    normal: Floats
    start: float
    pull: float
    brake: float
    friction: float
    angle: float

    @property
    def stays(self) -> bool:
        return self.start == 0.0 and self.brake >= self.pull

    def velocity(self, time: Floats) -> Floats:
        """Downhill at times from the start (t,) [m/s]."""
        if self.stays:
            return np.zeros_like(time)
        found = self.start + (self.pull - self.brake) * time
        return np.maximum(found, 0.0) if self.brake >= self.pull else found


def slide_setting(results: BodyResults, body: int) -> Slide:
    """Closed form of a body on the plane that it lies on at the start: the nearest."""
    planes, start = results.planes, results.scene.bodies
    gaps = [
        float((start.x[body] - planes.point[w]) @ planes.normal[w])
        - depth_along(start, results.scene_shapes, planes.normal[w])[body]
        for w in range(len(planes))
    ]
    plane = int(np.argmin(np.abs(gaps)))
    normal = planes.normal[plane]
    across = float(-results.gravity @ normal)
    down = results.gravity + across * normal
    pull = float(np.linalg.norm(down))
    along = down / pull if pull > 0.0 else np.array([1.0, 0.0, 0.0])
    mu = pair_value(results, results.friction, body, -1 - plane)
    return Slide(along, normal, float(start.v[body] @ along), pull, mu * across, mu, math.atan2(pull, across))


def slope_check(results: BodyResults) -> tuple[Check, ...]:
    columns = {
        "body": ("body", "1"),
        "friction": ("friction", "1"),
        "time": ("time [s]", "s"),
        "velocity": ("v downhill [m/s]", "m/s"),
        "closed": ("g (sin q - mu cos q) t", "m/s"),
        "error": ("error", "1"),
        "off_plane": ("off the plane [m/s]", "m/s"),
        "sideways": ("sideways [m/s]", "m/s"),
        "spin": ("spin [rad/s]", "rad/s"),
    }
    title = "Check against the closed form: slope"
    if len(results.planes) == 0:
        return (Check("slope", title, columns, (), ("there is no plane to slide on",)),)
    rows, notes = [], []
    for body, history in histories(results, list(range(min(results.grain_count, MOST_BODIES)))).items():
        slide = slide_setting(results, body)
        time = history.time - history.time[0]
        chosen = np.unique(
            [np.argmin(np.abs(time - share * time[-1])) for share in np.arange(1, SLOPE_TIMES + 1) / SLOPE_TIMES]
        )
        side = np.cross(slide.normal, slide.along)
        for k in chosen.tolist():
            velocity, want = float(history.v[k] @ slide.along), float(slide.velocity(time)[k])
            rows.append(
                {
                    "body": float(body),
                    "friction": slide.friction,
                    "time": float(time[k]),
                    "velocity": velocity,
                    "closed": want,
                    "error": velocity / want - 1.0 if want > 0.0 else math.nan,
                    "off_plane": float(history.v[k] @ slide.normal),
                    "sideways": float(history.v[k] @ side),
                    "spin": float(np.linalg.norm(history.w[k])),
                }
            )
        if slide.stays:
            largest = float(np.linalg.norm(history.v, axis=1).max())
            notes.append(
                f"body {body}: friction {slide.friction:g} holds it (tan q = {math.tan(slide.angle):.4g}); largest speed {largest:.2g} m/s"
            )
    return (Check("slope", title, columns, tuple(rows), tuple(notes)),)


# ------------------------------------------------------------------------------------------------ collision and row


def collided(m: tuple[float, float], v: tuple[float, float], e: float) -> tuple[float, float]:
    """Velocities after a central impact of two masses [kg] with velocities [m/s] along the line of their centres."""
    total, closing = m[0] + m[1], v[0] - v[1]
    middle = (m[0] * v[0] + m[1] * v[1]) / total
    return middle - e * m[1] * closing / total, middle + e * m[0] * closing / total


def collision_check(results: BodyResults) -> tuple[Check, ...]:
    """Pairs of bodies 0 and 1, 2 and 3, ..., from the first instant to the last, along the difference of their velocities at the start."""
    columns = {
        "body": ("body", "1"),
        "mass": ("mass [kg]", "kg"),
        "before": ("before [m/s]", "m/s"),
        "after": ("after [m/s]", "m/s"),
        "closed": ("closed form", "m/s"),
        "error": ("error [m/s]", "m/s"),
    }
    title = "Check against the closed form: collision"
    rows, notes = [], []
    mass = results.scene.bodies.mass
    count = min(results.grain_count, MOST_BODIES) // 2 * 2
    found = histories(results, list(range(count)))
    for one in range(0, count, 2):
        if one not in found or one + 1 not in found:
            continue
        first, second = found[one], found[one + 1]
        closing = first.v[0] - second.v[0]
        speed = float(np.linalg.norm(closing))
        if speed == 0.0:
            notes.append(f"bodies {one} and {one + 1} do not approach each other")
            continue
        along = closing / speed
        e = pair_value(results, results.restitution, one, one + 1)
        masses = (float(mass[one]), float(mass[one + 1]))
        before = (float(first.v[0] @ along), float(second.v[0] @ along))
        after = (float(first.v[-1] @ along), float(second.v[-1] @ along))
        closed = collided(masses, before, e)
        for k in (0, 1):
            rows.append(
                {
                    "body": float(one + k),
                    "mass": masses[k],
                    "before": before[k],
                    "after": after[k],
                    "closed": closed[k],
                    "error": after[k] - closed[k],
                }
            )
        momentum = [m0 * a + m1 * b for (m0, m1), (a, b) in ((masses, before), (masses, after))]
        energy = [0.5 * (masses[0] * a * a + masses[1] * b * b) for a, b in (before, after, closed)]
        scale = masses[0] * abs(before[0]) + masses[1] * abs(before[1])
        notes.append(
            f"restitution {e:g}: momentum changes by {(momentum[1] - momentum[0]) / scale:.1e} of its parts; "
            f"kinetic energy is {energy[1] / energy[0]:.9g} of that before, closed form {energy[2] / energy[0]:.9g}"
        )
    return (Check("collision", title, columns, tuple(rows), tuple(notes)),)


def row_check(results: BodyResults) -> tuple[Check, ...]:
    """A row of bodies in the order of their numbers, of which the first one comes: velocities at the end along that of the first."""
    columns = {
        "body": ("body", "1"),
        "before": ("before [m/s]", "m/s"),
        "after": ("after [m/s]", "m/s"),
        "closed": ("closed form", "m/s"),
        "error": ("error [m/s]", "m/s"),
    }
    title = "Check against the closed form: row"
    n = results.grain_count
    found = histories(results, list(range(n)))
    if len(found) < n or n < 2 or not np.linalg.norm(found[0].v[0]) > 0.0:
        return (Check("row", title, columns, (), ("the first body of a row must come",)),)
    along = found[0].v[0] / np.linalg.norm(found[0].v[0])
    before, after = (np.array([found[k].v[at] @ along for k in range(n)]) for at in (0, -1))
    mass = results.scene.bodies.mass
    e = pair_value(results, results.restitution, 0, 1)
    known = e == 1.0 and np.allclose(mass, mass[0], rtol=1e-9) and not before[1:].any()
    closed = np.where(np.arange(n) == n - 1, before[0], 0.0) if known else np.full(n, math.nan)
    columns_of = np.stack([np.arange(n), before, after, closed, after - closed], axis=1)
    rows = tuple(dict(zip(columns, map(float, line), strict=True)) for line in columns_of)
    momentum, energy = (mass @ after / (mass @ before), mass @ after**2 / (mass @ before**2))
    notes = [f"restitution {e:g}: momentum is {momentum:.12g} and kinetic energy {energy:.9g} of those before"]
    if not known:
        notes.append("a closed form is known for equal masses and restitution 1 only")
    elif n > 2:
        notes.append(f"largest velocity of the others at the end: {float(np.abs(after[:-1]).max()):.2g} m/s")
    return (Check("row", title, columns, rows, tuple(notes)),)
