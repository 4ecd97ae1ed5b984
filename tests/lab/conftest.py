"""What tests of the laboratory share with those of engines, evolution and pages."""

from tests.engines.conftest import engine as engine
from tests.evolution.conftest import tasks as tasks
from tests.visualization.conftest import browser as browser
from tests.visualization.conftest import meshcat as meshcat
