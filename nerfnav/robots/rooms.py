"""Robots of the size of rooms: a 25 cm quadrotor, a sofa and a cart, for places that are metres wide.

Their dynamics are those of the small ones. A quadrotor L times as large turns L times as slowly under the same thrust
per weight (Froude scaling: angular accelerations go with 1 / L, body rates with 1 / sqrt(L)).
"""

from nerfnav.robots.couch_config import CouchConfig
from nerfnav.robots.diffdrive_config import DiffDriveConfig
from nerfnav.robots.quadrotor_config import QuadrotorConfig

QUADROTOR_25 = QuadrotorConfig(
    name="quadrotor25",
    mass=0.7,
    inertia=(4.0e-3, 4.0e-3, 7.3e-3),  # of a solid box, as the small one's
    extents=(0.25, 0.25, 0.08),
    point_counts=(6, 6, 3),  # 4 to 5 cm apart
    max_thrust=16.8,  # the same share of the weight
    max_rate=8.0,
    angular_acceleration=8.0,
)
"""A quadrotor of 25 x 25 x 8 cm and 0.7 kg, propellers included: what carries a camera and a computer today."""
SOFA = CouchConfig(
    name="sofa",
    mass=30.0,
    extents=(1.5, 0.6, 0.4),
    point_counts=(26, 11, 5),  # 6 to 10 cm apart
    max_speed=1.5,
    max_yaw_rate=2.5,
    max_force=150.0,
)
"""A sofa that passes doors of 0.9 m only lengthwise."""
CART = DiffDriveConfig(
    name="cart",
    extents=(0.5, 0.4, 0.35),
    point_counts=(11, 9, 8),  # 5 cm apart
    max_speed=1.5,
    max_yaw_rate=3.0,
    max_acceleration=4.0,
    max_yaw_acceleration=12.0,
)
"""A cart on two wheels, as warehouses and hospitals have."""
