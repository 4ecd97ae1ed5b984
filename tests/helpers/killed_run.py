"""A small run to be killed, on a cheap fitness: killed_run.py DIRECTORY EXECUTOR DELAY.

The executor is processes or threads.
"""

import signal
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from helpers.analytic import DrawnBowl, drawn_scenario
from tetra_drake.evolution.evaluators import WorkerProcesses, on_executor
from tetra_drake.evolution.manifest import MANIFEST, RunRecord
from tetra_drake.evolution.trials import open_trials, run_trials
from tetra_drake.interrupts import heeding_interrupts

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in jobs of a script
    directory = Path(sys.argv[1])
    if (directory / MANIFEST).exists():
        opened = RunRecord.resume(directory)
    else:
        opened = RunRecord.create(directory, scenario=drawn_scenario(iterations=100), seed=9)
    make = WorkerProcesses if sys.argv[2] == "processes" else ThreadPoolExecutor
    evaluator = on_executor(DrawnBowl(delay=float(sys.argv[3])), make, 2)
    with heeding_interrupts(), opened as record, evaluator as submit:
        print("begun", flush=True)
        run_trials(open_trials(record), submit)
