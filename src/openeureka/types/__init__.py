"""The nouns of a run: frozen data, no behaviour that touches a file, a process or a tensor.

World axis N, lane axis L and worlds per lane n are used throughout; N = L * n.
"""

from .costs import COSTS, Limits
from .dynamics import NOMINAL, Dynamics, Ranges
from .remarks import Place, Remark, RemarkKind
from .replies import GIVEN, Attempt, Message, Prompt, Reply, Usage
from .rewards import Arg, Candidate, CandidateId, Finding, Node, Part, RewardGraph, Verdict, VerdictCode
from .search import Generation, Glance, History, Opinion, PromptPlan, Sample, Scored
from .tasks import StateKind, StateSpec, StateUse, StateVar, TaskContext
from .training import (
    Checkpoint,
    Evaluation,
    Lane,
    LaneSpec,
    NodeShare,
    Observe,
    Peak,
    PolicyId,
    RewardProgram,
    Role,
    Standing,
    Start,
    TrainBudget,
    Trainer,
    TrainingProgress,
    TrainingResult,
    TrainingState,
    lane_id,
)

__all__ = [
    "COSTS",
    "GIVEN",
    "NOMINAL",
    "Arg",
    "Attempt",
    "Candidate",
    "CandidateId",
    "Checkpoint",
    "Dynamics",
    "Evaluation",
    "Finding",
    "Generation",
    "Glance",
    "History",
    "Lane",
    "LaneSpec",
    "Limits",
    "Message",
    "Node",
    "NodeShare",
    "Observe",
    "Opinion",
    "Part",
    "Peak",
    "Place",
    "PolicyId",
    "Prompt",
    "PromptPlan",
    "Ranges",
    "Remark",
    "RemarkKind",
    "Reply",
    "RewardGraph",
    "RewardProgram",
    "Role",
    "Sample",
    "Scored",
    "Standing",
    "Start",
    "StateKind",
    "StateSpec",
    "StateUse",
    "StateVar",
    "TaskContext",
    "TrainBudget",
    "Trainer",
    "TrainingProgress",
    "TrainingResult",
    "TrainingState",
    "Usage",
    "Verdict",
    "VerdictCode",
    "lane_id",
]
