"""The parameters of JAX's primitives whose meaning is known, by the primitive's name."""

from __future__ import annotations

from functools import cache

_ANYWHERE = "accuracy sharding out_sharding out_dtype precision preferred_element_type"
"""Parameters that say where or how precisely a primitive is computed, which for float64 on one CPU changes nothing."""
_CALL = (
    "jaxpr call_jaxpr fun_jaxpr name debug_info ctx_mesh inline keep_unused donated_invars in_shardings out_shardings "
    "in_layouts out_layouts compiler_options_kvs prevent_cse differentiated policy attributes version num_consts "
    "symbolic_zeros out_trees jvp_jaxpr_fun jvp_jaxpr_thunk fwd_jaxpr_thunk bwd"
)
_GATHER = "dimension_numbers indices_are_sorted unique_indices mode fill_value slice_sizes"
_COMBINED = ("-add", "_add", "-sub", "-mul", "_mul", "-min", "_min", "-max", "_max")
_SCATTER = "dimension_numbers indices_are_sorted unique_indices mode update_jaxpr update_consts"
CALLS = ("jit", "pjit", "checkpoint", "remat", "remat2", "composite", "closed_call", "core_call", "custom_jvp_call")
CALLS += ("custom_vjp_call", "custom_vjp_call_jaxpr", "eval_jaxpr")
"""Primitives that run the one jaxpr that they hold."""
_PARAMETERS = {
    **dict.fromkeys(CALLS, _CALL),
    **dict.fromkeys(("argmax", "argmin"), "axes index_dtype"),
    **dict.fromkeys(("cummax", "cummin", "cumprod", "cumsum"), "axis reverse"),
    **dict.fromkeys((f"reduce_{name}" for name in ("and", "max", "min", "or", "prod", "sum")), "axes"),
    **dict.fromkeys(("scatter", *(f"scatter{end}" for end in _COMBINED)), _SCATTER),
    **dict.fromkeys(("stack", "unstack"), "axis"),
    "broadcast_in_dim": "shape broadcast_dimensions",
    "cholesky": "symmetrize_input",
    "concatenate": "dimension",
    "cond": "branches branches_platforms",
    "convert_element_type": "new_dtype weak_type",
    "custom_linear_solve": "const_lengths jaxprs",
    "device_put": "devices srcs copy_semantics",
    "dot_general": "dimension_numbers",
    "dynamic_slice": "slice_sizes",
    "empty": "shape dtype",
    "expand_dims": "dimensions",
    "gather": _GATHER,
    "integer_pow": "y",
    "iota": "shape dtype dimension",
    "lu": "pivot",
    "polynomial": "unroll",
    "pad": "padding_config",
    "platform_index": "platforms",
    "reshape": "new_sizes dimensions",
    "ffi_call": "target_name",
    "rev": "dimensions",
    "round": "rounding_method",
    "scan": "jaxpr length reverse unroll num_consts num_carry ft_in ft_out linear _split_transpose",
    "slice": "start_indices limit_indices strides",
    "sort": "dimension is_stable num_keys",
    "split": "axis sizes",
    "squeeze": "dimensions",
    "tile": "reps",
    "transpose": "permutation",
    "triangular_solve": "left_side lower transpose_a conjugate_a unit_diagonal",
    "while": "cond_jaxpr body_jaxpr cond_nconsts body_nconsts",
}
"""The parameters whose meaning is known: the rules read them, or they change no value."""


NAMES_ONLY = frozenset(
    ("name", "jvp_jaxpr_fun", "jvp_jaxpr_thunk", "fwd_jaxpr_thunk", "bwd", "debug_info", "ctx_mesh", "out_trees")
)
"""Parameters that describe the call or the origin of a function, not its result."""


@cache
def unknown_parameters(primitive: str, names: tuple[str, ...]) -> list[str]:
    """Those of the names of a primitive's parameters that are not known here."""
    known = {*_ANYWHERE.split(), *_PARAMETERS.get(primitive, "").split()}
    return [name for name in names if name not in known]
