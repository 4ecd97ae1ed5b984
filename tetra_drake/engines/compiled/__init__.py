"""The same robot without Drake, compiled end to end: equations of motion, integration."""
