"""Settings of runs and of what is done with them, as frozen dataclasses; `parsing` reads them."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from .errors import ConfigError

NO_MODEL = "none"
"""`model` of a run that searches for nothing: given rewards train, and are compared."""
NO_RANGES = "none"
"""`randomise` of a run whose worlds are the task's own."""
VIDEOS = ("all", "best", "none")
STARTS = BEST, SCRATCH = "best", "scratch"
FEEDBACKS = ("none", "human")
_MANY = 100_000
"""More than anybody asks for, and few enough to be counted through by who shows a run of somebody else."""
_MOST_STEPS = 2**53 - 1
"""The largest whole number that every reader of JSON keeps."""
FREE_TO_CHANGE = (
    "dir", "device", "threads", "executor", "address", "base_url", "max_cost", "price", "video", "log",
    "feedback_timeout", "unsafe_no_sandbox",
)  # fmt: skip
"""Settings that say how and where to run, not what is searched: a resumed run may have others."""
AS_TRAINED = ("curriculum", "randomise", "observe", "steps", "worlds", "bonus")
"""Settings of a run that say what its rewards are worth."""
LARGEST_SEED = 2**52
"""Fresh seeds are added to it, and JSON's whole numbers end at 2**53."""
MOST_THREADS = 1024
"""A process that asks for many more is killed."""
MOST_WORLDS = 1 << 20
"""Of a lane. A reward is measured with so many before it trains."""
_LONGEST_NAME = 60
"""Letters of a task's name, which may hold sentences: with four bytes each, a folder called so exists on any disk."""
FEWEST_TUNED = 4
"""Trainings of a tuning, and of a round of one: with fewer, nothing says which way is up."""
_Bounds = tuple[float, float, str]
_BOUNDS: Mapping[str, _Bounds] = {
    **dict.fromkeys(("sample", "iteration", "repair", "refill", "tune", "polish"), (0, _MANY, "")),
    "seeds": (1, _MANY, ""),
    "screen": (1, _MANY, "1 trains every reward"),
    "seed": (0, LARGEST_SEED, ""),
    "steps": (0, _MOST_STEPS, "0 takes the default"),
    "polish_steps": (0, _MOST_STEPS, "0 takes the default"),
    "worlds": (0, MOST_WORLDS, "0 takes the task's own"),
    "threads": (0, MOST_THREADS, "0 takes all cores"),
    "temperature": (0, 100, ""),
    "feedback_timeout": (0, 10**9, "0 waits for ever"),
    "max_cost": (0, 10**9, "0 sets no limit"),
}
"""The least and the most that a setting may be, and a hint. What is beyond them would end a run after its first
training, or never."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunConfig:
    """One search. Zero means: the default of the task (steps, worlds) or of the kind of model (sample, iteration)."""

    env: str = "cartpole"
    """A name from `eureka envs`, `FILE.py`, `pkg.mod:Class`, `gym:ID`; `python=` adds `dmc:`, `mjlab:` and others."""
    model: str = "local"
    """`local`, `local:PATH.gguf`, `random`, `replay:RUN`, `replay:FILE.json`, or the name of a model at an endpoint."""
    base_url: str = ""
    """OpenAI-compatible endpoint; empty means the one the openai package uses."""
    sample: int = 0
    """Candidates per generation, K; 0 means 8, or 16 with an endpoint."""
    iteration: int = 0
    """Generations, N; 0 means 3, or 5 with an endpoint."""
    search: str = "best"
    """`best` (the best so far is the parent), `eureka` (as published), or your own: `FILE.py:Name`, `pkg.mod:Name`."""
    init: str = ""
    """Begin with a given reward: `human`, or the path of a reward file; empty means with the model's own."""
    safety: str = ""
    """Safety requirements for the reward, in words for the model: `torques below 40 N m, smooth joints`."""
    limits: str = ""
    """Upper limits on costs of played policies; a reward that exceeds one cannot win: `torque_peak=40 falls=0.1`."""
    feedback: str = "none"
    """`none`, or `human`: after each generation, wait for a person's feedback on it."""
    feedback_timeout: float = 0.0
    """Seconds to wait for a person; 0 means for ever."""
    judge: str = "fitness"
    """Candidates are ranked by `fitness`, or by the `votes` of a person."""
    repair: int = 0
    """How often the model may repair a refused candidate before its slot is sampled again."""
    refill: int = 2
    """How often a slot may be sampled again after refusals, or when it repeats a program of the run."""
    temperature: float = 1.0
    """Sampling temperature of the model: at higher values its replies differ more."""
    curriculum: str = ""
    """Stages that each candidate trains through: a curriculum of the task, or a YAML file; empty means no stages."""
    randomise: str = NO_RANGES
    """Domain randomisation, how training worlds differ: `none`, `mild`, `wide`, or a YAML file of ranges."""
    observe: str = "all"
    """What policies see: `all` of the observation, or what is `measurable` on a robot."""
    tune: int = 0
    """Trainings after the search that fit the numbers in the best reward and keep its structure; 0 means none."""
    polish: int = 0
    """Trainings at the end that continue the best policy, each in a different way; 0 means none."""
    polish_steps: int = 0
    """Environment steps of each training of `polish`; 0 means an eighth of the training that made the policy."""
    seed: int = 0
    """Seed of start states, noise and samples."""
    seeds: int = 3
    """Maximum number of fresh seeds that the leading rewards train with at the end; fewer if two or more decide."""
    steps: int = 0
    """Environment steps per candidate, in whole epochs, over all stages of a curriculum; 0 means the task's own."""
    worlds: int = 0
    """Worlds per candidate; 0 means the task's own."""
    screen: int = 1
    """Ask for this many times as many rewards as train, and train those that differ most; 1 trains every reward."""
    schedule: str = "full"
    """`full`: all train to the end. `quarter`: a quarter goes on at 1/4. `halving`: half go on at 1/8, 1/4 and 1/2."""
    bonus: str = "none"
    """Added to generated rewards: `none`; `original`, 250 on success in hand tasks; `progress`, pay for rare stages."""
    device: str = "cpu"
    """`cpu`, `cuda` (every GPU there is), or some of them, such as `cuda:0,cuda:1`."""
    threads: int = 0
    """Cores to train on; 0 means all of them."""
    executor: str = "local"
    """Where lanes run: on this machine (`local`), on a cluster (`ray`), or your own: `FILE.py:Name`, `pkg.mod:Name`."""
    address: str = ""
    """The Ray cluster: `auto` (the one that this machine belongs to), `HOST:PORT`, or `local` (this machine alone)."""
    max_cost: float = 0.0
    """Stop before replies cost more than this many US dollars; 0 means no limit."""
    price: str = ""
    """`INPUT,OUTPUT` in US dollars per million tokens; empty means the built-in table of prices."""
    baselines: str = "train"
    """`train` both baselines in this run, or use the `known` scores that come with openeureka."""
    video: str = "best"
    """Film `all` trained policies, the `best` or `none`; with feedback=human the default is `all`."""
    log: str = ""
    """Mirror the run to `wandb`, `mlflow` or `tensorboard`; empty means nowhere, and no network."""
    dir: str = ""
    """Run directory; empty means `outputs/<time>_<env>`."""
    unsafe_no_sandbox: bool = False
    """Run generated code in an unconfined child process where the kernel cannot confine it."""

    def __post_init__(self) -> None:
        _check_bounds(self)
        if not self.model.strip():
            raise ConfigError("`model` is empty. Use model=local, model=random or the name of a model at an endpoint.")
        if "@" in self.base_url.partition("://")[2].partition("/")[0] or "?" in self.base_url:
            raise ConfigError(
                "`base_url` must not hold a user name, a password or a `?`, because settings are stored and shown. Put "
                "a key in the environment variable OPENAI_API_KEY, or set OPENAI_BASE_URL instead of base_url=."
            )
        if 0 < self.tune < FEWEST_TUNED:
            raise ConfigError(f"`tune` must be 0 or at least {FEWEST_TUNED}, not {self.tune}.")
        if self.polish_steps and not self.polish:
            raise ConfigError("`polish_steps` has no effect without `polish`; add polish=4, or leave it out.")
        choices = {
            "feedback": FEEDBACKS,
            "judge": ("fitness", "votes"),
            "bonus": ("none", "original", "progress"),
            "schedule": ("full", "quarter", "halving"),
            "baselines": ("train", "known"),
            "video": VIDEOS,
            "observe": ("all", "measurable"),
            "log": ("", "wandb", "mlflow", "tensorboard"),
        }
        for key, allowed in choices.items():
            if getattr(self, key) not in allowed:
                raise ConfigError(
                    f"`{key}` must be one of {', '.join(filter(None, allowed))}, not `{getattr(self, key)}`."
                )
        if self.curriculum and self.schedule != "full":
            raise ConfigError(f"`schedule={self.schedule}` does not work with `curriculum=`; leave one of them out.")
        for key, plays in (("limits", bool(self.cost_limits)), ("screen", self.screen > 1)):
            if plays and (self.search == "eureka" or self.model == NO_MODEL):
                raise ConfigError(
                    f"`{key}` needs a search that plays trained policies; use it with search=best and a model."
                )
        if self.judge == "votes" and self.feedback != "human":
            raise ConfigError("`judge=votes` needs a person who votes; add feedback=human.")
        if self.judge == "votes" and self.schedule != "full":
            raise ConfigError(f"`schedule={self.schedule}` drops rewards by F before anyone votes; use schedule=full.")

    @property
    def cost_limits(self) -> dict[str, float]:
        """`limits` by the name of a cost."""
        found: dict[str, float] = {}
        for word in self.limits.replace(",", " ").split():
            name, _, most = word.partition("=")
            if name in found:
                raise ConfigError(f"`limits` names `{name:.80}` twice; leave one of them out.")
            try:
                found[name] = float(most)
            except ValueError:
                found[name] = math.nan
            if not 0.0 <= found[name] < math.inf:
                raise ConfigError(f"`{word:.80}` in `limits` is not a limit; write a cost and its maximum: torque=40.")
        return found

    @property
    def generations(self) -> int:
        """All generations: those of the model, after that of a given reward."""
        return self.iteration + bool(self.init) if self.model != NO_MODEL else 0

    @property
    def hearings(self) -> int:
        """Generations after which a person is heard. What follows the last one can only change who wins by votes."""
        if self.feedback != "human":
            return 0
        return self.generations if self.judge == "votes" else self.generations - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainConfig:
    """Training of given rewards, without a language model. Zero means the default of the task."""

    env: str = "cartpole"
    reward: str = "human,sparse"
    """Comma-separated: `human`, `sparse` or the path of a reward file."""
    curriculum: str = ""
    """Stages that each reward trains through: a curriculum of the task, or a YAML file; empty means no stages."""
    randomise: str = NO_RANGES
    """Domain randomisation, how training worlds differ: `none`, `mild`, `wide`, or a YAML file of ranges."""
    observe: str = "all"
    """What policies see: `all` of the observation, or what is `measurable` on a robot."""
    seeds: int = 1
    """Trainings per reward."""
    seed: int = 0
    """First seed."""
    steps: int = 0
    """Environment steps per training, in whole epochs, over all stages of a curriculum; 0 means the task's own."""
    worlds: int = 0
    """Worlds per training; 0 means the task's own."""
    bonus: str = "none"
    """Added to reward files: `none`; `original`, 250 on success in hand tasks; `progress`, pay for rare stages."""
    device: str = "cpu"
    """`cpu`, `cuda` (every GPU there is), or some of them, such as `cuda:0,cuda:1`."""
    threads: int = 0
    """Cores to train on; 0 means all of them."""
    executor: str = "local"
    """Where lanes run: on this machine (`local`), on a cluster (`ray`), or your own: `FILE.py:Name`, `pkg.mod:Name`."""
    address: str = ""
    """The Ray cluster: `auto` (the one that this machine belongs to), `HOST:PORT`, or `local` (this machine alone)."""
    log: str = ""
    """Mirror the run to `wandb`, `mlflow` or `tensorboard`; empty means nowhere, and no network."""
    dir: str = ""
    """Run directory; empty means `outputs/<time>_train_<env>`. If it already holds this run, the run continues."""
    unsafe_no_sandbox: bool = False
    """Run reward files in an unconfined child process where the kernel cannot confine it."""

    def __post_init__(self) -> None:
        self.run_config()  # whose settings have the same bounds

    def run_config(self) -> RunConfig:
        """The settings of the run: one that searches for nothing."""
        known = {field.name for field in dataclasses.fields(RunConfig)}
        shared = {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name in known}
        return RunConfig(model=NO_MODEL, video="none", **shared)


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneConfig(TrainConfig):
    """Fitting the numbers of one reward, its structure kept. Zero means the default of the task."""

    reward: str = "human"
    """`human`, the path of a reward file, or a run directory, for the best reward of that run."""
    trials: int = 32
    """Trainings to fit the numbers with; one of them trains the unchanged reward."""
    bonus: str = "none"
    """Added to the reward, `human` too: `none`; `original`, 250 on success in hands; `progress`, for rare stages."""
    sample: int = 8
    """Trainings per round: they run side by side, then the next round is proposed."""
    seeds: int = 3
    """Maximum number of fresh seeds that the best weightings and the unchanged reward train with at the end."""
    dir: str = ""
    """Run directory; empty means `outputs/<time>_tune_<env>`. If it already holds this run, the run continues."""

    def __post_init__(self) -> None:
        _check_bounds(self, **dict.fromkeys(("trials", "sample"), (FEWEST_TUNED, _MANY, "")))
        TrainConfig.__post_init__(self)  # `super()` does not know a class with slots

    def run_config(self) -> RunConfig:
        return dataclasses.replace(TrainConfig.run_config(self), tune=self.trials)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustConfig:
    """Ranges that a model proposes for the best policy of a run."""

    model: str = ""
    """As in `eureka run`; empty means the run's own."""
    base_url: str = ""
    """OpenAI-compatible endpoint; empty means the run's."""
    sample: int = 8
    """Proposals of ranges that the model writes."""
    repair: int = 2
    """How often the model may correct a proposal that cannot be used."""
    start: str = BEST
    """What the trainings start from: the `best` policy of the run, or `scratch`."""
    steps: int = 0
    """Environment steps of each training; 0 means half of what trained the policy, or from scratch those of the run."""
    device: str = ""
    """As in `eureka run`; empty means the run's."""
    threads: int = 0
    """Cores to train on; 0 means those of the run."""
    max_cost: float = 0.0
    """As in `eureka run`, including what the search spent; if not given, the run's limit; 0 removes the limit."""
    price: str = ""
    """As in `eureka run`; empty means the run's."""

    def __post_init__(self) -> None:
        _check_bounds(self, sample=(1, 1000, ""), threads=(0, MOST_THREADS, "0 takes those of the run"))
        if self.start not in STARTS:
            raise ConfigError(f"`start` must be {' or '.join(STARTS)}, not `{self.start}`.")

    def applied_to(self, run: RunConfig, typed: Collection[str] = ()) -> RunConfig:
        """The run's settings with those that are given here, but for `start` and `steps`: both say how policies of the
        run go on, not how its own were made.

        Args:
            typed: settings that somebody gave. No limit of cost is then told from none given: both are 0.
        """
        counts, apart = {"repair", *({"max_cost"} & set(typed))}, {"start", "steps"}
        own = {key: value for key, value in dataclasses.asdict(self).items() if key not in apart}
        given = {key: value for key, value in own.items() if value or key in counts}
        return dataclasses.replace(run, schedule="full", **given)


def _check_bounds(config: object, **own: _Bounds) -> None:
    """Raises ConfigError for a number that is beyond the bounds of its setting, or its `own` ones."""
    for key, (least, most, hint) in {**_BOUNDS, **own}.items():
        value = getattr(config, key, least)
        if not least <= value <= most:  # so that NaN is refused, too
            raise ConfigError(f"`{key}` must be from {least:,} to {most:,}, not {value!s:.80}{hint and '; '}{hint}.")


def short_name(env: str) -> str:
    """A task's name for files and titles: that of `some/where/pendulum.py:Pendulum` is `pendulum`."""
    name = re.sub(r"\+python=[^+]*", "", env).rpartition(":")[2]
    return re.sub(r"\W+", "_", Path(name).stem if name.endswith(".py") else name).lower()[:_LONGEST_NAME]
