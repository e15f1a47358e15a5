"""Subcommands of nerfnav, by name."""


COMMANDS = {
    "serve": "open a scene or a field in the browser (what `nerfnav` alone does, with stonehenge)",
    "open": "open anything in the browser: a field, a mesh, a capture, splats, a video, a trained NeRF",
    "scenes": "list the bundled scenes and their tasks",
    "train": "train a field of a scene, a mesh, or somebody's photographs",
    "import": "make a field of a trained NeRF or of Gaussian splats",
    "bake": "turn a field into a voxel field",
    "place": "say how long a metre is and where the floor is in a field, and crop it",
    "info": "tell what a field file holds",
    "plan": "plan a trajectory through a field",
    "fly": "fly a trajectory with nothing but a simulated camera, replanning at every step",
    "localize": "find where in a field a picture was taken",
    "track": "follow a camera through a field: a video, a folder of pictures, a recording",
    "live": "guide a real vehicle: pictures in at a local socket, its pose and next setpoints out",
    "export": "write the trajectory of a plan or a flight in another format",
    "map": "write what planners take for free, solid or unproven, for other programs",
    "experiment": "run one of the experiments: trials judged on the ground truth, a table, figures",
    "bench": "time nerfnav against the paper's way on this machine",
    "doctor": "tell what this machine has: threads, GPU, kernels, browser, LieTorch",
}
"""Name and purpose of every subcommand, in the order of a first visit."""
