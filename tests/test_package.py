"""Files about the package: one version everywhere, and a README that a package index can show."""

import importlib
import json
import re
from pathlib import Path

import pytest
import yaml

import tetra_drake

CHECKOUT = Path(__file__).parents[1]


def read(name):
    return (CHECKOUT / name).read_text(encoding="utf-8")


CITATION, ZENODO = yaml.safe_load(read("CITATION.cff")), json.loads(read(".zenodo.json"))


def test_the_version_is_the_same_everywhere():
    released = re.search(r"^## (\d\S*)(?: \((\S+)\))?$", read("CHANGELOG.md"), re.M)
    (cited,) = re.findall(r"note = \{Version (\S+)\}", read("README.md"))
    versions = {released[1], cited, CITATION["version"], ZENODO["version"]}
    assert versions == {tetra_drake.__version__}
    assert released[2] == str(CITATION["date-released"])


def test_the_places_that_cite_the_package_agree():
    package = re.search(r"^keywords = (\[.*\])$", read("pyproject.toml"), re.M)
    assert CITATION["keywords"] == ZENODO["keywords"] == json.loads(package[1])
    assert CITATION["title"] == ZENODO["title"]
    assert CITATION["license"] == ZENODO["license"] == "BSD-3-Clause"
    assert " ".join(CITATION["abstract"].split()) == ZENODO["description"]
    names = [author["name"] for author in CITATION["authors"]]
    assert names == [creator["name"] for creator in ZENODO["creators"]]


def test_the_new_names_of_the_upgrading_page_exist():
    new = re.findall(r" now (.*?)(?:, `|$)", read("diagrams/site/upgrading.md"), re.M)
    names = re.findall(r"`(tetra_drake\.[\w.]+)", "\n".join(new))
    assert len(names) >= 6
    for name in names:
        importlib.import_module(name)


@pytest.fixture
def readme(monkeypatch):
    """The module package_readme, away from GitHub's workflows."""
    pytest.importorskip("hatchling")
    monkeypatch.syspath_prepend(str(CHECKOUT / "diagrams/site"))
    monkeypatch.delenv("GITHUB_REPOSITORY", raising=False)
    import package_readme

    return package_readme


def targets(text):
    found = re.findall(r'(?:\]\(|src=")([^)"]+)', text)
    return [target for target in found if not target.startswith("#")]


def test_links_and_pictures_survive_on_an_index_of_packages(readme):
    address = "https://code.example/someone/tetra_drake"
    text = readme.for_index(read("README.md"), address, "1.2.3")
    assert all(target.startswith("https://") for target in targets(text))
    assert f'<img src="{address}/raw/v1.2.3/runs/champion/walking.gif" width="380" alt="' in text
    assert f"]({address}/blob/v1.2.3/tetra_drake/scenario/KEYS.md#metrics)" in text
    assert len(targets(text)) == len(targets(read("README.md")))
