"""Parts of the robot simulated alone, as the thesis does to show its models."""
