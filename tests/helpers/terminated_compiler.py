"""A command that gets a SIGTERM as LLVM tells that it has compiled: DIRECTORY."""

import os
import signal
import sys
import time

import numba
from numba.core.codegen import JITCodeLibrary

told = JITCodeLibrary._object_compiled_hook


def terminate(module, buffer):
    """Takes the place of a callback of LLVM; Python drops what is raised in it."""
    if module.name.startswith("terminated"):
        print("compiled", flush=True)
        os.kill(os.getpid(), signal.SIGTERM)
    told(module, buffer)


JITCodeLibrary._object_compiled_hook = staticmethod(terminate)  # before numba starts its compiler


def terminated(x):
    return x + 1


def compile_terminated(scenario):
    """Takes the place of the engine's prepare()."""
    numba.njit(terminated)(1)
    time.sleep(60.0)


if __name__ == "__main__":
    from tetra_drake.cli import main
    from tetra_drake.engines.lanes.batch import ENGINE

    ENGINE.prepare = compile_terminated
    sys.exit(main(["simulate", "--engine", "compiled", "--out", sys.argv[1]]))
