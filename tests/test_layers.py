"""The rules of the house: which module may import which, how long files may be, and what starts fast."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import dem_cli

ROOT = Path(dem_cli.__file__).parent
LONGEST = 400

# A layer is a file or folder of dem_cli; it imports itself and those named here, and nothing else of dem_cli.
# cli > sweep > run > (assembly, engines, results) > (scenario, state) > errors, and report > (results, analysis).
BASE = {"errors", "units", "whole"}
STARTS = BASE | {"scenario", "state", "rigid"}
MAY_IMPORT: dict[str, set[str]] = {
    "errors": set(),
    "jit": set(),
    "units": {"errors"},
    "state": {"errors"},
    "rigid": {"state"},
    "scenario": BASE | {"geometry"},
    "geometry": {"jit"},
    "assembly": STARTS | {"geometry", "jit"},
    "engines": STARTS | {"assembly", "geometry", "jit"},
    "results": STARTS,
    "analysis": {"errors", "state", "rigid", "geometry", "jit"},
    "report": BASE | {"results", "analysis", "state", "rigid"},
    "interrupts": set(),
    "whole": set(),
    "pace": STARTS,
    "run": STARTS | {"assembly", "engines", "results", "analysis", "interrupts"},
    "sweep": STARTS | {"run", "results", "pace"},
    "cli": STARTS
    | {"assembly", "engines", "results", "analysis", "report", "run", "sweep", "jit", "pace", "interrupts"},
    "__init__": {"errors", "scenario", "results", "run"},
    "__main__": {"cli"},
}
# A kernel takes arrays and numbers.
KERNEL_FILES_MAY_IMPORT = {
    "geometry": {"geometry", "jit"},
    "engines": {"engines", "geometry", "jit"},
    "analysis": {"analysis", "geometry", "jit", "state"},
    "assembly": {"assembly", "geometry", "jit", "state"},
}
KERNEL_FILES_MAY_IMPORT_FROM_OUTSIDE = {
    "__future__", "collections", "dataclasses", "llvmlite", "math", "numba", "numpy", "operator", "typing",
}  # fmt: skip
NOT_IN_KERNELS = {"Grains", "Bodies", "Scene", "Contacts", "Walls", "Frame", "Energy", "Scenario", "open", "print"}

MODULES = {
    ".".join(("dem_cli", *path.relative_to(ROOT).with_suffix("").parts)).removesuffix(".__init__"): path
    for path in sorted(ROOT.rglob("*.py"))
    if "shipped" not in path.relative_to(ROOT).parts
}


def layer(module: str) -> str:
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else "__init__"


def imports(path: Path, *, only_at_import: bool = False) -> set[str]:
    """Modules that a file imports: those of dem_cli by full name, others by their first part.

    only_at_import: leave out what stands in functions or under TYPE_CHECKING.
    """
    found: set[str] = set()

    def walk(node: ast.AST) -> None:
        for child in ast.iter_child_nodes(node):
            lazy = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
            typing = isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test)
            if only_at_import and (lazy or typing):
                continue
            if isinstance(child, ast.Import):
                found.update(alias.name for alias in child.names)
            elif isinstance(child, ast.ImportFrom):
                assert child.level == 0, f"{path}: relative import"
                base = child.module or ""
                inside = {f"{base}.{alias.name}" for alias in child.names} & MODULES.keys()
                found.update(inside)
                if len(inside) < len(child.names):
                    found.add(base)
            walk(child)

    walk(ast.parse(path.read_text(encoding="utf-8")))
    return {name if name.split(".")[0] == "dem_cli" else name.split(".")[0] for name in found}


def kernels(path: Path) -> list[ast.FunctionDef]:
    """The functions of a file that are compiled."""
    marks = {"kernel", "intrinsic", "njit", "numba.njit"}
    return [
        node
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
        and marks & {ast.unparse(decorator).partition("(")[0] for decorator in node.decorator_list}
    ]


KERNEL_MODULES = [name for name, path in MODULES.items() if kernels(path)]


@pytest.mark.parametrize("module", MODULES)
def test_imports_point_down(module: str) -> None:
    here = layer(module)
    assert here in MAY_IMPORT, f"{module}: a new layer; give it a line in MAY_IMPORT"
    reached = {layer(name) for name in imports(MODULES[module]) if name in MODULES and name != "dem_cli"}
    assert reached - {here} <= MAY_IMPORT[here]


def test_layers_have_an_order() -> None:
    """The table itself has no circle."""
    TopologicalSorter(MAY_IMPORT).prepare()


def test_no_circular_imports() -> None:
    """No module needs, while it is imported, one that needs it."""
    graph = {name: (imports(path, only_at_import=True) & MODULES.keys()) - {name} for name, path in MODULES.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(f"circular: {' -> '.join(error.args[1])}")


@pytest.mark.parametrize("module", KERNEL_MODULES)
def test_kernels_know_arrays_only(module: str) -> None:
    """In engines a file of kernels holds nothing else; a measure or a packing may have its kernel beside it."""
    found = imports(MODULES[module])
    assert {layer(name) for name in found if name in MODULES} <= KERNEL_FILES_MAY_IMPORT[layer(module)]
    assert {name for name in found if not name.startswith("dem_cli")} <= KERNEL_FILES_MAY_IMPORT_FROM_OUTSIDE
    for function in kernels(MODULES[module]):
        names = {node.id for node in ast.walk(function) if isinstance(node, ast.Name)}
        assert not names & NOT_IN_KERNELS, function.name
        assert not any(isinstance(node, ast.Global | ast.Import | ast.ImportFrom) for node in ast.walk(function))


def test_kernel_files_are_found() -> None:
    """The test above looks at the files that it is meant for."""
    explicit = {f"dem_cli.engines.explicit.{name}" for name in ("step", "forces", "law", "lists", "observe")}
    assert explicit | {f"dem_cli.geometry.{name}" for name in ("cells", "ellipse", "lanes")} <= set(KERNEL_MODULES)


@pytest.mark.parametrize("module", MODULES)
def test_files_are_short(module: str) -> None:
    assert len(MODULES[module].read_text(encoding="utf-8").splitlines()) <= LONGEST


HEAVY = ("numba", "matplotlib", "pydantic", "h5py", "pint", "scipy", "rich", "trimesh")


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["run", "--help"]], ids=" ".join)
def test_help_imports_little(arguments: list[str]) -> None:
    """`dem --help` must answer at once."""
    code = (
        "import json, sys\n"
        "from dem_cli.cli import main\n"
        "try:\n"
        f"    main({arguments!r})\n"
        "except SystemExit as end:\n"
        "    assert not end.code\n"
        f"print(json.dumps([name for name in {HEAVY!r} if name in sys.modules]), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout
    assert json.loads(done.stderr) == []
