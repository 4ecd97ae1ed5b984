"""Studies of robots, gaits and runs, each with its table, text and figure."""
