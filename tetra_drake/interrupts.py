"""Interrupts: Ctrl-C and SIGTERM always end a command, even in the middle of a library."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator

_AGAIN = 0.1
"""Time (s) after which a lost interrupt is raised again."""


class Interrupt(KeyboardInterrupt):
    """Exception for Ctrl-C or SIGTERM in a block of heeding_interrupts(). Python drops an exception
    that is raised in a destructor or in a callback of a library, such as the compiler. A dropped
    interrupt is raised again shortly after."""

    heeded = True
    """False in a block of heeding_interrupts(): a dropped interrupt must be raised again."""

    def __del__(self) -> None:
        if not Interrupt.heeded:
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)


@contextlib.contextmanager
def heeding_interrupts() -> Iterator[None]:
    """Context manager: Ctrl-C and SIGTERM certainly end the block, by a KeyboardInterrupt. Outside
    the main thread it does nothing, because only the main thread receives signals."""
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread receives signals
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
