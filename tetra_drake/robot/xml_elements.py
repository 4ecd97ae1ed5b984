"""XML of models for other simulators."""

from __future__ import annotations

import re
from typing import Any
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

import numpy as np


def add_element(parent: Element, tag: str, **attributes: Any) -> Element:
    """Adds an element `tag` to `parent` and returns it. Its attributes are texts, numbers or arrays
    of numbers, which are written with spaces in between."""
    return SubElement(parent, tag, {name: _written(value) for name, value in attributes.items()})


def add_comment(parent: Element, text: str) -> None:
    """Adds a comment to `parent`. XML has no hyphens in a row there."""
    parent.append(Comment(f" {re.sub('-(?=-)', '- ', text)} "))


def xml_text(root: Element) -> str:
    """XML document with the element `root`, as indented text."""
    indent(root)
    return tostring(root, encoding="unicode") + "\n"


def _written(value: Any) -> str:
    """Text of an attribute's value: numbers with all their digits, arrays with spaces
    in between."""
    return value if isinstance(value, str) else " ".join(map(repr, np.ravel(value).tolist()))
