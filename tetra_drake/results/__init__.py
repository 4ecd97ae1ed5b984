"""What one simulation gives: metrics, trajectory, result folder."""
