"""The layout: which folder may import which, and what stays out of an import."""

from __future__ import annotations

import ast
import functools
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

import tetra_drake

PACKAGE = Path(tetra_drake.__file__).parent
ROWS = [
    ["errors", "files", "formatting", "interrupts", "machine", "on_demand"],
    ["kernels", "settings", "laws", "scenario", "options", "robot"],
    ["systems", "visualization", "results", "engines"],
    ["optimizers", "evolution", "figures", "report", "experiment"],
    ["command_options", "cli", "lab", "gym"],
]
ORDER = [name for row in ROWS for name in row]
"""A folder, or a module beside the folders, imports only those before it."""


def imports(file: Path) -> set[str]:
    """The modules that a file imports anywhere, as dotted names."""
    modules = set()
    for node in ast.walk(trees()[file]):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            modules |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return modules


@functools.cache
def trees() -> dict[Path, ast.Module]:
    """The package's modules, parsed."""
    return {file: ast.parse(file.read_text(encoding="utf-8")) for file in PACKAGE.rglob("*.py")}


@functools.cache
def modules() -> dict[str, set[str]]:
    """The modules of the package with what they import of it, names below "tetra_drake."."""
    names = {}
    for file in trees():
        parts = file.relative_to(PACKAGE).with_suffix("").parts
        if parts[0] not in ("__init__", "__main__"):
            name = ".".join(part for part in parts if part != "__init__")
            ours = [i for i in imports(file) if "tetra_drake." in i]
            names[name] = {i.removeprefix("tetra_drake.") for i in ours}
    return {name: {i for i in imported if i in names} for name, imported in names.items()}


def test_data_flows_one_way() -> None:
    for name, imported in modules().items():
        place = ORDER.index(name.split(".")[0])
        upward = [other for other in imported if ORDER.index(other.split(".")[0]) > place]
        assert not upward, f"{name} imports {upward}"


def test_a_diagram_loads_the_model_and_a_simulation_nothing_of_the_lab() -> None:
    show = "print(*(name for name in sys.modules if name.startswith('tetra_drake.')))"
    diagram, simulation = "import tetra_drake.systems.diagram", "td.simulate, td.evolve"
    code = "\n".join(["import sys, tetra_drake as td", diagram, show, simulation, show])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    of_diagram, of_simulation = map(str.split, done.stdout.splitlines())
    assert "tetra_drake.systems.diagram" in of_diagram
    assert len(of_diagram) <= 64  # 60 and the empty ones of the folders
    assert "tetra_drake.robot.equilibrium" not in of_diagram
    assert "tetra_drake.engines.simulate" in of_simulation
    assert not [name for name in of_simulation if name.startswith("tetra_drake.lab")]


def test_the_drawing_of_the_house_has_all_folders_in_their_order() -> None:
    drawing = (PACKAGE / "house.svg").read_text(encoding="utf-8")
    drawn = " ".join(re.findall(r'class="name">([^<]+)<', drawing)).split()
    folders = {f"{file.parent.name}/" for file in PACKAGE.glob("*/__init__.py")}
    assert folders <= {*drawn}
    core = [ORDER.index(name.removesuffix(".py").rstrip("/")) for name in drawn if name != "lab/"]
    assert core == sorted(core)


def test_no_modules_import_each_other_in_a_circle() -> None:
    graph = modules()
    settled: set[str] = set()
    while rest := graph.keys() - settled:
        free = {name for name in rest if graph[name] - {name} <= settled}
        assert free, f"a circle among {sorted(rest)}"
        settled |= free


def test_each_class_and_each_alias_of_a_type_has_a_name_of_its_own() -> None:
    names: Counter[str] = Counter()
    for tree in trees().values():
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                names[node.name] += 1
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                target = node.targets[0] if isinstance(node, ast.Assign) else node.target
                names[ast.unparse(target)] += 1
    types = [name for name in names if name[0].isupper() and not name.isupper()]
    assert [name for name in types if names[name] > 1] == []


@pytest.mark.parametrize("folder", ["laws", "engines/lanes"])
def test_neither_the_laws_nor_the_compiled_engine_use_drake(folder: str) -> None:
    for file in (PACKAGE / folder).glob("*.py"):
        for name in imports(file):
            assert not name.startswith(("pydrake", "tetra_drake.systems")), file


HEAVY = {"pydrake", "numba", "scipy", "cma", "ribs", "pandas", "xarray", "matplotlib"}
IMPORTS = {
    "tetra_drake": HEAVY | {"numpy"},
    "tetra_drake.cli": HEAVY | {"numpy", "pydantic"},
    # And so evaluators, which every worker imports.
    "tetra_drake.evolution.trials": HEAVY - {"numba", "scipy"},
    "tetra_drake.experiment": HEAVY - {"pydrake", "numba", "scipy"},
}
"""What each module must not import, from the lightest module to the heaviest."""


@pytest.fixture(scope="module")
def loaded() -> dict[str, set[str]]:
    """What is loaded after each import, in a process that imports one module after the other."""
    lines = [f"import sys, {name}; print(*sys.modules)" for name in IMPORTS]
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True)
    return dict(zip(IMPORTS, map(set, map(str.split, done.stdout.splitlines())), strict=True))


@pytest.mark.parametrize("module", IMPORTS)
def test_an_import_is_light(module: str, loaded: dict[str, set[str]]) -> None:
    assert module in loaded[module]
    assert not IMPORTS[module] & loaded[module]
