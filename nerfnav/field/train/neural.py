"""How a neural field is trained."""

from dataclasses import dataclass, field

from nerfnav.field.models.mlp import MlpConfig


@dataclass(frozen=True)
class NeuralTrainConfig:
    """How a neural field is trained; the paper's numbers."""

    network: MlpConfig = field(default_factory=MlpConfig)
    """Shape of both networks."""
    iterations: int = 200_000
    """Training steps, when there is no budget."""
    budget: float | None = None
    """Time to spend [s]; replaces `iterations`."""
    rays: int = 1024
    """Rays in a training step."""
    coarse_samples: int = 64
    """Points of the coarse network on each ray."""
    fine_samples: int = 128
    """Points that are drawn where the coarse network found something."""
    rate: float = 5e-4
    """Adam's learning rate at the start."""
    final_rate: float = 0.1
    """What is left of it at the end."""
    report_every: int = 50
    """Training steps between two reports."""
