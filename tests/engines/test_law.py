"""The contact law as a function: limits, forgetting, losses, and four contacts at once against one (physics.md 1.1)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dem_cli.engines.explicit.law import Law, contact_force, contact_losses, make_law
from dem_cli.geometry.rows import load, store
from dem_cli.jit import kernel

KN = 1e6


@kernel()
def one_force(overlap, closing, sliding, spring, root, friction, law):
    """`contact_force` of floats."""
    return contact_force(overlap, closing, sliding, spring, root, friction, law)


@kernel()
def one_loss(overlap, closing, sliding, old, new, law):
    """`contact_losses` of floats."""
    return contact_losses(overlap, closing, sliding, old, new, law)


@kernel()
def four_forces(inputs, friction, law, out):
    """Columns of inputs (5, 4) flat: overlap, closing, sliding, spring, root -> out (3, 4) flat: normal, shear, spring."""
    normal, shear, spring = contact_force(
        load(inputs, 0), load(inputs, 4), load(inputs, 8), load(inputs, 12), load(inputs, 16), friction, law
    )
    store(out, 0, normal)
    store(out, 4, shear)
    store(out, 8, spring)


@kernel()
def four_losses(inputs, law, out):
    """Columns of inputs (9, 4) flat: overlap, closing, sliding, three old, three new -> out (4, 4) flat: the losses."""
    old = (load(inputs, 12), load(inputs, 16), load(inputs, 20))
    new = (load(inputs, 24), load(inputs, 28), load(inputs, 32))
    a, b, c, d = contact_losses(load(inputs, 0), load(inputs, 4), load(inputs, 8), old, new, law)
    store(out, 0, a)
    store(out, 4, b)
    store(out, 8, c)
    store(out, 12, d)


def law_of(
    tension: str = "none", slider: str = "total", friction: float = 0.3, ratio: float = 0.5, h: float = 0.3
) -> Law:
    """A law with these words, damping ratio h in both directions."""
    return make_law(friction, KN, ratio * KN, h, h, tension=tension, slider=slider)


class Path:
    """One contact followed along a path of overlap and sliding; `lost` is in units of kn, not doubled."""

    def __init__(self, law: Law, overlap: float, root: float = 10.0) -> None:
        self.law, self.root = law, root
        self.overlap = overlap
        self.normal, self.shear, self.spring = max(overlap, 0.0), 0.0, 0.0
        self.dashpots = (0.0, 0.0)
        self.lost = np.zeros(4)
        self.work = 0.0

    @property
    def stored(self) -> float:
        """Elastic energy over kn."""
        return 0.5 * max(self.overlap, 0.0) ** 2 + 0.5 * self.spring**2 * self.law.flexibility_ratio

    def step(self, closing: float, sliding: float) -> np.ndarray:
        """Losses of one step that closes and slides by these lengths."""
        law, before = self.law, (self.normal, self.shear)
        old = (*self.dashpots, self.spring)
        self.overlap += closing
        self.normal, self.shear, self.spring = one_force(
            self.overlap, closing, sliding, self.spring, self.root, law.friction, law
        )
        self.dashpots = (self.normal - max(self.overlap, 0.0), self.shear - self.spring)
        lost = 0.5 * np.array(one_loss(self.overlap, closing, sliding, old, (*self.dashpots, self.spring), law))
        self.lost += lost
        self.work += 0.5 * (before[0] + self.normal) * closing + 0.5 * (before[1] + self.shear) * sliding
        return lost


lengths = st.floats(-1.0, 1.0, allow_subnormal=False)
roots = st.floats(0.5, 50.0)
frictions = st.sampled_from([0.0, 0.17, 0.5, 3.0])
tensions = st.sampled_from(["none", "damping"])
sliders = st.sampled_from(["total", "spring"])
ratios = st.sampled_from([1.0 / 3.0, 0.5, 1.0])
dampings = st.sampled_from([0.0, 0.05, 0.5, 1.0, 2.0])
laws = st.builds(law_of, tensions, sliders, frictions, ratios, dampings)
many = settings(max_examples=300, deadline=None)


@many
@given(laws, lengths, lengths, lengths, lengths, roots)
def test_definition(law, overlap, closing, sliding, spring, root):
    normal, shear, stretched = one_force(overlap, closing, sliding, spring, root, law.friction, law)
    if overlap <= 0.0:
        # An open contact gives no force and forgets its stretch.
        assert (normal, shear, stretched) == (0.0, 0.0, 0.0)
        return
    full = overlap + law.dashpot_n * root * closing
    assert normal == pytest.approx(max(full, law.pull), rel=1e-14, abs=1e-14)
    limit = law.friction * max(normal, 0.0)
    assert stretched == pytest.approx(float(np.clip(spring + law.stiffness_ratio * sliding, -limit, limit)), abs=1e-15)
    assert abs(stretched) <= limit
    total = stretched + law.dashpot_s * root * sliding
    if law.free == 0.0:
        assert abs(shear) <= limit
        assert shear == pytest.approx(float(np.clip(total, -limit, limit)), rel=1e-13, abs=1e-13)
    else:
        assert shear == pytest.approx(total, rel=1e-13, abs=1e-13)


@many
@given(laws, lengths, lengths, lengths, lengths, roots)
def test_no_pull_without_tension(law, overlap, closing, sliding, spring, root):
    normal, shear, stretched = one_force(overlap, closing, sliding, spring, root, law.friction, law)
    if law.pull == 0.0:
        assert normal >= 0.0
    if normal <= 0.0:  # also a dashpot that pulls carries no friction of the spring
        assert stretched == 0.0
        assert law.free > 0.0 or shear == 0.0


def test_dashpot_may_pull_with_damping_tension():
    law = law_of("damping", h=0.5)
    normal, shear, stretched = one_force(0.1, -0.5, 0.2, 0.05, 10.0, law.friction, law)
    assert normal == pytest.approx(0.1 - 0.5 * 10.0, rel=1e-15)
    assert (shear, stretched) == (0.0, 0.0)
    # the spring alone never pulls: a contact without overlap has no force, however fast it parts
    assert one_force(-1e-12, -0.5, 0.2, 0.05, 10.0, law.friction, law) == (0.0, 0.0, 0.0)


def test_dashpot_may_exceed_the_limit_of_the_spring_only():
    keys = {"friction": 0.3, "h": 1.0, "ratio": 0.5}
    limit = 0.3 * 1.0
    for slider, wanted in (("total", limit), ("spring", limit + 2.0 * math.sqrt(0.5) * 10.0 * 5.0)):
        law = law_of(slider=slider, **keys)
        normal, shear, stretched = one_force(1.0, 0.0, 5.0, 0.0, 10.0, law.friction, law)
        assert normal == 1.0
        assert stretched == pytest.approx(limit, rel=1e-15)
        assert shear == pytest.approx(wanted, rel=1e-14)


@many
@given(laws, lengths, lengths, lengths, lengths, roots)
def test_mirror(law, overlap, closing, sliding, spring, root):
    # The mirror image of a contact slides and pulls the other way, to the last bit.
    normal, shear, stretched = one_force(overlap, closing, sliding, spring, root, law.friction, law)
    mirrored = one_force(overlap, closing, -sliding, -spring, root, law.friction, law)
    assert mirrored == (normal, -shear, -stretched)


@many
@given(laws, st.lists(st.tuples(*[lengths] * 4, roots), min_size=4, max_size=4))
def test_lanes_equal_scalars(law, contacts):
    inputs = np.ascontiguousarray(np.array(contacts).T)
    out = np.empty((3, 4))
    four_forces(inputs.ravel(), law.friction, law, out.reshape(-1))
    scale = 1.0 + law.dashpot_n * inputs[4] + law.dashpot_s * inputs[4]
    for lane, contact in enumerate(contacts):
        single = one_force(*contact, law.friction, law)
        np.testing.assert_allclose(out[:, lane], single, rtol=1e-15, atol=1e-15 * scale[lane])


@many
@given(laws, st.lists(st.tuples(*[lengths] * 9), min_size=4, max_size=4))
def test_lanes_equal_scalars_in_losses(law, contacts):
    inputs = np.ascontiguousarray(np.array(contacts).T)
    out = np.empty((4, 4))
    four_losses(inputs.ravel(), law, out.reshape(-1))
    for lane, contact in enumerate(contacts):
        overlap, closing, sliding, *rest = contact
        single = one_loss(overlap, closing, sliding, tuple(rest[:3]), tuple(rest[3:]), law)
        np.testing.assert_allclose(out[:, lane], single, rtol=1e-15, atol=3e-15 * law.flexibility_ratio)


@many
@given(laws, st.lists(st.tuples(lengths, lengths), min_size=1, max_size=40), roots)
def test_work_is_stored_or_lost(law, moves, root):
    # Whatever the path, closing and opening included: work of the forces = energy of the springs + losses, to rounding.
    path = Path(law, overlap=-0.1, root=root)
    scale = 0.0
    for closing, sliding in moves:
        path.step(closing, sliding)
        scale += abs(path.normal) + abs(path.shear) + 1.0
    # path.lost[3] is what the time step gives to the grains: it is not work that the contact took in
    taken = path.lost[0] + path.lost[1] + path.lost[2] - path.lost[3]
    np.testing.assert_allclose(path.work, path.stored + taken, rtol=0, atol=1e-14 * scale * (1.0 + root))


@many
@given(laws, st.lists(st.tuples(lengths, lengths), min_size=1, max_size=40), roots)
def test_friction_gives_nothing_back(law, moves, root):
    # A step that turns the spring round within it may count a loss too small by ks sliding^2 / 8: no more, and only then.
    path = Path(law, overlap=0.5, root=root)
    for closing, sliding in moves:
        before = path.spring
        loss = path.step(closing, sliding)[2]
        assert loss >= -0.125 * law.stiffness_ratio * sliding**2 - 1e-14
        if before * path.spring >= 0.0 and before * (before + law.stiffness_ratio * sliding) >= 0.0:
            assert loss >= -1e-14


@many
@given(
    laws,
    st.floats(0.01, 0.5), st.floats(0.1, 2.0), st.floats(-3.0, 3.0), st.floats(0.0, 3.0), st.floats(0.0, 6.3),
)  # fmt: skip
def test_smooth_path_loses(law, speed, frequency, drift, swing, phase):
    # A contact that closes and opens once while it slides to and fro, in steps that are short against both.
    steps = 400
    time = np.linspace(0.0, math.pi, steps + 1)
    overlap = speed * np.sin(time)
    place = 0.1 * (drift * time + swing * np.sin(frequency * time + phase))
    path = Path(law, overlap=0.0, root=steps / math.pi)
    # the last step opens it
    for closing, sliding in zip(np.diff(overlap), np.diff(place), strict=True):
        lost = path.step(closing, sliding)
        assert lost[2] >= -0.125 * law.stiffness_ratio * sliding**2 - 1e-15
    path.step(-2e-3, 0.0)
    assert path.stored == 0.0
    rounding = 1e-12 + (0.125 * np.abs(np.diff(place)) ** 2).sum()
    assert path.lost[0] >= -1e-12
    assert path.lost[2] >= -rounding
    if law.free > 0.0 or law.dashpot_s == 0.0:
        assert path.lost[1] >= -1e-12
    assert path.lost[:3].sum() >= -rounding


def test_loop_of_force_over_path():
    # Constant overlap, sliding to and fro by a on each side: the loop has the area 4 mu N (a - mu N/ks), all of it friction.
    ratio, limit, reach, steps = 0.5, 0.3, 2.0, 1000
    path = Path(law_of(h=0.0, friction=limit, ratio=ratio), overlap=1.0)
    lost = []
    for way in (reach, -2.0 * reach, 2.0 * reach):
        for _ in range(steps):
            path.step(0.0, way / steps)
        lost.append(path.lost[2])
    assert path.shear == pytest.approx(limit, rel=1e-14)
    assert lost[2] - lost[0] == pytest.approx(4.0 * limit * (reach - limit / ratio), rel=1e-12)
    assert path.lost[[0, 1, 3]].tolist() == [0.0, 0.0, 0.0]


def test_crossing_counts_what_a_step_skips():
    # Opening by a step from overlap d to a gap g: the spring's force d acted over half the step more than it should, d g/2.
    path = Path(law_of(h=0.0), overlap=0.2)
    path.step(-0.5, 0.0)
    np.testing.assert_allclose(path.lost, [0.0, 0.0, 0.0, 0.5 * 0.2 * 0.3], rtol=1e-14)
    path = Path(law_of(h=0.0), overlap=-0.3)
    path.step(0.5, 0.0)
    np.testing.assert_allclose(path.lost, [0.0, 0.0, 0.0, -0.5 * 0.2 * 0.3], rtol=1e-14)


def test_make_law():
    law = make_law(0.4, 2e6, 5e5, 0.3, 0.2, tension="none", slider="total")
    assert law.stiffness_ratio == 0.25
    assert law.flexibility_ratio == 4.0
    assert law.dashpot_n == pytest.approx(0.6)  # cn d' / kn = 2 h sqrt(m/kn) d'
    assert law.dashpot_s == pytest.approx(0.4 * 0.5)  # cs s' / kn = 2 h sqrt(m ks)/kn s'
    assert (law.friction, law.pull, law.free) == (0.4, 0.0, 0.0)
    thesis = make_law(0.4, 2e6, 5e5, 0.3, 0.2, tension="damping", slider="spring")
    assert (thesis.pull, thesis.free) == (-math.inf, math.inf)
