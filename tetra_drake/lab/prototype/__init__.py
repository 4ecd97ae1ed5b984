"""Commands for the actuators of a prototype, and the loads on them."""
