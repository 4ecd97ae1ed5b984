"""Evolving gaits: operators, the optimiser, the trial loop and its record on disk.

`command` is the outermost layer, `run` the loop; `evaluation` is the only module that
simulates. Read a run's results with `tables.load_run`.
"""
