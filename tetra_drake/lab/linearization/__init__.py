"""Small motions about a state: Drake's LinearSystem, modes and LQR."""
