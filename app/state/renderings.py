"""What the worker has computed for the page to draw, beside plans and flights."""

from dataclasses import dataclass, field, replace
from typing import Self

from app.state.queries import EyeView, SliceView, Space, SpaceView
from app.state.view_settings import Eye


@dataclass(frozen=True)
class Sights:
    """Pictures and parts of space, as far as they were asked for."""

    eyes: dict[int, Eye] = field(default_factory=dict)
    """From where each tab looks, where that matters."""
    views: dict[int, EyeView] = field(default_factory=dict)
    """The field as last rendered for each tab."""
    spaces: dict[Space, SpaceView] = field(default_factory=dict)
    """Parts of space."""
    slice: SliceView | None = None
    """A slice through the density."""

    def looked(self, client: int, eye: Eye) -> Self:
        """With one tab looking from somewhere else."""
        return replace(self, eyes={**self.eyes, client: eye})

    def left(self, client: int) -> Self:
        """Without a tab."""
        eyes = {key: eye for key, eye in self.eyes.items() if key != client}
        return replace(self, eyes=eyes, views={key: view for key, view in self.views.items() if key != client})

    def seen(self, view: EyeView) -> Self:
        """With one more rendering, unless its tab is gone."""
        client = view.question.client
        return replace(self, views={**self.views, client: view}) if client in self.eyes else self

    def with_space(self, view: SpaceView) -> Self:
        """With one more part of space."""
        return replace(self, spaces={**self.spaces, view.question.space: view})

    def elsewhere(self) -> Self:
        """What is left of it in another place, or for another robot."""
        return type(self)(eyes=self.eyes)
