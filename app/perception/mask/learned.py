"""Learned segmenter: an ONNX file, run by OpenCV on the CPU.

Requirements: one input of 32-bit floats, shape (1, 3, H, W), an RGB image scaled to 0..1, whose size may be open; one
output of shape (1, 1 + K, h, w), a score for the background and for each of the K objects of the task. A pixel belongs
to the class with the highest score. Images are resized to H x W, and the result back to the image.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, TypeAlias, final

import cv2
import numpy as np
from jaxtyping import Float32

from app.core.colours import Mask
from app.core.errors import PerceptionError, UsageError
from app.core.types import ColourImage
from app.perception.mask.onnx_file import Tensor, tensors

Scores: TypeAlias = Float32[np.ndarray, "1 C h w"]

_WANTED: Final = (
    "a segmenter has one input of 32-bit floats, shape (1, 3, H, W), an RGB image in 0..1, and one output of shape "
    "(1, {classes}, h, w), the scores of the background and of {objects}"
)
_DIVERGED: Final = "its training has probably diverged: train it again, with a lower learning rate"
_TRIED: Final = (96, 128)
"""Height and width of the test image for a network of open size."""


@final
@dataclass(frozen=True, kw_only=True)
class Learned:
    """Network in a file. `height` and `width` of its input are 0 where they are open; `objects`: its object classes.

    The file is read once a process, on the first image.
    """

    path: Path
    height: int
    width: int
    objects: int

    def masks(self, color: ColourImage) -> Sequence[Mask]:
        """A mask for each object. Raises PerceptionError where the network fails."""
        size = (self.height or color.shape[0], self.width or color.shape[1])
        try:
            scores = _scores(self.path, color, size)
        except cv2.error as error:
            raise PerceptionError(
                f"The segmenter {self.path} failed on an image of {color.shape[1]} x {color.shape[0]}: "
                f"{_error_line(error)}. Train it for this size, or leave out --segmenter."
            ) from None
        if _diverged(scores):
            raise PerceptionError(f"The segmenter {self.path} gives scores that are not finite; {_DIVERGED}.")
        best = scores[0].argmax(axis=0).astype(np.uint8)
        best = cv2.resize(best, (color.shape[1], color.shape[0]), interpolation=cv2.INTER_NEAREST)
        return [best == 1 + index for index in range(self.objects)]


def load_segmenter(path: Path, objects: int) -> Learned:
    """The network in the file `path`, tried on a black image.

    Raises UsageError, with the expected and the actual interface, where it does not segment `objects` objects.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UsageError(f"--segmenter {path} cannot be read: {error.strerror}.") from None
    wanted = _WANTED.format(classes=1 + objects, objects="one object" if objects == 1 else f"{objects} objects")
    try:
        inputs, outputs = tensors(data)
    except ValueError as error:
        raise UsageError(f"--segmenter {path} is no ONNX file ({error}); {wanted}.") from None
    if len(inputs) != 1 or len(outputs) != 1 or not _fits(inputs[0]):
        raise UsageError(f"--segmenter {path} has {_tensor_list(inputs)} in and {_tensor_list(outputs)} out; {wanted}.")
    found = Learned(path=path.resolve(), height=inputs[0].shape[2], width=inputs[0].shape[3], objects=objects)
    size = (found.height or _TRIED[0], found.width or _TRIED[1])
    try:
        scores = _scores(found.path, np.zeros((*size, 3), np.uint8), size)
    except cv2.error as error:
        raise UsageError(f"--segmenter {path} cannot be run by OpenCV: {_error_line(error)}; {wanted}.") from None
    if _diverged(scores):
        raise UsageError(f"--segmenter {path} gives scores that are not finite; {_DIVERGED}.")
    if scores.ndim != 4 or scores.shape[:2] != (1, 1 + objects):
        raise UsageError(f"--segmenter {path} gives an output of shape {scores.shape}; {wanted}.")
    return found


def _fits(tensor: Tensor) -> bool:
    """True for an image tensor; 0 stands for an open size."""
    return tensor.float32 and len(tensor.shape) == 4 and tensor.shape[0] in (0, 1) and tensor.shape[1] == 3


def _tensor_list(found: Sequence[Tensor]) -> str:
    return ", ".join(str(tensor) for tensor in found) or "nothing"


def _scores(path: Path, color: ColourImage, size: tuple[int, int]) -> Scores:
    """Output of the network for the image, resized to height and width `size`. Raises cv2.error if there is none."""
    network = _network(path)
    image = cv2.resize(color, (size[1], size[0]), interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    network.setInput(np.ascontiguousarray(image.transpose(2, 0, 1)[None]))
    scores = network.forward()
    if scores is None:
        raise cv2.error("the network computes nothing")
    return scores


def _diverged(scores: np.ndarray) -> bool:
    """True where a score is no number: OpenCV gives the largest one for NaN and for infinity."""
    return not bool((np.abs(scores) < np.finfo(np.float32).max).all())


@lru_cache(maxsize=2)
def _network(path: Path) -> Any:
    return cv2.dnn.readNetFromONNX(str(path))


def _error_line(error: cv2.error) -> str:
    """OpenCV's own message, in one line."""
    return " ".join(str(error).split())[:200]
