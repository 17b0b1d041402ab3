"""Table of a scenario that says where the grains are at the start."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, ClassVar, Literal

from dem_cli.scenario.quantities import Distance, Length, Number, Whole
from dem_cli.scenario.stored_grains import is_result_file
from dem_cli.scenario.table import Given, Mistake, Table, key, misplaced

Method = Literal["falling", "rejection", "local-move", "growth", "insertion", "overlapping", "file"]
# Keys that only some methods have.
METHODS_OF = {
    "grid": ("falling", "local-move"),
    "file": ("falling", "file"),
    "void_ratio": ("falling", "rejection", "local-move", "growth", "insertion", "overlapping"),
    "height": ("falling", "rejection", "local-move", "growth", "insertion", "overlapping"),
    "attempts": ("falling", "rejection", "insertion"),
    "sweeps": ("local-move",),
}
# Void ratios that are aimed at where none is asked for; 0 is as dense as it gets.
USUAL = {"falling": 2.0, "rejection": 1.2, "local-move": 0.0, "growth": 0.0, "insertion": 0.25, "overlapping": 0.28}
RIVALS = {"grid": "file", "file": "grid", "void_ratio": "height", "height": "void_ratio"}


class Grid(Table):
    """Staggered starting grid: rows of `columns` places, every second row shifted, filled from the bottom left."""

    columns: Annotated[int, Whole(ge=1)] = key(doc="places in a row", example=40)
    spacing: Length = key(doc="distance between the centres of a row", example="3 cm")
    shift: Distance = key(
        maker=lambda good: f"{good['spacing'] / 2.0!r} m",
        doc="shift of every second row (default: half of spacing)",
        example="1.5 cm",
    )
    row_spacing: Length = key(
        maker=lambda good: f"{good['spacing']!r} m", doc="distance between rows (default: spacing)", example="3 cm"
    )

    def rows(self, count: int) -> int:
        """Rows that `count` grains take up."""
        return -(-count // self.columns)


class Packing(Table):
    """Where the grains are at the start. The stages that follow bring them to rest under gravity, or compress them.

    All methods but falling from a grid and file fill the container up to a height that follows from `void_ratio`, or is given as `height`; where
    the grains cannot be packed so densely it becomes higher, and a warning says what was reached.
    """

    method: Method = key(
        doc="falling: they start apart, from a grid, a file or random places, and fall; rejection: at random places, large ones first, "
        "those that overlap others are tried again; local-move: from a lattice, by small random moves and turns that sink; growth: they "
        "grow from random centres until they touch; insertion: large ones at random places, the others pushed into the widest gaps; "
        "overlapping (granular element method): at random places, over each other, and then pushed apart without friction; "
        "file: they lie as the file says",
        example="growth",
    )
    grid: Grid | None = key(
        None,
        "starting grid of falling (without grid and file they start at random places) and of local-move (default: the closest that keeps "
        "circles around the largest grain apart)",
        example={"columns": 40, "spacing": "3 cm"},
    )
    file: str | None = key(
        None,
        "result file of dem run (.h5), of any engine: its grains as they lie, without shear forces, so compress or settle them; or CSV file, "
        "a grain a line, with header x,y,r: centres and radii; columns vx,vy (velocity, per second), angle (degrees), spin (rad/s) and, "
        "for ellipses, aspect (a/b) may follow",
        example="grains.csv",
    )
    file_unit: Literal["m", "cm", "mm"] = key("m", "unit of length in the file", example="cm")
    stage: str | None = key(
        None,
        "stage of a result file, by name, at whose end its grains are taken (default: as they are in the last frame)",
        example="packing",
    )
    void_ratio: Annotated[float, Number(gt=0.0, le=1000.0)] | None = key(
        None,
        "void ratio of the filled height before the first stage (default: rejection 1.2, insertion 0.25, overlapping 0.28, falling from "
        "random places 2; growth and local-move as dense as they get)",
        example=0.25,
    )
    height: Length | None = key(None, "height that is filled, in place of void_ratio", example="30 cm")
    attempts: Annotated[int, Whole(ge=1)] | None = key(
        maker=lambda good: (
            1000 if good["method"] in METHODS_OF["attempts"] and not (good["grid"] or good["file"]) else None
        ),
        doc="rejection, insertion, falling from random places: places that a grain tries (default: 1000)",
        example=1000,
    )
    sweeps: Annotated[int, Whole(ge=1)] | None = key(
        maker=lambda good: 3000 if good["method"] == "local-move" else None,
        doc="local-move: moves that each grain tries on average at most (default: 3000)",
        example=3000,
    )

    elsewhere: ClassVar = {
        **dict.fromkeys(
            ("region", "gap", "overlaps"), ("impulse", "Leave it out; width, height and void_ratio say what is filled")
        ),
        "method=grid": ("impulse", 'Write method = "falling", and the grid'),
    }

    @property
    def random(self) -> bool:
        """Whether the places are made by chance: neither a grid to fall from nor a file gives them."""
        return not self.file and not (self.method == "falling" and self.grid)

    def region_height(self, width: float, solid: float, densest: float = 0.0) -> float:
        """Height [m] to be filled by grains of the area `solid` [m^2] in a container of this width [m]; densest: void ratio that stands for
        as dense as it gets."""
        if self.height is not None:
            return self.height
        wanted = USUAL[self.method] if self.void_ratio is None else self.void_ratio
        return (1.0 + (wanted or densest)) * solid / width

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        raw, method = given.raw, given.good.get("method")
        yield from misplaced(given, "method", METHODS_OF)
        if "stage" in raw and not is_result_file(str(raw.get("file", ""))):
            yield Mistake(("stage",), "is a key for result files", "Leave it out, or write the name of one as file")
        if method == "file" and "file" not in raw:
            yield Mistake(("file",), "is missing", 'Add for example file = "grains.csv"')
        for one, other in (("grid", "file"), ("void_ratio", "height")):
            if one in raw and other in raw:
                yield Mistake((other,), f"contradicts {one}", f"Give only one of: {one} or {other}")
        for start in ("grid", "file"):
            for name in ("void_ratio", "height"):
                if method == "falling" and start in raw and name in raw:
                    rule = f"contradicts {start}, which says where the grains start"
                    yield Mistake(
                        (name,), rule, 'Leave one of them out; to aim at a void ratio write method = "growth"'
                    )

    @classmethod
    def displaced(cls, path: Sequence[str], value: Any) -> list[tuple[str, ...]]:
        if path[0] in RIVALS:
            return [(RIVALS[path[0]],)]
        if tuple(path) != ("method",):
            return []
        return [(name,) for name, methods in METHODS_OF.items() if value not in methods]
