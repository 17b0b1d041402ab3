"""All measures of one frame of bodies in 3D: a row of the series, the engine's own numbers among them."""

from __future__ import annotations

import math

import numpy as np

from dem_cli.analysis.fill3d import measure_fill
from dem_cli.analysis.placed import extent
from dem_cli.rigid import Bodies, BodyContacts, BodyFrame, Scene, coordination, rotation, touching_pairs
from dem_cli.state import Bools, Floats

MOVING = 1e-3  # m/s; slower bodies count as at rest


def measure_bodies(frame: BodyFrame, scene: Scene) -> dict[str, float]:
    """The full row of the series of a frame, named as in results.body_schema; ValueError without contacts.

    scene: shapes and planes; its own bodies do not matter.
    """
    contacts, bodies = frame.contacts, frame.bodies
    if contacts is None:
        raise ValueError("a frame without contacts cannot be measured")
    present = ~bodies.escaped & np.isfinite(bodies.x).all(axis=1)
    here = bodies.take(present)
    reach = np.array([shape.reach for shape in scene.shapes])[here.shape] * here.scale
    speed, spin = (np.linalg.norm(part, axis=1) for part in (here.v, here.w))
    mass = float(here.mass.sum())
    center = here.mass @ here.x / mass if mass > 0.0 else np.full(3, math.nan)
    highest = extent(here, scene.shapes)[1][:, 2]
    height, voids = measure_fill(bodies, contacts, scene)
    return {
        **_numbers(frame),
        **_vector("momentum", here.mass @ here.v),
        **_vector("angular_momentum", angular_momentum(here)),
        **_contact_measures(contacts, present),
        **_vector("center", center),
        "top": float(highest.max()) if len(here) else math.nan,
        "speed_max": float(speed.max(initial=0.0)),
        "moving": float(np.count_nonzero((speed > MOVING) | (spin * reach > MOVING))),
        "escaped": float(np.count_nonzero(~present)),
        "fill_height": height,
        "void_ratio": voids,
    }


def angular_momentum(bodies: Bodies) -> Floats:
    """Sum about the origin [kg m^2/s], shape (3,)."""
    turn = rotation(bodies.q)
    own = np.einsum("nab,nb,ncb,nc->na", turn, bodies.inertia, turn, bodies.w)
    orbital = np.cross(bodies.x, bodies.mass[:, None] * bodies.v)
    return np.asarray((own + orbital).sum(axis=0))


def _contact_measures(contacts: BodyContacts, present: Bools) -> dict[str, float]:
    count = len(contacts)
    depth = np.maximum(0.0, -contacts.gap)
    touched = coordination(contacts, len(present))
    return {
        "contacts": float(count),
        "touching": float(len(touching_pairs(contacts))),
        "coordination": float(touched[present].mean()) if present.any() else math.nan,
        "sliding": float(np.mean(contacts.sliding)) if count else math.nan,
        "penetration": float(depth.max(initial=0.0)),
        "penetration_mean": float(depth.mean()) if count else 0.0,
    }


def _numbers(frame: BodyFrame) -> dict[str, float]:
    """What the engine tells itself."""
    energy, solving = frame.energy, frame.solving
    place, velocity, acceleration = frame.ground
    return {
        "time": frame.time,
        "step": float(frame.step),
        "stage": float(frame.stage),
        "time_step": frame.dt,
        **{
            f"ground_{kind}{axis}": float(values[k])
            for kind, values in (("", place), ("v", velocity), ("a", acceleration))
            for k, axis in enumerate("xyz")
        },
        "kinetic": energy.kinetic,
        "rotational": energy.rotational,
        "potential": energy.potential,
        "restitution_energy": energy.restitution,
        "friction": energy.friction,
        "projection": energy.projection,
        "escaped_energy": energy.escaped,
        "work": energy.work,
        "residual": frame.residual,
        "energy_in": frame.energy_in,
        "steps": float(solving.steps),
        "impacts": float(solving.impacts),
        "impact_iterations": solving.impact_iterations,
        "load_sweeps": solving.load_sweeps,
        "most_iterations": float(solving.most),
        "capped": float(solving.capped),
        "solver_residual": solving.residual,
        "islands": float(solving.islands),
        "largest_island": float(solving.largest_island),
    }


def _vector(name: str, values: Floats) -> dict[str, float]:
    return {f"{name}_{axis}": float(values[k]) for k, axis in enumerate("xyz")}
