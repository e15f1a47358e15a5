"""Tasks between the blocks: two flights."""

from nerfnav.world import Task

TASKS = (
    Task("Around the red block", (-0.42, 0.0, 0.12), (0.42, 0.0, 0.15)),
    Task("Down the lane", (-0.2, -0.48, 0.12), (-0.2, 0.48, 0.2)),
)
