"""Messages: what a digest names, and that ids differ."""

import numpy as np
import pytest

from app.core.messages import Model, Parameter, fresh_id
from app.core.motion import Motion


@pytest.fixture
def motion() -> Motion:
    return Motion(positions=np.array([[0.4, 0.1, 0.02], [0.5, -0.1, 0.02]]), speeds=np.array([0.3, 0.1]))


def test_equal_numbers_have_equal_digests_however_they_are_stored(motion):
    stored_otherwise = Motion(positions=np.asfortranarray(motion.positions), speeds=motion.speeds.repeat(2)[::2])
    assert stored_otherwise.digest() == motion.digest()


def test_every_number_is_in_the_digest(motion):
    digests = {motion.digest()}
    for index in np.ndindex(motion.positions.shape):
        positions = motion.positions.copy()
        positions[index] = np.nextafter(positions[index], 1.0)
        digests.add(Motion(positions=positions, speeds=motion.speeds).digest())
    for index in range(len(motion.speeds)):
        speeds = motion.speeds.copy()
        speeds[index] = np.nextafter(speeds[index], 1.0)
        digests.add(Motion(positions=motion.positions, speeds=speeds).digest())
    assert len(digests) == 1 + motion.positions.size + motion.speeds.size


def test_ids_are_unique_and_say_what_they_name():
    ids = {fresh_id("frame") for _ in range(1000)}
    assert len(ids) == 1000
    assert all(message_id.startswith("frame-") for message_id in ids)


def test_a_model_knows_its_parameters_by_name():
    friction = Parameter(name="friction", value=0.4, unit="1", low=0.3, high=0.5)
    model = Model(id=fresh_id("model"), time_s=0.0, version=0, task="rope_push", parameters=(friction,))
    assert model.value("friction") == 0.4
    with pytest.raises(KeyError):
        model.value("stiffness")
