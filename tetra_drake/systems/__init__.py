"""LeafSystems of the diagram: ports, state and events. The laws are in `laws`.

All names here are public. In the order of the signal flow: Steering, MatsuokaCpg (OscillatorCpg for
other kinds of oscillators), StartUpGate, CableNetwork, GroundContact and StateForces around a
MultibodyPlant, and Feedback back to the network; a SampledController in place of a network.
AddCables, AddGroundContact and Attach add them to any plant; diagram.MakeTensegrityDiagram() wires
a robot.

Diagrams of these systems convert to AutoDiffXd and can be cloned; see `scalar_conversion`.

Each name is imported at its first use; the names and their modules are in `__init__.pyi`.
"""

from __future__ import annotations

from pathlib import Path

from tetra_drake.on_demand import attributes

__all__, __getattr__, __dir__ = attributes(__name__, Path(__file__))
