"""Names of the LeafSystems, with their modules: for type checkers, and for __getattr__()."""

# ruff: noqa: I001
from tetra_drake.systems.steering import Steering as Steering
from tetra_drake.systems.matsuoka_cpg import MatsuokaCpg as MatsuokaCpg
from tetra_drake.systems.oscillator_cpg import OscillatorCpg as OscillatorCpg
from tetra_drake.systems.start_up_gate import StartUpGate as StartUpGate
from tetra_drake.systems.cable_network import CableNetwork as CableNetwork
from tetra_drake.systems.ground_contact import GroundContact as GroundContact
from tetra_drake.systems.state_forces import StateForces as StateForces
from tetra_drake.systems.feedback import Feedback as Feedback
from tetra_drake.systems.sampled_controller import SampledController as SampledController
from tetra_drake.systems.cable_network import Cable as Cable
from tetra_drake.systems.cable_network import AddCables as AddCables
from tetra_drake.systems.ground_contact import AddGroundContact as AddGroundContact
from tetra_drake.systems.attachment import Attach as Attach
from tetra_drake.robot.structure import AddFrame as AddFrame
