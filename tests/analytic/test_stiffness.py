"""Stiffness of contacts from wave speeds, and elasticity of a hexagonal lattice of discs (physics.md 1.2, 1.9)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from few_grains import KN, KS, RADIUS, Bench, few_grains, floor, scenario

from dem_cli.analysis.stress import window_stress
from dem_cli.analysis.void_ratio import Rectangle
from dem_cli.state import Floats

OVERLAP = 1e-6 * RADIUS  # of the lattice before it is strained; all contacts stay closed
SIDE = 2.0 * RADIUS - OVERLAP


def test_thesis_material():
    # Thesis (2.22)-(2.27): Vs = 150 m/s, nu = 0.25 and 2480 kg/m^3 give Vp = 259.81 m/s.
    model = scenario({
        "grains.density": "2480 kg/m^3", "material": {"s_wave_velocity": "150 m/s", "poisson_ratio": 0.25},
    })  # fmt: skip
    vp, vs = model.material.wave_speeds(2480.0, 1.0)
    np.testing.assert_allclose([vp, vs], [259.81, 150.0], rtol=1e-5)
    np.testing.assert_allclose(model.stiffness, [1.3148e8, 4.3825e7], rtol=4e-5)
    np.testing.assert_allclose(model.stiffness[0] / model.stiffness[1], 3.0, rtol=1e-14)


def test_depth_scales_stiffness():
    material = {"s_wave_velocity": "150 m/s", "poisson_ratio": 0.3}
    deep, shallow = (scenario({"material": material, "depth": depth}).stiffness for depth in ("1 m", "1 cm"))
    np.testing.assert_allclose(shallow, [0.01 * k for k in deep], rtol=1e-14)


@pytest.mark.parametrize("kn", [1e4, 3e8])
def test_contact_has_this_stiffness(kn):
    overlap = 1e-3 * RADIUS
    keys = {"material_normal_stiffness": f"{kn!r} N/m", "dt": 1e-6}
    pair = few_grains([0.0, 2.0 * RADIUS - overlap], [0.0, 0.0], **keys)
    lying = few_grains([0.0], [RADIUS - overlap], walls=floor(), **keys)
    for bench in (pair, lying):
        np.testing.assert_allclose(bench.frame().contacts.normal, kn * overlap, rtol=1e-12)
        np.testing.assert_allclose(np.abs(bench.frame().forces).max(), kn * overlap, rtol=1e-12)


def hexagonal(columns: int, rows: int, angle: float = 0.0) -> tuple[Floats, Floats]:
    """Centres of a hexagonal lattice around the origin, its rows turned by `angle`, at a distance of SIDE."""
    i, j = np.meshgrid(np.arange(columns) - columns // 2, np.arange(rows) - rows // 2)
    x, y = SIDE * (i + 0.5 * (j % 2)).ravel(), SIDE * 0.5 * math.sqrt(3.0) * j.ravel()
    return x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle)


def displaced(bench: Bench, dx: Floats, dy: Floats, turn: Floats | float) -> Bench:
    """The bench after one step in which grains move by (dx, dy) and turn by `turn` [rad].

    The step is so short that no force counts.
    """
    state = bench.state
    n = len(state.mass)
    state.rows[:n, 2], state.rows[:n, 3], state.rows[:n, 4] = dx, dy, turn * state.radius
    bench.steps(1)
    return bench


def patch_stress(strain: Floats, angle: float, spin: float = 0.0, **changes) -> Floats:
    """Change of the stress [Pa] in the middle of a lattice under a small uniform displacement gradient."""
    x, y = hexagonal(18, 18, angle)
    bench = few_grains(x, y, dt=1e-13, contact_friction=1e6, **changes)

    def stress() -> Floats:
        # Mean over the six branches of the grain at the origin: each belongs half to it, its cell has this area.
        contacts = bench.frame().contacts
        middle = int(np.argmin(x**2 + y**2))
        cell = 0.5 * math.sqrt(3.0) * SIDE**2
        total = np.zeros((2, 2))
        grains = bench.state.grains()
        assert np.count_nonzero((contacts.i == middle) | (contacts.j == middle)) == 6
        for c in np.flatnonzero((contacts.i == middle) | (contacts.j == middle)):
            n = np.array([contacts.nx[c], contacts.ny[c]])
            force = contacts.normal[c] * n + contacts.shear[c] * np.array([-n[1], n[0]])
            i, j = contacts.i[c], contacts.j[c]
            branch = np.array([grains.x[j] - grains.x[i], grains.y[j] - grains.y[i]])
            total += 0.5 * np.outer(force, branch)
        return total / cell

    before = stress()
    displaced(bench, strain[0, 0] * x + strain[0, 1] * y, strain[1, 0] * x + strain[1, 1] * y, spin)
    return stress() - before


def elastic(strain: Floats, kn: float, ks: float) -> Floats:
    """Stress of the isotropic plane body with the lattice's constants, compression positive."""
    young = 2.0 * math.sqrt(3.0) * kn * (kn + ks) / (3.0 * kn + ks)
    nu = (kn - ks) / (3.0 * kn + ks)
    return -young / (1.0 - nu**2) * ((1.0 - nu) * strain + nu * np.trace(strain) * np.eye(2))


SMALL = 1e-8
STRAINS = {
    "along x": [[-1.0, 0.0], [0.0, 0.0]],
    "along y": [[0.0, 0.0], [0.0, 1.0]],
    "isotropic": [[-1.0, 0.0], [0.0, -1.0]],
    "shear": [[0.0, 0.7], [0.7, 0.0]],
    "mixed": [[-0.4, 0.3], [0.3, 0.9]],
}


@pytest.mark.parametrize("ratio", [1.0 / 3.0, 0.5, 1.0])
@pytest.mark.parametrize("angle", [0.0, 0.4])
@pytest.mark.parametrize("name", STRAINS)
def test_hexagonal_lattice_elasticity(name, angle, ratio):
    strain = SMALL * np.array(STRAINS[name])
    found = patch_stress(strain, angle, material_tangential_stiffness=f"{ratio * KN!r} N/m")
    wanted = elastic(strain, KN, ratio * KN)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=3e-6 * np.abs(wanted).max())


def test_youngs_modulus_and_poissons_ratio():
    # The two constants themselves, from a strain that leaves the sides free: sigma_yy = 0.
    young = 2.0 * math.sqrt(3.0) * KN * (KN + KS) / (3.0 * KN + KS)
    nu = (KN - KS) / (3.0 * KN + KS)
    stress = patch_stress(SMALL * np.array([[-1.0, 0.0], [0.0, nu]]), 0.0)
    np.testing.assert_allclose(stress[0, 0] / SMALL, young, rtol=3e-6)
    np.testing.assert_allclose(stress[1, 1] / SMALL, 0.0, atol=3e-6 * young)


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_rigid_rotation_strains_nothing(angle):
    turn = np.array([[0.0, -SMALL], [SMALL, 0.0]])
    np.testing.assert_allclose(patch_stress(turn, angle, spin=SMALL), 0.0, atol=3e-6 * KN * SMALL)


def test_spin_alone_gives_moments_not_symmetric_stress():
    # All discs that turn by phi in place: shear ks 2 r phi in each contact, an antisymmetric stress sqrt(3) ks phi.
    found = patch_stress(np.zeros((2, 2)), 0.0, spin=SMALL)
    wanted = math.sqrt(3.0) * KS * SMALL
    np.testing.assert_allclose(np.abs(found), [[0.0, wanted], [wanted, 0.0]], rtol=0, atol=3e-6 * wanted)
    np.testing.assert_allclose(found[0, 1], -found[1, 0], rtol=3e-6)


def test_window_stress_agrees():
    # The measure that runs report, on a window of whole cells, gives the same stress.
    x, y = hexagonal(18, 18)
    bench = few_grains(x, y, dt=1e-13, contact_friction=1e6)
    window = Rectangle(-4.0 * SIDE, -4.5 * SIDE * 0.5 * math.sqrt(3.0), 4.0 * SIDE, 3.5 * SIDE * 0.5 * math.sqrt(3.0))
    before = window_stress(x, y, bench.frame().contacts, window, 1.0)
    strain = SMALL * np.array(STRAINS["mixed"])
    displaced(bench, strain[0, 0] * x + strain[0, 1] * y, strain[1, 0] * x + strain[1, 1] * y, 0.0)
    grains = bench.state.grains()
    found = window_stress(grains.x, grains.y, bench.frame().contacts, window, 1.0) - before
    wanted = elastic(strain, KN, KS)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-5 * np.abs(wanted).max())
