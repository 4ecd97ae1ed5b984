"""Changes after which a scenario is simulated, and evolved, in a moment."""

BRIEF = {
    "engine": "!Compiled",
    "simulation.duration": "0.3 s",
    "simulation.steady_from": "0.1 s",
    "evolution.trials": 1,
    "evolution.evaluations": 6,
    "optimizer": {"population": 4, "tournament": 2},
}
