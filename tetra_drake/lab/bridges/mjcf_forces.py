"""Forces that MuJoCo exerts in a model (mjModel) at control 0: by actuators, tendons and joints."""

from __future__ import annotations

from typing import Any

import numpy as np

_DISABLED = {
    "SPRING": "jnt_stiffness jnt_stiffnesspoly tendon_stiffness tendon_stiffnesspoly",
    "DAMPER": "dof_damping dof_dampingpoly tendon_damping tendon_dampingpoly actuator_damping",
    "EQUALITY": "eq_active0",
    "LIMIT": "tendon_limited",
    "CONTACT": "geom_contype geom_conaffinity",
    "FRICTIONLOSS": "dof_frictionloss tendon_frictionloss",
    "CLAMPCTRL": "actuator_ctrllimited",
}
"""Fields of a model that have no effect if a flag of it disables a part of MuJoCo."""


def obey_flags(model: Any) -> None:
    """Sets what the flags of a model disable to 0, in place."""
    from mujoco import mjtDisableBit, mjtJoint

    bits, flags = mjtDisableBit.__members__.items(), model.opt.disableflags
    off = {name.removeprefix("mjDSBL_") for name, bit in bits if flags & bit}
    if "CONSTRAINT" in off:
        off |= {"EQUALITY", "LIMIT", "FRICTIONLOSS", "CONTACT"}
    for field in " ".join(_DISABLED[part] for part in off & _DISABLED.keys()).split():
        getattr(model, field)[:] = 0
    if off >= {"SPRING", "DAMPER"}:
        model.body_gravcomp[:] = 0.0
    if "GRAVITY" in off:
        model.opt.gravity[:] = 0.0
    if "CONTACT" in off:
        model.pair_geom1[:] = model.pair_geom2
    if "ACTUATION" in off:
        model.opt.disableactuator = -1
    if "ACTUATION" in off or not model.nu:  # MuJoCo computes no force of actuators then
        joints = model.jnt_actgravcomp & (model.jnt_type == mjtJoint.mjJNT_FREE)
        model.body_gravcomp[np.isin(model.body_rootid, model.jnt_bodyid[joints])] = 0.0


def actuator_laws(model: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Whether actuators are forces or linear springs (actuators,), unlike muscles or disabled ones;
    their control or activation (actuators,), which is 0 or what is next to 0 in its range; and the
    force, the force per length and the force per rate there (actuators, 3)."""
    from mujoco import mjtBias, mjtDyn, mjtGain

    is_fixed = model.actuator_gaintype == mjtGain.mjGAIN_FIXED
    is_affine = model.actuator_biastype == mjtBias.mjBIAS_AFFINE
    is_static = model.actuator_dyntype == mjtDyn.mjDYN_NONE
    runs = model.actuator_dyntype == mjtDyn.mjDYN_INTEGRATOR
    lags = np.isin(model.actuator_dyntype, [mjtDyn.mjDYN_FILTER, mjtDyn.mjDYN_FILTEREXACT])
    is_linear = (is_static | runs | lags) & (model.actuator_plugin < 0)
    is_linear &= is_fixed | (model.actuator_gaintype == mjtGain.mjGAIN_AFFINE)
    is_linear &= is_affine | (model.actuator_biastype == mjtBias.mjBIAS_NONE)
    is_linear &= (model.opt.disableactuator >> model.actuator_group.clip(0, 31) & 1) == 0

    own = np.where(is_linear, model.actuator_ctrladr, -1)  # others may have no control, or several
    limits = np.vstack([model.actuator_ctrlrange, np.zeros(2)])[own]
    control = _clamped(0.0, limits, np.append(model.actuator_ctrllimited, False)[own])
    control[runs & (control != 0.0)] *= np.inf  # the activation grows until it is clamped
    is_bounded = model.actuator_actlimited & ~is_static
    control = _clamped(control, model.actuator_actrange, is_bounded)
    is_linear &= np.isfinite(control)
    control[~is_linear] = 0.0

    gains = model.actuator_gainprm[:, :3] * np.where(is_fixed[:, np.newaxis], [1, 0, 0], 1)
    laws = model.actuator_biasprm[:, :3] * is_affine[:, np.newaxis]
    laws = (laws + control[:, np.newaxis] * gains) * is_linear[:, np.newaxis]
    is_clamped = model.actuator_forcelimited & is_linear & ~laws[:, 1:].any(axis=1)
    laws[:, 0] = _clamped(laws[:, 0], model.actuator_forcerange, is_clamped)
    return is_linear, control, laws


def _clamped(values: Any, limits: np.ndarray, is_clamped: np.ndarray) -> np.ndarray:
    return np.where(is_clamped, np.clip(values, *limits.T), values)


def tendon_laws(model: Any, driven: np.ndarray) -> np.ndarray:
    """Stiffness, damping and free length of each tendon (tendons, 3), with the springs and dampers
    of its actuators. `driven` is the tendon of each actuator (actuators,); -1 for none."""
    stiffness, damping = model.tendon_stiffness.copy(), model.tendon_damping.copy()
    force = stiffness * model.tendon_lengthspring[:, 1]
    acts = driven >= 0
    tendons, gear = driven[acts], model.actuator_gear[model.actuator_outadr[acts], 0]
    push, per_length, per_rate = actuator_laws(model)[2][acts].T
    np.subtract.at(stiffness, tendons, gear**2 * per_length)
    np.add.at(damping, tendons, gear**2 * (model.actuator_damping[acts] - per_rate))
    np.add.at(force, tendons, gear * push)
    free_length = np.divide(force, stiffness, out=0.0 * force, where=stiffness != 0.0)
    return np.stack([stiffness, damping, free_length], axis=1)


def limit_laws(model: Any) -> np.ndarray:
    """Stiffness, damping and free length (tendons, 3) of cables like the tendons' upper limits.

    With the constants k and b, the impedance d and the inverse mass A, a limit exerts
    d / ((1 - d) A) (d k x + b v) at rest. The impedance depends on x; here it is the last one.
    """
    time, ratio = model.tendon_solref_lim.T
    time = np.where(time > 0.0, np.maximum(time, 2.0 * model.opt.timestep), time)
    d = model.tendon_solimp_lim[:, 1].clip(1e-4, 0.9999)  # as in MuJoCo
    with np.errstate(divide="ignore", invalid="ignore"):
        k = np.where(time > 0.0, 1.0 / (time * ratio) ** 2, -time) / d**2
        b = np.where(time > 0.0, 2.0 / time, -ratio) / d
        per_mass = d / (1.0 - d) / model.tendon_invweight0
    longest = model.tendon_range[:, 1] - model.tendon_margin
    return np.stack([per_mass * d * k, per_mass * b, longest], axis=1)
