"""Evolving gaits.

trials          the loop over all trials of a run: ask, evaluate, tell, record
evaluation      the fitness of one vector, by simulation
evaluators      many evaluations at once: lanes, processes, any executor
cluster         executors on a Dask cluster
manifest        a run on disk: its definition, its lock, how it is begun and resumed
entries         the files of a record: lines and their checksums
run             `load_run`: a recorded run as pandas tables; the gaits of a run or of a file
reevaluation    the best gaits, evaluated again on the Drake diagram
progress        bars and lines that show how far a run is
"""
