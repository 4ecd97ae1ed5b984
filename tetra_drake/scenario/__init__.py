"""Scenarios: every number of an experiment, as YAML files with units and as dataclasses in SI."""
