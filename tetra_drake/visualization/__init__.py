"""The robot in Meshcat: scene, replay page, live view."""
