"""What all tests share."""

# isort: off
import nerfnav  # noqa: F401  # before torch: it tells idle threads to sleep, which torch reads when it is loaded
import torch

# isort: on

# Tests are many small operations, often beside other busy processes: more threads only wait for each other.
torch.set_num_threads(1)
