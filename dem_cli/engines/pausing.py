"""What lets an engine stop between two stages and go on later, in another process or as several runs: its state as bytes."""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable
from typing import Any, ClassVar

from dem_cli.errors import ResultsError

FROM_NUMPY = {"_reconstruct", "ndarray", "dtype", "scalar", "_frombuffer"}
OWN = ("dem_cli.engines.", "dem_cli.assembly", "dem_cli.state", "dem_cli.rigid")  # modules of what engines consist of
FROM_ELSEWHERE = {("collections", "deque"), ("builtins", "frozenset"), ("builtins", "set")}


class Pausable:
    """An engine whose first `done` stages are over. All that it is goes into its bytes but the scenario, whose stages to come may differ."""

    check: Callable[[], None]
    done: int = 0  # stages that are over

    _left_out: ClassVar = ("scenario", "check")

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in self._left_out}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, check=lambda: None)

    def freeze(self) -> bytes:
        """The engine between two stages, so that `thaw` gives one that goes on with the same bits."""
        return pickle.dumps(self, protocol=5)


class _Reader(pickle.Unpickler):
    """Reads arrays and the classes of this program; nothing that a strange file might want to call."""

    def find_class(self, module: str, name: str) -> Any:
        # The name must be that of a class made there: a module hands out what it imports, too, also by a name with dots.
        if module.startswith(OWN) and name.isidentifier():
            found = super().find_class(module, name)
            if isinstance(found, type) and found.__module__ == module:
                return found
        elif (module.split(".")[0] == "numpy" and name in FROM_NUMPY) or (module, name) in FROM_ELSEWHERE:
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name} does not belong to the state of an engine")


def thaw(data: bytes, scenario: Any) -> Any:
    """The engine that `data` (of `freeze`) holds, to go on with `scenario`. ResultsError if they hold none."""
    try:
        engine = _Reader(io.BytesIO(data)).load()
    except Exception as error:  # whatever a damaged file makes of itself
        raise ResultsError(f"the state of the preparation cannot be read ({error})") from error
    if not isinstance(engine, Pausable):
        raise ResultsError("the state of the preparation is none of an engine")
    vars(engine)["scenario"] = scenario
    return engine
