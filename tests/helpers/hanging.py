"""A point mass that hangs on two cables without free length, from a bar that the world holds."""

from __future__ import annotations

from typing import Any

from helpers.anchored import BAR, LINE

MASS, STIFFNESS = 0.05, 40.0
HANGING: dict[str, Any] = {
    "nodes": {"a": [0.0, 0.0, 1.0], "b": [0.2, 0.0, 1.0], "p": [0.1, 0.0, 0.8]},
    "struts": {"bar": BAR},
    "cables": {
        "line": LINE
        | {"pairs": [["a", "p"], ["b", "p"]], "stiffness": STIFFNESS, "free_length": 0.0}
    },
    "masses": {"p": MASS},
    "anchors": {"a": "xyz", "b": "xyz"},
    "anchor_stiffness": 1e7,
}
