"""An object as its user describes it: sizes, masses, colours and priors. Plain data, kept in a recording."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from math import pi
from types import MappingProxyType
from typing import Any, Final, Literal, Self, TypeAlias, final, get_args

import msgspec

from app.core.colours import ColourRange
from app.core.errors import RecordingError
from app.core.geometry.shapes.base import Colour
from app.core.messages import Parameter

ObjectType: TypeAlias = Literal["rope", "beans", "cloth", "liquid"]
OBJECT_TYPES: Final[tuple[ObjectType, ...]] = get_args(ObjectType)
KEY: Final = "object"
"""Key of the description in the configuration of a recording's `Episode`."""

Range: TypeAlias = tuple[float, float]
SIZES: Final[Mapping[str, Range]] = MappingProxyType(
    {
        "length_m": (0.18, 0.80),
        "radius_m": (0.003, 0.016),
        "mass_kg": (0.003, 0.6),
        "finger_radius_m": (0.002, 0.030),
        "finger_half_width_m": (0.0, 0.045),
        "finger_yaw_rad": (-pi, pi),
    }
)
"""Numbers of a rope and its finger that may be other ones, and their ranges: there a rod's time steps are as good as
the nominal rope's, within a factor of two (`tests/tasks/test_size_limits.py`)."""
BEAN_SIZES: Final[Mapping[str, Range]] = MappingProxyType({"count": (20.0, 80.0), "mass_kg": (0.01, 0.2)})
"""Number of beans, and the mass of all."""
CLOTH_SIZES: Final[Mapping[str, Range]] = MappingProxyType({"size_m": (0.20, 0.28), "mass_kg": (0.004, 0.05)})
"""Side of a square cloth, and its mass: the expert does not hang one of 18 cm, and does one of 20; one that is longer
than 28 cm reaches the table when it is carried."""
LIQUID_SIZES: Final[Mapping[str, Range]] = MappingProxyType(
    {"volume_m3": (60e-6, 160e-6), "density_kg_m3": (920.0, 1300.0)}
)
"""Volume of a liquid, of which the bowls hold more than twice the most, and its density: in a lighter one, waves are
faster than time steps bear."""
SIZES_OF: Final[Mapping[ObjectType, Mapping[str, Range]]] = MappingProxyType(
    {"rope": SIZES, "beans": BEAN_SIZES, "cloth": CLOTH_SIZES, "liquid": LIQUID_SIZES}
)


@final
@dataclass(frozen=True, kw_only=True)
class ObjectDescription:
    """One object. `kind` None: sizes alone were given, of whatever the task has.

    `sizes`: [m], [kg], [m^3], [kg/m^3] or [rad], by the names of `SIZES_OF`; `colour`: RGB in 0..1; `colours`: the
    range in which cameras find it, where that is not the one about `colour`. `priors`: parameters of the simulator,
    each with the interval in which it lies with a probability of 90 %; a session begins with them.
    """

    kind: ObjectType | None = None
    name: str = ""
    sizes: Mapping[str, float] = field(default_factory=dict[str, float])
    colour: Colour | None = None
    colours: ColourRange | None = None
    priors: tuple[Parameter, ...] = ()

    @property
    def seen_colours(self) -> ColourRange | None:
        """Colours in which cameras find it; None: the task's own."""
        if self.colours is not None or self.colour is None:
            return self.colours
        return ColourRange.around(self.colour)

    @property
    def as_json(self) -> dict[str, Any]:
        """The description as JSON has it."""
        return asdict(self) | {"sizes": dict(self.sizes)}

    @classmethod
    def from_json(cls, said: object) -> Self:
        """The inverse of `as_json`. Raises RecordingError where `said` is no description."""
        try:
            return msgspec.convert(said, cls)
        except (msgspec.ValidationError, TypeError) as error:
            raise RecordingError(f"What the recording says of its object cannot be read: {error}.") from None


def recorded_object(config: str) -> ObjectDescription | None:
    """The object that the configuration of an `Episode` describes; None where it describes none.

    Raises RecordingError where it describes one that cannot be.
    """
    try:
        found: Any = json.loads(config)
    except json.JSONDecodeError:
        return None
    if not isinstance(found, dict) or found.get(KEY) is None:
        return None
    return ObjectDescription.from_json(found[KEY])
