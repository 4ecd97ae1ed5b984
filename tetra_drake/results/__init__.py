"""Results of one simulation: metrics and trajectory."""
