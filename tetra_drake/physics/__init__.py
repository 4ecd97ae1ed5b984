"""The laws of the robot, each once, as functions compiled by numba; no Drake in sight.

Arrays that kernels write to come last in their signatures. State vectors have Drake's
layout for free bodies: [q; v] with q = (quaternion wxyz, p_WBo) and v = (w_WB, v_WBo) a body.
"""
