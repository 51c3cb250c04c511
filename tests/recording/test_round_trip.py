"""Round trip: every message is read as it was written."""

import base64
import dataclasses
import json
from pathlib import Path

import msgspec
import numpy as np
import pytest

from app.core.dialogue.segmentation_message import Seen
from app.core.messages import ArmState, Episode, Extension, Frame, Message, Model, Particles, Proposal, Transition
from app.core.motion import Motion
from app.recording.format.channels import TOPICS, record_of
from app.recording.format.codec import decode, encode, schema
from app.recording.format.records import FrameRecord, ParticlesRecord
from app.recording.read.reader import read_episode, read_messages, read_transitions
from tests.recording.samples import Maker, Recording, all_kinds, record, same, same_as_read


def test_every_message_of_the_vocabulary_has_a_channel_of_its_own() -> None:
    assert set(TOPICS) == set(all_kinds())
    assert len(set(TOPICS.values())) == len(TOPICS)


@pytest.mark.parametrize("kind", all_kinds(), ids=lambda kind: kind.__name__)
def test_every_kind_of_message_comes_back_as_it_was_written(kind: type[Message], make: Maker, tmp_path: Path) -> None:
    written = make(kind)
    read = list(read_messages(record(tmp_path, make(Episode), [written])))[-1]
    assert same_as_read(written, read)


def test_arrays_are_read_in_types_that_libraries_in_c_take(make: Maker) -> None:
    """Such libraries refuse a type that names its byte order, even that of the computer itself."""
    frame, particles = make(Frame), make(Particles)
    camera = decode(encode(frame, FrameRecord), FrameRecord).camera
    read = decode(encode(particles, ParticlesRecord), ParticlesRecord)
    assert [memoryview(each).format for each in (camera.K, camera.T_world_camera, read.positions)] == ["d", "d", "f"]


def test_particles_of_before_there_were_predicted_ones_are_read(make: Maker) -> None:
    plain = json.loads(encode(make(Particles), ParticlesRecord))
    del plain["predicted"]
    read = decode(json.dumps(plain).encode(), ParticlesRecord)
    assert read.predicted.shape == (0,)
    assert len(read.positions)


def test_messages_come_back_in_the_order_of_writing(recording: Recording) -> None:
    path, written = recording.path, recording.messages
    assert [message.id for message in read_messages(path)] == [message.id for message in written]


def test_a_choice_of_kinds_is_the_same_as_choosing_afterwards(recording: Recording) -> None:
    path, written = recording.path, recording.messages
    for kinds in ([Frame], [Particles, Model], [Transition]):
        chosen = [message.id for message in written if type(message) in kinds]
        assert [message.id for message in read_messages(path, kinds)] == chosen


def test_the_transitions_and_the_episode_are_found_by_name(recording: Recording) -> None:
    path, written = recording.path, recording.messages
    assert same(read_episode(path), written[0])
    transitions = [message for message in written if isinstance(message, Transition)]
    assert transitions
    assert all(same(a, b) for a, b in zip(transitions, read_transitions(path), strict=True))


def test_images_of_several_cameras_are_not_confused(make: Maker, tmp_path: Path) -> None:
    frames = [make(Frame) for _ in range(4)]
    cameras = [frames[0].camera, frames[1].camera]
    frames = [dataclasses.replace(frame, camera=cameras[n % 2]) for n, frame in enumerate(frames)]
    read = read_messages(record(tmp_path, make(Episode), list(frames)), [Frame])
    assert all(same_as_read(a, b) for a, b in zip(frames, read, strict=True))


def test_a_model_of_before_there_were_extended_ones_is_read_as_one_that_is_none(make: Maker) -> None:
    plain = msgspec.json.decode(encode(make(Model), Model))
    del plain["apparatus"], plain["extension"]
    read = decode(msgspec.json.encode(plain), Model)
    assert (read.apparatus, read.extension) == ((), Extension())
    del plain["parameters"]
    with pytest.raises(KeyError, match="parameters"):
        decode(msgspec.json.encode(plain), Model)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_non_finite_numbers_stay_what_they_are(value: float, make: Maker) -> None:
    motion = Motion(positions=np.full((2, 3), value), speeds=np.full(2, value))
    for message in (
        make(Model, loss_m2=float(value)),
        make(ArmState, joints=np.full(7, value)),
        make(Proposal, motion=motion, chamfer_m2=float(value)),
    ):
        assert same(message, decode(encode(message, type(message)), type(message)))


def test_clouds_may_be_empty(make: Maker, tmp_path: Path) -> None:
    none = np.zeros((0, 3), np.float32)
    particles = make(Particles, positions=none, surface=none)
    assert same(particles, list(read_messages(record(tmp_path, make(Episode), [particles])))[-1])


def test_truth_values_take_a_bit_each(make: Maker) -> None:
    mask = np.zeros((3, 7), np.bool_)
    mask[1, 2:6] = True
    seen = make(Seen, masks={"left": mask, "right": np.zeros((0, 5), np.bool_)})
    data = encode(seen, Seen)
    assert same(seen, decode(data, Seen))
    packed = msgspec.json.decode(data)["masks"]["left"]
    assert (packed["dtype"], packed["shape"]) == ("bits", [3, 7])
    assert (
        np.unpackbits(np.frombuffer(base64.b64decode(packed["data"]), np.uint8))[:21].tolist() == mask.ravel().tolist()
    )


def test_no_schema_asks_for_more_than_foxglove_reads() -> None:
    for kind in all_kinds():
        described = json.dumps(schema(record_of(kind)))
        assert "prefixItems" not in described
        assert '"items": false' not in described


def test_paths_of_different_lengths_stand_in_one_proposal(make: Maker) -> None:
    proposal = make(Proposal)
    short = dataclasses.replace(proposal.branches[0], tool_path=np.zeros((2, 3), np.float32))
    proposal = dataclasses.replace(proposal, branches=(short, *proposal.branches[1:]))
    assert same(proposal, decode(encode(proposal, Proposal), Proposal))


def test_numbers_that_numpy_made_are_numbers(make: Maker) -> None:
    model = make(Model, loss_m2=np.float64(0.25), transition_count=3)
    assert decode(encode(model, Model), Model).loss_m2 == 0.25


def test_a_record_lacks_nothing_but_what_stands_elsewhere() -> None:
    apart = {"Frame": {"color", "depth"}, "Particles": {"surface"}, "Approved": {"seal"}}
    for kind in all_kinds():
        fields = {field.name for field in dataclasses.fields(kind)}
        assert fields - {field.name for field in dataclasses.fields(record_of(kind))} == apart.get(kind.__name__, set())
