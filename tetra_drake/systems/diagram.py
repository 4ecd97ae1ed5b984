"""Drake diagram of a robot, after the thesis's Simulink model (appendix C)."""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from types import NoneType

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Meshcat, SceneGraph
from pydrake.lcm import DrakeLcmParams
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import (
    Context,
    Diagram,
    DiagramBuilder,
    InputPort,
    OutputPort,
    System,
)
from pydrake.systems.lcm import ApplyLcmBusConfig
from pydrake.systems.primitives import ConstantVectorSource, PassThrough, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from tetra_drake.errors import InputError, check_type
from tetra_drake.laws.matsuoka import Matsuoka
from tetra_drake.laws.oscillator import Oscillators
from tetra_drake.robot.gait import Gait, SteeringSignal
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import signal_samples
from tetra_drake.robot.structure import AddBodies, AddNodes, node_positions
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.systems.attachment import Attach
from tetra_drake.systems.cable_network import AddNetwork, CableNetwork
from tetra_drake.systems.feedback import Feedback
from tetra_drake.systems.ground_contact import AddGroundContact
from tetra_drake.systems.matsuoka_cpg import MatsuokaCpg
from tetra_drake.systems.oscillator_cpg import OscillatorCpg
from tetra_drake.systems.start_up_gate import StartUpGate
from tetra_drake.systems.steering import Steering

_OUTPUTS = ["drives", "state", "signals", "tensions", "lengths"]
_OUTPUTS += ["normal_forces", "friction_forces", "contact_forces", "modes"]
"""Output ports of a robot's diagram, as far as its systems have them."""


def MakeTensegrityDiagram(
    robot: Robot,
    gait: Gait | None = None,
    *,
    steering: SteeringSignal | None = None,
    controller: System | None = None,
    ground: System | None = None,
    scene_graph: bool = False,
    meshcat: Meshcat | None = None,
    parameters: bool = False,
    modes: npt.ArrayLike | None = None,
) -> Diagram:
    """Diagram of a robot that walks with a gait. Its default context is at the start of the walk.
    Drake's own Simulator(diagram) and larger diagrams lack the velocities of the start: see
    MakeSimulator() and SetStart().

    The robot may also be driven by a controller, or by signals from outside: without `gait` and
    `controller`, the diagram has an input port `signals`.

        steering ──→ cpg ──→ start_up ─┬─→ cables ──┬──→ forces ──→ plant ──┬──→ state
                      ↑                │      ↑     │                       │
                      │                │      │   ground                    │
                      │                ↓      │    │ ↑                      │
                      └───────────── feedback ←────┘ │                      │
                                       ↑      │      │                      │
                                       └──────┴──────┴──────────────────────┘

        cables_actuators ←──→ cables, and ──→ feedback

        state_forces ──→ forces

    Subsystems:

    - cpg: only with a gait. With `cpg.signals: live` in the scenario, it is the network, integrated
      with the robot (a live network): a MatsuokaCpg, or an OscillatorCpg for other kinds.
      Otherwise it is the network's signals, computed beforehand. A robot without oscillators has no
      cpg.
    - steering: only for a live network with oscillators on the left or right
    - feedback: only if the scenario's `cpg.feedback` is not empty
    - cables_actuators: only if the kind of actuators has states, as winches have
    - state_forces: only if struts touch, or nodes of bodies are held, joined or loaded
    - controller: in place of cpg and start_up, a system with the output port `signals`, and any
      others. Its input ports `state` and those named like an output port of cables or ground, such
      as `lengths`, `rates`, `tensions` and `normal_forces`, are connected to these. All others are
      input ports of the diagram. See SampledController and robot.command.controlled_robot().
    - ground: a GroundContact; or the system given as `ground`, with the input port `state` (13*n,)
      and the output port `generalized_force` (6*n,) of the n bodies, as GroundContact has them, and
      whichever of its other ports
    - scene_graph: with `scene_graph` or `meshcat`; it has struts, spheres and cables. During a
      simulation it is shown in `meshcat`, where bodies can be dragged with the mouse while Ctrl is
      held, if Drake has MeshcatMouseSpring; pages and films are made from trajectories.

    `steering`, a turn (-1 to 1) or a function from the time (s) to it, replaces the gait's turn.

    Input ports of the diagram: turn of steering; signals (m,) in N without gait and
    controller, one for each of the structure's m `oscillators`; ports of the controller. Output
    ports, with their subsystems in parentheses: state (plant), signals (start_up, controller or
    signals), drives (cables_actuators), tensions and lengths (cables), normal_forces,
    friction_forces, contact_forces and modes (ground), query_object (scene_graph). The classes
    Steering, CableNetwork and GroundContact have their shapes and units.

    With `parameters`, one diagram serves many robots that differ in constants of cables and ground,
    which are parameters of the context then; see CableNetwork.SetLaw() and
    GroundContact.SetGround():

    >>> cables, context = diagram.GetSubsystemByName("cables"), diagram.CreateDefaultContext()
    >>> own = cables.GetMyMutableContextFromRoot(context)
    >>> law = cables.GetLaw(own)
    >>> cables.SetLaw(own, law._replace(stiffness=1.1 * law.stiffness))

    With `modes`, such as robot.starting_modes, contacts keep these modes. The diagram then has no
    discrete state, as Drake's Linearize and DirectCollocation need it. So it is right near a state
    only: a node that sticks there keeps its friction where it lifts off.

    Raises InputError if the scenario has events, or a policy beside a gait; if a gait is not of
    this robot, a port of the controller or of the ground is missing or has another size, or
    `ground` is given with `modes`.
    """
    source = "MakeTensegrityDiagram"
    check_type(source, "robot", robot, Robot)
    check_type(source, "gait", gait, Gait, NoneType)
    check_type(source, "controller", controller, System, NoneType)
    check_type(source, "ground", ground, System, NoneType)
    check_type(source, "scene_graph", scene_graph, bool)
    check_type(source, "meshcat", meshcat, Meshcat, NoneType)
    scenario, structure = robot.scenario, robot.structure
    if scenario.events:
        raise InputError(scenario.name, "events", "found some; only td.simulate() knows them")
    if scenario.policy is not None and gait is not None:
        problem = "found one beside a gait; give a SampledController of it in place of the gait"
        raise InputError(scenario.name, "policy", problem)
    builder = DiagramBuilder()

    if scene_graph or meshcat is not None:
        plant, scene = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    else:
        plant, scene = builder.AddNamedSystem("plant", MultibodyPlant(time_step=0.0)), None
    nodes = AddNodes(plant, structure, AddBodies(plant, structure))
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -scenario.robot.gravity])
    plant.Finalize()
    if scene is not None and meshcat is not None:
        _ShowInMeshcat(builder, plant, scene, meshcat)
    plant.SetDefaultPositions(structure.initial_state[: plant.num_positions()])

    if controller is None:
        signals = _AddSignals(builder, robot, gait, steering)
    cables = CableNetwork(
        robot.model,
        names=structure.cable_names,
        signals=structure.signals,
        parameters=parameters,
    )
    AddNetwork(builder, plant, cables, drives=robot.starting_drives())
    if scene is not None and cables.pieces:
        from tetra_drake.systems.cable_geometry import AddCableGeometry

        ends = node_positions(structure, structure.initial_state)[robot.model.cables.pieces]
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).tolist()
        AddCableGeometry(builder, scene, cables, dict(zip(cables.pieces, lengths, strict=True)))
    if ground is None:
        ground = AddGroundContact(
            builder,
            plant,
            frames=[nodes[node] for node in structure.contacts],
            ground=robot.ground,
            radius=robot.ground.radius.tolist(),
            witness=isinstance(scenario.engine, Drake)
            and scenario.engine.mode_changes == "witness",
            parameters=parameters,
            modes=modes,
        )
    else:
        _AddGround(builder, plant, ground, robot, has_modes=modes is not None)
    model = robot.model
    held = model.anchors.nodes.size or model.joints.node_a.size or model.loads.nodes.size
    if model.strut_contact.acts or held:
        from tetra_drake.systems.state_forces import StateForces  # the thesis's robot has none

        Attach(builder, plant, builder.AddNamedSystem("state_forces", StateForces(robot)))

    ports = {"state": plant.get_state_output_port()}
    for system in (cables, ground):
        given = map(system.get_output_port, range(system.num_output_ports()))
        ports = {port.get_name(): port for port in given} | ports
    if controller is not None:
        signals = _AddController(builder, controller, ports, size=structure.signals)
    ports["signals"] = signals
    if structure.signals:
        builder.Connect(signals, cables.GetInputPort("signals"))
    if builder.HasSubsystemNamed("cables_actuators"):
        ports["drives"] = builder.GetSubsystemByName("cables_actuators").get_output_port()
    if builder.HasSubsystemNamed("cpg") and scenario.cpg.feedback:
        assert gait is not None
        feedback = Feedback(robot, gains=robot.oscillators(gait).gains)
        _ConnectInputs(builder, builder.AddNamedSystem("feedback", feedback), ports)
        cpg = builder.GetSubsystemByName("cpg")
        builder.Connect(feedback.get_output_port(), cpg.GetInputPort("feedback"))

    for name in _OUTPUTS:
        if name in ports:
            builder.ExportOutput(ports[name], name)
    if scene is not None:
        builder.ExportOutput(scene.get_query_output_port(), "query_object")
    diagram = builder.Build()
    diagram.set_name("tensegrity_robot")
    if structure.v_WB is not None:
        own = weakref.ref(diagram)
        diagram.CreateDefaultContext = lambda: SetStart(
            own(), Diagram.CreateDefaultContext(own()), robot
        )
    return diagram


def SetStart(diagram: Diagram, context: Context, robot: Robot) -> Context:
    """Sets the velocities of a robot's start in a context of its diagram, and returns it."""
    plant = diagram.GetSubsystemByName("plant")
    velocities = robot.structure.initial_state[plant.num_positions() :]
    plant.SetVelocities(plant.GetMyMutableContextFromRoot(context), velocities)
    return context


def _ShowInMeshcat(
    builder: DiagramBuilder, plant: MultibodyPlant, scene: SceneGraph, meshcat: Meshcat
) -> None:
    """Shows a finalized plant in Meshcat, and lets users drag its bodies where Drake can do so."""
    from pydrake.visualization import (  # loads matplotlib
        ApplyVisualizationConfig,
        VisualizationConfig,
    )

    config = VisualizationConfig(
        publish_proximity=False, publish_contacts=False, publish_inertia=False
    )
    # Drake would also send all poses to viewers on the network.
    buses = ApplyLcmBusConfig({config.lcm_bus: DrakeLcmParams(lcm_url="memq://null")}, builder)
    ApplyVisualizationConfig(
        config, builder, lcm_buses=buses, plant=plant, scene_graph=scene, meshcat=meshcat
    )


def _AddGround(
    builder: DiagramBuilder, plant: MultibodyPlant, ground: System, robot: Robot, *, has_modes: bool
) -> None:
    """Adds a user's system `ground` to the diagram. Raises InputError if a port is missing or has
    another size, or the diagram needs what only a GroundContact has."""
    source, bodies = "MakeTensegrityDiagram", len(robot.structure.bodies)
    if has_modes:
        raise InputError(source, "modes", "found some, but `ground` has no modes to hold")
    if not ground.HasInputPort("state") or not ground.HasOutputPort("generalized_force"):
        problem = "expected an input port 'state' and an output port 'generalized_force'"
        raise InputError(source, "ground", problem)
    if robot.scenario.cpg.feedback and not ground.HasOutputPort("mode_table"):
        raise InputError(source, "ground", "`cpg.feedback` needs an output port 'mode_table'")
    _check_size(ground.GetInputPort("state"), 13 * bodies, key="ground")
    _check_size(ground.GetOutputPort("generalized_force"), 6 * bodies, key="ground")
    Attach(builder, plant, builder.AddNamedSystem("ground", ground))


def _AddController(
    builder: DiagramBuilder, controller: System, ports: Mapping[str, OutputPort], *, size: int
) -> OutputPort:
    """Adds `controller` to the diagram and connects its inputs. Returns its output port `signals`,
    which must have `size` numbers. Raises InputError for a port of another size."""
    if not controller.HasOutputPort("signals"):
        own = map(controller.get_output_port, range(controller.num_output_ports()))
        found = ", ".join(port.get_name() for port in own) or "no output ports"
        problem = f"found {found}, expected an output port 'signals' of size {size}"
        raise InputError("MakeTensegrityDiagram", "controller", problem)
    signals = controller.GetOutputPort("signals")
    _check_size(signals, size)
    _ConnectInputs(builder, builder.AddNamedSystem("controller", controller), ports)
    return signals


def _ConnectInputs(
    builder: DiagramBuilder, system: System, ports: Mapping[str, OutputPort]
) -> None:
    """Connects the input ports of a system to the `ports` of the same names; all others become
    input ports of the diagram. Raises InputError for a port of another size."""
    for port in map(system.get_input_port, range(system.num_input_ports())):
        name = port.get_name()
        if name in ports:
            _check_size(port, ports[name].size())
            builder.Connect(ports[name], port)
        else:
            builder.ExportInput(port, name)


def _check_size(port: InputPort | OutputPort, size: int, *, key: str = "controller") -> None:
    if port.size() != size:
        problem = f"found size {port.size()} of port '{port.get_name()}', expected {size}"
        raise InputError("MakeTensegrityDiagram", key, problem)


def _AddSignals(
    builder: DiagramBuilder, robot: Robot, gait: Gait | None, steering: SteeringSignal | None
) -> OutputPort:
    """Adds the systems `cpg` and `start_up` to the diagram. Returns the output port of `start_up`,
    with the signals (m,) of the cables. Without a gait, there is a system `signals` in their place,
    which passes on the diagram's input port of this name.

    `cpg` is a live network, integrated with the robot, with a system `steering`; or it is a source
    of signals that were computed beforehand. `steering`, a function from the time (s) to the turn,
    replaces the gait's turn.
    """
    cpg, size = robot.scenario.cpg, robot.structure.signals
    if not size:
        none = builder.AddNamedSystem("start_up", ConstantVectorSource(np.zeros(0)))
        return none.get_output_port()
    if gait is None:
        passed = builder.AddNamedSystem("signals", PassThrough(size))
        builder.ExportInput(passed.get_input_port(), "signals")
        return passed.get_output_port()
    if cpg.signals == "live":
        robot.turns(gait, steering)  # raises InputError for a wrong turn
        made = _MakeCpg(robot.oscillators(gait), tonic=np.full(2 * size, cpg.tonic), gain=cpg.gain)
        oscillators = builder.AddNamedSystem("cpg", made)
        if robot.structure.sides.any():
            turn = gait.turn if steering is None else steering
            steers = builder.AddNamedSystem("steering", Steering(robot.tonic_input, turn=turn))
            builder.Connect(steers.get_output_port(), oscillators.GetInputPort("tonic"))
            builder.ExportInput(steers.GetInputPort("turn"), "turn")
    else:
        source = MakeSignalSource(signal_samples(robot, gait, steering), step=cpg.listing_step)
        oscillators = builder.AddNamedSystem("cpg", source)
    start_up = builder.AddNamedSystem("start_up", StartUpGate(size, start_up=cpg.start_up))
    builder.Connect(oscillators.get_output_port(0), start_up.get_input_port())
    return start_up.get_output_port()


def MakeSignalSource(samples: np.ndarray, *, step: float) -> Diagram:
    """Source of signals that are known beforehand, such as the signals of a command. Its output
    port `signals` (m,) in N is linear between the `samples` (k, m) at multiples of `step` (s), and
    holds the last ones."""
    bends = 1 + np.flatnonzero(np.diff(samples, 2, axis=0).any(axis=1))
    kept = np.array([0, *bends, len(samples) - 1])  # a command holds its signals for many steps
    signals = PiecewisePolynomial.FirstOrderHold(step * kept, samples[kept].T)
    builder, source = DiagramBuilder(), TrajectorySource(signals)
    builder.ExportOutput(builder.AddSystem(source).get_output_port(), "signals")
    return builder.Build()


def _MakeCpg(network: Oscillators, *, tonic: np.ndarray, gain: float) -> OscillatorCpg:
    """LeafSystem of oscillators of any kind. Matsuoka's have a port of their neurons, too."""
    if network.own is not Matsuoka.own:
        return OscillatorCpg(network, tonic=tonic, gain=gain)
    return MatsuokaCpg(network.constants, tonic=tonic, initial_state=network.start, gain=gain)
