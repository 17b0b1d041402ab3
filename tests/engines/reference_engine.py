"""A second explicit DEM, as slow and plain as can be: SI units, every pair at every step, the law of physics.md 1.1 written out."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from dem_cli.state import Floats, Grains, Walls


@dataclass
class Reference:
    """Discs and walls under one law; stretch_force [N] of the contacts that are closed, touched: all that ever were."""

    grains: Grains
    walls: Walls
    kn: float
    ks: float
    hn: float
    hs: float
    friction: float
    tension: str
    slider: str
    integrator: str
    mass_damping: float = 0.0
    local_damping: float = 0.0
    stretch_force: dict[tuple[int, int], float] = field(default_factory=dict)
    touched: set[tuple[int, int]] = field(default_factory=set)

    def __post_init__(self) -> None:
        g = self.grains
        self.place = np.stack([g.x, g.y, g.angle], axis=1)
        self.velocity = np.stack([g.vx, g.vy, g.spin], axis=1)
        self.inertia = np.stack([g.mass, g.mass, g.inertia], axis=1)
        self.radius = g.radius.tolist()
        self.force = self.forces(self.velocity, 0.0)

    def advance(self, dt: float, body: Floats) -> None:
        """As many steps as `body`, (steps + 1, 2) [m/s^2], has intervals. Leapfrog kicks by half a step first and last, so that
        velocities and places belong to the same instant before and after.
        """
        for s in range(len(body) - 1):
            kick = 0.5 * dt if s == 0 and self.integrator == "leapfrog" else dt
            new = self.velocity + kick * self.acceleration(body[s])
            # (3.16), (3.17) of the thesis: forward Euler, and the mean of the velocities for the position
            carried = 0.5 * (self.velocity + new) if self.integrator == "thesis" else new
            self.velocity = new
            self.place = self.place + dt * carried
            self.force = self.forces(carried, dt)
            self.touched |= self.stretch_force.keys()
        if self.integrator == "leapfrog":
            self.velocity = self.velocity + 0.5 * dt * self.acceleration(body[-1])

    def acceleration(self, body: Floats) -> Floats:
        """(n, 3), extra damping included: mass-proportional, and Cundall's share of the resultant against the motion."""
        push = self.force / self.inertia
        push[:, :2] += body
        return push - self.mass_damping * self.velocity - self.local_damping * np.abs(push) * np.sign(self.velocity)

    def forces(self, velocity: Floats, dt: float) -> Floats:
        """Forces and moments (n, 3) of all contacts at the present places; the springs stretch by velocity x dt."""
        total = np.zeros_like(self.place)
        x, y = self.place[:, 0].tolist(), self.place[:, 1].tolist()
        v, r, mass = velocity.tolist(), self.radius, self.grains.mass.tolist()
        springs: dict[tuple[int, int], float] = {}
        for i in range(len(r)):
            for j in range(i + 1, len(r)):
                dx, dy = x[j] - x[i], y[j] - y[i]
                distance = math.sqrt(dx * dx + dy * dy)
                if distance >= r[i] + r[j]:
                    continue
                nx, ny = dx / distance, dy / distance
                du, dv = v[j][0] - v[i][0], v[j][1] - v[i][1]
                closing = -(du * nx + dv * ny)
                sliding = dv * nx - du * ny - (r[i] * v[i][2] + r[j] * v[j][2])
                effective = mass[i] * mass[j] / (mass[i] + mass[j])
                normal, shear = self.law(
                    (i, j), r[i] + r[j] - distance, closing, sliding, effective, self.friction, dt, springs
                )
                fx, fy = normal * nx + shear * ny, normal * ny - shear * nx
                total[j] += (fx, fy, shear * r[j])
                total[i] += (-fx, -fy, shear * r[i])
            for w in range(len(self.walls)):
                nx, ny, distance = self.to_wall(x[i], y[i], w)
                if distance >= r[i]:
                    continue
                closing = v[i][0] * nx + v[i][1] * ny
                sliding = -(v[i][1] * nx - v[i][0] * ny) - r[i] * v[i][2]
                mu = float(self.walls.friction[w])
                normal, shear = self.law((i, -1 - w), r[i] - distance, closing, sliding, mass[i], mu, dt, springs)
                total[i] -= (normal * nx + shear * ny, normal * ny - shear * nx, -shear * r[i])
        self.stretch_force = springs
        return total

    def law(
        self, key: tuple[int, int], overlap: float, closing: float, sliding: float, mass: float, friction: float,
        dt: float, springs: dict[tuple[int, int], float],
    ) -> tuple[float, float]:  # fmt: skip
        """Normal force and shear resistance [N] of a closed contact; its tangential spring force goes to `springs`."""
        cn, cs = 2.0 * self.hn * math.sqrt(mass * self.kn), 2.0 * self.hs * math.sqrt(mass * self.ks)
        normal = self.kn * overlap + cn * closing
        if self.tension == "none":
            normal = max(normal, 0.0)
        limit = friction * max(normal, 0.0)
        spring = self.stretch_force.get(key, 0.0) + self.ks * sliding * dt
        spring = min(max(spring, -limit), limit)
        shear = spring + cs * sliding
        if self.slider == "total":
            shear = min(max(shear, -limit), limit)
        springs[key] = spring
        return normal, shear

    def to_wall(self, x: float, y: float, w: int) -> tuple[float, float, float]:
        """Unit vector to the nearest point of wall w, and its distance [m]."""
        x0, y0 = float(self.walls.x0[w]), float(self.walls.y0[w])
        x1, y1 = min(float(self.walls.x1[w]), 1e3), min(float(self.walls.y1[w]), 1e3)
        length = math.hypot(x1 - x0, y1 - y0)
        ex, ey = (x1 - x0) / length, (y1 - y0) / length
        along = min(max((x - x0) * ex + (y - y0) * ey, 0.0), length)
        dx, dy = x0 + along * ex - x, y0 + along * ey - y
        distance = math.hypot(dx, dy)
        return dx / distance, dy / distance, distance
