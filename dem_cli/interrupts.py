"""Ctrl-C and SIGTERM without an exception in the wrong place.

Python raises KeyboardInterrupt wherever it happens to be, and in the middle of handing arrays to or from compiled code
that ends in a crash. So while a run goes on a signal only leaves a mark, and the run asks for it between two calls.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextlib.contextmanager
def marked_interrupts() -> Iterator[Callable[[], None]]:
    """A function that raises KeyboardInterrupt if a signal has come since; handlers are put back at the end.

    Outside the main thread, where Python allows no handlers, signals are left as they are.
    """
    came = False

    def mark(_number: int, _frame: FrameType | None) -> None:
        nonlocal came
        came = True

    def check() -> None:
        if came:
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield check
        return
    before = {number: signal.signal(number, mark) for number in SIGNALS}
    try:
        yield check
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
