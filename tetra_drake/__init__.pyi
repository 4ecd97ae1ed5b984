"""Names of the package, with their modules: for type checkers, and for __getattr__()."""

from tetra_drake.engines.preparation import prepare as prepare
from tetra_drake.engines.simulate import simulate as simulate
from tetra_drake.engines.simulate import simulate_many as simulate_many
from tetra_drake.evolution.run import load_run as load_run
from tetra_drake.experiment import evolve as evolve
from tetra_drake.lab.comparison import compare as compare
from tetra_drake.lab.fit.fit import fit as fit
from tetra_drake.lab.fit.measurements import MotionCapture as MotionCapture
from tetra_drake.lab.fit.measurements import Rest as Rest
from tetra_drake.lab.form import form_find as form_find
from tetra_drake.lab.linearization.linearization import linearize as linearize
from tetra_drake.lab.planner import Planner as Planner
from tetra_drake.lab.predict.predict import predict as predict
from tetra_drake.lab.prototype.export import export as export
from tetra_drake.lab.spread import spread as spread
from tetra_drake.lab.stepping.simulation import Simulation as Simulation
from tetra_drake.lab.stepping.states import States as States
from tetra_drake.lab.study.equilibrium import study_equilibrium as study_equilibrium
from tetra_drake.lab.study.robustness import robustness as robustness
from tetra_drake.lab.study.sweep import sweep as sweep
from tetra_drake.report.result_folder import load_result as load_result
from tetra_drake.robot.command_file import load_command as load_command
from tetra_drake.robot.gait_file import load_gait as load_gait
from tetra_drake.robot.parameter_space import ParameterSpace as ParameterSpace
from tetra_drake.robot.parameter_space import seeded_gait as seeded_gait
from tetra_drake.scenario.load import load_scenario as load_scenario

__version__: str
