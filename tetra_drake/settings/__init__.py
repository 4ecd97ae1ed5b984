"""Settings as pydantic models: numbers with units, YAML tags that choose a type, one-line
errors."""
