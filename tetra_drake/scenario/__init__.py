"""Scenarios: all settings of an experiment, in YAML files with units or as objects in SI."""
