"""Compiled engine: equations of motion and integration without Drake."""
