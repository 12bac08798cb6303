"""Edits of inputs, state kept between calls, and changes of torch itself."""

from __future__ import annotations

from ...types import VerdictCode
from .case import Hostile, Layer, gate, harmless, probe

PURITY: tuple[Hostile, ...] = (
    gate(57, "zero-in-place", "input-edit", "pos.zero_()"),
    gate(57, "slice-assignment", "input-edit", "pos[:, 0] = 0"),
    gate(57, "slice-subtraction", "input-edit", "pos[:, 0] -= 5"),
    gate(58, "augmented-argument", "input-edit", "pos += 1"),
    probe(59, "alias", "input-edit", "p = pos\np += 1"),
    probe(59, "alias-in-a-list", "input-edit", "p = [pos, vel]\np[0] += 1"),
    probe(60, "view", "input-edit", "p = pos[:, 0]\np *= 0"),
    probe(60, "tuple-alias", "input-edit", "a, b = pos, vel\na -= b"),
    probe(60, "loop-variable", "input-edit", "for p in [pos, vel]:\n    p.zero_()"),
    probe(60, "reshaped", "input-edit", "pos.view(-1).mul_(0)"),
    gate(61, "out-argument", "input-edit", "torch.add(pos, 1, out=pos)"),
    gate(61, "inplace-argument", "input-edit", "F.relu(pos, inplace=True)"),
    gate(61, "relu", "torch-function", "torch.relu_(pos)"),
    gate(61, "unbound-method", "attribute", "torch.Tensor.add_(pos, 1)"),
    gate(62, "data", "attribute", "pos.data += 1"),
    probe(62, "detach", "input-edit", "pos.detach().add_(1)"),
    gate(63, "numpy-write", "data-read", "pos.numpy()[:] = 9"),
    gate(64, "storage-resize", "attribute", "pos.untyped_storage().resize_(0)"),
    gate(64, "set", "attribute", "pos.set_(vel)"),
    gate(64, "swap-tensors", "torch-function", "torch.utils.swap_tensors(pos, vel)"),
    harmless(65, "view-of-an-input", "r = pos[:, 0]"),
    gate(66, "requires-grad", "attribute", "pos.requires_grad_()"),
    harmless(66, "wants-gradients", "r = r * torch.ones(1, requires_grad=True)"),
    gate(67, "keeps-tensors", "statement", "global kept\nkept = [pos]"),
    Hostile(
        67,
        "remembers-in-a-default",
        "def compute_reward(pos, kept=[]):\n    kept.append(1)\n    return pos[:, 0] * len(kept), {}\n",
        Layer.PROBE,
        VerdictCode.CONTRACT,
        "nondeterminism",
    ),
    gate(68, "manual-seed", "randomness", "torch.manual_seed(0)"),
    gate(69, "rand", "randomness", "r = r + torch.rand(3)[0]"),
    gate(69, "normal", "randomness", "r = r + torch.zeros(3).normal_()[0]"),
    gate(70, "default-dtype", "torch-function", "torch.set_default_dtype(torch.float64)"),
    gate(70, "threads", "torch-function", "torch.set_num_threads(64)"),
    gate(70, "grad-mode", "torch-function", "torch.set_grad_enabled(True)"),
    gate(70, "backends", "attribute", "torch.backends.mkldnn.enabled = False"),
    gate(71, "patch-torch", "attribute", "torch.exp = torch.log"),
    gate(71, "shadow-torch", "shadowing", "torch = None"),
)
