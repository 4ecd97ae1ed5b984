"""Examples of every law, for tests that hold for all laws of a sort."""

import numpy as np

from helpers.actuations import ACTUATIONS
from tetra_drake.laws.friction import Coulomb, FrictionKind
from tetra_drake.laws.terrain import Flat, Incline, Nothing, Obstacles, Relief, Rough, Steps
from tetra_drake.scenario.load import load_scenario
from tetra_drake.settings.units import INCH

_READINGS = {"reset": {"reset": "reversal"}, "range": {"reset": "range"}}
_KEPT = {"reset": "never", "breaks_free": "both", "stiffness": "0.3 lbf/in", "load": "0.1 lbf"}
_THESIS = load_scenario("thesis")

RESET: dict[str, FrictionKind] = {
    name: _THESIS.with_changes({"friction": changes}).friction
    for name, changes in {**_READINGS, "kept": _KEPT}.items()
}
COULOMB, FIRM = Coulomb(), Coulomb(static=0.6, kinetic=0.5, stiffness=1000.0, backward=2.0)
FRICTIONS = RESET | {"coulomb": COULOMB, "firm": FIRM}

UNEVEN: dict[str, Relief] = {
    "incline": Incline(slope=np.radians(5.0)),
    # Steps are where the robot meets them at once.
    "steps": Steps(height=-0.25 * INCH, depth=4.0 * INCH, count=4, start=2.0 * INCH),
    "rough": Rough(amplitude=0.1 * INCH, wavelength=6.0 * INCH),
    "obstacles": Obstacles(
        height=0.25 * INCH, radius=1.0 * INCH, spacing=2.5 * INCH, start=14.0 * INCH
    ),
}
TERRAINS = {"flat": Flat(), "nothing": Nothing()} | UNEVEN

EXAMPLES = {"actuation": ACTUATIONS, "friction": FRICTIONS, "terrain": TERRAINS}
"""Examples by the key of a scenario."""
