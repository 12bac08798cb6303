"""The names that a reward program may use: plain data, rendered into prompts and enforced by the gate and the graph.

An allow-list, never a deny-list: the real `torch` module carries `os`, `sys` and `ctypes` as ordinary attributes.
"""

from __future__ import annotations


def words(text: str) -> frozenset[str]:
    """The words of a text as a set."""
    return frozenset(text.split())


MAX_COMPONENTS = 16
"""Components that a program may return besides the reward."""
DTYPES = words("float float16 float32 float64 half double int int32 int64 long bool bfloat16")

TORCH = DTYPES | words("""
    abs absolute acos acosh add addcdiv addcmul all amax amin any arange arccos arcsin arctan arctan2 argmax
    argmin as_tensor asin asinh atan atan2 atanh bmm broadcast_tensors broadcast_to cat ceil chunk clamp
    clamp_max clamp_min clip clone column_stack concat concatenate copysign cos cosh cosine_similarity cross
    cumprod cumsum deg2rad detach device diff div divide dot einsum eq erf exp exp2 expm1 eye flatten flip
    FloatTensor floor floor_divide fmax fmin fmod frac full full_like gather ge greater greater_equal gt
    heaviside hstack hypot index_select inf is_tensor isclose isfinite isinf isnan le lerp less less_equal
    linspace log log10 log1p log2 logaddexp logical_and logical_not logical_or logical_xor logsumexp lt
    masked_fill matmul max maximum mean median min minimum mm mul multiply nan nan_to_num narrow ne neg negative
    norm not_equal numel ones ones_like outer permute pi pow prod rad2deg reciprocal relu remainder
    repeat_interleave reshape roll round rsqrt select sgn sigmoid sign sin sinc sinh softmax sort split sqrt
    square squeeze stack std sub subtract sum take_along_dim tan tanh Tensor tensor tile topk transpose tril
    triu trunc unbind unsqueeze var vstack where zeros zeros_like
""")

ALSO_TORCH = words("""
    aminmax argsort bitwise_and bitwise_not bitwise_or bitwise_xor cdist count_nonzero cummax cummin diagonal dstack
    empty empty_like erfc finfo fliplr float_power flipud hsplit inner kthvalue logit moveaxis movedim mv
    positive ravel selu signbit std_mean swapaxes swapdims tensordot trace true_divide unflatten var_mean vsplit
    xlogy
""")
"""Accepted, but left out of prompts to keep them short; `empty` gives zeros."""

FUNCTIONAL = words("""
    cosine_similarity elu gelu hardsigmoid hardtanh huber_loss l1_loss leaky_relu log_softmax logsigmoid
    mse_loss normalize pairwise_distance relu relu6 selu sigmoid silu smooth_l1_loss softmax softplus softsign
    tanh
""")

ALSO_FUNCTIONAL = words("celu hardshrink hardswish mish softmin softshrink tanhshrink threshold")

LINALG = words("cross norm vecdot vector_norm")

MATH = words("""
    acos asin atan atan2 ceil copysign cos cosh degrees e exp fabs floor fmod hypot inf isclose isfinite isnan
    log log10 log2 nan pi pow radians sin sinh sqrt tan tanh tau
""")

NUMPY = words("""
    arccos arcsin arctan arctan2 cos cosh deg2rad degrees e exp hypot inf log log10 log2 nan newaxis pi power
    rad2deg radians sin sinh sqrt tan tanh
""")
"""For Python numbers only, as in `np.pi` and `np.sqrt(2.0)`; numpy itself is not there."""

METHODS = words("""
    abs absolute acos add addcdiv addcmul all amax amin aminmax any append argmax argmin argsort asin atan
    atan2 bfloat16 bmm bool ceil chunk clamp clamp_max clamp_min clip clone contiguous copy copysign cos cosh cpu cross
    cummax cummin cumprod cumsum deg2rad detach device diagonal diff dim div divide dot double dtype eps
    eq erf erfc exp exp2 expand expand_as expm1 extend flatten flip float float_power floor floor_divide fmax
    fmin fmod frac gather ge get greater greater_equal gt half heaviside hypot index_select indices inner int
    is_floating_point isfinite isinf isnan items keys kthvalue le lerp less less_equal log log10 log1p
    log2 logaddexp logical_and logical_not logical_or logical_xor logit logsumexp long lt masked_fill matmul
    max maximum mean median mH min minimum mm moveaxis movedim mT mul multiply mv nan_to_num narrow ndim
    ndimension ne neg negative nelement new_full new_ones new_tensor new_zeros norm not_equal numel outer
    permute pop pow prod rad2deg ravel reciprocal relu remainder repeat repeat_interleave reshape roll round
    rsqrt select setdefault sgn shape sigmoid sign sin sinh size softmax sort split sqrt square squeeze std
    sub subtract sum swapaxes swapdims t T take_along_dim tan tanh tile tiny to topk transpose tril triu
    true_divide trunc type type_as unbind unflatten unsqueeze update values var view view_as where xlogy
""")
"""Attributes of tensors (and of the dicts and lists that hold components) that a program may use."""

IN_PLACE_METHODS = words("""
    abs_ add_ addcmul_ ceil_ clamp_ clamp_max_ clamp_min_ clip_ copy_ cos_ div_ exp_ fill_ floor_ log_
    logical_and_ logical_not_ logical_or_ masked_fill_ mul_ nan_to_num_ neg_ pow_ reciprocal_ relu_ round_
    rsqrt_ sigmoid_ sign_ sin_ sqrt_ square_ sub_ tanh_ zero_
""")
"""Fine on tensors the program made, refused on inputs."""

BUILTINS = words("""
    abs all any AssertionError bool dict divmod enumerate Exception filter float int isinstance len list map
    max min pow range reversed round slice sorted str sum tuple ValueError zip
""")

RANDOM = words("""
    bernoulli bernoulli_ dropout exponential_ manual_seed multinomial normal normal_ poisson rand rand_like
    randint randint_like randn randn_like random random_ randperm seed torch_rand_float torch_rand_float2
    torch_random_dir_2 uniform_
""")
"""Named only to explain the refusal."""

READS = words("item tolist numpy nonzero masked_select unique")
"""Named only to explain the refusal: they turn tensor values into Python numbers or shapes."""

HELPERS = words("""
    angle_axis_to_exp_map calc_heading calc_heading_quat calc_heading_quat_inv compute_heading_and_up
    compute_rot copysign exp_map_to_angle_axis exp_map_to_quat get_axis_params get_basis_vector get_euler_xyz
    local_to_world_space my_quat_rotate normalise_quat_in_pose normalize normalize_angle quat_apply
    quat_apply_yaw quat_axis quat_conjugate quat_diff_rad quat_from_angle_axis quat_from_euler_xyz quat_mul
    quat_rotate quat_rotate_inverse quat_to_angle_axis quat_to_exp_map quat_to_tan_norm quat_unit saturate
    scale scale_transform slerp tensor_clamp tf_apply tf_combine tf_inverse tf_vector to_torch unscale
    unscale_transform wrap_to_pi
""")
"""Quaternion and vector helpers of Isaac Gym's environments, implemented in `reward.math`: x, y, z, w."""

ALL_HELPERS = HELPERS | words("euler_xyz_to_exp_map matrix_to_quaternion quaternion_to_matrix unscale_np")
"""Includes those left out of prompts. Quaternions of the matrix functions are w, x, y, z, in Isaac Gym as here."""

HELPERS_PATH = "isaacgym.torch_utils"
HELPER_MODULES = words("""
    isaacgym.torch_utils isaacgymenvs.utils.torch_jit_utils isaacgymenvs.utils.torch_utils torch_jit_utils
    torch_utils utils.torch_jit_utils utils.torch_utils
""")
"""Modules that hold the helpers in the original environments, as programs import them."""

MODULES = {
    "torch": TORCH | ALSO_TORCH,
    "torch.nn.functional": FUNCTIONAL | ALSO_FUNCTIONAL,
    "torch.linalg": LINALG,
    "math": MATH,
    "numpy": NUMPY,
    HELPERS_PATH: ALL_HELPERS,
    "isaacgymenvs.utils.torch_jit_utils": ALL_HELPERS,
}
"""Module path to the names it offers."""

PACKAGES = words("torch torch.nn torch.jit typing")
"""Paths that may lead to a name but hold none that a program may use as a value."""

ATEN = words("""
    _log_softmax.default _softmax.default _to_copy.default _unsafe_view.default
    abs.default acos.default acosh.default add.Scalar add.Tensor addcdiv.default addcmul.default alias.default
    all.default all.dim all.dims amax.default amin.default aminmax.default any.default any.dim any.dims
    arange.default arange.start arange.start_step argmax.default argmin.default asin.default asinh.default
    atan.default atan2.default atanh.default bitwise_and.Scalar bitwise_and.Tensor bitwise_not.default
    bitwise_or.Scalar bitwise_or.Tensor bitwise_xor.Scalar bitwise_xor.Tensor bmm.default cat.default
    ceil.default celu.default clamp.default clamp.Tensor clamp_max.default clamp_max.Tensor clamp_min.default
    clamp_min.Tensor clone.default copy.default copysign.Scalar copysign.Tensor cos.default cosh.default
    cummax.default cummin.default cumprod.default cumsum.default deg2rad.default detach.default
    diagonal.default div.Scalar div.Scalar_mode div.Tensor div.Tensor_mode dot.default elu.default eq.Scalar
    eq.Tensor erf.default erfc.default exp.default exp2.default expand.default expm1.default eye.default eye.m
    fill.Scalar fill.Tensor flip.default floor.default floor_divide.default floor_divide.Scalar fmax.default
    fmin.default fmod.Scalar fmod.Tensor frac.default full.default full_like.default gather.default ge.Scalar
    ge.Tensor gelu.default gt.Scalar gt.Tensor hardshrink.default hardsigmoid.default hardswish.default
    hardtanh.default heaviside.default huber_loss.default hypot.default index.Tensor index_put.default
    index_select.default isinf.default isnan.default kthvalue.default le.Scalar le.Tensor leaky_relu.default
    lerp.Scalar lerp.Tensor lift_fresh.default linalg_cross.default linalg_vector_norm.default
    linspace.default log.default log10.default log1p.default log2.default log_sigmoid_forward.default
    logaddexp.default logical_and.default logical_not.default logical_or.default logical_xor.default
    logit.default logsumexp.default lt.Scalar lt.Tensor masked_fill.Scalar masked_fill.Tensor max.default
    max.dim maximum.default mean.default mean.dim median.default median.dim min.default min.dim
    minimum.default mish.default mm.default mse_loss.default mul.Scalar mul.Tensor mv.default
    nan_to_num.default ne.Scalar ne.Tensor neg.default new_full.default new_ones.default new_zeros.default
    norm.Scalar norm.ScalarOpt_dim ones.default ones_like.default permute.default pow.Scalar pow.Tensor_Scalar
    pow.Tensor_Tensor prod.default prod.dim_int rad2deg.default reciprocal.default relu.default
    remainder.Scalar remainder.Scalar_Tensor remainder.Tensor repeat.default reshape.default roll.default round.decimals
    round.default rsqrt.default rsub.Scalar rsub.Tensor scalar_tensor.default select.int
    select_scatter.default sgn.default sigmoid.default sign.default signbit.default silu.default sin.default
    sinc.default sinh.default slice.Tensor slice_scatter.default smooth_l1_loss.default softplus.default
    softshrink.default sort.default sort.stable split.Tensor split_with_sizes.default sqrt.default squeeze.dim
    squeeze.dims stack.default std.correction std_mean.correction sub.Scalar sub.Tensor sum.default
    sum.dim_IntList t.default tan.default tanh.default threshold.default topk.default transpose.int
    tril.default triu.default trunc.default unbind.int unsqueeze.default var.correction var_mean.correction
    view.default where.self xlogy.Scalar_Other xlogy.Scalar_Self xlogy.Tensor zeros.default zeros_like.default
""")
"""ATen overloads a graph may hold. All are pure: no random number, no in-place write, and no output whose size depends
on values, except `index.Tensor` with a boolean mask, which `x[mask] = y[mask]` needs."""
