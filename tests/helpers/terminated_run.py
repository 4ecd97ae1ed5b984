"""The command evolve on a cheap fitness: terminated_run.py ARGUMENTS."""

import sys

from helpers.analytic import Bowl

if __name__ == "__main__":
    import tetra_drake.experiment
    from tetra_drake.cli import main

    tetra_drake.experiment.GaitEvaluation = lambda *_: Bowl(delay=0.2)
    sys.exit(main(["evolve", *sys.argv[1:]]))
