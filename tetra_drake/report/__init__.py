"""Pages: the report of a run, and replays of results, gaits and runs."""
