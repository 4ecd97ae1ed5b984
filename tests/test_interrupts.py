"""Interrupts that Python drops."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tetra_drake.interrupts import heeding_interrupts

PROGRAM = Path(__file__).parent / "helpers" / "terminated_compiler.py"


@pytest.mark.slow
def test_a_sigterm_during_compilation_ends_a_command(tmp_path):
    command, given = [sys.executable, PROGRAM, tmp_path / "out"], {"timeout": 40, "text": True}
    given["env"] = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    ended = subprocess.run(command, capture_output=True, **given)
    assert (ended.returncode, ended.stdout) == (130, "compiled\n")
    assert ended.stderr == "\ntetra-drake: interrupted\n"


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
