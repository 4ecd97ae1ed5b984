"""Physical laws of the robot, as functions compiled by numba, independent of Drake.

Arrays that a kernel writes to are the last parameters. State vectors have Drake's layout for free
bodies: [q; v], with q = (quaternion wxyz, p_WBo) and v = (w_WB, v_WBo) per body.
"""
