"""Bars on a terminal, plain lines in a log: what all that is shown of a run or a sweep while it goes on has in common. All of it on stderr."""

from __future__ import annotations

import sys
from abc import ABC, abstractmethod
from typing import Any, Self


class Bars(ABC):
    """A context manager. verbosity -1: silent. `bar` is rich's display while it is open on a terminal, else None."""

    def __init__(self, verbosity: int = 0) -> None:
        self.silent = verbosity < 0
        self.bar: Any = None

    @abstractmethod
    def make(self, console: Any) -> Any:
        """The display, not started yet."""

    def __enter__(self) -> Self:
        if not self.silent and sys.stderr.isatty():
            from rich.console import Console

            self.bar = self.make(Console(stderr=True))
            self.bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar:
            self.bar.stop()

    def say(self, text: str) -> None:
        """A line for the reader, above the bars if there are any."""
        if self.silent:
            return
        if self.bar:
            self.bar.console.print(text, markup=False, highlight=False)
        else:
            print(text, file=sys.stderr, flush=True)
