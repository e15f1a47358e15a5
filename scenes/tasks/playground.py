"""Tasks in the playground: ten flights."""

from nerfnav.world import Task

TASKS = tuple(
    Task(name, start, goal)
    for name, start, goal in [
        ("Through the tube", (-0.5, 0.55, 0.58), (0.36, 0.5, 0.6)),
        ("Under the monkey bars", (-0.5, -0.85, 0.2), (-0.5, 0.15, 0.3)),
        ("Through the hoop", (0.08, -0.82, 0.3), (-0.12, -0.28, 0.42)),
        ("Through the jungle gym", (0.22, -0.75, 0.13), (1.12, -0.61, 0.42)),
        ("Down the slide", (0.36, 0.5, 0.6), (0.2, -0.62, 0.12)),
        ("Over the roof", (-1.0, 0.2, 0.15), (-0.05, 0.9, 0.6)),
        ("Below the tube", (-0.07, 0.93, 0.28), (-0.1, 0.0, 0.35)),
        ("Up to the top of the jungle gym", (-1.1, 0.05, 0.3), (0.86, -0.6, 0.72)),
        ("Under the slide", (0.75, 0.1, 0.15), (0.0, 0.1, 0.15)),
        ("Corner to corner", (-1.1, -0.75, 0.4), (1.05, 0.85, 0.55)),
    ]
)
