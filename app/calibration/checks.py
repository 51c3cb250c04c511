"""Checks that refuse uninformative transitions before or after a fit, each in one line."""

import numpy as np
from jaxtyping import Float64
from scipy.spatial import KDTree

from app.calibration.evidence import Evidence
from app.core.errors import RecordingError
from app.core.geometry.chamfer import chamfer_m2

_NEAR_M = 0.02
"""Margin beyond the distance of contact: errors of cameras and arm for a tool that still touches."""
_ABOVE_M = 0.03
"""Height over the object's top at which a tip passes over it."""
_MOVED_M2 = 2 * 0.005**2
"""Change of an object that has moved [m^2]: 5 mm on the average; the noise of one at rest is less."""
_ALONG = 0.2
"""Least mean cosine between the directions of the tool and of the object that it pushes: 0.8 is usual."""
_MM = 1e3


def check_contact(evidence: Evidence, contact_m: float) -> None:
    """Raises RecordingError where the tool came near the object in no transition, or is in another frame than it.

    `contact_m`: from the tool's axis to the object's middle where they touch. Objects that move although no tool is
    near, and those that move away from where they are pushed to, are in another frame.
    """
    gaps = np.array([_gap_m(before, tool) for before, tool in zip(evidence.before, evidence.tool, strict=True)])
    moved = no_motion_m2(evidence) > _MOVED_M2
    near = gaps < contact_m + _NEAR_M
    if not near.any():
        if moved.any():
            raise RecordingError(
                f"The object moved in {moved.sum()} of {len(gaps)} transitions, but the tool came no nearer than "
                f"{_MM * gaps.min():.0f} mm: clouds and tool are in different frames; give both in the robot's base "
                "frame, and see `dipac calibration`."
            )
        raise RecordingError(
            f"The tool came no nearer to the object than {_MM * gaps.min():.0f} mm in {len(gaps)} transitions, and "
            "touched nothing; record pushes that move it."
        )
    cosines = _along(evidence)[near & moved]
    if len(cosines) and cosines.mean() < _ALONG:
        raise RecordingError(
            f"In {len(cosines)} transitions the object went another way than the tool pushed it (mean cosine "
            f"{cosines.mean():.2f}, from -1 to 1): clouds and tool are in different frames; give both in the robot's "
            "base frame, and see `dipac calibration`."
        )


def check_better_than_no_motion(losses_m2: Float64[np.ndarray, " K"], evidence: Evidence) -> None:
    """Raises RecordingError where a fitted model predicts no better than that nothing moves.

    `losses_m2`: of the transitions that it predicts; NaN for the others.
    """
    finite = np.isfinite(losses_m2)
    still, found = float(no_motion_m2(evidence)[finite].mean()), float(losses_m2[finite].mean())
    if found >= still:
        raise RecordingError(
            f"The fitted model predicts the transitions no better ({_MM**2 * found:.4g} mm^2) than that nothing moves "
            f"({_MM**2 * still:.4g} mm^2), so its numbers mean nothing; check that the recordings are of this task's "
            "object and tool, or record pushes that move it farther."
        )


def no_motion_m2(evidence: Evidence) -> Float64[np.ndarray, " K"]:
    """Chamfer distances [m^2] of the objects from their earlier positions."""
    pairs = zip(evidence.before, evidence.after, strict=True)
    return np.array([float(chamfer_m2(before, after)) for before, after in pairs])


def _gap_m(before: np.ndarray, tool: np.ndarray) -> float:
    """Distance from the tool's path to the nearest particle, seen from above; more where it is over the object."""
    gap = float(KDTree(before[:, :2]).query(tool[:, :2])[0].min())
    over = float(tool[:, 2].min() - before[:, 2].max())
    return max(gap, over) if over > _ABOVE_M else gap


def _along(evidence: Evidence) -> Float64[np.ndarray, " K"]:
    """Cosine between the displacements of the tool and of the object's centroid, seen from above; 0 where one rests."""
    way = (evidence.tool[:, -1] - evidence.tool[:, 0])[:, :2].astype(np.float64)
    shift = (evidence.after.mean(1) - evidence.before.mean(1))[:, :2].astype(np.float64)
    lengths = np.linalg.norm(way, axis=1) * np.linalg.norm(shift, axis=1)
    return np.where(lengths > 0, (way * shift).sum(1) / np.maximum(lengths, 1e-12), 0.0)
