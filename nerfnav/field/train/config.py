"""Training settings of a voxel field, and their values at each stage."""

import itertools
import math
from dataclasses import dataclass, field

from nerfnav.field.train.grid_learner import LearningRates
from nerfnav.field.train.training_volume import Finish
from nerfnav.geometry import Box, shape_for


@dataclass(frozen=True)
class TrainConfig:
    """Settings of training a voxel field."""

    voxel: float = 0.013
    """Distance of nodes in the end [m]."""
    iterations: int = 1500
    """Training steps, when there is no budget."""
    budget: float | None = None
    """Wall time to spend, evaluation included [s]; replaces `iterations`. The result then depends on how fast the
    machine is. Exceeded where evaluation leaves too little of it for learning."""
    least_iterations: int = 0
    """Training steps after which a budget may end the training."""
    rays: int = 8192
    """Rays in a training step."""
    patch: int = 1
    """Pixels along each edge of the patches that rays are drawn in (see `RaySampler.draw`)."""
    density_rate: float = 0.25
    """Learning rate of raw densities at the start."""
    color_rate: float = 0.03
    """Learning rate of colours at the start."""
    final_rate: float = 0.1
    """Share of the learning rates that is left at the end."""
    sparsity: float = 1e-4
    """Weight of the integral of log(1 + 2 rho^2) along each ray: drives fog away."""
    rough_density: float = 0.0
    """Weight of the differences between raw densities of neighbours."""
    rough_color: float = 0.0
    """Weight of the differences between colours of neighbours."""
    points: int = 1024
    """Rays in a training step that lead to points which structure from motion found, where there are any."""
    points_weight: float = 0.02
    """Weight of the likelihood that they end there."""
    stages: tuple[float, ...] = (4.0, 2.0, 1.0)
    """Distance of nodes in each stage, in final voxels."""
    stage_iterations: tuple[float, ...] = (0.4, 0.35, 0.25)
    """Share of each stage in the iterations. Coarse steps are cheap and move most."""
    stage_time: tuple[float, ...] = (0.12, 0.28, 0.6)
    """Share of each stage in the budget."""
    stage_rays: tuple[float, ...] = (1.0, 1.0, 1.0)
    """Share of `rays` in the steps of each stage. Where time is short, more steps of fewer rays find shapes sooner."""
    finish: Finish = field(default_factory=Finish)
    """Final treatment of the densities."""
    firm_from: float = 0.92
    """Share of the training from which on densities rest, finished, and only colours are learned: those that surfaces
    had while they were softer are not theirs. Not before the last stage."""
    outside: int = 0
    """Nodes along each edge of the grid of the surroundings, as photographs of real places need it; 0 where the
    background is one colour. See field/render/surroundings.py."""
    exposure: bool = False
    """Estimate the gain of each photograph during training, because they differ in exposure (see exposure.py)."""
    device: str = "cpu"
    """Device of training: "cpu" with compiled kernels, "cuda" and others in torch, the same to rounding."""
    report_every: int = 50
    """Training steps between two TrainSteps."""
    field_every: float | None = None
    """Time between two fields in training [s]; evaluating one takes seconds. None: only the last is made."""

    picture_every: float | None = None
    """Time between two small pictures of the field in training [s]; None: none."""

    @property
    def stage_ends(self) -> list[float]:
        """At which share of the training each stage ends."""
        ends = list(itertools.accumulate(self.stage_iterations if self.budget is None else self.stage_time))
        ends[-1] = math.inf  # whatever the shares add up to, the last stage lasts to the end
        return ends

    @property
    def firm_at(self) -> float:
        """Share of the training from which on densities rest."""
        return max([self.firm_from, *self.stage_ends[:-1]])

    def rates(self, fraction: float) -> LearningRates:
        """Learning rates when a share of the training is done."""
        decay = self.final_rate**fraction
        return LearningRates(
            self.density_rate * decay if fraction < self.firm_at else 0.0,
            self.color_rate * decay,
            self.sparsity,
            self.rough_density,
            self.rough_color,
            self.points_weight if fraction < self.firm_at else 0.0,
        )

    def shape(self, box: Box, stage: int) -> tuple[int, int, int]:
        """Numbers of nodes of the grid of a stage."""
        return shape_for(box, self.voxel * self.stages[stage])

    def rays_of(self, stage: int) -> int:
        """Rays in a step of a stage."""
        return max(1, round(self.rays * self.stage_rays[stage]))

    def nodes_outside(self, stage: int) -> int:
        """Nodes along each edge of the grid of the surroundings."""
        return round(self.outside / self.stages[stage])
