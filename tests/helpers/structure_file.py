"""A structure file with a bent body of two groups, b-a-c, a bar d-e, and a bar f-g."""

FILE = """
unit: cm
nodes:
  g: [9, 2, 10 in]
  a: [0, 0, 0]
  b: [10, 0, 0]
  c: [0, 10, 0]
  d: [2, 2, 5]
  e: [2, 2, 15]
  f: [9, 2, 5]
struts:
  arm: {pairs: [[b, a], [d, e]], diameter: 8 mm, density: 1.2 g/cm^3, node_diameter: 16 mm}
  leg: {pairs: [[a, c]], diameter: 4 mm, density: 2 g/cm^3, node_diameter: 0 m}
  bar: {pairs: [[f, g]], diameter: 4 mm, density: 2 g/cm^3, node_diameter: 1 cm}
cables:
  side: {pairs: [[b, d], [c, d]], stiffness: 2 N/cm, damping: 3 N*s/m, free_length: 20 mm}
  long: {pairs: [[e, f]], stiffness: 100 N/m, damping: 0 N*s/m, tension: 2 N}
actuated: {left: [side d b, long e f], right: [side c d]}
masses: {g: 20 g}
contacts: [a, g]
"""
