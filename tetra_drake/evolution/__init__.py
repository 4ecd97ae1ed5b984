"""Evolving gaits.

trials: the loop over optimisers and evaluations, of all trials of a run
evaluation, draws: from a vector to its fitness, by simulation; evaluators, cluster: many at once
manifest, entries, json_lines, run_record: a run on disk, and how it is resumed
run: `load_run`, a recorded run as pandas tables; source: its gaits for other commands
reevaluation: best gaits on the Drake diagram; progress: what is shown meanwhile
"""
