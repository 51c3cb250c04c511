"""Kinds of objects that discovery tells apart, and what differs between them: everything else is one program."""

from dataclasses import dataclass, replace
from typing import Final, final

from app.sim.effects.base import ObjectKind


@final
@dataclass(frozen=True, kw_only=True)
class ObjectTraits:
    """Traits of a kind of object, by which its pushes are compared and its causes weighed."""

    name: ObjectKind
    has_length: bool
    """True if each of its points has a place along it, from one end to the other: fields along it are compared."""
    is_chaotic: bool
    """True if every push is simulated from several beginnings, whatever simulates it."""
    physics_null_sd: float | None
    """Standard deviation, in typical sizes, of what any physics seem to be where nothing is missing; None: each
    parameter has its own."""
    errs_with_tool: bool
    """True if the simulator errs in what a moved tool does, too."""
    errs_by: float = 0.3
    """Error of the simulator in each push, as a share of a step of every effect that changes the simulation.

    With it the fits of material points to 20 recordings in which nothing was hidden scatter 1.5 times as much as they
    say; without it, 3.5 times."""
    is_in_space: bool = False
    """True if it is carried through the air: heights are compared as well, and the tool holds it all the while."""
    is_poured: bool = False
    """True of what has no shape of its own: compared is how much of it is in a bowl, at rest alone."""

    is_smooth: bool = False
    """True if what is simulated changes by little where its model does: evidence of refits is not chance."""

    @property
    def unit(self) -> str:
        """Unit of its errors in thousandths of a metre of residual."""
        return "% of the liquid" if self.is_poured else "mm"


ROPE: Final = ObjectTraits(name="rope", has_length=True, is_chaotic=False, physics_null_sd=None, errs_with_tool=False)
# What 15 causes of physics seemed to be in four recordings of MuJoCo's beans without any, root mean square, is
# 0.8 typical sizes, and of some of them (friction that falls with speed, cohesion, an obstacle, an attraction) the same
# in all four. So none of a typical size is named in pieces.
GRAINS: Final = ObjectTraits(name="grains", has_length=False, is_chaotic=True, physics_null_sd=1.0, errs_with_tool=True)
CLOTH: Final = ObjectTraits(
    name="cloth", has_length=False, is_chaotic=False, physics_null_sd=1.0, errs_with_tool=True, is_in_space=True
)
# What five causes of physics seemed to be in two recordings of 12 pours without any, root mean square, is 0.54 typical
# sizes, where the fits say that they scatter by 0.64: two recordings are few, and all there is of soup.
SOUP: Final = ObjectTraits(
    name="soup", has_length=False, is_chaotic=False, physics_null_sd=0.5, errs_with_tool=True, is_poured=True
)
# Recordings of 24 pours without any are likeliest if what cameras and arm get wrong is no error of each pour. Null
# priors of single parameters were learnt in two worlds (`ParameterSpec.liquid_null_prior`); how a liquid thins shows in
# no recording.
LIQUID: Final = replace(SOUP, name="liquid", errs_with_tool=False, is_smooth=True)
