"""Pages and texts: reports of runs, replays, tables for the terminal."""
