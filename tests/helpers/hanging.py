"""A point mass that hangs on two cables without free length, from a bar that the world holds."""

from __future__ import annotations

from typing import Any

MASS, STIFFNESS = 0.05, 40.0
HANGING: dict[str, Any] = {
    "nodes": {"a": [0.0, 0.0, 1.0], "b": [0.2, 0.0, 1.0], "p": [0.1, 0.0, 0.8]},
    "struts": {
        "bar": {
            "pairs": [["a", "b"]],
            "diameter": 0.008,
            "density": 1200.0,
            "node_diameter": 0.0,
            "contact_radius": 0.0,
        }
    },
    "cables": {
        "line": {"pairs": [["a", "p"], ["b", "p"]], "stiffness": STIFFNESS, "damping": 0.0}
        | {"free_length": 0.0}
    },
    "masses": {"p": MASS},
    "anchors": {"a": "xyz", "b": "xyz"},
    "anchor_stiffness": 1e7,
}
