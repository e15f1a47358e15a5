"""What all tests share."""

import torch

# Tests are many small operations, often beside other busy processes: more threads only wait for each other.
torch.set_num_threads(1)
