"""Evolving gaits.

trials                      the loop over all trials of a run: ask, evaluate, tell, record
evaluation, draws           the fitness of one vector, by simulation
evaluators, cluster         many evaluations at once: lanes, processes, Dask
manifest, run_record        a run on disk: its definition, its lock, how it is resumed
entries                     the files of a record: lines and their checksums
run                         `load_run`: a recorded run as pandas tables
source                      the gaits of a run or of a file, for other commands
reevaluation                the best gaits, evaluated again on the Drake diagram
progress                    bars and lines that show how far a run is
"""
