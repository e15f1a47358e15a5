"""Quadrotor's dynamics: roll out actions, hold, and find first thrusts; twins of `Quadrotor.step`, `hold`, `encode`.

Notation as in robots/quadrotor.py; `state` is (p, v, R, w), `constants` are mass, J_x, J_y, J_z, gravity, dt, and
`holding` are the deceleration for each m/s of velocity [1/s], the largest one [m/s^2], the share of the attitude's
error that one step takes away, and the least upward force [N]. Holds do not turn.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.geometry.linear import copy_matrix
from nerfnav.geometry.rotations import cross, turned


@kernel()
def first_thrusts(state, wanted, constants, floor, thrusts):
    """Fill f_0 and f_1, each at least `floor`, that push as far towards p_2 and p_3 as wanted (2, 3) as they can."""
    position, velocity, rotation, rate = state
    mass, gravity, dt = constants[0], constants[4], constants[5]
    before, at, following, attitude = position.copy(), position + velocity * dt, np.empty(3), rotation.copy()
    for index in range(2):
        if index == 1:
            turned(rotation, rate[0] * dt, rate[1] * dt, rate[2] * dt, attitude)
        along = 0.0
        for axis in range(3):
            wish = (wanted[index, axis] - 2.0 * at[axis] + before[axis]) / (dt * dt) + (gravity if axis == 2 else 0.0)
            along += mass * wish * attitude[axis, 2]
        thrusts[index] = max(along, floor)
        for axis in range(3):
            push = attitude[axis, 2] * thrusts[index] / mass - (gravity if axis == 2 else 0.0)
            following[axis] = 2.0 * at[axis] - before[axis] + push * dt * dt
        for axis in range(3):
            before[axis], at[axis] = at[axis], following[axis]


@kernel()
def roll_out(state, actions, constants, positions):
    """Fill the positions (n + 1, 3) of a robot that takes actions (n, 4) whatever happens, the start's first."""
    velocity, rotation, rate = state[1].copy(), state[2].copy(), state[3].copy()
    for axis in range(3):
        positions[0, axis] = state[0][axis]
    for t in range(actions.shape[0]):
        for axis in range(3):
            positions[t + 1, axis] = positions[t, axis] + velocity[axis] * constants[5]
        push(velocity, rotation, rate, actions[t], constants)


@kernel()
def push(velocity, rotation, rate, action, constants):
    """Change velocity, attitude and body rate by one action."""
    mass, gravity, dt = constants[0], constants[4], constants[5]
    momentum, gyroscopic, following = np.empty(3), np.empty(3), np.empty((3, 3))
    for axis in range(3):
        velocity[axis] += rotation[axis, 2] * action[0] / mass * dt
        momentum[axis] = constants[1 + axis] * rate[axis]
    velocity[2] -= gravity * dt
    turned(rotation, rate[0] * dt, rate[1] * dt, rate[2] * dt, following)
    copy_matrix(following, rotation)
    cross(rate, momentum, gyroscopic)
    for axis in range(3):
        rate[axis] += (action[1 + axis] - gyroscopic[axis]) / constants[1 + axis] * dt


_ALONG = 1e-12  # a force whose direction is nearer to the body's z axis than that needs no turn


@kernel()
def hold_out(start, wanted, constants, holding, rest, states, actions):
    """Fill states (n + 1) and actions (n, 4) of a robot that brakes to the wanted velocities (n, 3) in turn.

    Returns how many steps it took until rest was wanted and its speed was below `rest` [m/s], at most n.
    """
    position, velocity, rotation, rate = states
    for axis in range(3):
        position[0, axis], velocity[0, axis], rate[0, axis] = start[0][axis], start[1][axis], start[3][axis]
    copy_matrix(start[2], rotation[0])
    seen = np.empty(3)
    for t in range(actions.shape[0]):
        for axis in range(3):
            seen[axis] = velocity[t, axis] - wanted[t, axis]
        _hold(seen, rotation[t], rate[t], constants, holding, actions[t])
        for axis in range(3):
            position[t + 1, axis] = position[t, axis] + velocity[t, axis] * constants[5]
            velocity[t + 1, axis], rate[t + 1, axis] = velocity[t, axis], rate[t, axis]
        copy_matrix(rotation[t], rotation[t + 1])
        push(velocity[t + 1], rotation[t + 1], rate[t + 1], actions[t], constants)
        stays = wanted[t, 0] == 0.0 and wanted[t, 1] == 0.0 and wanted[t, 2] == 0.0
        if stays and _length(velocity[t + 1]) < rest:
            return t + 1
    return actions.shape[0]


@kernel()
def _hold(velocity, rotation, rate, constants, holding, action):
    """Fill the action that brakes, levels out and hovers: thrust now, torque for the attitude two steps from now."""
    dt = constants[5]
    action[1], action[2], action[3] = 0.0, 0.0, 0.0  # what is predicted turns by its own rate alone
    later, ahead, turning = velocity.copy(), rotation.copy(), rate.copy()
    soon, force, thrust = np.empty((3, 3)), np.empty(3), 0.0
    for step in range(2):
        _wish(later, constants, holding, force)
        action[0] = max(0.0, force[0] * ahead[0, 2] + force[1] * ahead[1, 2] + force[2] * ahead[2, 2])
        if step == 0:
            thrust = action[0]
        push(later, ahead, turning, action, constants)
        if step == 0:
            copy_matrix(ahead, soon)
    _wish(later, constants, holding, force)
    turn, momentum, gyroscopic = np.empty(3), np.empty(3), np.empty(3)
    _tip(soon, force, turn)
    for axis in range(3):
        momentum[axis] = constants[1 + axis] * rate[axis]
    cross(rate, momentum, gyroscopic)
    action[0] = thrust
    for axis in range(3):
        faster = holding[2] * turn[axis] / dt - rate[axis]
        action[1 + axis] = constants[1 + axis] * faster / dt + gyroscopic[axis]


@kernel()
def _wish(velocity, constants, holding, force):
    """Fill the force [N] that brakes a velocity and carries the weight."""
    size = _length(velocity)
    share = holding[0] * holding[1] / max(holding[0] * size, holding[1])
    for axis in range(3):
        force[axis] = -constants[0] * share * velocity[axis]
    force[2] = max(force[2] + constants[0] * constants[4], holding[3])


@kernel()
def _tip(rotation, force, turn):
    """Fill the shortest turn [rad], in the body, of its z axis to where a force points."""
    x = rotation[0, 0] * force[0] + rotation[1, 0] * force[1] + rotation[2, 0] * force[2]
    y = rotation[0, 1] * force[0] + rotation[1, 1] * force[1] + rotation[2, 1] * force[2]
    z = rotation[0, 2] * force[0] + rotation[1, 2] * force[1] + rotation[2, 2] * force[2]
    across = math.sqrt(x * x + y * y)
    share = math.atan2(across, z) / across if across > _ALONG * math.sqrt(z * z) else 0.0
    turn[0], turn[1], turn[2] = -y * share, x * share, 0.0


@kernel()
def _length(vector):
    return math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
