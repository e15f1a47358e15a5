"""A quadrotor's first thrusts and its way under given actions: twins of parts of `Quadrotor.encode` and `step`.

Notation as in robots/quadrotor.py; `state` is (p, v, R, w), `constants` are mass, J_x, J_y, J_z, gravity, dt.
"""

import numpy as np

from nerfnav.core.jit import kernel
from nerfnav.robots.kernels.rotations import cross, turned


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
        before[:], at[:] = at, following


@kernel()
def roll_out(state, actions, constants, positions):
    """Fill the positions (n + 1, 3) of a robot that takes actions (n, 4) whatever happens, the start's first."""
    velocity, rotation, rate = state[1].copy(), state[2].copy(), state[3].copy()
    positions[0] = state[0]
    for t in range(actions.shape[0]):
        for axis in range(3):
            positions[t + 1, axis] = positions[t, axis] + velocity[axis] * constants[5]
        push(velocity, rotation, rate, actions[t], constants)


@kernel(inline=True)
def push(velocity, rotation, rate, action, constants):
    """Change velocity, attitude and body rate by one action."""
    mass, gravity, dt = constants[0], constants[4], constants[5]
    momentum, gyroscopic, following = np.empty(3), np.empty(3), np.empty((3, 3))
    for axis in range(3):
        velocity[axis] += rotation[axis, 2] * action[0] / mass * dt
        momentum[axis] = constants[1 + axis] * rate[axis]
    velocity[2] -= gravity * dt
    turned(rotation, rate[0] * dt, rate[1] * dt, rate[2] * dt, following)
    rotation[:] = following
    cross(rate, momentum, gyroscopic)
    for axis in range(3):
        rate[axis] += (action[1 + axis] - gyroscopic[axis]) / constants[1 + axis] * dt
