"""LeafSystems of the diagram: ports, state and events. The laws are in `laws`."""

from tetra_drake.robot.structure import AddFrame
from tetra_drake.systems.attachment import Attach
from tetra_drake.systems.cable_network import AddCables, Cable, CableNetwork
from tetra_drake.systems.feedback import Feedback
from tetra_drake.systems.ground_contact import AddGroundContact, GroundContact
from tetra_drake.systems.matsuoka_cpg import MatsuokaCpg
from tetra_drake.systems.sampled_controller import HeldSignals, SampledController
from tetra_drake.systems.start_up_gate import StartUpGate
from tetra_drake.systems.state_forces import StateForces
from tetra_drake.systems.steering import Steering

__all__ = [
    "AddCables",
    "AddFrame",
    "AddGroundContact",
    "Attach",
    "Cable",
    "CableNetwork",
    "Feedback",
    "GroundContact",
    "HeldSignals",
    "MatsuokaCpg",
    "SampledController",
    "StartUpGate",
    "StateForces",
    "Steering",
]
