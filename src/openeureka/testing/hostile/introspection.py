"""From a value to the interpreter: attributes, frames, patterns, and text that is not what it seems."""

from __future__ import annotations

from .case import Hostile, gate, gate_text

INTROSPECTION: tuple[Hostile, ...] = (
    gate(1, "subclasses", "dunder", "().__class__.__base__.__subclasses__()"),
    gate(2, "format-globals", "attribute", 'r = r + len("{0.__class__.__init__.__globals__}".format(pos)) * 0'),
    gate(3, "format-map", "attribute", '"{m.os}".format_map({"m": torch})'),
    gate(4, "f-string-attribute", "dunder", 'x = f"{pos.__class__}"'),
    gate(4, "f-string-conversion", "f-string", r"""x = f"{pos!r}" """.strip()),
    gate(5, "type-builder", "unknown-name", 'T = type("T", (list,), {})'),
    gate(5, "metaclass", "statement", "class M(type):\n    pass\nclass T(metaclass=M):\n    pass"),
    gate(6, "getattr", "unknown-name", 'getattr(pos, "da" + "ta").zero_()'),
    gate(6, "vars", "unknown-name", "vars()"),
    gate(7, "generator-frame", "attribute", "g = (x for x in [1])\ng.gi_frame.f_back.f_globals"),
    gate_text(
        8, "coroutine", "statement", "async def h():\n    pass\ndef compute_reward(pos):\n    return pos[:, 0], {}\n"
    ),
    gate(8, "await", "statement", "x = [await r]"),
    gate(9, "traceback", "statement", "try:\n    1 / 0\nexcept Exception as e:\n    e.__traceback__.tb_frame.f_back"),
    gate(10, "attribute-error-object", "statement", "try:\n    pos.x\nexcept AttributeError as e:\n    e.obj.zero_()"),
    gate(10, "import-error-object", "statement", "try:\n    import nothing\nexcept ImportError as e:\n    e.obj"),
    gate(11, "except-star", "statement", "try:\n    1 / 0\nexcept* ZeroDivisionError as e:\n    pass"),
    gate(12, "class-pattern", "statement", "match pos:\n    case object(__class__=c):\n        pass"),
    gate(13, "class-pattern-module", "statement", 'match torch:\n    case object(os=o):\n        o.system("id")'),
    gate_text(14, "positional-only", "signature", "def compute_reward(pos, _getattr_, /):\n    return pos[:, 0], {}\n"),
    gate(15, "full-width-dunder", "dunder", "pos.__\uff43lass__"),
    gate(15, "full-width-exec", "unknown-name", '\uff45xec("1")'),
    gate(16, "bidi", "characters", "x = 1  # \u202e drawer eht kcatta"),
    gate(16, "zero-width", "characters", "x\u200b = 1"),
    gate(16, "homoglyph", "characters", "p\u043es = vel"),
    gate(17, "null-byte", "characters", "x = 1\0"),
    gate(17, "form-feed", "characters", "\fx = 1"),
    gate(17, "lone-surrogate", "characters", "x = '\ud800'"),
    gate_text(
        18, "decorator-chain", "decorator", "@exec\n@input\ndef compute_reward(pos):\n    return pos[:, 0], {}\n"
    ),
    gate_text(19, "call-in-default", "signature", "def compute_reward(pos, x=print(1)):\n    return pos[:, 0], {}\n"),
    gate_text(19, "call-in-annotation", "annotation", "def compute_reward(pos: print(1)):\n    return pos[:, 0], {}\n"),
    gate_text(20, "class", "statement", "class R:\n    pass\ndef compute_reward(pos):\n    return R(), {}\n"),
    gate(
        20, "torch-function-class", "statement", "class R:\n    def __torch_function__(self, *a):\n        return pos"
    ),
    gate(29, "tensor-class", "attribute", "torch.Tensor.mro()"),
    gate(29, "tensor-subclasses", "dunder", "torch.Tensor.__subclasses__()"),
)
