"""What does not move in a result file of bodies in 3D, to the file and back: /shapes, /planes, /terrain, /materials, /groups."""

from __future__ import annotations

from typing import Any

import numpy as np

from dem_cli.results.body_schema import SHAPE
from dem_cli.results.tables import TEXT, describe
from dem_cli.rigid import Planes, Scene, Shape, Terrain

_SHAPE_NUMBERS = ("spacing", "mass", "volume", "reach")


def create_scene(file: Any, scene: Scene) -> None:
    """Write all of a scene but its bodies, unless it is there."""
    if "groups" in file:
        return
    _names(file.create_group("groups"), scene.groups)
    materials = file.create_group("materials")
    name, other = _names(materials, scene.materials), _names(materials, scene.materials, "other")
    for key, definition in (("restitution", "coefficient of restitution"), ("friction", "coefficient of friction")):
        dataset = materials.create_dataset(key, data=np.asarray(getattr(scene, key), dtype=np.float64))
        describe(dataset, "1", f"{definition} of each pair of materials")
        dataset.dims[0].attach_scale(name)
        dataset.dims[1].attach_scale(other)
    shapes = file.create_group("shapes")
    for k, shape in enumerate(scene.shapes):
        _create_shape(shapes.create_group(str(k)), shape)
    _create_planes(file.create_group("planes"), scene.planes)
    if scene.terrain is not None:
        _create_terrain(file.create_group("terrain"), scene.terrain)
    file.attrs["scene_low"], file.attrs["scene_high"] = scene.low, scene.high


def _names(group: Any, names: tuple[str, ...], scale: str = "name") -> Any:
    name = group.create_dataset(scale, data=list(names), dtype=TEXT, shape=(len(names),))
    name.make_scale(scale)
    return name


def _create_shape(group: Any, shape: Shape) -> None:
    group.attrs["name"], group.attrs["kind"] = shape.name, shape.kind
    for name in _SHAPE_NUMBERS:
        group.attrs[name] = getattr(shape, name)
    for name, (unit, definition) in SHAPE.items():
        describe(group.create_dataset(name, data=getattr(shape, name)), unit, definition)


def _create_planes(group: Any, planes: Planes) -> None:
    name = _names(group, planes.name)
    for key, unit, definition in (
        ("point", "m", "a point of the plane"),
        ("normal", "1", "unit normal to the side of the bodies"),
        ("material", "1", "number in /materials"),
        ("edge", "m", "corners of the piece that pictures show, anticlockwise seen from the bodies"),
    ):
        dataset = group.create_dataset(key, data=getattr(planes, key))
        describe(dataset, unit, definition)
        dataset.dims[0].attach_scale(name)


def _create_terrain(group: Any, terrain: Terrain) -> None:
    group.attrs["name"], group.attrs["material"] = terrain.name, terrain.material
    describe(group.create_dataset("vertices", data=terrain.vertices), "m", "corners of the surface")
    definition = "corners of each triangle, anticlockwise seen from the side of the bodies"
    describe(group.create_dataset("triangles", data=terrain.triangles), "1", definition)


def read_names(file: Any, group: str) -> tuple[str, ...]:
    return tuple(str(name) for name in file[group]["name"].asstr()[:])


def read_shapes(file: Any) -> tuple[Shape, ...]:
    return tuple(_read_shape(file["shapes"][str(k)]) for k in range(len(file["shapes"])))


def _read_shape(group: Any) -> Shape:
    arrays: dict[str, Any] = {name: np.asarray(group[name][()]) for name in SHAPE}
    numbers: dict[str, Any] = {name: float(group.attrs[name]) for name in _SHAPE_NUMBERS}
    return Shape(name=str(group.attrs["name"]), kind=group.attrs["kind"], **arrays, **numbers)


def read_planes(file: Any) -> Planes:
    arrays = {key: np.asarray(file["planes"][key][()]) for key in ("point", "normal", "material", "edge")}
    return Planes(name=read_names(file, "planes"), **arrays)


def read_terrain(file: Any) -> Terrain | None:
    """None where there is none."""
    if "terrain" not in file:
        return None
    group = file["terrain"]
    return Terrain(
        name=str(group.attrs["name"]),
        vertices=np.asarray(group["vertices"][()]),
        triangles=np.asarray(group["triangles"][()]),
        material=int(group.attrs["material"]),
    )
