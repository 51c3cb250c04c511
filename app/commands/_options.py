"""The options that `run` and `console` share."""

import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, final

from app.cells import load as load_cell
from app.commands._named import Dynamics
from app.config import Limits, Site
from app.core.bounds import check_range
from app.core.errors import PreflightError, UsageError
from app.core.geometry.scene_description import RopeModel
from app.core.task_name import Split
from app.planner.method import PAPER
from app.ui.server.tls import Tls

Preset = Literal["auto", "cpu", "gpu"]

_LAST_PORT = 65535
_SLOWEST_M_S = 0.005
_LARGEST_GB = 1e6


@final
@dataclass(frozen=True, kw_only=True)
class Options:
    """The options that `run` and `console` share."""

    problems: Split | None = None
    """easy or hard starts and goals (docs/evaluation.md); easy ones where neither this nor the task's name says so"""
    seed: int = 0
    """seed of the start, the goal and the noise"""
    pushes: int = 10
    """at most, in the console until a mode is chosen anew; fewer where the goal is reached before"""
    preset: Preset = "auto"
    """size of the search for a decision; auto asks this machine"""
    probe: bool = False
    """choose pushes, --pushes at most, for their information about model errors, instead of planning for a goal"""
    asked: Path | None = None
    """a pushes.json of `dipac probe --recordings`, whose pushes are offered first"""
    planner: str = PAPER
    """the planner: the paper's tree, dipac, or a baseline; a wrong name lists them"""
    ablation: str | None = None
    """ablation of dipac: no_calibration, no_optimisation, no_planning, no_policy, no_remainder or no_online"""
    goal: Path | None = None
    """an .npy file of points (M, 3) [m] instead of a random goal; at least as many as the preset's particles"""
    model: Path | None = None
    """a model.toml to start from instead of the nominal model"""
    policy: Path | None = None
    """a folder of `dipac train`, whose policy guides the tree instead of the task's scripted one; or `shipped`, the
    learned one that comes with the program"""
    calibrate: bool = True
    """calibrate the model in the background"""
    dynamics: Dynamics | None = None
    """simulation of the object in plans: rods, for ropes, or mpm, material points; by default the task's own"""
    object: Path | None = None
    """a TOML file that describes another object: its kind, sizes, mass, colour, and what is known of its parameters
    (docs/objects.md)"""
    segmenter: Path | None = None
    """an ONNX file that finds the object, instead of its colour (docs/perception.md says what it has to be)"""
    rig: str = "simulated"
    """simulated; rehearsal, the same by Kinova's protocol and RealSense's SDK; replayed, what --cell recorded; or gen3,
    which is real, as --cell says"""
    world: RopeModel = "chain"
    """a simulated rope's: a chain of bodies joined by hinges, or an elastic cable of mass points"""
    cell: Path | None = None
    """the TOML file of a real cell (docs/real-cell.md), whose table and limits --rig rehearsal rehearses, or the .mcap
    file that --rig replayed shows"""
    checklist: bool = False
    """ask for the checklist before the first motion in a simulated cell, too; on a real arm it is always asked for"""
    depth: bool = True
    """use the cameras' depth; without, the object's shape is what its outlines leave"""
    speed: float = Limits().speed_m_s
    """the fastest that the tool may move [m/s], or what a real cell's file says where that is less"""
    recordings: Path = Path("recordings")
    """folder of the MCAP file"""
    budget_gb: float | None = None
    """at most so many GB of recordings in that folder: an episode that may not fit is refused before it begins"""
    port: int = 8088
    """port of the console; 0 takes a free one"""
    host: str = "127.0.0.1"
    """address of the console; another one than loopback needs --tls-cert and --tls-key"""
    tls_cert: Path | None = None
    """certificate of the console, a PEM file, for use from other machines"""
    tls_key: Path | None = None
    """its key, a PEM file"""
    tls_name: str | None = None
    """the host name that it is for; this machine's where none is given"""

    @property
    def tls(self) -> Tls | None:
        """The console's certificate, if one is given. Raises UsageError for half of it."""
        if self.tls_cert is None and self.tls_key is None:
            return None
        if self.tls_cert is None or self.tls_key is None:
            raise UsageError("--tls-cert and --tls-key belong together; give both, or neither.")
        return Tls(certificate=self.tls_cert, key=self.tls_key, name=self.tls_name or socket.getfqdn())

    def site(self) -> Site:
        """The default site with the command line's changes.

        Raises PreflightError for an impossible port, ParameterError for an impossible speed or budget.
        """
        if not 0 <= self.port <= _LAST_PORT:
            raise PreflightError(f"Port {self.port} does not exist; choose one from 1024 to {_LAST_PORT} with --port.")
        limits = Limits(speed_m_s=check_range("--speed", self.speed, _SLOWEST_M_S, Limits().speed_m_s))
        budget: int | None = None
        if self.budget_gb is not None:
            budget = round(check_range("--budget-gb", self.budget_gb, 0.0, _LARGEST_GB) * 1e9)
        site = Site(
            limits=limits,
            recordings=self.recordings,
            console_host=self.host,
            console_port=self.port,
            budget_bytes=budget,
        )
        return load_cell(self.rig).narrowed(site, self.cell)
