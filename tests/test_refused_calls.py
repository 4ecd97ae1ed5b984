"""Arguments of Python functions that are refused, with their names and what was found.

A refused call leaves no file.
"""

from pathlib import Path

import pytest
import yaml
from helpers import refused as refused_calls

ROWS = yaml.safe_load(Path(__file__).with_name("refused_calls.yaml").read_text("utf-8"))


@pytest.mark.parametrize(("call", "source", "key", "words"), [(*row[:3], row[3:]) for row in ROWS])
def test_of_a_call(call, source, key, words, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    with refused(source, key, *words):
        eval(call, dict(vars(refused_calls)))
    assert not list(tmp_path.iterdir())
