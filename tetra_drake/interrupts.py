"""Interrupts that are not lost: Ctrl-C and SIGTERM end a command wherever they arrive."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator

_AGAIN = 0.1
"""Time (s) after which an interrupt that was lost is raised again."""


class Interrupt(KeyboardInterrupt):
    """A Ctrl-C or SIGTERM. Python drops what is raised in a destructor or in a callback of a
    library, such as the compiler's as it ends. Then another one follows."""

    heeded = True
    """False while a block of heeding_interrupts() waits for it."""

    def __del__(self) -> None:
        if not Interrupt.heeded:
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)


@contextlib.contextmanager
def heeding_interrupts() -> Iterator[None]:
    """A block that a Ctrl-C or SIGTERM certainly ends, by a KeyboardInterrupt."""
    if threading.current_thread() is not threading.main_thread():
        yield  # signals reach the main thread alone
        return
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)
    handlers = {number: signal.getsignal(number) for number in numbers}
    hook = sys.unraisablehook
    for number, handler in handlers.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
    sys.unraisablehook = lambda lost: None if lost.exc_type is Interrupt else hook(lost)
    Interrupt.heeded = False
    try:
        yield
    finally:
        Interrupt.heeded = True
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        sys.unraisablehook = hook
        for number, handler in handlers.items():
            signal.signal(number, handler)


def _interrupt(*_: object) -> None:
    raise Interrupt
