"""Tutorials with fewer gaits and shorter motion."""

import re

NUMBERS = {
    r'(?<="evolution.trials": )4': "2",
    r'(?<="evolution.evaluations": )\d+': "26",
    r'(?<="popsize": )16': "8",
    r'(?<="simulation.duration": ")[58](?= s")': "2.5",
    r"(?<=AdvanceTo\()[\d.]+(?=\))": "1.0",
    r"(?<=whole_cables)$": "[:3]",
    r"(?<=samples=)64": "8",
    r"(?<=DEPTH, PERIOD = )6": "3",
    r"(?<=\(0\.0, )4\.0": "0.2",
    r"(?<=True, )200_000": "5_000",
}
"""Numbers of gaits, robots and samples and durations (s) of tutorials, and what stands in their
place."""


def shortened(source: str) -> str:
    """The source of a tutorial, or of a cell, with less work of the same kind."""
    for pattern, number in NUMBERS.items():
        source = re.sub(pattern, number, source, flags=re.MULTILINE)
    return source
