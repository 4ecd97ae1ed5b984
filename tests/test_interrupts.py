"""Interrupts that Python drops."""

import signal

import pytest

from tetra_drake.interrupts import heeding_interrupts


class Loud:
    """An object during whose destruction a signal arrives."""

    def __del__(self):
        signal.raise_signal(signal.SIGTERM)


@pytest.mark.parametrize("lost", [True, False])
def test_a_block_ends_by_a_signal_also_if_its_exception_is_lost(lost):
    before = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGALRM)
    with pytest.raises(KeyboardInterrupt), heeding_interrupts():
        if lost:
            Loud()
        else:
            signal.raise_signal(signal.SIGTERM)
        signal.pause()
    assert (signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGALRM)) == before
    assert signal.setitimer(signal.ITIMER_REAL, 0.0) == (0.0, 0.0)
