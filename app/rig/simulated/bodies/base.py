"""Interface of the bodies on which injected effects act."""

from typing import Protocol

from app.rig.simulated.injected_effects.base import Factors, Moment, Vectors


class Bodies(Protocol):
    """An object's S bodies in a running MuJoCo model: their state, their friction on the table, and forces on them."""

    @property
    def period_s(self) -> float:
        """Time step of the model."""
        ...

    @property
    def sleeps(self) -> bool:
        """True while MuJoCo has all of them asleep."""
        ...

    def moment(self, session: float) -> Moment:
        """The state as seen by effects."""
        ...

    def rub(self, factor: Factors) -> None:
        """Set the friction of each body on the table, as a multiple of its own."""
        ...

    def stiffen(self, factor: Factors) -> None:
        """Set the stiffness of each body, as a multiple of its own."""
        ...

    def pull(self, moment: Moment, force: Vectors) -> None:
        """Apply a force [N] at the middle of each body, where it matters: friction holds what is at rest."""
        ...

    def relax(self, share: float) -> None:
        """Make this share of the elastic deformation permanent."""
        ...
