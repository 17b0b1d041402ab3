"""Groups of a result file as xarray datasets for notebooks: named axes, units, and what each quantity means."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from dem_cli.errors import ResultsError
from dem_cli.results.body_schema import BODY_CELL_DATA, BODY_POINT_DATA, BODY_TRACKS
from dem_cli.results.schema import BOND_STRAIN, BONDS, CELL_DATA, DISSIPATION, POINT_DATA, SURFACE, TRACKS

if TYPE_CHECKING:
    import xarray

    from dem_cli.results.reader import Results

Frames = int | slice | Sequence[int] | None
Values = npt.NDArray[Any]
Variables = dict[str, Any]

GROUPS = ("series", "surface", "tracks", "dissipation", "stages", "frames", "grains", "contacts", "bonds")
STRESS = ("xx", "xy", "yx", "yy")
# Names of a contact's arrays, where those of `Contacts` say too little beside others: field -> (name in the dataset, name in the file).
CONTACT = {
    "nx": ("nx", "normal"),
    "ny": ("ny", "normal"),
    "px": ("px", "contact_point"),
    "py": ("py", "contact_point"),
    "overlap": ("overlap", "overlap"),
    "normal": ("normal_force", "normal_force"),
    "shear": ("shear_force", "shear_force"),
    "stretch": ("stretch", "stretch"),
    "sliding": ("sliding", "sliding"),
}
FIRST = ("1", "number of the first body")
SECOND = ("1", "number of the other body, -1 - w for wall, plane or terrain w")


def to_xarray(results: Results, group: str = "series", frames: Frames = None) -> xarray.Dataset:
    """`group` of GROUPS as a dataset in memory; see `Results.to_xarray`. ResultsError for one that the file has not, and without xarray."""
    makers: Mapping[str, Callable[[Results, Frames], xarray.Dataset]] = {
        "series": _series, "surface": _surface, "tracks": _tracks, "dissipation": _dissipation, "stages": _stages,
        "frames": _frames, "grains": _grains, "contacts": _contacts, "bonds": _bonds,
    }  # fmt: skip
    if group not in makers:
        raise ResultsError(f'unknown group "{group}"; choose from {", ".join(GROUPS)}')
    if frames is not None and group not in ("frames", "grains", "contacts", "bonds"):
        raise ResultsError(f"frames choose from frames, grains, contacts and bonds; {group} has none")
    dataset = makers[group](results, frames)
    if isinstance(frames, int) and "frame" in dataset.dims:
        dataset = dataset.isel(frame=0)
    dataset.attrs.update(
        title=results.title,
        file=results.path.name,
        complete=int(results.complete),
        **{name: results.attrs[name] for name in ("engine", "seed", "scenario_hash") if name in results.attrs},
    )
    return dataset


def _xarray() -> Any:
    try:
        import xarray
    except ImportError:
        raise ResultsError("datasets need xarray: pip install 'dem-cli[notebook]'") from None
    return xarray


def _dataset(columns: Variables, coordinates: Variables) -> xarray.Dataset:
    found: xarray.Dataset = _xarray().Dataset(columns, coordinates)
    return found


def _attrs(name: str, meaning: tuple[str, str]) -> dict[str, str]:
    """Attributes that label a plot. Numbers without a unit get none, as xarray would write [1] beside their name."""
    unit, definition = meaning
    attrs = {"long_name": name.replace("_", " "), "definition": definition}
    return attrs if unit == "1" else {**attrs, "units": unit}


def _variable(dims: str | tuple[str, ...], values: Any, name: str, meaning: tuple[str, str]) -> Any:
    return dims, values, _attrs(name, meaning)


def _needs(results: Results, there: bool, what: str) -> None:
    if not there:
        raise ResultsError(f"{results.path}: has no {what}")


# ------------------------------------------------------------------------------------------------ over time or increments


def _series(results: Results, _: Frames) -> xarray.Dataset:
    """Every series over time, or over increments; the step and the stage of each row are coordinates."""
    axis = results.axis
    known = {name: (results.series.unit(name), results.series.definition(name)) for name in results.series}
    columns = {name: _variable(axis, results.series[name], name, known[name]) for name in known}
    beside = [name for name in (axis, "step", "stage", "in_stage") if name in columns]
    coordinates = {name: columns.pop(name) for name in beside}
    coordinates["stage"] = _stage(axis, results.series["stage"])
    return _dataset(columns, coordinates)


def _surface(results: Results, _: Frames) -> xarray.Dataset:
    """Height of the free surface over time and place."""
    surface = results.surface
    place = _variable("x", surface.x, "x", SURFACE["x"])
    eta = _variable(("time", "x"), surface.eta, "free_surface", SURFACE["eta"])
    return _dataset({"eta": eta}, {"time": _axis(results, surface.time), "x": place})


def _tracks(results: Results, _: Frames) -> xarray.Dataset:
    """Followed grains over time and their numbers."""
    tracks = results.tracks
    _needs(results, tracks is not None, "tracks; ask for them with [output] tracks and run again")
    assert tracks is not None
    meanings = BODY_TRACKS if results.kind == "bodies" else TRACKS
    columns = {
        name: _variable((results.axis, "grain"), values, name, meanings[name]) for name, values in tracks.arrays.items()
    }
    coordinates = {results.axis: _axis(results, tracks.time), "grain": _numbers("grain", tracks.ids)}
    return _dataset(columns, coordinates)


def _dissipation(results: Results, _: Frames) -> xarray.Dataset:
    """The contacts that dissipate most, over increments and their rank."""
    table = results.dissipation
    _needs(results, table is not None, "ranked dissipation, only quasi-static tests do")
    assert table is not None
    columns = {
        name: _variable(("increment", "rank"), getattr(table, name), name, meaning)
        for name, meaning in DISSIPATION.items()
    }
    rank = _variable("rank", table.rank, "rank", ("1", "1 is the contact that dissipates most"))
    return _dataset(columns, {"increment": _axis(results, table.increment), "rank": rank})


def _axis(results: Results, places: Values) -> Any:
    axis = results.axis
    return _variable(axis, places, axis, results.layout.series[axis])


def _stage(dim: str, numbers: Values) -> Any:
    """Counted from 1, as in reports and options; the file counts from 0."""
    return _variable(dim, np.asarray(numbers, dtype=np.int64) + 1, "stage", ("1", "number of the stage, from 1"))


def _numbers(what: str, ids: Values) -> Any:
    return _variable(what, ids, what, ("1", f"number of the {what}"))


def _stages(results: Results, _: Frames) -> xarray.Dataset:
    """Each measure before and after each stage, over `stage` and `when`."""
    stages, layout = results.stages, results.layout
    when = ("before", "after")
    names = [name for name in layout.measures if any(name in getattr(one, side) for one in stages for side in when)]
    columns = {
        name: _variable(
            ("stage", "when"),
            np.array([[getattr(one, side).get(name, np.nan) for side in when] for one in stages]).reshape(-1, 2),
            name,
            layout.series[name],
        )
        for name in names
    }
    facts = {
        name: _variable("stage", [getattr(one, name) for one in stages], name, layout.stages[name])
        for name in ("name", "kind", "start", "end", "reason")
    }
    number = _stage("stage", np.arange(len(stages)))
    return _dataset(columns, {"stage": number, "when": list(when), **facts})


# ------------------------------------------------------------------------------------------------ over frames


def _chosen(results: Results, frames: Frames) -> list[int]:
    """Indices of the frames that are asked for, all for None. ResultsError for one that is none."""
    count = results.n_frames
    if frames is None or isinstance(frames, slice):
        return list(range(count))[slice(None) if frames is None else frames]
    wanted = [int(k) for k in (frames if isinstance(frames, Iterable) else [frames])]
    for k in wanted:
        if not -count <= k < count:
            raise ResultsError(f"{results.path}: frame {k} is none of its {count} (0 to {count - 1})")
    return [k % count for k in wanted]


def _at(results: Results, chosen: list[int]) -> Variables:
    """Coordinates of frames: their number, where they lie on the axis, and their stage."""
    return {
        "frame": _variable("frame", np.array(chosen, dtype=np.int64), "frame", ("1", "number of the frame, from 0")),
        results.axis: ("frame", *_axis(results, results.frame_times[chosen])[1:]),
        "stage": _stage("frame", results.frame_stages[chosen]),
    }


def _frames(results: Results, frames: Frames) -> xarray.Dataset:
    """The numbers that are kept with each frame: step, energies, ground motion, ..."""
    chosen = _chosen(results, frames)
    columns = {
        name: _variable("frame", values[chosen], name, results.layout.frames[name])
        for name, values in results.frame_table.items()
        if name not in (results.axis, "stage")
    }
    return _dataset(columns, _at(results, chosen))


def _grains(results: Results, frames: Frames) -> xarray.Dataset:
    """Elements, or bodies in 3D, over frames and their numbers; what never changes is a coordinate over `grain` alone."""
    chosen = _chosen(results, frames)
    _needs(results, bool(chosen), "frames")
    states = [results.frame(k) for k in chosen]
    columns, fixed = _of_bodies(results, states) if results.kind == "bodies" else _of_elements(states)
    return _dataset(columns, {**_at(results, chosen), **fixed})


def _of_elements(states: list[Any]) -> tuple[Variables, Variables]:
    first = states[0].grains
    columns = {
        name: _variable(("frame", "grain"), np.stack([getattr(one.grains, name) for one in states]), name, meaning)
        for name, meaning in {**TRACKS, "escaped": _of(POINT_DATA, "escaped")}.items()
    }
    coordination = np.stack([one.coordination for one in states])
    columns["coordination"] = _variable(
        ("frame", "grain"), coordination, "coordination", _of(POINT_DATA, "coordination")
    )
    stress = np.stack([one.grain_stress if hasattr(one, "grain_stress") else one.stress for one in states])
    for k, part in enumerate(STRESS):
        columns[f"stress_{part}"] = _variable(
            ("frame", "grain"), stress[..., k], f"stress_{part}", _of(POINT_DATA, "stress")
        )
    fixed = {
        name: _variable("grain", getattr(first, name), name, _of(POINT_DATA, name))
        for name in ("radius", "a", "b", "mass", "inertia", "body")
    }
    return columns, {"grain": _numbers("grain", first.id), **fixed}


def _of_bodies(results: Any, states: list[Any]) -> tuple[Variables, Variables]:
    first = states[0].bodies
    columns: Variables = {}
    for field, names in (
        ("x", ("x", "y", "z")), ("q", ("q0", "q1", "q2", "q3")), ("v", ("vx", "vy", "vz")), ("w", ("wx", "wy", "wz")),
    ):  # fmt: skip
        values = np.stack([getattr(one.bodies, field) for one in states])
        for k, name in enumerate(names):
            columns[name] = _variable(("frame", "grain"), values[..., k], name, BODY_TRACKS[name])
    touched, gone = [one.coordination for one in states], [one.bodies.escaped for one in states]
    for name, rows in (("coordination", touched), ("escaped", gone)):
        columns[name] = _variable(("frame", "grain"), np.stack(rows), name, _of(BODY_POINT_DATA, name))
    fixed = {
        name: _variable("grain", getattr(first, name), name, _of(BODY_POINT_DATA, name)) for name in ("scale", "mass")
    }
    shapes = [shape.name for shape in results.scene_shapes]
    named = {
        "kind": (results.groups, first.group),
        "shape": (shapes, first.shape),
        "material": (results.materials, first.material),
    }
    for name, (names, numbers) in named.items():
        fixed[name] = _variable("grain", [str(names[k]) for k in numbers], name, ("1", f"{name} of the body"))
    return columns, {"grain": _numbers("grain", first.id), **fixed}


def _of(table: Mapping[str, Any], name: str) -> tuple[str, str]:
    column = table[name]
    return column.unit, column.definition


def _contacts(results: Results, frames: Frames) -> xarray.Dataset:
    """Contacts of one frame, by default the last, over their number."""
    chosen = _chosen(results, -1 if frames is None else frames)
    if len(chosen) != 1:
        raise ResultsError("contacts are those of one frame, as their number changes: frames=K, or -1 for the last")
    state = results.frame(chosen[0])
    c = state.contacts
    columns: Variables = {"i": _variable("contact", c.i, "i", FIRST), "j": _variable("contact", c.j, "j", SECOND)}
    if results.kind == "bodies":
        columns |= _between_bodies(c, state.dt)
    else:
        for field in fields(c):
            if field.name in CONTACT:
                name, stored = CONTACT[field.name]
                columns[name] = _variable("contact", getattr(c, field.name), name, _of(CELL_DATA, stored))
    number = _numbers("contact", np.arange(len(c)))
    at = {name: value for name, value in _at(results, chosen).items() if name != "frame"}
    scalars = {name: ((), values[0], attrs) for name, (_, values, attrs) in at.items()}
    return _dataset(columns, {"contact": number, "frame": chosen[0], **scalars})


def _between_bodies(c: Any, dt: float) -> Variables:
    columns: Variables = {}
    for field, letter, stored in (
        ("normal", "n", "normal"),
        ("point", "p", "contact_point"),
        ("impulse", "i", "impulse"),
    ):
        for k, axis in enumerate("xyz"):
            name = f"impulse_{axis}" if field == "impulse" else f"{letter}{axis}"
            columns[name] = _variable("contact", getattr(c, field)[:, k], name, _of(BODY_CELL_DATA, stored))
    along = np.einsum("ck,ck->c", c.impulse, c.normal)
    force = along / dt if dt > 0.0 else np.full(len(c), np.nan)
    for name, values in (("gap", c.gap), ("sliding", c.sliding), ("normal_impulse", along), ("normal_force", force)):
        columns[name] = _variable("contact", values, name, _of(BODY_CELL_DATA, name))
    return columns


def _bonds(results: Results, frames: Frames) -> xarray.Dataset:
    """Bonds between elements, over their number, and what they have given, over frames too."""
    bonds = results.bonds
    _needs(results, len(bonds) > 0, "bonds")
    chosen = _chosen(results, frames)
    strains = [results.frame(k).bonds for k in chosen]
    columns = {name: _variable("bond", getattr(bonds, name), name, meaning) for name, meaning in BONDS.items()}
    for name, meaning in BOND_STRAIN.items():
        values = np.array([getattr(one, name) for one in strains], dtype=float).reshape(len(chosen), len(bonds))
        columns[name] = _variable(("frame", "bond"), values, name, meaning)
    at = {**_at(results, chosen), "bond": _numbers("bond", np.arange(len(bonds)))}
    return _dataset(columns, at)
