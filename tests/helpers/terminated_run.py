"""The command evolve on a cheap fitness: terminated_run.py ARGUMENTS."""

import sys

from helpers.analytic import Bowl
from tetra_drake.evolution.evaluators import InProcesses

if __name__ == "__main__":
    import tetra_drake.experiment
    from tetra_drake.cli import main

    tetra_drake.experiment.evaluator_of = lambda *_, **__: InProcesses(Bowl(delay=0.2), 2)
    sys.exit(main(["evolve", *sys.argv[1:]]))
