"""The arrays that the kernels of the contact search take, and what their columns are.

Few and wide: each array that a kernel takes costs time to compile, in every kernel that hands it on.
"""

from __future__ import annotations

from typing import NamedTuple

from dem_cli.state import Floats, Ints

SPHERES, POLYHEDRON, CLOUD = range(3)  # kinds of shapes

# Shapes.number. *0: first of the shape's things in their array, those of shape s end where those of s + 1 start.
KIND, CONVEX, SPHERE0, VERTEX0, TRIANGLE0, EDGE0, RIDGE0, CORNER0, POINT0, TRIANGLE_GRID, POINT_GRID = *range(10), 13
NUMBERS = 17  # a grid: its first cell in Shapes.cell, and how many there are along x, y, z
# Shapes.size
REACH, SPACING, LOW, HIGH, TRIANGLE_CELL, POINT_CELL = 0, 1, 2, 5, 8, 12
SIZES = 16  # a grid: its lowest corner, and the edge of its cells
# Shapes.vertex, .vertex_part; Shapes.point has PLACE, NORMAL and TRUSTED
PLACE, NORMAL, TRUSTED = 0, 3, 6
LEAVE0, IS_CORNER = 0, 1
# Shapes.triangle, .triangle_part (the first two have three columns each; SIDE has three of three, STRETCH three)
FACE_NORMAL, MIDDLE, BOX_LOW, BOX_HIGH, SIDE, STRETCH = 0, 3, 6, 9, 12, 21
TRIANGLE_VERTEX, TRIANGLE_EDGE, GROUP = 0, 3, 6
# Shapes.edge, .edge_part
INWARD, OTHER_INWARD = 0, 3
END, OTHER_END, BEND, RIM = range(4)


class Shapes(NamedTuple):
    """All shapes one after another, the terrain last, lengths of scale 1; see `topology.Mesh` for what belongs to a surface.

    number (s + 1, NUMBERS), size (s, SIZES): of each shape. sphere (., 4): centre and radius. vertex (v, 6): PLACE and mean NORMAL,
    vertex_part (v + 1, 2): LEAVE0 in `leave` (., 3), unit directions of the edges that leave it, and IS_CORNER. triangle (t, 24), triangle_part
    (t, 7); edge (e, 6), edge_part (e, 4). ridge: the convex edges, corner: the vertices with a cone, which alone make contacts. point (p, 7):
    face points of polyhedra, particles of clouds. cell, member: grids of triangles and of points; members of a cell c are
    member[cell[c]:cell[c + 1]].
    """

    number: Ints
    size: Floats
    sphere: Floats
    vertex: Floats
    vertex_part: Ints
    leave: Floats
    triangle: Floats
    triangle_part: Ints
    edge: Floats
    edge_part: Ints
    ridge: Ints
    corner: Ints
    point: Floats
    cell: Ints
    member: Ints


# Placed.frame: centre of mass, matrix from the shape's frame to the container's row by row, factor of lengths, radius of the sphere about it
CENTER, TURN, SCALE, RADIUS = 0, 3, 12, 13
FRAME = 14


class Placed(NamedTuple):
    """Where bodies are: frame (n, FRAME), shape (n,). The terrain, where there is one, is the last."""

    frame: Floats
    shape: Ints


# Near.many and the rows of Near.item; STAMP: number of the last gathering
TRIANGLES, RIDGES, CORNERS, POINTS, HELD, STAMP = range(6)


class Near(NamedTuple):
    """Features of one body that were gathered: item[k, :many[k]] are indices into `Shapes`. Scratch.

    seen (3, .): the last gathering that looked at a triangle, edge, vertex, so that each is taken once. height: of a point over the faces HELD.
    """

    item: Ints
    many: Ints
    seen: Ints
    height: Floats


COUNT, FIRST = range(2)


class Found(NamedTuple):
    """Contacts (capacity,), see `contacts.find`. state: COUNT of all, even beyond the capacity, and FIRST of the present pair."""

    i: Ints
    j: Ints
    key: Ints
    point: Floats
    normal: Floats
    gap: Floats
    state: Ints
