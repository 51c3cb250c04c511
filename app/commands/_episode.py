"""Common part of `run` and `console`: check, open the rig, the console and the recording, and run the session."""

import json
import time
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import final

import anyio
from anyio import to_thread
from rich.text import Text

from app.cells import load as load_cell
from app.cells.base import Wanted
from app.commands._audience import Audience
from app.commands._case import MODEL, DiscoveryResults, read_case
from app.commands._cell import cell
from app.commands._goal import read_goal
from app.commands._guiding import with_policy
from app.commands._named import check_description, full_name, read_description
from app.commands._options import Options
from app.commands._preflight import check_port
from app.commands._pushes import motions_in
from app.commands._sight import seen_with
from app.commands._version import code_version
from app.config import Site
from app.core.dialogue.summary import Summary
from app.core.errors import DipacError, MotionRefused, ParameterError, UsageError
from app.core.geometry.object_description import KEY, ObjectDescription, recorded_object
from app.core.geometry.scene_description import Stage
from app.core.messages import Episode, Goal, Model, fresh_id
from app.core.ports import CameraShelf, Rig
from app.core.rejection_codes import Refusal
from app.core.system.clock import SystemClock
from app.core.system.gc_control import spared_collection
from app.core.system.processes import in_real_time
from app.core.system.worker import Worker
from app.core.task_name import TaskName, recorded_name
from app.jobs.goals import goal_of
from app.jobs.probed import probed_subject
from app.jobs.worker_api import check_model, choose_preset, nominal_model, shown_goal
from app.planner.method import Method
from app.recording.exchange.model_file import load_model
from app.recording.library.session_recorder import SessionRecorder, open_studio
from app.recording.read.reader import read_episode
from app.recording.write.preflight import Room
from app.services.same_setup import CollectionSetup, earlier_collection, require_same
from app.session import Parts, Session
from app.tasks import Task, load
from app.tasks.elements.base import EpisodeConfig, Experiment
from app.tasks.elements.descriptions import with_appearance
from app.ui.terminal import Output, open_terminal

_AROUND_S, _LONGEST_ROUND_S = 60.0, 30.0
"""Usual longest time of an episode without its pushes, and of a push with its decision."""
_LONGEST_TAKE_S = 120.0
"""Usual longest demonstration."""
PLANNER_NICENESS = 10
"""The planner gives way to the arm and the cameras."""


@final
@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Request of the command line for the task `asked`.

    `case`: a folder that a discovery wrote; `resume`: recordings whose set-up this one has to be; `board`: a
    calibration board is in the gripper.

    `allow_automatic`: on a real arm, too, an operator may permit motions without approval.
    """

    asked: str
    options: Options
    automatic: bool
    case: Path | None = None
    board: bool = False
    allow_automatic: bool = False
    resume: Path | None = None

    @cached_property
    def task(self) -> str:
        """The full name of the task. Raises UsageError for an unknown one."""
        sizes = self.description.sizes if self.description else {}
        options = self.options
        return full_name(
            self.asked, dynamics=options.dynamics, problems=options.problems, sizes=sizes, model=self.model
        )

    @cached_property
    def description(self) -> ObjectDescription | None:
        """The object of --object, or of the recording that a replayed cell shows; None where neither describes one.

        Raises UsageError where it is none of the task.
        """
        options = self.options
        if options.object is not None:
            return read_description(options.object, self.asked)
        if options.cell is None or load_cell(options.rig).answers:
            return None
        shown = recorded_object(read_episode(options.cell).config)
        if shown is not None:
            check_description(shown, self.asked, f"{options.cell}: ")
        return shown

    @property
    def model(self) -> Path | None:
        """The model file to start from: that of the case if none is named."""
        return self.options.model or (self.case / MODEL if self.case else None)

    def cell_options(self, task: Task, site: Site) -> Wanted:
        """Settings for opening the cell."""
        seed = self.options.seed
        return Wanted(
            stage=self.stage(task),
            start=task.start(seed),
            site=site,
            seed=seed,
            board=self.board,
            file=self.options.cell,
        )

    def stage(self, task: Task) -> Stage:
        """Contents of the cell. Raises UsageError if its rope has no such model."""
        options, rig = self.options, load_cell(self.options.rig)
        if options.world != "chain" and not (rig.simulated and rig.answers):
            raise UsageError(f"--world {options.world} is of a simulated rope, and {rig.name} has none; leave it out.")
        return task.stage.in_world(options.world)

    @property
    def method(self) -> Method:
        """Planning method. Raises UsageError if it is unknown, or must not have this model."""
        method = Method.of(self.options.planner, self.options.ablation)
        if self.model and not method.calibrated:
            raise UsageError(
                f"--ablation {self.options.ablation} plans without calibration, not with {self.model}; leave one out."
            )
        return method


@final
@dataclass(frozen=True, kw_only=True)
class EpisodeReport:
    """Result of an episode.

    `recorded` counts the messages in the recording; `failure` is the error that ended the episode early, if one did.
    """

    order: RunOptions
    rig: str
    summary: Summary
    recording: Path
    recorded: int
    failure: DipacError | None

    @property
    def faults(self) -> list[str]:
        """All faults, the one that ended it last: once, even if it was announced before."""
        said = self.summary.faults
        again = self.failure is None or (said and said[-1].endswith(str(self.failure)))
        return list(said) if again else [*said, str(self.failure)]

    def to_json(self) -> str:
        """The keys that `dipac run --json` promises, and the timings behind the results page."""
        row = asdict(self.summary) | {
            "task": recorded_name(self.order.task),
            "dynamics": TaskName.parse(self.order.task).dynamics,
            "planner": self.order.options.planner,
            "ablation": self.order.options.ablation,
            "policy": str(self.order.options.policy) if self.order.options.policy else None,
            "seed": self.order.options.seed,
            "rig": self.rig,
            "world": self.order.options.world,
            "faults": self.faults,
            "failure": str(self.failure) if self.failure else None,
            "recording": str(self.recording),
            "recorded": self.recorded,
        }
        return json.dumps(row, indent=2)


async def episode(order: RunOptions, output: Output) -> EpisodeReport:
    """Run one episode to its end.

    What is wrong with the order or the machine is raised before anything moves; what fails later is in the report.
    """
    if order.automatic and not load_cell(order.options.rig).simulated:
        raise MotionRefused(
            Refusal.NOT_SIMULATED,
            f"{order.options.rig} is real, and `dipac run` approves by itself; use `dipac console`.",
        )
    options, site = order.options, await to_thread.run_sync(order.options.site)
    description = await to_thread.run_sync(lambda: order.description)
    shown = with_appearance(load(order.task), description)
    task = await to_thread.run_sync(partial(seen_with, shown, options.segmenter, depth=options.depth))
    if options.pushes < 0:
        raise UsageError(f"--pushes {options.pushes} must not be negative.")
    if options.seed < 0:
        raise UsageError(f"--seed {options.seed} must not be negative.")
    order.stage(task)  # It is said now, and not once all has started, where there is no such rope.
    method, tls = order.method, options.tls
    if tls is not None:
        tls.context()  # What is wrong with its files shall be said now, and not once all has started.
    check_port(site)
    async with Worker("planner", niceness=PLANNER_NICENESS) as planner:
        with output.status("starting the planner's process"):
            preset = options.preset if options.preset != "auto" else await planner.run(choose_preset)
            method = await to_thread.run_sync(with_policy, method, options.policy, order.task)
            config = await _with_corrections(
                await to_thread.run_sync(_config, task, order, preset, method), order, site, planner
            )
        start = await to_thread.run_sync(_start, order, preset)
        config = replace(config, opening=start)
        if options.probe:
            await to_thread.run_sync(probed_subject, task)
            config = replace(config, experiment=Experiment(budget=options.pushes))
        before = await to_thread.run_sync(_resumed_setup, order, start, output)
        shelf = await to_thread.run_sync(load_cell(options.rig).shelf, options.cell)
        async with (
            open_studio(site.recordings, start, _room(site, options.pushes), take_bytes=_take_bytes(site)) as recorder,
            cell(options.rig, order.cell_options(task, site), tls, f"dipac {task.name}", output) as (rig, console),
        ):
            heading = (
                Text.assemble("Operator console: ", (console.url, "bold"), no_wrap=True),
                Text(f"Recording to {recorder.path}", no_wrap=True),
            )
            if order.resume is not None and before is not None:
                now = CollectionSetup.of_episode(start, tuple(camera.model for camera in rig.cameras))
                require_same(before, now, order.resume)
            with _announced_if_interrupted(output, recorder.path):
                async with open_terminal(output, *heading) as terminal:
                    audience = Audience(console, terminal)
                    audience.show(start)
                    summary, failure = await _run(config, site, rig, audience, recorder, planner, shelf)
    return EpisodeReport(
        order=order,
        rig=rig.name,
        summary=summary,
        recording=recorder.path,
        recorded=recorder.written,
        failure=failure,
    )


async def _with_corrections(config: EpisodeConfig, order: RunOptions, site: Site, planner: Worker) -> EpisodeConfig:
    """The configuration with the model's and the case's corrections. Raises ParameterError, which names the file."""
    if order.case:
        own = order.options.model is None
        case: DiscoveryResults = await planner.run(
            read_case, order.case, recorded_name(order.task), site, time.monotonic(), own
        )
        config = replace(config, verdict=case.verdict, asked=case.asked)
    if order.options.asked:
        asked = await planner.run(motions_in, order.options.asked, recorded_name(order.task), order.task, site)
        config = replace(config, asked=(*asked, *config.asked))
    if config.model is None and order.description is not None and order.description.priors:
        if not config.method.calibrated:
            raise UsageError(
                f"--ablation {order.options.ablation} plans without what is known of the object, and it has priors; "
                "leave them out, or the ablation."
            )
        known: Model = await planner.run(nominal_model, config.task.name, order.description.priors)
        config = replace(config, model=known)
    if config.model is None:
        return config
    try:
        await planner.run(check_model, config.model)
    except ParameterError as error:
        raise ParameterError(f"{order.model or order.options.object}: {error}") from None
    return replace(config, shown_goal=await planner.run(shown_goal, config.goal.positions, config.model))


@contextmanager
def _announced_if_interrupted(output: Output, recording: Path) -> Generator[None]:
    """Context manager that announces, after Ctrl-C, that the recording is being closed: it takes seconds."""
    try:
        yield
    except anyio.get_cancelled_exc_class():
        output.print(Text(f"Interrupted; closing the recording {recording} ..."), soft_wrap=True)
        raise


async def _run(
    config: EpisodeConfig,
    site: Site,
    rig: Rig,
    audience: Audience,
    recorder: SessionRecorder,
    planner: Worker,
    shelf: CameraShelf,
) -> tuple[Summary, DipacError | None]:
    session = Session(
        Parts(
            config,
            site=site,
            rig=rig,
            operator=audience,
            recorder=recorder,
            clock=SystemClock(),
            planner=planner,
            recording=recorder.path,
            studio=recorder,
            # What was recorded does not say where a camera stands now.
            shelf=shelf if config.answering else None,
        )
    )
    try:
        with spared_collection(), in_real_time():
            return await session.run(), None
    except DipacError as error:
        return session.summary, error


def _config(task: Task, order: RunOptions, preset: str, method: Method) -> EpisodeConfig:
    """Reads the goal and the model from their files where the order names some."""
    now_s = time.monotonic()
    particle_count = task.preset(preset).particle_count
    options, answers = order.options, load_cell(order.options.rig).answers
    if options.goal:
        workspace = options.site().limits.workspace
        name, points = f"The goal {options.goal}", read_goal(options.goal)
        positions = goal_of(task.name, points, particle_count, workspace, name, options.seed)
    else:
        positions = task.goal(options.seed, particle_count)
    model = load_model(order.model, task=task.name, time_s=now_s) if order.model else None
    return EpisodeConfig(
        task=task,
        preset=preset,
        goal=Goal(id=fresh_id("goal"), time_s=now_s, positions=positions),
        model=model,
        seed=options.seed,
        pushes=options.pushes,
        automatic=order.automatic,
        calibrating=options.calibrate and method.calibrated and method.following and answers,
        method=method,
        staying=not order.automatic,
        answering=answers,
        checklist=options.checklist,
        allow_automatic=order.allow_automatic,
    )


def _room(site: Site, pushes: int) -> Room:
    """Disk space that the episode may take, and must leave free."""
    expected_s = _AROUND_S + pushes * _LONGEST_ROUND_S
    return Room(
        min_free_bytes=site.min_free_bytes,
        expected_bytes=round(expected_s * site.recording_bytes_s),
        budget_bytes=site.budget_bytes,
    )


def _take_bytes(site: Site) -> int:
    """Bytes of a demonstration, with the pauses in it."""
    return round(_LONGEST_TAKE_S * site.recording_bytes_s)


def _resumed_setup(order: RunOptions, start: Episode, output: Output) -> CollectionSetup | None:
    """The set-up that is to be resumed, which this one is but for the cameras: they are not known yet.

    Read before this session's own recording lies in the same folder. Raises UsageError, which names what differs.
    """
    if order.resume is None:
        return None
    earlier = earlier_collection(order.resume, start.task)
    for sentence in earlier.skipped:
        output.print(Text(sentence), soft_wrap=True)
    require_same(earlier.setup, CollectionSetup.of_episode(start, None), order.resume)
    return earlier.setup


def _start(order: RunOptions, preset: str) -> Episode:
    site = order.options.site()
    config = asdict(order) | {"task": order.task, "preset": preset, "table": asdict(site.table)}
    config |= {"limits": {"workspace": asdict(site.limits.workspace)}}
    config |= {KEY: order.description.as_json} if order.description else {}
    return Episode(
        id=fresh_id("episode"),
        time_s=time.monotonic(),
        task=recorded_name(order.task),
        rig=order.options.rig,
        seed=order.options.seed,
        simulated=load_cell(order.options.rig).simulated,
        code_version=code_version(),
        config=json.dumps(config, default=str),
    )
