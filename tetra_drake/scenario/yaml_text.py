"""Reading and writing of YAML 1.2, with tags such as `!Coulomb`."""

from __future__ import annotations

import copy
import functools
import itertools
import re
from collections.abc import Collection
from pathlib import Path
from typing import Any

import yaml
import yamlcore
from yamlcore.loader import CommonResolver

from tetra_drake.errors import InputError
from tetra_drake.files import read_text
from tetra_drake.settings.refusals import TAG, described
from tetra_drake.settings.section import Tree

LARGEST_YAML = 2**20
"""Largest size of a file in bytes."""

FORMAT = 1
"""Version of the format of scenario files and structure files, see FORMAT.md."""


def parse_yaml(content: str, source: object) -> Any:
    """Content of a YAML text. A tag such as `!Coulomb` becomes a key of its mapping. Raises
    InputError, naming `source`, if the text is not YAML."""
    # The file may be a private one, so errors show neither its lines nor its names.
    try:
        return copy.deepcopy(_parsed(content))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        problem = re.sub(r" (alias|anchor|tag|handle) '.*", r" \1", str(error.problem))
        raise InputError(source, "", f"is not YAML{place}: {problem}") from error
    except RecursionError as error:
        raise InputError(source, "", "is not YAML: it is nested too deeply") from error
    except (yaml.YAMLError, ValueError, LookupError, AttributeError) as error:  # by wrong tags
        raise InputError(source, "", "is not YAML: it holds what YAML cannot") from error


@functools.lru_cache(maxsize=1)  # a large file is read for its kind, then for its content
def _parsed(content: str) -> Any:
    return yaml.load(content, _Loader)


def read_mapping(file: Path, what: str, *, keys: Collection[str]) -> Tree:
    """Content of a YAML file: a mapping with at least one of `keys`; it may have others. `what` is
    the kind of file, such as "scenario file", for error messages.

    Raises InputError for another content, or for another version of the format. The file may be a
    private one, so the error does not show its content.
    """
    content = parse_yaml(read_text(file, what, most=LARGEST_YAML), file)
    if not isinstance(content, dict):
        raise InputError(file, "", f"holds no mapping of keys, expected a {what}")
    version = content.get("format", FORMAT)
    if type(version) is not int or version != FORMAT:
        raise InputError(file, "format", f"found {described(version)}, expected {FORMAT}")
    if content.keys().isdisjoint(keys):
        problem = f"has none of the keys of a {what}, expected some of {', '.join(keys)}"
        raise InputError(file, "", problem)
    return content


def dump_yaml(tree: Tree) -> str:
    """YAML text of nested mappings, lists, numbers and texts."""
    return yaml.dump(tree, Dumper=_Dumper, sort_keys=False, default_flow_style=None)


MOST_VALUES = 10**6
"""Largest number of values in a file. The content of a file is walked through many times."""


class _Loader(yamlcore.CoreLoader):
    """Loader of YAML 1.2 that keeps the tags of mappings. It refuses repeated keys."""

    def get_single_node(self) -> yaml.Node:
        self.deep_construct = True  # refuses an alias of what holds it
        node = super().get_single_node()
        if node is not None and _expanded(node, {}) > MOST_VALUES:
            problem = f"found aliases that stand for more than {MOST_VALUES} values in all"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)
        return node

    def scan_to_next_token(self) -> None:
        """Skips what separates tokens. PyYAML alone refuses tabs there; YAML refuses them only in
        an indentation."""
        super().scan_to_next_token()
        while self.peek() == "\t":
            before = self.buffer[self.pointer - self.column : self.pointer]
            if not (before.strip() or self.flow_level):
                break
            self.forward()
            super().scan_to_next_token()

    def construct_mapping(self, node: yaml.Node, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key, _ in node.value if isinstance(node, yaml.MappingNode) else ():
            name, problem = str(key.value), ""
            if name in seen:
                problem = f"found {_shown(name, 'a key')} twice"
            elif name == "<<" and key.style is None:
                problem = "found the merge key <<, which YAML 1.2 does not have"
            if problem:
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            seen.add(name)
        tree: dict[Any, Any] = super().construct_mapping(node, deep)
        return tree

    def construct_kind(self, name: str, node: Any) -> dict[Any, Any]:
        if node.value and not isinstance(node, yaml.MappingNode):
            problem = f"found {_shown(f'!{name}', 'a tag')} without a mapping of keys"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)
        return {TAG: name} | (self.construct_mapping(node, deep=True) if node.value else {})


def _expanded(node: yaml.Node, sizes: dict[int, int]) -> int:
    """Number of values in a YAML node: itself and all values in it. What an alias names counts at
    every use. `sizes` has the numbers of the nodes counted already, by Python's id(), and gets the
    new ones."""
    if id(node) not in sizes:
        sizes[id(node)] = 1  # for an alias of what holds it
        inner = node.value if isinstance(node, yaml.CollectionNode) else []
        parts = itertools.chain(*inner) if isinstance(node, yaml.MappingNode) else inner
        sizes[id(node)] += sum(_expanded(part, sizes) for part in parts)
    return sizes[id(node)]


def _shown(name: str, what: str) -> str:
    """Name in quotes, for a message; `what` in place of a text that does not look like a name."""
    return f"'{name}'" if re.fullmatch(r"!?[\w.]{1,40}", name) else what


class _Dumper(yaml.SafeDumper, CommonResolver):
    """Writer of YAML with tags, for readers of YAML 1.1 and 1.2: texts that either would take for
    something else are quoted. Each key of a mapping has its own line."""

    def represent_dict(self, data: Any) -> yaml.MappingNode:
        entries = {name: value for name, value in data.items() if name != TAG}
        tag = f"!{data[TAG]}" if TAG in data else "tag:yaml.org,2002:map"
        return self.represent_mapping(tag, entries, flow_style=False)


_Loader.add_multi_constructor("!", _Loader.construct_kind)
_Dumper.init_resolvers("core")
_Dumper.add_representer(dict, _Dumper.represent_dict)
_Dumper.add_multi_representer(str, _Dumper.represent_str)  # for HeightFile, a subclass of str
