"""A run as an object: its directory, and what it holds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np
import torch
from numpy.typing import ArrayLike

from ..config import NO_MODEL, RunConfig
from ..errors import ConfigError, StoreError
from ..parsing import short_path, taken, whole_path
from ..refine.hardened import Robust
from ..refine.polishing import Polished
from ..refine.tuned import Tuned
from ..report import html, verdict
from ..report.candidates import CandidateView
from ..report.view import RunView
from ..score import Outcome
from ..store import Store, artifacts, expect_files, look
from ..tasks import registry
from ..training.policy import Player, Policy
from ..types import Evaluation, History, Lane, TrainingResult
from .settings import SearchSettings

if TYPE_CHECKING:
    from ..llm.client import LanguageModel
    from .program import Event

Row = dict[str, str | int | float | None]

LONGEST = 40.0
"""[s] that `Run.play` shows at most: each second takes 83 MB."""
SHOWN = 8
"""Candidates in a notebook's view of a run."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneView:
    """One training of a run, as far as it has come."""

    lane: Lane
    place: str
    """The first slot that holds its candidate, such as `g0s3`; empty for a reward that no model wrote."""
    result: TrainingResult | None
    """None while it trains."""
    played: Evaluation | None
    """Score of its policy in the episodes that rewards are ranked by."""
    held_out: Evaluation | None
    """Score of its policy in the end, in new episodes that nothing was chosen by."""

    @property
    def curves(self) -> Mapping[str, tuple[float | None, ...]]:
        """A value for each epoch, by name: see `TrainingResult.curves`. Empty while the lane trains."""
        return self.result.curves if self.result is not None else {}

    def row(self) -> Row:
        """All that is a text or a number; undefined values are None."""
        result, played, held_out = self.result, self.played, self.held_out
        return {
            "lane": self.lane.id,
            "reward": self.lane.reward,
            "seed": self.lane.seed,
            "role": self.lane.role,
            "place": self.place,
            "state": str(result.state) if result is not None else None,
            "played_fitness": played.fitness if played is not None else None,
            "played_error": played.error if played is not None else None,
            "fitness": result.fitness if result is not None else None,
            "held_out_fitness": held_out.fitness if held_out is not None else None,
            "held_out_episode_length": held_out.episode_length if held_out is not None else None,
            "correlation_with_human": result.correlation if result is not None else None,
            "env_steps": result.env_steps if result is not None else 0,
            "seconds": result.seconds if result is not None else 0.0,
            "message": result.message if result is not None else "",
            **{f"cost/{name}": value for name, value in (played.costs if played is not None else {}).items()},
        }


def lanes(run: RunView) -> dict[str, LaneView]:
    """The lanes of a run by id, in the order in which they were begun."""
    places = run.places
    return {
        name: LaneView(
            lane=lane,
            place=str(places.get(lane.reward, "")),
            result=run.results.get(name),
            played=run.played.get(name),
            held_out=run.evaluations.get(name),
        )
        for name, lane in run.lanes.items()
    }


class RewardText(str):
    """A reward's program, which a notebook shows in colours."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        """For a notebook."""
        return html.notebook("reward", self)


@dataclass(frozen=True, slots=True)
class Run:
    """A run directory, of a search or of given rewards, finished or not. Every access reads the directory anew."""

    directory: Path
    """An absolute path, so that a program may change its working directory."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "directory", whole_path(self.directory))

    @property
    def view(self) -> RunView:
        """All that reports show of the run. To use several things of a large run, read it once into a variable."""
        return RunView.read(self.directory)

    @property
    def config(self) -> RunConfig:
        """Its settings."""
        with Store.view(self.directory) as store:
            return store.config

    @property
    def finished(self) -> bool:
        """Whether the run is complete; else `resume` continues it. Raises StoreError where there is no run."""
        return look(self.directory)[1].ended

    @property
    def history(self) -> History:
        """The finished generations: every slot with its program, verdict, training and feedback."""
        return self.view.history

    @property
    def candidates(self) -> tuple[CandidateView, ...]:
        """Every slot of every generation, also of the one under way, with all attempts at it."""
        return self.view.candidates

    @property
    def lanes(self) -> dict[str, LaneView]:
        """Every training by id, such as `human-s0`: its result, scores and curves."""
        return lanes(self.view)

    def _repr_html_(self) -> str:
        """For a notebook: what was found, and the best candidates with their curves."""
        return html.notebook("run", self.view, str(short_path(self.directory)), SHOWN)

    def rows(self) -> list[Row]:
        """A row of numbers and texts for each training, as data frames take them: `pandas.DataFrame(run.rows())`."""
        return [lane.row() for lane in self.lanes.values()]

    @property
    def verdict(self) -> str:
        """One sentence that says which reward is better."""
        return verdict.verdict(self.view)

    @property
    def outcome(self) -> Outcome | None:
        """The final comparison of a search in numbers; None before it is done, and for given rewards."""
        view = self.view
        return view.outcome if view.searched else None

    @property
    def tuned(self) -> Tuned | None:
        """What the fitting of a reward's numbers has found so far; None where none were fitted."""
        return self.view.tuned

    @property
    def polished(self) -> Polished | None:
        """What came of training the best policy further (`polish=`); None where none was."""
        return self.view.polished

    @property
    def robust(self) -> Robust | None:
        """What `openeureka.robust` has found so far; None where it was never called."""
        return self.view.robust

    @property
    def best_reward(self) -> RewardText | None:
        """The best reward's program; None where nothing is trained yet, or the best reward comes with the task."""
        program = artifacts.read(self.directory, "best/reward.py")
        return RewardText(program.decode(errors="replace")) if program is not None else None

    @property
    def policy(self) -> TrainedPolicy:
        """The best reward's policy, a function of numpy observations (O,) or (N, O). Raises StoreError before there is
        one."""
        return TrainedPolicy.of(self._policy("best"))

    @property
    def polished_policy(self) -> TrainedPolicy:
        """The policy that `polish=` trained further. Raises StoreError where there is none, or it is not better."""
        return TrainedPolicy.of(self._policy("polished"))

    def _policy(self, folder: str) -> bytes:
        data = artifacts.read(self.directory, f"{folder}/policy.safetensors")
        if data is None and folder == "polished":
            raise StoreError(
                f"{short_path(self.directory)} has no polished policy; use `policy`, that of its best reward."
            )
        if data is None:
            with Store.view(self.directory) as store:
                expect_files(store)
            raise StoreError(
                f"{short_path(self.directory)} has no policy yet; it has one as soon as a training is done."
            )
        return data

    def play(self, *, seconds: float = 10.0, seed: int = 0, env: str | Path = "", polished: bool = False) -> np.ndarray:
        """Pictures of the best reward's policy at work: uint8 (T, 720, 1280, 3), 30 for each second of simulated time.

        Args:
            seconds: at most 40; a second takes 83 MB.
            seed: of the start state and of the task's random events.
            polished: take `polished_policy`.
            env: the task, where it is a file or a package of your own that this machine does not know yet.

        Raises:
            VideoUnavailable: where nothing can be rendered; it says what to install.
            ConfigError: where the run names a task that is not installed and that you never used here: it would be run
                with your rights.
        """
        from ..film import mp4, video
        from . import trust

        seconds = float(seconds)
        if not 0.0 < seconds <= LONGEST:
            raise ConfigError(f"`seconds` must be above 0 and at most {LONGEST:g}, not {seconds}.")
        task = str(env) or self.config.env
        if not env:
            trust.expect_known(task, "The run", "call play(env=...)")
        return mp4.frames(
            video.render(task, self._policy("polished" if polished else "best"), seconds=seconds, seed=seed)
        )

    @property
    def report(self) -> Path:
        """Path of its report, a page for a browser. The file exists once the run is finished."""
        return self.directory / "report.html"

    def resume(
        self,
        *,
        model: LanguageModel | None = None,
        trust: bool = False,
        on_event: Callable[[Event], object] | None = None,
        **settings: Unpack[SearchSettings],
    ) -> Run:
        """Go on where it stopped. No reply is paid twice and no training is done twice.

        Args:
            model: for a search that began with an object of your own: the object again.
            trust: use addresses, files and models that the run names, also those that you never used on this machine.
            on_event: as in `search`.
            settings: those that do not change what is searched may be given anew, such as `max_cost`.
        """
        from ..llm.registry import expect_model
        from . import compose, program
        from .trust import agree

        if model is not None:
            expect_model(model)
        directory = self.directory
        config = replace(compose.stored(directory), **taken(RunConfig, settings))
        typed = [*settings, *(["model"] if model is not None else [])]
        agree(config, directory, typed=typed, trusted=trust, way="call resume(trust=True)")

        def work(host: compose.Host) -> object:
            if config.model != NO_MODEL:
                return compose.search(config, directory, host, model)
            return (compose.tune if config.tune else compose.train)(config, directory, None, host)

        return program.done(directory, on_event, work, own=model is not None)


@dataclass(frozen=True, slots=True, eq=False)
class TrainedPolicy:
    """Called with observations (O,) or (N, O) it returns float32 actions (A,) or (N, A) in [-1, 1], without noise.

    It clips observations as its task does, where the task is installed. Where it is not, the caller has to."""

    env: str
    """The task it was trained on."""
    observations: int
    """O."""
    actions: int
    """A."""
    clip: float
    """Observations are clipped to -clip and clip first; infinite where the task is not installed."""
    _player: Player = field(repr=False)

    @classmethod
    def of(cls, data: bytes) -> TrainedPolicy:
        """From a safetensors file. Raises RewardFileError for anything else."""
        policy = Policy.from_bytes(data)
        policy.expect()
        task = registry.offered(policy.env)
        clip = task.clip_observations if task is not None else math.inf
        return cls(policy.env, policy.observations, policy.actions, clip, Player([policy]))

    def __call__(self, observations: ArrayLike) -> np.ndarray:
        seen = np.asarray(observations, dtype=np.float32)
        if seen.ndim not in (1, 2) or seen.shape[-1] != self.observations:
            raise ValueError(f"observations are ({self.observations},) or (N, {self.observations}), not {seen.shape}")
        actions = self._player(torch.from_numpy(np.atleast_2d(seen).clip(-self.clip, self.clip))).numpy()
        return actions[0] if seen.ndim == 1 else actions
