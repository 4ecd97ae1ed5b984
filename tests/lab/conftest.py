"""What tests of the laboratory share with the engines' and the pages'."""

from tests.engines.conftest import engine as engine
from tests.visualization.conftest import browser as browser
from tests.visualization.conftest import meshcat as meshcat
