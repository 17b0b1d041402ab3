"""Impacts of two bodies with given contacts: what both solvers must keep, closed forms, and where they meet their limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from dem_cli.engines.impulse.drift import turn_inverse
from dem_cli.engines.impulse.impact import PGS, TRACKING, solve_impact
from dem_cli.engines.impulse.rows import WIDTH, fill_rows
from dem_cli.engines.impulse.tracking import link_contacts
from dem_cli.rigid import rotation
from dem_cli.state import Floats, Ints

SOLVERS = {"pgs": PGS, "energy-tracking": TRACKING}


@dataclass
class Impact:
    """Bodies (n,) and contacts (c,) of an impact before it, SI units; j = n is what never moves."""

    mass: Floats
    inertia: Floats
    q: Floats
    x: Floats
    velocity: Floats
    point: Floats
    normal: Floats
    i: Ints
    j: Ints

    def tensors(self) -> Floats:
        turn = rotation(self.q)
        return turn @ (self.inertia[:, :, None] * np.swapaxes(turn, 1, 2))

    def kinetic(self, velocity: Floats) -> float:
        n = len(self.mass)
        turning = np.einsum("ka,kab,kb->", velocity[:n, 3:], self.tensors(), velocity[:n, 3:])
        return float(0.5 * (self.mass @ (velocity[:n, :3] ** 2).sum(axis=1) + turning))

    def momenta(self, velocity: Floats) -> tuple[Floats, Floats]:
        """Linear momentum, and angular momentum about the origin."""
        n = len(self.mass)
        p = self.mass[:, None] * velocity[:n, :3]
        own = np.einsum("kab,kb->ka", self.tensors(), velocity[:n, 3:])
        return p.sum(axis=0), (np.cross(self.x[:n], p) + own).sum(axis=0)

    def closing(self, velocity: Floats) -> Floats:
        """Relative velocities u (c, 3) of j against i at the contacts."""
        at = [velocity[k, :3] + np.cross(velocity[k, 3:], self.point - self.x[k]) for k in (self.i, self.j)]
        return at[1] - at[0]


@dataclass
class Outcome:
    velocity: Floats
    impulse: Floats
    iterations: int
    residual: float
    capped: bool


def solve(
    case: Impact, restitution: float, friction: float, method: str, *, quanta: float = 50.0, tolerance: float = 1e-6,
    order: Ints | None = None,
) -> Outcome:  # fmt: skip
    """The impact, all contacts one island, in the given order of contacts."""
    n, order = len(case.mass), np.arange(len(case.i)) if order is None else order
    inverse = np.zeros((n + 1, 7))
    turn_inverse(np.ones(n, dtype=bool), case.q, case.mass, case.inertia, inverse)
    i, j = case.i[order], case.j[order]
    rows, contacts = np.zeros((len(i), WIDTH)), np.ones(len(i))
    fill_rows(
        i, j, case.point[order], case.normal[order], case.x, inverse, restitution * contacts, friction * contacts, rows
    )
    velocity, impulse = case.velocity.copy(), np.zeros((len(i), 3))
    head, following = link_contacts(i, j, n)
    told = solve_impact(
        0, len(i), i, j, rows, velocity, inverse, impulse, case.velocity.copy(), case.closing(case.velocity)[order],
        head, following, SOLVERS[method], quanta, 1e-3, tolerance, 20000, 100000,
    )  # fmt: skip
    back = np.argsort(order)
    return Outcome(velocity, impulse[back], *told)


@cache
def random_impact(seed: int, contacts: int) -> Impact:
    """Two bodies of unequal mass and inertia, turned anyhow, that fly at each other with spin and touch at some points."""
    rng = np.random.default_rng(seed)
    mass = rng.uniform(0.5, 2.0, 2)
    inertia = rng.uniform(0.05, 0.12, (2, 3)) * mass[:, None]
    q = rng.normal(size=(2, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    x = np.zeros((3, 3))
    x[:2] = np.array([[0, -0.45, 0], [0, 0.45, 0]]) + rng.normal(size=(2, 3)) * 0.1
    velocity = np.zeros((3, 6))
    velocity[:2, :3], velocity[:2, 3:] = rng.normal(size=(2, 3)), 2.0 * rng.normal(size=(2, 3))
    velocity[1, 1] -= 2.0
    point = np.c_[rng.uniform(-0.4, 0.4, contacts), np.zeros(contacts), rng.uniform(-0.4, 0.4, contacts)]
    normal = np.array([0.0, 1.0, 0.0]) + 0.15 * rng.normal(size=(contacts, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    zero = np.zeros(contacts, dtype=np.int64)
    return Impact(mass, inertia, q, x, velocity, point, normal, zero, zero + 1)


def settings(seed: int) -> tuple[int, float, float]:
    """Contacts, restitution and friction of a seed, so that all combinations come in turn."""
    return (1, 4)[seed % 2], (0.0, 0.5, 1.0)[seed // 2 % 3], (0.0, 0.3, 1.0)[seed // 6 % 3]


@pytest.mark.parametrize("method", SOLVERS)
def test_random_impacts_keep_momentum_and_gain_no_energy(method: str) -> None:
    for seed in range(306):
        contacts, e, mu = settings(seed)
        case = random_impact(seed, contacts)
        after = solve(case, e, mu, method, tolerance=1e-8)
        for before, now in zip(case.momenta(case.velocity), case.momenta(after.velocity), strict=True):
            assert np.abs(now - before).max() < 1e-12 * max(1.0, float(np.abs(before).max()))
        energy = case.kinetic(case.velocity)
        assert case.kinetic(after.velocity) <= energy * (1.0 + 1e-9)
        along = np.einsum("ca,ca->c", after.impulse, case.normal)
        across = np.linalg.norm(after.impulse - along[:, None] * case.normal, axis=1)
        assert np.all(along >= 0.0)
        assert np.all(across <= mu * along + 1e-12)
        assert np.einsum("ca,ca->c", case.closing(after.velocity), case.normal).min() >= -1e-6


@pytest.mark.parametrize("method", SOLVERS)
@pytest.mark.parametrize("restitution", [0.0, 0.4, 1.0])
def test_one_contact_rebounds_with_its_restitution(method: str, restitution: float) -> None:
    """Without friction, whatever the arms: u.n after = -e u.n before (Newton, Poisson and Stronge agree)."""
    for seed in range(20):
        case = random_impact(seed, 1)
        before = float(case.closing(case.velocity)[0] @ case.normal[0])
        if before > -1e-3:
            continue
        after = float(case.closing(solve(case, restitution, 0.0, method).velocity)[0] @ case.normal[0])
        assert after == pytest.approx(-restitution * before, abs=1e-9)


@pytest.mark.parametrize("friction", [0.0, 0.05, 0.2, 1.0])
def test_the_solvers_agree_on_single_contacts(friction: float) -> None:
    """Any arm without friction; with friction spheres, whose slip keeps its direction: there the path does not matter."""
    for seed in range(30):
        case = random_impact(seed, 1)
        if friction > 0.0:
            case = two_spheres(seed)
        one, other = (solve(case, 0.5, friction, method).velocity for method in SOLVERS)
        assert np.abs(one - other).max() < 1e-9


def two_spheres(seed: int) -> Impact:
    rng = np.random.default_rng(seed)
    mass, radius = rng.uniform(0.5, 2.0, 2), rng.uniform(0.2, 0.6, 2)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    x = np.zeros((3, 3))
    x[0], x[1] = -radius[0] * normal, radius[1] * normal
    velocity = np.zeros((3, 6))
    velocity[:2] = rng.normal(size=(2, 6))
    velocity[0, :3] += 3.0 * normal
    unit, zero = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)), np.zeros(1, dtype=np.int64)
    return Impact(
        mass, np.tile((0.4 * mass * radius**2)[:, None], 3), unit, x, velocity, np.zeros((1, 3)), normal[None], zero, zero + 1
    )  # fmt: skip


@pytest.mark.parametrize("method", SOLVERS)
@pytest.mark.parametrize(("slip", "friction"), [(1.0, 0.1), (1.0, 1.0)])
def test_sphere_on_a_floor_sticks_or_slips_as_in_closed_form(method: str, slip: float, friction: float) -> None:
    """Gross slip: v_t' = v_t - mu (1 + e) v_n; sticking: it rolls off with 5/7 v_t (physics.md 1.9 in three dimensions)."""
    unit, zero = np.array([[1.0, 0.0, 0.0, 0.0]]), np.zeros(1, dtype=np.int64)
    x, velocity = np.zeros((2, 3)), np.zeros((2, 6))
    velocity[0, :3] = slip, 0.0, -1.0
    case = Impact(
        np.array([2.0]), np.full((1, 3), 0.4 * 2.0 * 0.3**2), unit, x, velocity, np.array([[0.0, 0.0, -0.3]]),
        np.array([[0.0, 0.0, -1.0]]), zero, zero + 1,
    )  # fmt: skip
    after = solve(case, 0.5, friction, method).velocity[0]
    slides = 3.5 * friction * 1.5 < slip
    assert after[0] == pytest.approx(slip - friction * 1.5 if slides else 5.0 / 7.0 * slip, abs=1e-6)
    assert after[2] == pytest.approx(0.5, abs=1e-9)
    assert after[4] == pytest.approx(2.5 * (slip - after[0]) / 0.3, abs=1e-6)


@pytest.mark.parametrize("method", SOLVERS)
def test_the_order_of_contacts_does_not_matter(method: str) -> None:
    rng = np.random.default_rng(1)
    for seed in range(20):
        case = random_impact(seed, 4)
        for friction in (0.0, 0.3):
            one = solve(case, 0.5, friction, method, tolerance=1e-9)
            other = solve(case, 0.5, friction, method, tolerance=1e-9, order=rng.permutation(4))
            assert np.abs(one.velocity - other.velocity).max() < 1e-6


@pytest.mark.parametrize("method", SOLVERS)
def test_mirrored_impacts_are_mirrored(method: str) -> None:
    """x -> -x: velocities and normals change their x, spins their y and z."""
    for seed in range(20):
        case = random_impact(seed, 4)
        flip, turn = np.array([-1.0, 1.0, 1.0]), np.array([1.0, -1.0, -1.0])
        mirrored = Impact(
            case.mass, case.inertia, case.q * np.array([1.0, 1.0, -1.0, -1.0]), case.x * flip, case.velocity * np.r_[flip, turn],
            case.point * flip, case.normal * flip, case.i, case.j,
        )  # fmt: skip
        one, other = (solve(one, 0.5, 0.3, method, tolerance=1e-9).velocity for one in (case, mirrored))
        assert np.abs(other - one * np.r_[flip, turn]).max() < 1e-6


def flat_landing(contacts: tuple[int, int]) -> Impact:
    """A box of 2 m x 1 m x 2 m that meets the floor flat at 3 m/s, with a grid of contact points."""
    a, b = (np.linspace(-half, half, n) for half, n in zip((0.95, 0.45), contacts, strict=True))
    point = np.array([[x, y, 0.0] for x in a for y in b])
    many, q = len(point), np.array([[1.0, 0.0, 0.0, 0.0]])
    velocity = np.zeros((2, 6))
    velocity[0, 2] = -3.0
    x, down = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]), np.tile([0.0, 0.0, -1.0], (many, 1))
    first = np.zeros(many, dtype=np.int64)
    return Impact(
        np.array([8000.0]), np.array([[3333.3, 5333.3, 3333.3]]), q, x, velocity, point, down, first, first + 1
    )


@pytest.mark.parametrize("contacts", [(2, 2), (20, 10)])
def test_a_flat_body_lands_flat_with_any_number_of_contacts(contacts: tuple[int, int]) -> None:
    """As a cloud does, whose face has a contact for each of its particles."""
    found = solve(flat_landing(contacts), 0.5, 0.3, "pgs", tolerance=1e-4)
    assert found.velocity[0] == pytest.approx([0.0, 0.0, 1.5, 0.0, 0.0, 0.0], abs=1e-6)


def test_the_error_falls_with_the_quantum() -> None:
    """Oblique impacts with friction at several points, against much finer quanta: a quarter of the quantum, about a quarter of the error."""
    cases = [random_impact(seed, 4) for seed in range(60)]
    fine = [solve(case, 0.5, 0.3, "energy-tracking", quanta=6400.0).velocity for case in cases]
    errors = []
    for quanta in (40.0, 160.0, 640.0):
        found = [solve(case, 0.5, 0.3, "energy-tracking", quanta=quanta).velocity for case in cases]
        errors.append(float(np.median([np.abs(a - b).max() for a, b in zip(found, fine, strict=True)])))
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2]
    assert errors[0] > 12.0 * errors[2]


@pytest.mark.parametrize("method", SOLVERS)
@pytest.mark.parametrize("friction", [0.5, 1.2, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("degrees", [50.0, 60.0, 70.0])
@pytest.mark.parametrize("speed", [2.0, -2.0])
def test_painleve_rod_stops_without_gaining_energy(method: str, friction: float, degrees: float, speed: float) -> None:
    """A rod that slides on its end, pulled into the floor by friction: no impulse on the cone along the slip ends the approach."""
    angle = np.radians(degrees)
    unit, zero, x = np.array([[1.0, 0.0, 0.0, 0.0]]), np.zeros(1, dtype=np.int64), np.zeros((2, 3))
    velocity = np.zeros((2, 6))
    velocity[0, :3] = speed, 0.0, -0.01
    case = Impact(
        np.ones(1), np.full((1, 3), 1.0 / 3.0), unit, x, velocity, np.array([[-np.cos(angle), 0.0, -np.sin(angle)]]),
        np.array([[0.0, 0.0, -1.0]]), zero, zero + 1,
    )  # fmt: skip
    after = solve(case, 0.0, friction, method, tolerance=1e-5)
    assert not after.capped
    assert case.kinetic(after.velocity) < case.kinetic(velocity)
    assert float(case.closing(after.velocity)[0] @ case.normal[0]) >= -1e-5
