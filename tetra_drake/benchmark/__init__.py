"""Benchmark of the engines and their settings: speed, accuracy, and cost by size of the robot."""
