"""Settings: sections with units, tagged kinds, and errors of one line."""
