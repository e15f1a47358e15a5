"""PX4 in offboard mode: send pictures to `nerfnav live`, and pose and setpoints to the autopilot by MAVSDK.

PX4 takes the pose as vision (EKF2_EV_CTRL), so its local frame is the field's: north along the world's y axis.

nerfnav live place.npz --robot x500 --camera camera.yaml --token T
python mavsdk_offboard.py "ws://127.0.0.1:8090/?token=T" --goal 1 2 1.5 0
"""

import argparse
import asyncio
import math
import time

import cv2

from nerfnav.live import Goal, LiveClient, Order


async def main(address: str, goal: Goal, camera: str, autopilot: str) -> None:
    """Fly to the goal, or until the camera ends. The vehicle must already be in the air."""
    from mavsdk import System  # pyright: ignore[reportMissingImports]
    from mavsdk import mocap as vision  # pyright: ignore[reportMissingImports]
    from mavsdk.offboard import AccelerationNed, PositionNedYaw, VelocityNedYaw  # pyright: ignore[reportMissingImports]

    drone, pictures, offboard = System(), cv2.VideoCapture(int(camera) if camera.isdigit() else camera), False
    held = False
    await drone.connect(system_address=autopilot)
    with LiveClient(address) as live:
        while (read := pictures.read())[0]:
            taken = time.time()
            picture = cv2.cvtColor(read[1], cv2.COLOR_BGR2RGB)
            answer = await asyncio.to_thread(live.see, picture, taken, goal, time.time(), held)
            if answer.position and answer.quaternion:
                (x, y, z), (w, i, j, k) = answer.position, answer.quaternion
                roll = math.atan2(2 * (j * k + w * i), 1 - 2 * (i * i + j * j))
                pitch = math.asin(max(-1.0, min(1.0, 2 * (i * k - w * j))))  # nose up
                yaw = math.pi / 2 - math.atan2(2 * (i * j + w * k), 1 - 2 * (j * j + k * k))  # clockwise from north
                await drone.mocap.set_vision_position_estimate(vision.VisionPositionEstimate(
                    round(1e6 * taken), vision.PositionBody(y, x, -z), vision.AngleBody(roll, pitch, yaw),
                    vision.Covariance([math.nan]),
                ))  # fmt: skip
            guidance = answer.guidance_at(now := time.time())
            setpoint = guidance and guidance.at(now)
            order = guidance and f"{guidance.order.value}: {guidance.reason}"
            print(f"{answer.status}, {answer.latency_ms:.0f} ms, {order}")
            held = setpoint is None
            if setpoint is None:
                if offboard:
                    await drone.action.hold()
                offboard = False
                continue
            (x, y, z), (vx, vy, vz), (ax, ay, az) = setpoint.position, setpoint.velocity, setpoint.acceleration
            heading = 90 - math.degrees(setpoint.yaw)
            await drone.offboard.set_position_velocity_acceleration_ned(
                PositionNedYaw(y, x, -z, heading), VelocityNedYaw(vy, vx, -vz, heading), AccelerationNed(ay, ax, -az)
            )
            if not offboard:
                await drone.offboard.start()
                offboard = True
            if guidance and guidance.order is Order.ARRIVED:
                return


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("address", help="address that `nerfnav live` prints")
    parser.add_argument("--goal", type=float, nargs=4, required=True, help="x y z [m] and heading [rad]")
    parser.add_argument("--camera", default="0", help="number of a camera, or a video")
    parser.add_argument("--autopilot", default="udpin://0.0.0.0:14540", help="MAVSDK address of the autopilot")
    arguments = parser.parse_args()
    x, y, z, yaw = arguments.goal
    asyncio.run(main(arguments.address, Goal((x, y, z), yaw), arguments.camera, arguments.autopilot))
