"""What one process is asked to do in a sweep, and what it answers: plain data, so that it goes through a pipe and over a network."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, Self

# done; failed: the run itself, so that it would fail again; refused: the scenario cannot be run; hindered: by the machine; full: no room on the
# disk; lost: the process came to an end without a word; stopped: by the user; strange: another program version; absent: the worker does not
# see the sweep's folder.
End = Literal["done", "failed", "refused", "hindered", "full", "lost", "stopped", "strange", "absent"]


@dataclass(frozen=True)
class Task:
    """A member of a sweep, or a preparation: the first `stages` of one.

    text, origin, folder, overrides: of the scenario, as `parse_scenario` takes them. hash: of the scenario, as it was planned.
    target: result file. state: where a preparation leaves its engine. prepared: result file and engine of the preparation that it goes
    on from, whose stages are the first `begin`. program: what runs it must be this.
    """

    key: str
    text: str
    origin: str
    folder: str
    overrides: tuple[str, ...]
    hash: str
    target: str
    program: str
    stages: int | None = None
    state: str = ""
    prepared: tuple[str, str] | None = None
    begin: int = 0

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, line: str) -> Self:
        raw = json.loads(line)
        raw["overrides"] = tuple(raw["overrides"])
        raw["prepared"] = tuple(raw["prepared"]) if raw["prepared"] else None
        return cls(**raw)


@dataclass(frozen=True)
class Answer:
    """How a task ended. reason: one line, where it is not done. seconds: wall time.

    content: files by name, from a worker that does not see ours.
    """

    end: End
    reason: str = ""
    seconds: float = 0.0
    content: dict[str, bytes] = field(default_factory=dict, repr=False)

    def to_json(self) -> str:
        return json.dumps({"end": self.end, "reason": self.reason, "seconds": self.seconds})

    @classmethod
    def from_raw(cls, raw: dict[str, Any]) -> Self:
        return cls(raw["end"], raw["reason"], raw["seconds"])
