"""XML of models for other simulators."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np


def add_element(parent: Element, tag: str, text: Any = None, **attributes: Any) -> Element:
    """Adds an element. Its text and attributes are texts, numbers or arrays of numbers."""
    written = {name: _written(value) for name, value in attributes.items()}
    element = SubElement(parent, tag, written)
    element.text = None if text is None else _written(text)
    return element


def xml_text(root: Element) -> str:
    """A document as indented text."""
    indent(root)
    return tostring(root, encoding="unicode") + "\n"


def _written(value: Any) -> str:
    """Text of an attribute: numbers with all their digits."""
    return value if isinstance(value, str) else " ".join(map(repr, np.ravel(value).tolist()))
