"""Evolving gaits.

optimizers/ ask for vectors and are told evaluations; evaluation: a vector's, by simulation
executors: many evaluations at once; trials: the loop, fed by the workers
method, record, json_lines: what a run is, on disk; tables: `load_run`, to read it as pandas tables;
reevaluation: best gaits on the Drake diagram; summary, progress: what is printed
"""
