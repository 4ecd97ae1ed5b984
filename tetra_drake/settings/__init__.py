"""Settings as pydantic models: numbers with units, tagged kinds, errors of one line."""
