"""Keys that join several scenario keys by commas."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from tetra_drake.errors import InputError
from tetra_drake.settings.quantities import Value


def separate(joined: str) -> list[str]:
    """Splits a key that joins scenario keys by commas: "cpg.gain, robot.density" gives two keys."""
    return [key.strip() for key in joined.split(",")]


def different_keys(by_joined: Mapping[str, Value], *, source: str = "") -> Mapping[str, Value]:
    """Checks a mapping whose keys may each name several scenario keys, such as "a.b, c.d", and
    returns it. Raises InputError, naming `source`, if a scenario key occurs twice."""
    counts = Counter(key for joined in by_joined for key in separate(joined))
    for key, count in counts.items():
        if count > 1:
            raise InputError(source, key, "is given twice")
    return by_joined
