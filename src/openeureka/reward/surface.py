"""What a reward program may name: plain data, rendered into prompts and enforced by the gate and the graph.

An allow-list, never a deny-list: the real `torch` module carries `os`, `sys` and `ctypes` as ordinary attributes.
"""

from __future__ import annotations


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


DTYPES = _words("float float16 float32 float64 half double int int32 int64 long bool bfloat16")

TORCH = DTYPES | _words("""
    abs absolute acos acosh add addcdiv addcmul all amax amin any arange arccos arcsin arctan arctan2 argmax argmin asin
    asinh atan atan2 atanh bmm broadcast_tensors broadcast_to cat ceil chunk clamp clamp_max clamp_min clip clone column_stack
    concat concatenate copysign cos cosh cosine_similarity cross cumprod cumsum deg2rad detach diff dist div divide dot einsum
    eq erf exp exp2 expm1 eye flatten flip floor floor_divide fmax fmin fmod frac full full_like gather ge greater greater_equal
    gt heaviside hstack hypot index_select inf isclose isfinite isinf isnan le lerp less less_equal linspace log log10 log1p
    log2 logaddexp logical_and logical_not logical_or logical_xor logsumexp lt masked_fill matmul max maximum mean median min
    minimum mm mul multiply nan nan_to_num narrow ne neg negative norm not_equal numel ones ones_like outer permute pi
    pow prod rad2deg reciprocal relu remainder repeat_interleave reshape roll round rsqrt select sgn sigmoid sign sin sinc sinh
    softmax sort split sqrt square squeeze stack std sub subtract sum take_along_dim tan tanh tensor as_tensor tile topk
    transpose tril triu trunc unbind unsqueeze var vstack where zeros zeros_like Tensor FloatTensor device is_tensor
""")

FUNCTIONAL = _words("""
    cosine_similarity elu gelu hardtanh huber_loss l1_loss leaky_relu log_softmax logsigmoid mse_loss normalize
    pairwise_distance relu relu6 selu sigmoid silu smooth_l1_loss softmax softplus softsign tanh hardsigmoid
""")

LINALG = _words("cross norm vecdot vector_norm")

MATH = _words("""
    acos asin atan atan2 ceil copysign cos cosh degrees e exp fabs floor fmod hypot inf isclose isfinite isnan log log10
    log2 nan pi pow radians sin sinh sqrt tan tanh tau
""")

MODULES = {
    "torch": TORCH,
    "torch.nn.functional": FUNCTIONAL,
    "torch.linalg": LINALG,
    "math": MATH,
}
"""Module path to the names it offers."""

PACKAGES = _words("torch torch.nn torch.jit typing")
"""Paths that may lead to a name but hold none that a program may use as a value."""

METHODS = _words("""
    abs absolute acos add all amax amin any argmax argmin asin atan atan2 bmm bool ceil chunk clamp clamp_max clamp_min clip
    clone contiguous copysign cos cosh cpu cross cumprod cumsum deg2rad detach device diff dim div divide dot double dtype eq
    erf exp exp2 expand expand_as expm1 flatten flip float floor floor_divide fmod frac gather ge gt half index_select int
    is_floating_point isclose isfinite isinf isnan le lerp log log10 log1p log2 logical_and logical_not logical_or
    logical_xor logsumexp long lt mH mT masked_fill matmul max maximum mean median min minimum mm movedim mul multiply
    nan_to_num narrow ndim ndimension ne neg negative new_full new_ones new_tensor new_zeros norm numel permute pow prod
    rad2deg reciprocal relu remainder repeat repeat_interleave reshape roll round rsqrt select shape sigmoid sign sin sinh size
    softmax sort split sqrt square squeeze std sub subtract sum swapaxes t T tan tanh tile to topk transpose trunc type
    type_as unbind unflatten unsqueeze var view view_as where
    values indices items keys get update append extend copy pop
""")
"""Attributes of tensors (and of the dicts and lists that hold components) that a program may use."""

IN_PLACE_METHODS = _words("""
    abs_ add_ addcmul_ ceil_ clamp_ clamp_max_ clamp_min_ clip_ copy_ cos_ div_ exp_ fill_ floor_ log_ logical_and_
    logical_not_ logical_or_ masked_fill_ mul_ nan_to_num_ neg_ pow_ reciprocal_ relu_ round_ rsqrt_ sigmoid_ sign_ sin_
    sqrt_ square_ sub_ tanh_ zero_
""")
"""Fine on tensors the program made, refused on inputs."""

BUILTINS = _words("""
    abs bool dict enumerate float int isinstance len list max min pow range round sorted str sum tuple zip
    Exception ValueError AssertionError
""")

RANDOM = _words("""
    rand rand_like randn randn_like randint randint_like randperm bernoulli normal multinomial poisson manual_seed seed
    dropout torch_rand_float torch_random_dir_2 random normal_ uniform_ random_ exponential_ bernoulli_
""")
"""Named only to explain the refusal."""

READS = _words("item tolist numpy nonzero masked_select unique")
"""Named only to explain the refusal: they turn tensor values into Python numbers or shapes."""

HELPERS = _words("""
    to_torch quat_mul normalize quat_apply quat_rotate quat_rotate_inverse quat_conjugate quat_unit quat_from_angle_axis
    normalize_angle tf_inverse tf_apply tf_vector tf_combine get_basis_vector get_axis_params copysign get_euler_xyz
    quat_from_euler_xyz tensor_clamp scale unscale scale_transform unscale_transform saturate quat_diff_rad quat_axis
    quat_to_angle_axis angle_axis_to_exp_map quat_to_exp_map
    compute_heading_and_up compute_rot local_to_world_space normalise_quat_in_pose my_quat_rotate
    calc_heading calc_heading_quat calc_heading_quat_inv exp_map_to_angle_axis exp_map_to_quat slerp
    quat_to_tan_norm quat_apply_yaw wrap_to_pi
""")
"""Quaternion and vector helpers of environments of this kind; `reward.math` implements them, x, y, z, w."""

# ATen overloads a graph may hold. All are pure: no random number, no in-place write, no output whose size depends on values
# except `index.Tensor` with a boolean mask, which `x[mask] = y[mask]` needs.
ATEN = _words("""
    abs.default acos.default acosh.default add.Tensor add.Scalar addcdiv.default addcmul.default
    alias.default all.default all.dim all.dims amax.default amin.default any.default any.dim any.dims arange.default arange.start arange.start_step
    argmax.default argmin.default asin.default asinh.default atan.default atan2.default atanh.default
    bitwise_and.Tensor bitwise_and.Scalar bitwise_not.default bitwise_or.Tensor bitwise_or.Scalar bitwise_xor.Tensor
    bitwise_xor.Scalar bmm.default cat.default ceil.default clamp.default clamp.Tensor clamp_max.default clamp_max.Tensor
    clamp_min.default clamp_min.Tensor clone.default copy.default copysign.Tensor copysign.Scalar cos.default cosh.default cumprod.default
    cumsum.default deg2rad.default detach.default div.Tensor div.Scalar div.Tensor_mode div.Scalar_mode dot.default
    elu.default eq.Tensor eq.Scalar erf.default exp.default exp2.default expand.default expm1.default eye.default eye.m
    fill.Scalar fill.Tensor flip.default floor.default floor_divide.default floor_divide.Scalar fmax.default fmin.default
    fmod.Tensor fmod.Scalar frac.default full.default full_like.default gather.default ge.Tensor ge.Scalar gelu.default
    gt.Tensor gt.Scalar hardsigmoid.default hardtanh.default heaviside.default huber_loss.default hypot.default index.Tensor index_put.default
    index_select.default isinf.default isnan.default le.Tensor le.Scalar leaky_relu.default
    lerp.Tensor lerp.Scalar lift_fresh.default linalg_cross.default linalg_vector_norm.default linspace.default log.default
    log10.default log1p.default log2.default log_sigmoid_forward.default logaddexp.default logical_and.default
    logical_not.default logical_or.default logical_xor.default logsumexp.default lt.Tensor lt.Scalar masked_fill.Scalar
    masked_fill.Tensor max.default max.dim maximum.default mean.default mean.dim median.default median.dim min.default
    min.dim minimum.default mm.default mse_loss.default mul.Tensor mul.Scalar mv.default nan_to_num.default ne.Tensor ne.Scalar
    neg.default new_full.default new_ones.default new_zeros.default norm.ScalarOpt_dim norm.Scalar ones.default
    ones_like.default permute.default pow.Scalar pow.Tensor_Scalar pow.Tensor_Tensor prod.default prod.dim_int
    rad2deg.default reciprocal.default relu.default remainder.Scalar remainder.Tensor remainder.Scalar_Tensor repeat.default
    roll.default round.default round.decimals rsqrt.default rsub.Tensor rsub.Scalar scalar_tensor.default select.int
    select_scatter.default sgn.default sigmoid.default sign.default silu.default sin.default sinc.default sinh.default
    slice.Tensor slice_scatter.default smooth_l1_loss.default softplus.default sort.default sort.stable split.Tensor split_with_sizes.default
    sqrt.default squeeze.dim squeeze.dims stack.default std.correction sub.Tensor sub.Scalar sum.default sum.dim_IntList
    t.default tan.default tanh.default topk.default transpose.int tril.default triu.default trunc.default unbind.int
    unsqueeze.default var.correction view.default where.self xlogy.Tensor zeros.default zeros_like.default _softmax.default _log_softmax.default _to_copy.default
    _unsafe_view.default _reshape_alias.default diagonal.default
""")
